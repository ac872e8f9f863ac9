"""What ``--predict`` says: how far ahead -> times."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from piazzi.text import nearest
from piazzi.units import TABLE

if TYPE_CHECKING:
    from piazzi.problem.checks import Array

MOST = 100_000
_UNITS = {name: factor for name, (factor, powers) in TABLE.items() if powers == (0, 0, 1, 0)} | {"d": 86400.0}
_LENGTH = re.compile(r"(@?)\s*([0-9.+-][0-9.eE+-]*)\s*([A-Za-z]*)")


def times_ahead(text: str, last: float) -> Array:
    """Times in seconds that a text such as ``10min,2h``, ``1d/1h`` or ``@86400`` means, in order, each once.

    A length of time counts from the last epoch, at `last`; ``/STEP`` makes a time of every step up to it; ``@`` gives the time
    itself.  Without a unit they are seconds.

    Raises
    ------
    ValueError
        For what cannot be read, is not finite, is not after zero, or makes more than a hundred thousand times.
    """
    found: list[float] = []
    for item in text.split(","):
        end, slash, step = item.partition("/")
        absolute, seconds = _length(end, text)
        ahead = seconds - last if absolute else seconds
        if not slash:
            found.append(seconds if absolute else last + seconds)
            continue
        every_is_absolute, every = _length(step, text)
        if every_is_absolute or not every > 0:
            raise ValueError(f"--predict {text}: the step {step.strip()!r} must be a length of time above zero")
        many = math.floor(ahead / every * (1 + 1e-12))
        if many > MOST:
            raise ValueError(f"--predict {text}: makes {many:g} times; at most {MOST} are shown")
        found += [last + every * i for i in range(1, many + 1)]
    if not found:
        raise ValueError(f"--predict {text}: makes no times")
    return np.unique(found)


def _length(text: str, whole: str) -> tuple[bool, float]:
    """Whether a time itself is meant, and its seconds."""
    match = _LENGTH.fullmatch(text.strip())
    try:
        value = float(match[2]) if match else math.nan
    except ValueError:
        value = math.nan
    if match is None or not math.isfinite(value):
        raise ValueError(f"--predict {whole}: {text.strip()!r} is no length of time: write such as 10min, 2h, 1d/1h or @86400")
    if match[3] and match[3] not in _UNITS:
        raise ValueError(f"--predict {whole}: unknown unit {match[3]!r}{nearest(match[3], _UNITS)}")
    if value < 0 and not match[1]:
        raise ValueError(f"--predict {whole}: {text.strip()!r} lies before the last epoch")
    return bool(match[1]), value * _UNITS.get(match[3], 1.0)
