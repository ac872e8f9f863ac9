"""Residuals of a determination: of every measurement, in groups by station and component, and as a dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.evaluate.quantities import finite
from piazzi.formats.kinds import KINDS
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    import xarray


def table(found: Any) -> dict[str, Array]:
    """Columns of one entry a measurement, in the order of time: t, station, component, unit, observed, o_minus_c, sigma, ..."""
    given, measured = found.setup, found.setup.measured
    rows, components = np.nonzero(given.rows >= 0)
    observation = given.rows[rows, components]
    kinds = np.array([measured.observations.kinds[i] for i in measured.observations.kind[observation]], dtype=object)
    which = given.tracking.stations_of(given.problem)[rows]
    labels = np.array([measured.labels[given.problem.stations[i].name] for i in which], dtype=object)
    observed = given.tracking.values[rows, components]
    sigma = np.sqrt(np.diagonal(given.problem.station_noise, axis1=1, axis2=2)[which, components])
    absent = np.full(len(rows), np.nan)
    residual, computed, whitened = absent, absent, absent
    if found.analysis is not None:
        own = found.analysis
        residual, computed, whitened = (a[rows, components] for a in (own.residual, own.computed, own.whitened))
    used = found.keep[rows]
    weights = found.estimate.details.get("weights")
    weight = np.ones(len(rows)) if weights is None else np.asarray(weights)[rows]
    return {
        "t": given.tracking.row_times[rows], "station": labels, "component": kinds,
        "unit": units_of(given.problem, which, components, kinds), "observed": observed,
        "computed": computed, "o_minus_c": residual, "whitened": whitened, "sigma": sigma,
        "weight": np.where(used, weight, 0.0), "used": used, "reason": found.reasons[rows], "observation": observation,
    }  # fmt: skip


def units_of(problem: Any, which: Array, components: Array, kinds: Array) -> Array:
    """Units of measurements as sensors have them: of a time of flight it is half the way, in metres."""
    sensors = {sensor.name: sensor for sensor in problem.model.sensors}
    own = [sensors[problem.stations[i].sensor] for i in which]
    said = [dict(one.units).get(one.components[c], "") for one, c in zip(own, components, strict=True)]
    return np.array([unit or KINDS[kind].unit for unit, kind in zip(said, kinds, strict=True)], dtype=object)


def groups(found: Any) -> list[dict[str, Any]]:
    """One entry for each station and component: counts, mean and root mean square of those used."""
    rows = table(found)
    keys = dict.fromkeys(zip(rows["station"].tolist(), rows["component"].tolist(), rows["unit"].tolist(), strict=True))
    out = []
    for station, component, unit in keys:
        own = (rows["station"] == station) & (rows["component"] == component)
        used = own & rows["used"] & np.isfinite(rows["o_minus_c"])
        residual, whitened = rows["o_minus_c"][used], rows["whitened"][used]
        some = bool(used.any())
        out.append({
            "station": station, "component": component, "unit": unit, "count": int(own.sum()),
            "used": int((own & rows["used"]).sum()),
            "mean": finite(float(residual.mean())) if some else None,
            "rms": finite(float(np.sqrt(np.mean(residual**2)))) if some else None,
            "weighted_rms": finite(float(np.sqrt(np.mean(whitened**2)))) if some else None,
        })  # fmt: skip
    return out


def rejected(found: Any) -> list[dict[str, Any]]:
    """One entry for each measurement that was not used, with the reason."""
    rows = table(found)
    epoch = found.setup.measured.epoch
    return [
        {
            "time": (epoch + float(rows["t"][i])).to(found.scale),
            "station": rows["station"][i], "component": rows["component"][i],
            "residual": finite(float(rows["o_minus_c"][i])), "sigma": finite(float(rows["sigma"][i])),
            "reason": str(rows["reason"][i]),
        }
        for i in np.flatnonzero(~rows["used"])
    ]  # fmt: skip


def dataset(found: Any) -> xarray.Dataset:
    """All columns with their names; time is seconds of TT past the epoch in the attributes."""
    import xarray as xr

    rows = table(found)
    names = ("station", "unit", "observed", "computed", "o_minus_c", "sigma", "weight", "used", "reason")
    variables: dict[str, Any] = {name: (("measurement",), rows[name]) for name in names}
    variables["kind"] = (("measurement",), rows["component"])
    coordinates = {"time": ("measurement", rows["t"], {"units": "s", "long_name": "seconds of TT past the epoch"})}
    return xr.Dataset(variables, coordinates, {"epoch": found.setup.measured.epoch.exact()})
