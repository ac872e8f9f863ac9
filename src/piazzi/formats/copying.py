"""Copies of frozen tables: made anew, so that they are checked and as immutable as what they are of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

import numpy as np


def reduced(instance: Any) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    """What `__reduce__` returns for a dataclass: its class and fields, columns of one number as that number."""
    return _made, (type(instance), {field.name: _short(getattr(instance, field.name)) for field in fields(instance)})


def _made(kind: Callable[..., Any], given: Mapping[str, Any]) -> Any:
    return kind(**given)


def _short(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.size and not any(value.strides):
        return np.array(value.flat[0], dtype=value.dtype)
    if isinstance(value, Mapping):
        return {key: _short(part) for key, part in value.items()}
    return value
