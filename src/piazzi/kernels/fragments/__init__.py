"""Estimator loops as plain Python source; each is compiled inside a generated module, after the model's own functions."""
