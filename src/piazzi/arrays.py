"""The type of arrays: their shapes and units stand in docstrings."""

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]
