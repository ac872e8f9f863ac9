"""Functions from outside of a model's text: tables over time, interpolation, and fragments of the user's own."""
