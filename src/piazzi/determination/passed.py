"""Passes of a stream: what became of the rows of each, told as it ends."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from piazzi.determination.live import AXES, Taken
from piazzi.earth import Epoch
from piazzi.formats.passes import GAP


@dataclass(frozen=True)
class Ended:
    """A pass over a station.

    Attributes
    ----------
    station, first, last : who measured, from when to when
    count, used : rows, and those that were taken in
    squares, values : sum of squares of what was predicted of them, in sigma, over those that were used, and how many values
    sigma : (3,) m, of the position along R, T and N behind it
    """

    station: str
    first: Epoch
    last: Epoch
    count: int = 0
    used: int = 0
    squares: float = 0.0
    values: int = 0
    sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def weighted_rms(self) -> float | None:
        """Of the innovations of used rows, in sigma; None where nothing was predicted."""
        return (self.squares / self.values) ** 0.5 if self.values else None

    def __str__(self) -> str:
        rms = "" if self.weighted_rms is None else f", weighted RMS {self.weighted_rms:.2f}"
        sigma = " ".join(f"{axis} {value:.3g}" for axis, value in zip(AXES, self.sigma, strict=True))
        return f"pass over {self.station}: {self.first} to {self.last}, {self.used} of {self.count} rows used{rms}, {sigma} m"

    def joined(self, row: Taken) -> Ended:
        """With one more row."""
        told = [value for value in row.residuals.values() if row.used and value is not None]
        return replace(
            self, last=max(self.last, row.time), count=self.count + 1, used=self.used + row.used,
            squares=self.squares + sum(value**2 for value in told), values=self.values + len(told), sigma=row.sigma,
        )  # fmt: skip


class Passes:
    """Passes that are under way; `take` rows as they come, which gives those that have ended, and `end` gives the rest."""

    def __init__(self) -> None:
        self._open: dict[str, Ended] = {}

    def take(self, row: Taken) -> list[Ended]:
        """Passes that ended before this row: no row of theirs came for an hour."""
        over = self._over(row.time)
        now = self._open.get(row.station, Ended(row.station, row.time, row.time))
        self._open[row.station] = now.joined(row)
        return over

    def end(self) -> list[Ended]:
        """Those that are under way, in order of their ends."""
        return self._closed(self._open.values())

    def _over(self, time: Epoch) -> list[Ended]:
        return self._closed(one for one in self._open.values() if time - one.last > GAP)

    def _closed(self, which: Iterable[Ended]) -> list[Ended]:
        found = sorted(which, key=lambda one: one.last)
        for one in found:
            del self._open[one.station]
        return found
