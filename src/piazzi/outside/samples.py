"""Columns of numbers from a CSV file."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.opening import opened
from piazzi.text import is_number


def read_columns(path: Path) -> np.ndarray[Any, Any]:
    """The numbers of a CSV file by rows; a first line of names and lines that begin with # are passed over.

    Raises ValueError with the line where a value is no finite number or rows differ in length.
    """
    with opened(path) as file:
        lines = file.read().decode("utf-8", errors="replace").splitlines()
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        cells = next(csv.reader([line]), [])
        if not any(cell.strip() for cell in cells) or line.lstrip().startswith("#"):
            continue
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            if not rows and not any(is_number(cell) for cell in cells):
                continue  # names
            wrong = next(cell for cell in cells if not is_number(cell))
            raise ValueError(f"{path.name}, line {number}: {wrong!r} is not a number") from None
        if not np.isfinite(row).all():
            raise ValueError(f"{path.name}, line {number}: values must be finite")
        if rows and len(row) != len(rows[0]):
            raise ValueError(f"{path.name}, line {number}: {len(row)} values, where the rows before have {len(rows[0])}")
        rows.append(row)
    if not rows or len(rows[0]) < 2:
        raise ValueError(f"{path.name}: a table has two columns or more, of numbers")
    return np.array(rows)
