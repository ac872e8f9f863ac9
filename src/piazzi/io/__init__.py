"""Files of problems, measurements and estimates."""
