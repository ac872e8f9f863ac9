"""How far two orbits are apart, along the axes of the first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piazzi.arrays import Array
from piazzi.earth import FRAMES, Epoch, rotation
from piazzi.orbit.axes import orbit_axes
from piazzi.orbit.paths import Path, first_date, opened, path_of
from piazzi.text import brief

SCHEMA = "piazzi.difference/1"
INSIDE = 14.156413609126675  # of chi-square with 3 degrees of freedom: 0.9973, as 3 sigma of one
_STEPS = 241  # over a span, for orbits that have no rows of their own


@dataclass(frozen=True, eq=False)
class Difference:
    """The second orbit minus the first, at K times.

    Attributes
    ----------
    names : of the two orbits
    axes : RTN or TNW of the first orbit, or a frame
    epoch, t : time zero, and (K,) seconds of TT past it
    position, velocity : (K, 3) m and m/s along the axes; velocities turned, not relative to turning axes
    sigma : (K, 3) m along the axes, of both covariances together; NaN where no file has one
    squared : (K,) squared Mahalanobis distance of the position, NaN where there is no covariance
    told : of each orbit how states between its rows were made: method, degree and, as `error` in m, how far those of
        the next degrees are off: what its error is like, where the motion has no waves shorter than two steps
    """

    names: tuple[str, str]
    axes: str
    epoch: Epoch
    t: Array
    position: Array
    velocity: Array
    sigma: Array
    squared: Array
    told: tuple[dict[str, Any], dict[str, Any]]

    __repr__ = brief

    @property
    def letters(self) -> tuple[str, str, str]:
        """Names of the three axes."""
        return (self.axes[0], self.axes[1], self.axes[2]) if self.axes in ("RTN", "TNW") else ("X", "Y", "Z")

    @property
    def rms(self) -> Array:
        """(3,) m, along each axis."""
        return np.asarray(np.sqrt(np.mean(self.position**2, axis=0)))

    @property
    def maximum(self) -> Array:
        """(3,) m, the largest without its sign along each axis."""
        return np.asarray(np.abs(self.position).max(axis=0))

    @property
    def rms_3d(self) -> float:
        """Root mean square of the distance, m."""
        return float(np.sqrt(np.mean(np.sum(self.position**2, axis=1))))

    @property
    def covered(self) -> float | None:
        """Share of the times with a covariance whose position is inside its ellipsoid of probability 0.9973; None without."""
        known = np.isfinite(self.squared)
        return float(np.mean(self.squared[known] <= INSIDE)) if known.any() else None

    def to_dict(self) -> dict[str, Any]:
        """Everything but the rows, for JSON."""
        known = np.isfinite(self.sigma).all(axis=1)
        distance = np.linalg.norm(self.position, axis=1)
        in_sigma = None
        if known.any():
            share = self.position[known] / self.sigma[known]
            in_sigma = {
                "count": int(known.sum()),
                "rms": self._by_axis(np.sqrt(np.mean(share**2, axis=0))),
                "maximum": self._by_axis(np.abs(share).max(axis=0)),
                "inside": self.covered,
                "expected_inside": 0.9973,
            }
        return {
            "schema": SCHEMA,
            "orbits": [{"name": name, **told} for name, told in zip(self.names, self.told, strict=True)],
            "axes": self.axes,
            "first": (self.epoch + float(self.t[0])).to("UTC", digits=3),
            "last": (self.epoch + float(self.t[-1])).to("UTC", digits=3),
            "count": len(self.t),
            "rms": self._by_axis(self.rms) | {"3d": self.rms_3d},
            "maximum": self._by_axis(self.maximum) | {"3d": float(distance.max())},
            "mean": self._by_axis(self.position.mean(axis=0)),
            "rms_velocity": self._by_axis(np.sqrt(np.mean(self.velocity**2, axis=0))),
            "in_sigma": in_sigma,
        }

    def _by_axis(self, values: Array) -> dict[str, float]:
        return dict(zip(self.letters, values.tolist(), strict=True))


def difference(
    a: Any,
    b: Any,
    axes: str = "RTN",
    span: tuple[Epoch | str | None, Epoch | str | None] | None = None,
    *,
    step: float | None = None,
    object: str | None = None,  # noqa: A002  # what the command calls it
    degree: int | None = None,
) -> Difference:
    """Orbit `b` minus orbit `a`, at the times of `a`'s rows that both cover.

    Parameters
    ----------
    a, b : each a file (OEM, OPM, OCM, SP3, CPF, two-line elements, OMM), an `Ephemeris`, one of its arcs, mean elements,
        what `pz.load` gives of a scenario or a recording with its truth, or a function that takes a list of Epochs and gives
        position (m) and velocity (m/s), (K, 3) each, in the GCRF
    axes : RTN or TNW of `a` at each time, or a frame of `piazzi.earth.FRAMES`
    span : first and last date, Epochs or text with a scale; None is open
    step : seconds between times, where they are not those of the rows of `a` (or of `b`, where `a` has none)
    object : name or identifier of the object in files of several
    degree : of the polynomial between rows; default that of the file, else the one that differs least from its neighbours

    Returns
    -------
    Difference

    Raises
    ------
    ValueError
        Where the orbits have no time in common, a file has several objects and none is said, positions are about another
        body or in axes that nobody says, or nothing says at which times to compare.

    Notes
    -----
    Rows are turned into the GCRF, and states between them are those of Hermite's polynomial where there are velocities, of
    Lagrange's where there are none.  In sigma the difference is by the sum of both covariances, which is right for
    independent data only.
    """
    if axes not in ("RTN", "TNW", *FRAMES):
        raise ValueError(f"axes {axes!r} are not known; there are RTN, TNW, {', '.join(FRAMES)}")
    (first_name, one), (second_name, other) = opened(a, object), opened(b, object)
    limits = [None if end is None else Epoch(end) for end in span or (None, None)]
    zero = next((d for d in (first_date(one), first_date(other), *limits) if d is not None), None)
    if zero is None:
        raise ValueError("neither orbit has dates of its own: give a span")
    paths = path_of(first_name, one, zero, degree), path_of(second_name, other, zero, degree)
    t = _times(paths, [None if end is None else end - zero for end in limits], step)
    (r, v), (s, w) = (path.states(t) for path in paths)
    dates = [zero + float(x) for x in t]
    R = orbit_axes(r, v, axes) if axes in ("RTN", "TNW") else rotation("GCRF", axes, dates)
    apart, drift = (np.einsum("kij,kj->ki", R, x) for x in (s - r, w - v))
    P = _covariance(paths, t, r, v)
    known = np.isfinite(P).all(axis=(1, 2))
    sigma, squared = np.full((len(t), 3), np.nan), np.full(len(t), np.nan)
    if known.any():
        turned = R[known] @ P[known] @ np.swapaxes(R[known], 1, 2)
        sigma[known] = np.sqrt(np.diagonal(turned, axis1=1, axis2=2))
        squared[known] = np.einsum("ki,ki->k", apart[known], np.linalg.solve(turned, apart[known][..., None])[..., 0])
    told = (paths[0].told(), paths[1].told())
    return Difference((first_name, second_name), axes, zero, t, apart, drift, sigma, squared, told)


def _times(paths: tuple[Path, Path], limits: list[Any], step: float | None) -> Array:
    """Times that both cover, within the limits."""
    rows = next((path.rows() for path in paths if len(path.rows())), np.zeros(0))
    low, high = (end if end is not None else rows[i] if len(rows) else None for i, end in zip((0, -1), limits, strict=True))
    if low is None or high is None:
        raise ValueError("neither orbit has rows of its own: give a span with both ends")
    if step is not None and not step > 0.0:
        raise ValueError(f"step is {step:g} s; it must be positive")
    if not low <= high:
        told = f"the span ends {low - high:g} s before it begins" if None not in limits else "there are no rows within the span"
        raise ValueError(told)
    if step is not None or not len(rows):
        width = (high - low) / (_STEPS - 1) if step is None else step
        rows = low + width * np.arange(int((high - low) / width + 1e-9) + 1) if width > 0.0 else np.array([low])
    t = rows[(rows >= low) & (rows <= high)]
    covered = [path.covered(t) for path in paths]
    t = t[covered[0] & covered[1]]
    if not len(t):
        raise ValueError(f"{paths[0].name} and {paths[1].name} have no time in common within the span")
    return np.asarray(t)


def _covariance(paths: tuple[Path, Path], t: Array, r: Array, v: Array) -> Array:
    """Of the difference, (K, 3, 3): the sum of those there are; NaN where there is none."""
    found = [path.covariances(t, r, v) for path in paths]
    missing = [np.isnan(P).any(axis=(1, 2), keepdims=True) for P in found]
    total = sum(np.where(none, 0.0, P) for P, none in zip(found, missing, strict=True))
    return np.where(missing[0] & missing[1], np.nan, total)
