"""Values on a grid of one or two variables as a function of equations: cubic splines, with derivatives and stated errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.arrays import Array
from piazzi.model.functions import Signature
from piazzi.outside.evaluation import aligned, check_count, checksum, derivatives, numbers, value
from piazzi.outside.samples import read_columns
from piazzi.outside.splines import foretold, slopes
from piazzi.text import brief

OUTSIDE = ("refuse", "clamp")
_HEADER = 8


@dataclass(frozen=True, eq=False)
class Interpolation:
    """A function of one or two variables given by values at nodes, such as a thrust profile, or density over time and height.

    Cubic splines go through them, along each variable: value and derivatives are continuous.  What varies over powers of ten
    is better given by its logarithm, and used as ``exp(ln_rho(t, h))``.

    Parameters
    ----------
    nodes : (n,), ascending, or a pair of such, one for each variable
    values : (n,), or (n, m) for two variables
    outside : "refuse" or "clamp", or one for each variable
        What holds beyond the nodes: no value, or that of the edge, with a derivative of zero.
    error : the largest that is allowed; default what the nodes allow

    Raises
    ------
    ValueError
        Where nodes are not ascending or anything is not finite, or nodes are too far apart for the error.
    """

    nodes: Any
    values: Any
    outside: Any = "refuse"
    error: float | None = None

    if TYPE_CHECKING:  # what is taken; the fields above say what is kept of it

        def __init__(
            self, nodes: Any, values: Any, outside: str | Sequence[str] = "refuse", error: float | None = None
        ) -> None: ...

    __repr__ = brief

    def __post_init__(self) -> None:
        put = object.__setattr__
        pair = isinstance(self.nodes, Sequence) and len(self.nodes) == 2 and np.ndim(self.nodes[0]) == 1
        given = tuple(self.nodes) if pair else (self.nodes,)
        nodes = tuple(_checked(numbers(x, "nodes of an interpolation"), k, len(given)) for k, x in enumerate(given))
        values = numbers(self.values, "values of an interpolation")
        if values.shape != tuple(map(len, nodes)):
            raise ValueError(f"values of an interpolation have shape {values.shape}; its nodes make {tuple(map(len, nodes))}")
        if not np.isfinite(values).all():
            at = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
            node = ", ".join(map(str, at))
            raise ValueError(f"values of an interpolation must be finite; that of node {node} is {values[at]}")
        values.flags.writeable = False
        outside = (self.outside,) * len(nodes) if isinstance(self.outside, str) else tuple(self.outside)
        if len(outside) != len(nodes) or not set(outside) <= set(OUTSIDE):
            raise ValueError(f"outside is {self.outside!r}; it must be 'refuse' or 'clamp', or one for each variable")
        put(self, "nodes", nodes)
        put(self, "values", values)
        put(self, "outside", outside)
        if self.error is not None and not self.errors[0] <= self.error:
            few = "are too few to tell an error" if np.isnan(self.errors[0]) else f"leave one of about {self.errors[0]:.2g}"
            raise ValueError(f"nodes of an interpolation are too far apart for an error of {self.error:.2g}: they {few}")

    def __getstate__(self) -> dict[str, Any]:
        """What it was made of."""
        return {name: getattr(self, name) for name in ("nodes", "values", "outside", "error")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for a in (*state["nodes"], state["values"]):
            a.flags.writeable = False

    @classmethod
    def read(cls, path: str | Path, outside: str | Sequence[str] = "refuse", error: float | None = None) -> Interpolation:
        """That of a CSV file, a row for each node: the variable or both, then the value; raises ValueError with the line."""
        file = Path(path)
        rows = read_columns(file)
        if rows.shape[1] == 2:
            return cls(rows[:, 0], rows[:, 1], outside, error)
        if rows.shape[1] != 3:
            raise ValueError(f"{file.name}: a row has one or two variables and a value, not {rows.shape[1]} numbers")
        x, y = np.unique(rows[:, 0]), np.unique(rows[:, 1])
        values = np.full((len(x), len(y)), np.nan)
        values[np.searchsorted(x, rows[:, 0]), np.searchsorted(y, rows[:, 1])] = rows[:, 2]
        if np.isnan(values).any() or len(rows) != values.size:
            i, j = np.argwhere(np.isnan(values))[0] if np.isnan(values).any() else (0, 0)
            what = f"none for {x[i]:g}, {y[j]:g}" if np.isnan(values).any() else "two for one node"
            raise ValueError(f"{file.name}: nodes of two variables are a whole grid, {len(x)} by {len(y)}; there is {what}")
        return cls((x, y), values, outside, error)

    @cached_property
    def signature(self) -> Signature:
        """The form of the function: one or two arguments, one output."""
        count = len(self.nodes)
        return Signature(f"interpolation_{count}", count, 1, tuple((0, k) for k in range(count)))

    @property
    def span(self) -> None:
        """Which argument is the time, only equations tell: see `spans`."""
        return

    @property
    def spans(self) -> tuple[tuple[float, float] | None, ...]:
        """For each variable its first and last node, None where those are held beyond."""
        ends = zip(self.nodes, self.outside, strict=True)
        return tuple(None if outside == "clamp" else (float(x[0]), float(x[-1])) for x, outside in ends)

    @cached_property
    def checksum(self) -> str:
        """Hash of what the data are."""
        return checksum("interpolation", *self.nodes, self.values, self.outside)

    @cached_property
    def errors(self) -> tuple[float, ...]:
        """Estimated errors of the value and of each derivative; NaN for fewer than nine nodes along a variable."""
        if len(self.nodes) == 1:
            return tuple(foretold(self.nodes[0], self.values[:, None]).tolist())
        along = [foretold(x, f) for x, f in zip(self.nodes, (self.values, self.values.T), strict=True)]
        across = [self._across(0), self._across(1)]
        return (float(along[0][0] + along[1][0]), float(along[0][1] + across[0]), float(along[1][1] + across[1]))

    def _across(self, k: int) -> float:
        """Error of the slope along a variable by interpolation along the other one."""
        x, f = self.nodes[k], self.values if k == 0 else self.values.T
        return float(foretold(self.nodes[1 - k], slopes(x, f).T)[0])

    def block(self, first: float = 0.0, last: float = 0.0) -> Array:
        """The data as kernels read them, whatever the times."""
        return self.data

    @cached_property
    def data(self) -> Array:
        """The data as kernels read them: see the fragment ``function_interpolation``."""
        if len(self.nodes) == 1:
            f = self.values[:, None]
            parts = np.stack([f[:, 0], slopes(self.nodes[0], f)[:, 0]], axis=-1)
        else:
            x, y = self.nodes
            by_x, by_y = slopes(x, self.values), slopes(y, self.values.T).T
            parts = np.stack([self.values, by_x, by_y, slopes(y, by_x.T).T], axis=-1)
        whole = np.concatenate([*self.nodes, parts.ravel()])
        out = aligned(_HEADER + len(whole))
        count = len(self.nodes)
        out[:count] = [len(x) for x in self.nodes]
        out[count : 2 * count] = [outside == "clamp" for outside in self.outside]
        out[_HEADER:] = whole
        out.flags.writeable = False
        return out

    def value(self, *at: float) -> tuple[float, ...]:
        """The value; raises ValueError beyond the nodes, unless the edge is held there."""
        return value(self.signature, self.data, *self._within(*at))

    def derivatives(self, *at: float) -> Array:
        """The derivatives by each variable, (1, variables)."""
        return derivatives(self.signature, self.data, *self._within(*at))

    def _within(self, *at: float) -> tuple[float, ...]:
        check_count(self.signature, at)
        for k, (x, span) in enumerate(zip(at, self.spans, strict=True)):
            if span is not None and not span[0] <= x <= span[1]:
                raise ValueError(f"argument {k + 1} is {x:.17g}; its nodes go from {span[0]:.17g} to {span[1]:.17g}")
        return at


def _checked(x: Array, k: int, count: int) -> Array:
    """The nodes of variable `k`."""
    what = "nodes of an interpolation" + (f", variable {k + 1}," if count > 1 else "")
    if x.ndim != 1 or len(x) < 2:
        raise ValueError(f"{what} must be two numbers or more, not of shape {x.shape}")
    if not np.isfinite(x).all():
        raise ValueError(f"{what} must be finite; node {int(np.argmin(np.isfinite(x)))} is not")
    if not (np.diff(x) > 0.0).all():
        i = int(np.argmin(np.diff(x) > 0.0)) + 1
        raise ValueError(f"{what} must ascend; node {i} is {x[i]:.17g} after {x[i - 1]:.17g}")
    x.flags.writeable = False
    return x
