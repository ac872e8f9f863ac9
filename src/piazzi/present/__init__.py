"""Results as people look at them: tables and pictures."""
