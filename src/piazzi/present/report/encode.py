"""Numbers as text that is short, and JSON that is safe inside a page."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping
from typing import Any

import numpy as np

from piazzi.problem.checks import Array

_EVEN = 1e-9  # of the span: times that are so near to evenly spaced are told by their start and step


class Pool:
    """All arrays of a page, each once; what draws them holds their numbers here."""

    def __init__(self) -> None:
        self.entries: list[Any] = []
        self._known: dict[bytes, int] = {}

    def add(self, values: Array) -> int:
        """Number of the array, which is kept to one part in 65,536, in 4 characters a value."""
        return self._add(packed(values))

    def add_exactly(self, values: Array) -> int:
        """Number of the array, kept in double precision: for times, of which neighbours differ in the last digits."""
        values = np.asarray(values, dtype=np.float64)
        step = float(values[-1] - values[0]) / max(len(values) - 1, 1) if len(values) else 0.0
        even = len(values) > 2 and np.allclose(np.diff(values), step, rtol=0, atol=_EVEN * abs(step))
        if even:
            return self._add([float(values[0]), step, len(values)])
        return self._add({"double": b64encode(values.astype("<f8").tobytes()).decode("ascii")})

    def add_length(self, parts: tuple[Array, ...]) -> int:
        """Number of the root of the summed squares of these arrays, which the page computes."""
        return self._add({"length": [self.add(part) for part in parts]})

    def _add(self, entry: Any) -> int:
        key = json.dumps(entry).encode()
        if key not in self._known:
            self._known[key] = len(self.entries)
            self.entries.append(entry)
        return self._known[key]


def packed(values: Array) -> str:
    """The upper 24 bits of every value in single precision, rounded, as base64; what is not finite becomes NaN."""
    finite = np.isfinite(values) & (np.abs(values) < np.finfo(np.float32).max / 2)
    single = np.where(finite, values, np.nan).astype("<f4")
    bits = single.view("<u4")
    rounded = np.where(finite, bits + 0x80, 0x7FC00000).astype("<u4") >> 8
    return b64encode(rounded.view(np.uint8).reshape(-1, 4)[:, :3].tobytes()).decode("ascii")


def script_json(value: Mapping[str, Any]) -> str:
    """Strict JSON that ends no script element and holds nothing that HTML or JavaScript reads otherwise."""
    text = json.dumps(value, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
