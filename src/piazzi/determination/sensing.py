"""Observations as what a problem takes: sensors, stations with their noise, and a tracking that knows its observations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from piazzi.determination.centres import Centre, centre_of
from piazzi.determination.correcting import with_corrections
from piazzi.determination.differences import differences
from piazzi.determination.directions import AZEL, RADEC, XEYN, XSYE, ascensions, mounts
from piazzi.determination.fixes import fixes
from piazzi.determination.frequencies import frequencies
from piazzi.determination.parts import Part
from piazzi.determination.phases import phases
from piazzi.determination.pseudoranges import pseudoranges
from piazzi.determination.ranging import ranges
from piazzi.determination.rates import rates
from piazzi.determination.sites import Context, oriented, sites_of, with_station_sigmas
from piazzi.determination.unknowns import Label
from piazzi.earth import Epoch
from piazzi.earth.scales import Orientation
from piazzi.formats import Observations
from piazzi.formats.kinds import asked_sigmas
from piazzi.model import Sensor
from piazzi.problem import Station, Tracking
from piazzi.problem.checks import Array
from piazzi.text import listed

MOST_SIGMAS = 200  # different noise matrices of one station and sensor; beyond, sigmas are rounded up to two digits
# kinds of rows, and what makes parts of all rows of these kinds; who takes a kind takes it from all stations
MAKERS: Mapping[tuple[str, ...], Callable[[Context, Array], Sequence[Part]]] = {
    ("x", "y", "z", "vx", "vy", "vz"): fixes,
    ("range", "time_of_flight"): ranges,
    AZEL: mounts,
    XEYN: mounts,
    XSYE: mounts,
    RADEC: ascensions,
    ("range_rate", "range_rate_averaged", "doppler"): rates,
    ("receive_frequency",): frequencies,
    ("receive_phase", "doppler_count"): phases,
    ("pseudorange",): pseudoranges,
    ("delta_range_delay", "vlbi_delay"): differences,
}
SILENT = (
    "magnitude", "radar_cross_section", "carrier_power", "carrier_to_noise", "ranging_to_noise", "transmit_phase",
    "troposphere_dry", "troposphere_wet", "total_electron_content",
)  # fmt: skip
FROM_THE_SUN = (*RADEC, "time_of_flight", "doppler")  # that are determined from about the Sun


@dataclass(frozen=True, eq=False)
class Measured:
    """What was measured, as a problem takes it.

    Attributes
    ----------
    observations : as they were read, of one object
    object : its name, "" where nobody says it
    sensors, stations, tracking : of a problem whose time zero is `epoch`
    rows : (J, m), for each row of the tracking and component the index of the observation, -1 for none
    labels : for each station of the problem, the name by which users know it
    functions, parameters : that sensors need beside those of the forces: data, and numbers or beliefs with their roles
    labels_of_constants : how users know those of the parameters that have names for kernels only
    about : what the orbit goes about, "earth" or "sun"
    assumed, left_out : what was assumed; why, and how many rows are not in the tracking
    """

    observations: Observations
    object: str
    sensors: tuple[Sensor, ...]
    stations: tuple[Station, ...]
    tracking: Tracking
    rows: Array
    labels: Mapping[str, str]
    epoch: Epoch
    functions: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, tuple[str, Any]] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    left_out: Mapping[str, int] = field(default_factory=dict)
    labels_of_constants: Mapping[str, Label] = field(default_factory=dict)
    about: str = "earth"

    @property
    def centre(self) -> Centre:
        """What the orbit goes about."""
        return centre_of(self.about)

    @property
    def first(self) -> Epoch:
        """When the first row was measured."""
        return self.epoch + float(self.tracking.times[0])


def measured(
    observations: Observations,
    stations: Any = None,
    *,
    com: float | None = None,
    corrections: str | None = None,
    clocks: bool = False,
    name: str | None = None,
    about: str = "earth",
    antenna: tuple[float, float, float] | None = None,
    epoch: Epoch | None = None,
    partners: Mapping[str, Any] | None = None,
    eop: Orientation | None = None,
) -> Measured:
    """Sensors, stations and tracking of observations of one object.

    Parameters
    ----------
    observations : of one object
    stations : see `sites.sites_of`; default those of the ILRS for lasers, of the Minor Planet Center for its formats
    com : what ranges are shorter by than to the centre of mass, m; default by the object's name
    corrections : "applied" or "open", whether media are corrected for already where the files do not say it
    clocks : whether sensors have a number that times are late by
    name : of the object, where the files do not say it
    about : what the orbit goes about
    antenna : where fixes are taken, m from the centre of mass along R, T and N
    epoch : time zero of the problem; default the second in which the first row is
    partners : participants in orbit whose ephemerides are given, by name; see `partners.partners_of`
    eop : orientation of the Earth, as the forces have it; default the tables

    Raises
    ------
    ValueError
        For what the files leave open (with the option that says it), kinds that cannot be used, or no rows.
    """
    sites = sites_of(stations)
    if sites is None and any(segment.wavelength is not None for segment in observations.segments):
        sites = sites_of("ilrs")
    if sites is None and "place_axes" in observations.extra:  # of the Minor Planet Center, whose list may not be installed
        with suppress(ValueError):
            sites = sites_of("mpc")
    everything = replace(observations, sigma=with_station_sigmas(observations, sites))
    _ask(everything)
    everything, added = with_corrections(everything, sites)
    usable = everything.measured & everything.used
    left_out = dict(everything.left_out)
    unused, speeds = everything.measured & ~everything.used, everything.of_kind("vx", "vy", "vz")
    for rows, what in ((unused & speeds, "velocities that follow from positions"), (unused & ~speeds, "marked in the file")):
        if rows.any():
            left_out[f"rows not to be used: {what}"] = int(np.count_nonzero(rows))
    left_out |= {f"rows of {words}, which say nothing of the orbit": n for words, n in _silent(everything).items()}
    order = np.argsort(everything.t, kind="stable")
    index = order[usable[order]]
    if not len(index):
        raise ValueError(f"{_where(everything)}there is no measurement to use")
    _check_sigmas(everything, index)
    epoch = epoch or Epoch.at(float(everything.epoch.whole + np.floor(everything.t[index[0]])))
    known = everything.objects
    own = known[0] if known else name or ""
    context = Context(
        everything, epoch, sites, own, com, corrections == "applied", corrections == "open", clocks, about, antenna,
        partners or {}, eop,
    )  # fmt: skip
    parts = [part for part in _parts(context, index) if len(part.t)]
    left_out |= context.left
    if not parts:
        raise ValueError(f"{_where(everything)}there is no measurement to use: {', '.join(context.left)}")
    sensors, places, names, labels = _stations(parts)
    if others := [one for one in context.partners if one in labels.values()]:
        context.said[f"orbits taken as they are given, without errors, and not estimated: {listed(others)}"] = None
    times = np.concatenate([part.t for part in parts]) + (everything.epoch - epoch)
    width = max(part.values.shape[1] for part in parts)
    values = np.concatenate([_padded(part.values, width, np.nan) for part in parts])
    rows = np.concatenate([_padded(part.rows, width, -1) for part in parts])
    by_time = np.argsort(times, kind="stable")
    tracking = Tracking(times[by_time], values[by_time], np.array(names)[by_time], epoch=epoch)
    in_order = bool(np.all(everything.t[1:] >= everything.t[:-1]))
    sorted_ = () if in_order else ("rows were out of order, and are sorted by time",)
    if any(segment.quality == "degraded" for segment in everything.segments):
        context.said["rows that the file calls degraded are used as the others"] = None
    said = [*everything.assumed, *added, *sorted_, *context.said, *(sites.notes if sites else ())]
    found = Measured(
        everything, context.object, sensors, places, tracking, rows[by_time], labels, epoch,
        {name: value for part in parts for name, value in part.functions.items()},
        {name: value for part in parts for name, value in part.parameters.items()},
        tuple(dict.fromkeys([*said, *(text for part in parts for text in part.assumed)])),
        left_out, about=about,
    )  # fmt: skip
    stations = tuple(replace(station, place=oriented(station.place, eop)) for station in found.stations)
    return replace(found, stations=stations, functions={name: oriented(data, eop) for name, data in found.functions.items()})


def _silent(observations: Observations) -> dict[str, int]:
    """How many rows of each kind neither measure the orbit nor help to use those that do."""
    counts = np.bincount(observations.kind, minlength=len(observations.kinds))
    return {kind.replace("_", " "): int(n) for kind, n in zip(observations.kinds, counts, strict=True) if n and kind in SILENT}


def _check_sigmas(observations: Observations, index: Array) -> None:
    """Raise ValueError where a row has no standard deviation."""
    lost = np.isnan(observations.sigma[index])
    if lost.any():
        kinds = dict.fromkeys(observations.kinds[k] for k in observations.kind[index[lost]])
        raise ValueError(f"{_where(observations)}left open by the file: {asked_sigmas(kinds)}")


def of_object(observations: Observations, chosen: str | None) -> Observations:
    """The rows of one object; raises ValueError with the list where there are several, or not that one.

    Rows of which no file says what they are of, such as clocks and frequencies of stations, are of any object.
    """
    known = observations.objects
    if chosen is None or not known:
        if len(known) > 1:
            more = f" and {len(known) - 8} more" if len(known) > 8 else ""
            raise ValueError(
                f"{_where(observations)}{len(known)} objects, {', '.join(known[:8])}{more}: say which with --object, or --each"
            )
        return observations
    if chosen not in known:
        raise ValueError(f"{_where(observations)}no object {chosen!r}; there is {', '.join(known[:8]) or 'no name of any'}")
    own = observations.object == observations.participants.index(chosen)
    return observations[own | ((observations.object < 0) & ~observations.measured)]


def _ask(observations: Observations) -> None:
    """Raise ValueError for all that is open; standard deviations are of those kinds that have none yet."""
    lost = observations.measured & observations.used & np.isnan(observations.sigma)
    kinds = [observations.kinds[i] for i in np.unique(observations.kind[lost])]
    waiting = [_plain(text) for text in observations.open if "--" in text and "--sigma" not in text]
    if kinds and any("--sigma" in text for text in observations.open):
        waiting.append(asked_sigmas(kinds))
    if waiting:
        raise ValueError(f"{_where(observations)}left open by the file: {'; '.join(waiting)}")


def _plain(text: str) -> str:
    return text[:1].lower() + text[1:] if not text[:2].isupper() else text


def _where(observations: Observations) -> str:
    return f"{observations.files[0]}: " if observations.files else ""


def _parts(context: Context, index: Array) -> list[Part]:
    """Parts of all rows, in the order of `MAKERS`; raises ValueError for kinds that none of them takes."""
    observations = context.observations
    found: list[Part] = []
    kinds = observations.kind[index]
    taken = np.zeros(len(index), dtype=np.bool_)
    if context.about == "sun":
        _only_directions(context, kinds)
    for names, maker in MAKERS.items():
        own = np.isin(kinds, [i for i, kind in enumerate(observations.kinds) if kind in names])
        if own.any():
            found += maker(context, index[own])
            taken |= own
    if not taken.all():
        kind = observations.kinds[kinds[~taken][0]]
        known = ", ".join(n for names in MAKERS for n in names)
        raise ValueError(f"{_where(observations)}{kind} is not determined from yet; what is, is {known}")
    return found


def _only_directions(context: Context, kinds: Array) -> None:
    """Raise ValueError for rows that are not determined from about the Sun."""
    other = [kind for i, kind in enumerate(context.observations.kinds) if i in kinds and kind not in FROM_THE_SUN]
    if other:
        raise ValueError(
            f"{context.where}{other[0]} is not determined from about the Sun yet; directions and echoes of radar are"
        )


def _padded(values: Array, width: int, blank: float) -> Array:
    out = np.full((len(values), width), blank, dtype=values.dtype)
    out[:, : values.shape[1]] = values
    return out


def _stations(parts: Sequence[Part]) -> tuple[tuple[Sensor, ...], tuple[Station, ...], list[str], dict[str, str]]:
    """Sensors, stations of the problem (one for each sensor, place and noise), that of each row, what users call them."""
    sensors: dict[str, Sensor] = {}
    stations: list[Station] = []
    labels: dict[str, str] = {}
    names: list[str] = []
    for part in parts:
        sensors.setdefault(part.sensor.name, part.sensor)
        noise, which = _noises(part.noise)
        own = []
        for R in noise:
            name, i = part.station, 1
            while name in labels:
                i += 1
                name = f"{part.station} ({i})"
            labels[name] = part.station
            own.append(name)
            stations.append(Station(name, part.sensor.name, R, part.numbers, place=part.place))
        names += [own[i] for i in which]
    return tuple(sensors.values()), tuple(stations), names, labels


def _noises(noise: Array) -> tuple[Array, Array]:
    """The different matrices of (R, m, m), and which of them each row has."""
    flat = noise.reshape(len(noise), -1)
    different, which = np.unique(flat, axis=0, return_inverse=True)
    if len(different) > MOST_SIGMAS:
        sigma = np.sqrt(np.diagonal(noise, axis1=1, axis2=2))
        size = 10.0 ** (np.floor(np.log10(sigma)) - 1.0)
        rounded = np.ceil(sigma / size - 1e-9) * size
        scale = rounded / sigma
        rounder = noise * scale[:, :, None] * scale[:, None, :]
        diagonal = np.zeros_like(noise)
        place = np.arange(noise.shape[1])
        diagonal[:, place, place] = rounded**2
        alone = (noise == diagonal * (noise != 0)).all(axis=(1, 2))
        flat = np.where(alone[:, None], diagonal.reshape(len(noise), -1), rounder.reshape(len(noise), -1))
        different, which = np.unique(flat, axis=0, return_inverse=True)
    return different.reshape(-1, *noise.shape[1:]), np.asarray(which).reshape(-1)
