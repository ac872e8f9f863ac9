"""A problem's numbers as arrays: what is estimated in one vector, and one row for each station."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from piazzi.model import Model
from piazzi.problem.checks import Array, frozen
from piazzi.problem.parts import Gaussian, Station


def mean(model: Model, prior: Gaussian, parameters: Mapping[str, Any]) -> Array:
    """Prior mean of everything estimated, (n,)."""
    if model.names == model.states:
        return prior.mean  # type: ignore[no-any-return]
    return frozen([*prior.mean[list(model.sources)], *(parameters[c].mean[0] for c in model.constants)])


def covariance(model: Model, prior: Gaussian, parameters: Mapping[str, Any]) -> Array:
    """Prior covariance of everything estimated, (n, n)."""
    if model.names == model.states:
        return prior.covariance  # type: ignore[no-any-return]
    out = np.zeros((model.n, model.n))
    sources, nd = list(model.sources), len(model.moving)
    out[:nd, :nd] = prior.covariance[np.ix_(sources, sources)]
    for i, name in enumerate(model.constants, start=nd):
        out[i, i] = parameters[name].covariance[0, 0]
    return frozen(out)


def given(model: Model, parameters: Mapping[str, Any]) -> Array:
    """Values of the parameters that are not estimated, at least one number long."""
    values = [parameters[name] for name in model.given]
    return frozen([v.mean[0] if isinstance(v, Gaussian) else v for v in values] or [0.0])


def station_sensor(stations: Sequence[Station], model: Model) -> Array:
    """Index of each station's sensor, (S,)."""
    names = [s.name for s in model.sensors]
    return _indices(names.index(s.sensor) for s in stations)


def station_noise(stations: Sequence[Station], model: Model) -> Array:
    """R of each station, (S, M, M), unit variance where a sensor has fewer components."""
    out = np.zeros((len(stations), model.width, model.width))
    out[:] = np.eye(model.width)
    for R, station in zip(out, stations, strict=True):
        m = len(station.noise)
        R[:m, :m] = station.noise
    return frozen(out)


def station_limits(noise: Array) -> tuple[tuple[float, ...], ...]:
    """For each station and component, the largest measurement that a number holds more exactly than its noise."""
    sigma = np.sqrt(np.diagonal(noise, axis1=1, axis2=2))
    return tuple(tuple(row) for row in (sigma / np.finfo(float).eps).tolist())


def station_correlated(stations: Sequence[Station]) -> Array:
    """For each station, 1 where its R is not diagonal, (S,)."""
    return _indices(bool(np.count_nonzero(s.noise) > np.count_nonzero(np.diag(s.noise))) for s in stations)


def station_numbers(stations: Sequence[Station], model: Model) -> Array:
    """Each station's own numbers in alphabetical order, (S, widest)."""
    out = np.zeros((len(stations), model.most_numbers))
    for row, station in zip(out, stations, strict=True):
        row[: len(station.numbers)] = list(station.numbers.values())
    return frozen(out)


def _indices(values: Iterable[int]) -> Array:
    out = np.array([*values], dtype=np.int64)
    out.setflags(write=False)
    return out
