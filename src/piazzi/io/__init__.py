"""Files of problems, measurements and estimates."""

from piazzi.io.files import load_estimate, save, save_estimate

__all__ = ["load_estimate", "save", "save_estimate"]
