"""Where an array's numbers are, for object code: the only place that reads what belongs to the interpreter."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

_HEADER: int = object.__basicsize__
_read = ctypes.c_void_p.from_address


def _field_after_header(a: np.ndarray[Any, Any]) -> int | None:
    return _read(id(a) + _HEADER).value


def _attribute(a: np.ndarray[Any, Any]) -> int | None:
    return a.ctypes.data


# NumPy's C interface fixes the address of the numbers as the first field after an array's header; reading it there takes a
# sixth of the time of the attribute, which is for interpreters that lay objects out otherwise
_probe = np.zeros(1)
address = _field_after_header if _field_after_header(_probe) == _attribute(_probe) else _attribute
