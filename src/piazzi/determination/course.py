"""An orbit over time, from whatever says one: where it is and how sure that is, at any date, on the axes of the GCRF.

About the Sun these are those of the ICRF, and states are from its centre.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.beliefs import beliefs, carried_to
from piazzi.determination.centres import EARTH, Centre, centre_of
from piazzi.determination.density import Law, departed
from piazzi.determination.guesses import CARTESIAN, SCHEMA, Guess, guess_of
from piazzi.determination.motion import Extra, instead
from piazzi.determination.orbit_forces import AirVaries, Chosen, chosen_forces
from piazzi.determination.physical import DENSITY, WAVES
from piazzi.determination.sun_forces import forces_about_the_sun
from piazzi.earth import EphemerisWarning, Epoch, Forces
from piazzi.earth.force_text import LATITUDE
from piazzi.earth.rotation import frame_named
from piazzi.formats import read_ephemeris
from piazzi.formats.ephemeris import MeanElements
from piazzi.formats.recognise import recognise
from piazzi.kernels import RungeKutta8
from piazzi.opening import opened as opened_file
from piazzi.orbit import sgp4_states
from piazzi.orbit.axes import in_axes
from piazzi.orbit.paths import opened, path_of
from piazzi.orbit.starting import start_of
from piazzi.problem import Gaussian, Problem
from piazzi.problem.checks import Array

HDF5, JSON = b"\x89HDF", b"{"
MEAN = f"{DENSITY}mean"  # of its logarithm
MEMORY = f"{DENSITY}time"  # over which what density departs by goes back to zero, s
OLD = 10.0  # days from two-line elements, from which on it is said
Beliefs = Callable[[Array], tuple[Array, Array | None]]


@dataclass(frozen=True, eq=False)
class Course:
    """An orbit over time.

    Attributes
    ----------
    name : of the object, "" where nobody says it
    problem : with the forces that move it; times are past its epoch
    beliefs : gives states (K, 6) and covariances (K, 6, 6), or None, at times (K,)
    source, assumed : where it is from, and what was taken where nothing was said
    spans : pairs of times between which it is known; empty for all times
    centre : what it goes about
    """

    name: str
    problem: Problem
    beliefs: Beliefs
    source: str
    assumed: tuple[str, ...] = ()
    spans: tuple[tuple[float, float], ...] = ()
    centre: Centre = EARTH

    @property
    def epoch(self) -> Epoch:
        """That times are past."""
        return self.problem.epoch  # type: ignore[no-any-return]

    def check(self, t: Array) -> None:
        """Raise ValueError unless it is known at all times."""
        if self.spans and len(t):
            known = np.zeros(len(t), dtype=bool)
            for first, last in self.spans:
                known |= (t >= first - 1e-6) & (t <= last + 1e-6)
            if not known.all():
                ends = (float(t[~known][0]), self.spans[0][0], self.spans[-1][1])
                at, begin, end = ((self.epoch + one).rounded(3) for one in ends)
                raise ValueError(
                    f"{self.source} has no state of {self.name or 'the object'} at {at}: it goes from {begin} to {end} "
                    "(piazzi propagate goes on)"
                )


def course_of(
    given: Any, near: Epoch, *, chosen: str | None = None, forces: Any = None, about: str = "earth", source: str = ""
) -> Course:
    """The orbit that is given.

    Parameters
    ----------
    given : a `Determination`, its JSON or .nc, a file (OEM, OPM, OCM, SP3, CPF, TLE, OMM), an ephemeris, text of an orbit
    near : a date by which one of several states is taken
    chosen : name of the object in a file of several
    forces : of an orbit that is given by one state, as `determine` takes them; default by height
    about : what elements and states of text go about
    source : of the object of a determination, its file

    Raises
    ------
    ValueError
        Where it is no orbit, and for forces on one that is not given by one state.
    OSError
        Where a file cannot be read.
    """
    if hasattr(given, "setup") and hasattr(given, "estimate"):
        return _of_determination(given)
    if isinstance(given, Mapping):
        _no_forces(forces, source or "the determination", "has its own")
        return _of_document(given, source or "the determination")
    if isinstance(given, Guess) or (isinstance(given, str) and "=" in given and not os.path.exists(given)):
        guess = guess_of(given, near, about=about, where="ORBIT")
        return _of_state("", guess.epoch, guess.state, None, guess.source, forces, guess.assumed, guess.about)
    if isinstance(given, (str, os.PathLike)):
        facts = determination_in(os.fspath(given))
        if facts is not None:
            return course_of(facts, near, forces=forces, source=os.fspath(given))
    if about != "earth":
        raise ValueError(f"--about {about} is of elements and states as text; {given} is not")
    return _of_orbit(given, near, chosen, forces)


def _of_determination(found: Any) -> Course:
    setup, zero = found.setup, found.setup.measured.epoch

    def at(t: Array) -> tuple[Array, Array | None]:
        return beliefs(setup, found.estimate, [zero + float(x) for x in t])

    return Course(found.object, setup.problem, at, "the determination", setup.assumed, centre=setup.measured.centre)


def determination_in(path: str) -> Mapping[str, Any] | None:
    """The object of a determination in a file of JSON or NetCDF; None for another file."""
    with opened_file(path) as file:
        start = file.read(512)
        if start.lstrip().startswith(JSON):
            if recognise(start) is not None:
                return None
            return _parsed(start + file.read(2**24), path)
    if not start.startswith(HDF5):
        return None
    import h5py

    with h5py.File(path, "r") as data:
        text = data.attrs.get("determination")
    if text is None:
        raise ValueError(f"{path}: there is no determination in it")
    return _parsed(text, path)


def _parsed(text: Any, path: str) -> Mapping[str, Any]:
    try:
        facts = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: no JSON of a determination: {' '.join(str(error).split())}") from None
    if not isinstance(facts, dict) or facts.get("schema") != SCHEMA:
        raise ValueError(f"{path}: this is not a determination ({SCHEMA})")
    return facts


def _of_document(facts: Mapping[str, Any], source: str) -> Course:
    """The state, its covariance and the constants of a determination, with the forces that it says."""
    guess = guess_of(facts, Epoch.at(0.0))
    try:
        names = [str(name) for name in facts["names"]]
        P, mean = np.array(facts["covariance"], dtype=float), np.array(facts["mean"], dtype=float)
        said = {**facts["forces"]}
        before = {str(one["name"]): (one["prior"], one["prior_sigma"]) for one in facts["estimated"]}
        frame, name = str(facts["frame"]), str(facts.get("object") or "")
        dates = [Epoch(str(when)) - guess.epoch for when in facts.get("density") or ()]
        last = (facts.get("span") or {}).get("last")
        behind = 0.0 if dates or last is None else max(Epoch(str(last)) - guess.epoch, 0.0)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{source}: the determination is not whole: {' '.join(str(error).split())}") from None
    if not (np.isfinite(P).all() and P.shape == (len(names), len(names)) and np.isfinite(mean).all()):
        raise ValueError(f"{source}: the determination has no finite covariance")
    chosen = _chosen(_forces_of(said, source, guess.about), guess.state, name, guess.about)
    varies, air = chosen.air_varies, _estimated_air(names, dates, before)
    if varies is not None and air:
        mean, P = _with_density(dates, names, mean, P)
        chosen = _with_departure(replace(chosen, air_varies=varies), air, varies)
    own = [p for p in (*chosen.forces.parameters, *air) if p in before and p in names]
    roles = {p: role for p, role in chosen.roles.items() if p in own} | dict.fromkeys(own, "estimated")
    roles |= dict.fromkeys([name for name in (MEMORY, MEAN) if name in chosen.values], "fixed")
    values: dict[str, Any] = {**_numbers(chosen)}
    values |= {p: Gaussian(mean[names.index(p)], max(P[names.index(p), names.index(p)], 1e-300)) for p in own}
    problem = _problem(chosen, roles, values, guess.epoch, guess.state, np.zeros((6, 6)), name)
    order = [names.index(p) for p in (*CARTESIAN, *problem.model.constants)]
    J = np.eye(len(order))
    J[:6, :6] = in_axes(frame_named(frame), "GCRF", [guess.epoch])[0]
    moved = J @ P[np.ix_(order, order)] @ J.T
    first = np.concatenate([guess.state, mean[order[6:]]])
    assumed = tuple(str(text) for text in facts.get("assumed", ()))
    carry = _carrying(problem, chosen.max_step, first, moved)
    found = Course(name, problem, carry, source, assumed, centre=centre_of(guess.about))
    return _departing(found, chosen, first, moved, behind, MEMORY in chosen.values)


def _chosen(forces: Any, state: Array, name: str, about: str) -> Chosen:
    """The forces on a state."""
    return forces_about_the_sun(forces, state) if about == "sun" else chosen_forces(forces, state, name=name)


def _estimated_air(names: Sequence[str], dates: Sequence[float], known: Mapping[str, Any]) -> list[str]:
    """Names by which the density of the air was estimated at dates: its last node, and its waves; none where it was not."""
    nodes, waves = [f"{DENSITY}{k}" for k in range(1, len(dates) + 1)], [wave for wave in WAVES if wave in names]
    whole = nodes and {"cd_a_m", *nodes} <= set(names) & set(known) and set(waves) <= set(known)
    return [nodes[-1], *waves] if whole else []


def _with_density(dates: Sequence[float], names: Sequence[str], mean: Array, P: Array) -> tuple[Array, Array]:
    """Means and covariance with the density at the epoch, from which on `dates` (s) of nodes count, as the last node."""
    nodes = [names.index(f"{DENSITY}{k}") for k in range(1, len(dates) + 1)]
    J = np.eye(len(names))
    J[nodes[-1], nodes] = [np.interp(0.0, dates, row) for row in np.eye(len(dates))]
    return J @ mean, J @ P @ J.T


def _with_departure(chosen: Chosen, own: Sequence[str], air: AirVaries) -> Chosen:
    """The forces with a density of those logarithms, whose mean goes back to that of the model away from t = 0."""
    total = [f"{MEMORY}_left*({own[0]} + {MEAN}*({MEMORY}_left - 1))"]
    total += [f"{wave}*{wave.replace(DENSITY, 'latitude_')}" for wave in own[1:]]
    drag = instead(chosen.forces.definitions, "cd_a_m", f"(cd_a_m*exp({' + '.join(total)}))")
    text = {**LATITUDE, f"{MEMORY}_left": f"exp(-abs(t)/{MEMORY})", **drag}
    return replace(chosen, extra=Extra(text), values={**chosen.values, MEMORY: air.time, MEAN: -0.5 * air.sigma**2})


def _departing(found: Course, chosen: Chosen, first: Array, covariance: Array, behind: float, known: bool) -> Course:
    """The orbit with covariances that have in them how density departs; its first state and the covariance of that.

    Where it was estimated, `known`, it departs from that at the epoch; else `behind` the last measurement (s).
    """
    air, names, problem = chosen.air_varies, found.problem.model.names, found.problem
    if air is None or "cd_a_m" not in names:
        return found
    place, law, there = names.index("cd_a_m"), Law(air.sigma, air.time, known), first
    size = float(np.hypot(first[place], np.sqrt(covariance[place, place])))
    if behind > 0.0:
        there = carried_to(problem, chosen.max_step, 0.0, first, np.eye(len(first)), np.array([behind]))[0][0]

    def at(t: Array) -> tuple[Array, Array | None]:
        x, P = found.beliefs(t)
        for side in (t > behind, (t < 0.0) & known):
            if P is not None and side.any():
                P[side] += departed(problem, chosen.max_step, behind, there, (place, size), law, t[side])
        return x, P

    said = ("the density of the air goes from what was estimated at the epoch back to its model, and departs",) if known else ()
    return replace(found, beliefs=at, assumed=(*found.assumed, *said))


def _forces_of(said: Mapping[str, Any], source: str, about: str) -> Forces:
    """The forces that a determination says it used."""
    try:
        if about == "sun":
            own = tuple(said["bodies"])
            return Forces(about="sun", bodies=own, relativity=said["relativity"], nongravitational=tuple(said["empirical"]))
        return Forces(
            gravity=str(said["gravity"]), degree=int(said["degree"]), bodies=tuple(said["bodies"]), tides=tuple(said["tides"]),
            relativity=said["relativity"], radiation=said["radiation"] or False, drag=said["drag"] or False,
            empirical=tuple(said["empirical"]),
        )  # fmt: skip
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{source}: its forces cannot be taken up: {' '.join(str(error).split())}") from None


def _of_orbit(given: Any, near: Epoch, chosen: str | None, forces: Any) -> Course:
    """A file or an object of others: rows between which it is known, mean elements, or one state to go on from."""
    what = read_ephemeris(given) if isinstance(given, (str, os.PathLike)) else given
    name, found = opened(what, chosen)
    source = os.fspath(given) if isinstance(given, (str, os.PathLike)) else name
    if isinstance(found, MeanElements):
        r, v = sgp4_states(found, found.epoch, "GCRF")
        problem = _moved_by(forces, np.concatenate([r, v]), found.epoch, found.name or name)
        mean_elements = found

        def by_theory(t: Array) -> tuple[Array, Array | None]:
            place, speed = sgp4_states(mean_elements, [mean_elements.epoch + float(x) for x in t], "GCRF")
            return np.hstack([place, speed]), None

        _no_forces(forces, source, "goes by SGP4")
        said, days = ["by SGP4, which has no covariance"], abs(near - mean_elements.epoch) / 86400.0
        if days > OLD:
            said.append(f"elements that are {days:,.0f} days away, though SGP4 loses kilometres in a few days")
        return Course(problem.name, problem, by_theory, source, tuple(said))
    if not isinstance(found, tuple):
        raise ValueError(f"{source}: an orbit is a file, an ephemeris, elements or a determination")
    if sum(int(np.isfinite(arc.position).all(axis=1).sum()) for arc in found) < 2:
        start = start_of(what, near, chosen)
        return _of_state(start.name, start.epoch, start.state, start.covariance, source, forces)
    _no_forces(forces, source, "has rows of its own")
    return _of_rows(name, found, source, start_of(what, near, chosen), forces)


def _no_forces(forces: Any, source: str, why: str) -> None:
    """Raise ValueError where forces are asked for that nothing would come of."""
    if forces is not None:
        raise ValueError(f"--forces is for orbits that are given by one state; {source} {why}")


def _of_rows(name: str, arcs: Sequence[Any], source: str, start: Any, forces: Any) -> Course:
    problem = _moved_by(forces, start.state, start.epoch, start.name or name)
    path = path_of(start.name or name, tuple(arcs), start.epoch, None)
    spans = []
    for arc in arcs:
        whole = arc.t[np.isfinite(arc.position).all(axis=1)] + (arc.epoch - start.epoch)
        first, last = (None if end is None else end - start.epoch for end in arc.useable)
        spans.append((max(whole.min(), first or -np.inf), min(whole.max(), np.inf if last is None else last)))
    nodes = distinct(np.concatenate([arc.covariance_t + (arc.epoch - start.epoch) for arc in arcs]))

    def between(t: Array) -> tuple[Array, Array | None]:
        r, v = path.states(t)
        return np.hstack([r, v]), _between_nodes(path, nodes, t, r, v)

    return Course(problem.name, problem, between, source, (), tuple(sorted(spans)))


def _between_nodes(path: Any, nodes: Array, t: Array, r: Array, v: Array) -> Array | None:
    """Covariances (K, 6, 6) of positions, that of the nearest row turned with the orbit; None where the file has none."""
    if not len(nodes):
        return None
    place = np.clip(np.searchsorted(nodes, t), 1, len(nodes) - 1) if len(nodes) > 1 else np.zeros(len(t), dtype=int)
    nearest = nodes[np.where((place > 0) & (t - nodes[place - 1] < nodes[place] - t), place - 1, place)]
    there, speed = path.states(nearest)
    P = path.covariances(nearest, there, speed)
    turn = np.swapaxes(_axes(r, v), 1, 2) @ _axes(there, speed)
    out = np.zeros((len(t), 6, 6))
    out[:, :3, :3] = turn @ P @ np.swapaxes(turn, 1, 2)
    return out


def _axes(r: Array, v: Array) -> Array:
    """Rows (K, 3, 3) of radial, transverse and normal."""
    radial = r / np.linalg.norm(r, axis=1, keepdims=True)
    normal = np.cross(r, v)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.stack([radial, np.cross(normal, radial), normal], axis=1)


def _of_state(
    name: str,
    epoch: Epoch,
    state: Array,
    P: Array | None,
    source: str,
    forces: Any,
    assumed: tuple[str, ...] = (),
    about: str = "earth",
) -> Course:
    chosen = _chosen(forces, state, name, about)
    problem = _moved_by(forces, state, epoch, name, chosen)
    carry = _carrying(problem, chosen.max_step, state, np.zeros((6, 6)) if P is None else P)

    def at(t: Array) -> tuple[Array, Array | None]:
        x, covariance = carry(t)
        return x, None if P is None else covariance

    said = tuple(f"{p} = {problem.parameters[p]:.3g}" for p in chosen.roles)
    told = (*assumed, *(text for text in chosen.assumed if " is estimated" not in text), *said)
    return Course(name, problem, at, source, told, centre=centre_of(about))


def _moved_by(forces: Any, state: Array, epoch: Epoch, name: str, chosen: Chosen | None = None) -> Problem:
    """A problem without measurements, its constants as they are assumed."""
    chosen = chosen or chosen_forces(forces, state, name=name)
    return _problem(chosen, {}, _numbers(chosen), epoch, state, np.zeros((6, 6)), name)


def _numbers(chosen: Chosen) -> dict[str, float]:
    """Constants as they are assumed, their uncertainty aside."""
    return {p: float(np.ravel(v.mean if isinstance(v, Gaussian) else v)[0]) for p, v in chosen.values.items()}


def _problem(
    chosen: Chosen, roles: Mapping[str, str], values: Mapping[str, Any], epoch: Epoch, state: Array, P: Array, name: str
) -> Problem:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", EphemerisWarning)  # `assumed` says it
        functions = chosen.choice.functions(epoch)
    return Problem(
        chosen.forces.model((), roles, None, chosen.extra.definitions), Gaussian(state, P), parameters=values,
        integrator=RungeKutta8(max_step=chosen.max_step), functions=functions, epoch=epoch,
        prior_time=0.0, name=name,
    )  # fmt: skip


def _carrying(problem: Problem, step: float, first: Array, P: Array) -> Beliefs:
    """By the forces of the problem from its epoch, forwards and backwards."""

    def at(t: Array) -> tuple[Array, Array | None]:
        x, covariance = np.empty((len(t), 6)), np.empty((len(t), 6, 6))
        for side in (t >= 0.0, t < 0.0):
            if side.any():
                states, moved = carried_to(problem, step, 0.0, first, P, t[side])
                x[side], covariance[side] = states[:, :6], moved[:, :6, :6]
        return x, covariance

    return at
