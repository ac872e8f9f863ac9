"""The epochs and measurements in a live window, in arrays that stay where they are while epochs come and go."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from piazzi.problem.checks import Array

_EPOCHS, _ROWS = 16, 16  # room to begin with


class Stretch:
    """Epochs `first` to `stop - 1` of buffers, oldest first, each with its rows of measurements.

    Epochs join at the end and leave at the front.  At the end of a buffer everything moves to its front, or into larger
    buffers where it fills half of these, so that an epoch costs as little in a long window as in a short one.

    Attributes
    ----------
    t, count, scale : (E,), times, and the substeps and noise scales of the intervals before them
    x, x_before : (E, n), states, now and before the measurements of the newest epoch moved them
    first_row : (E + 1,), where the rows of each epoch begin; those of epoch k end where those of k + 1 begin
    z, station : (R, m), (R,), rows of measurements, NaN where missing
    """

    names = ("t", "count", "scale", "x", "x_before")
    row_names = ("z", "station")

    def __init__(self, n: int, m: int) -> None:
        self.first = self.stop = 0
        self.t, self.count, self.scale = np.zeros(_EPOCHS), np.zeros(_EPOCHS, dtype=np.int64), np.zeros(_EPOCHS)
        self.x, self.x_before = np.zeros((_EPOCHS, n)), np.zeros((_EPOCHS, n))
        self.first_row = np.zeros(_EPOCHS + 1, dtype=np.int64)
        self.z, self.station = np.zeros((_ROWS, m)), np.zeros(_ROWS, dtype=np.int64)

    def __len__(self) -> int:
        return self.stop - self.first

    @property
    def rows(self) -> int:
        return int(self.first_row[self.stop] - self.first_row[self.first])

    @property
    def room(self) -> tuple[int, int]:
        """Epochs and rows that the buffers hold."""
        return len(self.t), len(self.z)

    def find(self, t: float) -> int:
        """The first epoch that is not before `t`."""
        return self.first + int(np.searchsorted(self.t[self.first : self.stop], t))

    def open_epoch(self, k: int, t: float, count: int, scale: float) -> int:
        """Make room for an epoch without rows before epoch `k`, or at the end; its place, whose state is still to be set."""
        if self.stop == len(self.t):
            k += self._make_room(len(self.t) if 2 * len(self) <= len(self.t) else 2 * len(self.t), len(self.z))
        if k < self.stop:
            for name in self.names:
                values = getattr(self, name)
                values[k + 1 : self.stop + 1] = values[k : self.stop]
        self.first_row[k + 1 : self.stop + 2] = self.first_row[k : self.stop + 1]
        self.t[k], self.count[k], self.scale[k] = t, count, scale
        self.stop += 1
        return k

    def add_row(self, k: int, z: Array, station: int) -> None:
        """A measurement of epoch `k`, behind those that it has."""
        if self.first_row[self.stop] == len(self.z):
            k += self._make_room(len(self.t), len(self.z) if 2 * self.rows <= len(self.z) else 2 * len(self.z))
        at, end = int(self.first_row[k + 1]), int(self.first_row[self.stop])
        if at < end:
            for values in (self.z, self.station):
                values[at + 1 : end + 1] = values[at:end]
        self.z[at], self.station[at] = z, station
        self.first_row[k + 1 : self.stop + 1] += 1

    def _make_room(self, epochs: int, rows: int) -> int:
        """Move everything to the front of buffers of this size; by how many places epochs moved."""
        first, W, row, J = self.first, len(self), int(self.first_row[self.first]), self.rows
        for names, size, begin, many in ((self.names, epochs, first, W), (self.row_names, rows, row, J)):
            for name in names:
                setattr(self, name, _moved(getattr(self, name), begin, many, size))
        self.first_row = _moved(self.first_row, first, W + 1, epochs + 1)
        self.first_row[: W + 1] -= row
        self.first, self.stop = 0, W
        return -first

    def copied(self) -> dict[str, Array]:
        """Copies of what the window holds now, by name, counted from its oldest epoch."""
        row = int(self.first_row[self.first])
        out = {name: getattr(self, name)[self.first : self.stop].copy() for name in self.names}
        out |= {name: getattr(self, name)[row : row + self.rows].copy() for name in self.row_names}
        return out | {"first_row": self.first_row[self.first : self.stop + 1] - row}

    @classmethod
    def of(cls, n: int, m: int, arrays: Mapping[str, Array]) -> Stretch:
        """The stretch that such copies are of."""
        out = cls(n, m)
        W, J = len(arrays["t"]), len(arrays["z"])
        out._make_room(max(_EPOCHS, 2 * W), max(_ROWS, 2 * J))
        for names, many in ((cls.names, W), (cls.row_names, J), (("first_row",), W + 1)):
            for name in names:
                getattr(out, name)[:many] = arrays[name]
        out.stop = W
        return out


def _moved(values: Array, begin: int, many: int, size: int) -> Array:
    """So many values from `begin` on at the front: of the same array where its size is right, of another one otherwise."""
    out = values if len(values) == size else np.zeros((size, *values.shape[1:]), dtype=values.dtype)
    out[:many] = values[begin : begin + many]
    return out
