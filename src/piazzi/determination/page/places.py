"""Globe, ground track, and what every station saw."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from piazzi.determination.page.charts import passes_of
from piazzi.determination.page.ecliptic import ecliptic
from piazzi.determination.page.sampled import Sampled, fixed
from piazzi.determination.residuals import table
from piazzi.earth import azimuth_elevation_range
from piazzi.present.colours import station_colour
from piazzi.present.land import land
from piazzi.present.report.blocks import Rows, Section, Sky, World
from piazzi.problem.checks import Array

SHARE = 0.06  # of the orbit's size, that the tube's half-width is about
_ORBIT = (
    "Drag the globe, or turn it with the arrow keys; play, or drag the slider above. The line is the orbit, dots are where it"
    " was when it was measured, in the colour of the station; crosses are measurements that were not used."
)
_SKY = "North is up, east is right, the zenith in the middle. Crosses were not used; point at one for why."


def sections(found: Any, path: Sampled | None, rows: Sequence[Rows]) -> list[Section]:
    """The orbit about the Earth, and skies."""
    if path is not None and path.about == "sun":
        return [ecliptic(found, path)]
    out = []
    if path is not None:
        factor, note = _tube(path)
        shared = (path.times, path.place, path.spread, path.turned, path.sun, path.period, factor, rows, land())
        start = _start(path)
        ground = World("Ground track", "map", *shared, start=start, note=_span(found, path))
        out.append(Section("The orbit", [World("Globe", "globe", *shared, start=start, note=note), ground], _ORBIT))
    skies = [Sky(_title(one), one) for one in rows if one.azimuth is not None]
    if skies:
        out.append(Section("What every station saw", skies, _SKY, folded=len(skies) > 12))
    return out


def station_rows(found: Any, path: Sampled | None) -> list[Rows]:
    """Measurements of every station in the order of time, with where the object was; none without an orbit."""
    if path is None or path.about == "sun":
        return []
    columns = table(found)
    zero = found.setup.measured.epoch
    times, inverse = np.unique(columns["t"], return_inverse=True)
    epochs = [zero + float(t) for t in times]
    place, turned, _ = fixed(_positions(found, times), epochs)
    sites = {
        found.setup.measured.labels[s.name]: s.place.station
        for s in found.problem.stations
        if getattr(s.place, "station", None) is not None
    }
    names = list(dict.fromkeys(columns["station"].tolist()))
    number = np.zeros(len(columns["t"]), dtype=int)
    for k, (_, entries) in enumerate(passes_of(found, columns)):
        number[entries] = k
    out = []
    for n, name in enumerate(names):
        own = np.flatnonzero(columns["station"] == name)
        at, first, which = np.unique(inverse[own], return_index=True, return_inverse=True)
        used, reasons = _together(columns, own, which, len(at))
        site = sites[name].position(epochs[int(at[0])]) if name in sites else None
        look = (None, None) if site is None else azimuth_elevation_range(site, place[at])[:2]
        gaps = np.flatnonzero(np.diff(number[own][first])) + 1

        def apart(values: Any, gaps: Array = gaps) -> Any:
            return None if values is None else np.insert(np.asarray(values, dtype=float), gaps, np.nan, axis=0)

        notes = np.insert(reasons, gaps, "").tolist()
        when = np.insert(times[at], gaps, times[at][gaps - 1] if len(gaps) else [])
        out.append(
            Rows(
                name, station_colour(n), when, apart(place[at]), apart(turned[at]), apart(used), notes, site,
                apart(look[0]), apart(look[1]),
            )
        )  # fmt: skip
    return out


def _together(columns: dict[str, Array], own: Array, which: Array, count: int) -> tuple[Array, Array]:
    """Whether all components of a time were used, and why one was not, at so many times."""
    used, reasons = np.ones(count, dtype=bool), np.full(count, "", dtype=object)
    left = ~columns["used"][own].astype(bool)
    used[which[left]] = False
    reasons[which[left]] = columns["reason"][own[left]]
    return used, reasons


def _positions(found: Any, times: Array) -> Array:
    """Positions (T, 3) at the times of measurements: those of the estimate, which has an epoch at each."""
    nodes = found.estimate.times
    at = np.clip(np.searchsorted(nodes, times - 1e-6), 0, len(nodes) - 1)
    return np.asarray(found.estimate.mean[at, :3])


def _title(rows: Rows) -> str:
    used = int(np.nansum(rows.used))
    left = int(np.isfinite(rows.used).sum()) - used
    passes = int(np.isnan(rows.used).sum()) + 1
    parts = [f"{passes} pass{'es' if passes > 1 else ''}", f"{used:,} used", *([f"{left:,} not"] if left else [])]
    return f"{rows.label}: {', '.join(parts)}"


def _tube(path: Sampled) -> tuple[float, str]:
    """By which round number the tube is widened, and the words that say it."""
    sigma = path.sigmas[path.measured][:, [0, 2]]
    typical = 3.0 * float(np.median(sigma.max(axis=1)))
    reach = float(np.linalg.norm(path.place, axis=1).max())
    if not typical > 0:
        return 1.0, ""
    wanted = max(SHARE * reach / typical, 1.0)
    power = 10.0 ** np.floor(np.log10(wanted))
    factor = float(power * max(m for m in (1.0, 2.0, 5.0) if m * power <= wanted * 1.000001))
    return factor, f"The tube is three sigma across the orbit, drawn {factor:,.0f} times as wide as it is."


def _span(found: Any, path: Sampled) -> str:
    first = float(found.estimate.times[0])
    if path.times[0] <= first:
        return ""
    return f"The last {(path.times[-1] - path.times[0]) / path.period:.0f} revolutions are drawn."


def _start(path: Sampled) -> tuple[float, float]:
    """Longitude and latitude among the stars to look from: aslant on the orbit, over where it was measured last."""
    k = int(np.flatnonzero(path.measured)[-1]) if path.measured.any() else len(path.times) - 1
    r = path.mean[k, :3] / np.linalg.norm(path.mean[k, :3])
    n = np.cross(path.mean[k, :3], path.mean[k, 3:])
    n = n / np.linalg.norm(n) * (1.0 if n[2] >= 0 else -1.0)
    view = 0.75 * r + 0.65 * n
    latitude = float(np.clip(np.arctan2(view[2], np.hypot(view[0], view[1])), -1.1, 1.1))
    return float(np.arctan2(view[1], view[0])), latitude
