"""Studies: many runs of many settings, on one machine or a cluster."""
