"""A problem's compiled functions: which kernel fragments it needs, and its equations at one state or many."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import isnan
from typing import Any

import numpy as np

from piazzi import kernels
from piazzi.expressions import evaluate
from piazzi.kernels import Integrator, KernelSpec
from piazzi.kernels.apart import Apart
from piazzi.kernels.bundle import Given
from piazzi.kernels.spec import outside_fragments
from piazzi.model import Model
from piazzi.model.functions import ROOT, STATION, STATION_TABLE
from piazzi.model.values import with_values
from piazzi.problem.checks import Array, numeric
from piazzi.problem.parts import Station

RATE = "rate_at_once_of_"
MOST_KINDS = 100  # for which no kernel was wanted yet: of so many more kinds of problem, these are forgotten
_ROOM = [MOST_KINDS]
_SPECS: dict[tuple[Any, ...], dict[tuple[Any, ...], KernelSpec]] = {}


def shared_specs(kind: tuple[Any, ...]) -> dict[tuple[Any, ...], KernelSpec]:
    """Specifications of kernels so far for problems of a kind, to which whoever needs another adds it."""
    if len(_SPECS) > _ROOM[0]:  # the others stay: what is loaded is found by them, and stays too
        for idle in [other for other, specs in list(_SPECS.items()) if not specs]:
            _SPECS.pop(idle, None)
        _ROOM[0] = len(_SPECS) + MOST_KINDS
    return _SPECS.setdefault(kind, {})


def _states(model: Model, x: Any, t: Any) -> tuple[Array, Array, bool]:
    """States (K, n), times (K,), and whether one state was given."""
    n = model.n
    out = np.ascontiguousarray(numeric(x, "state"))
    if out.ndim not in (1, 2) or out.shape[-1] != n:
        raise ValueError(f"state has shape {out.shape}; it must be ({n},) or (K, {n}) ({', '.join(model.names)})")
    many = np.atleast_2d(out)
    times = numeric(t, "time")
    if times.size not in (1, len(many)):
        raise ValueError(f"time has shape {times.shape}; it must be one number or ({len(many)},), one for each state")
    times = np.ascontiguousarray(np.broadcast_to(times.reshape(-1), (len(many),)))
    return many, times, out.ndim == 1


def rates(spec: KernelSpec, entry: str, given: Given, x: Any, t: Any) -> Array:
    """dx/dt, same shape as the states, or its derivative F, (n, n) or (K, n, n), as `entry` says."""
    model = spec.model
    if model.discrete:
        raise ValueError("the model is a step, x[k+1], and has no rates: use step()")
    many, times, one = _states(model, x, t)
    out = np.empty((len(many), *[model.n] * (2 if entry.endswith("jacobian") else 1)))
    getattr(kernels.load(spec), entry)(len(many), times, many, given, out)
    return out[0] if one else out


def step(
    spec: KernelSpec, counts: Callable[[Array, float, float, Array], Array], given: Given, x: Any, dt: float, t: Any
) -> tuple[Array, Array]:
    """Next states and the derivative of the step; `counts` says in how many substeps: of intervals, in a span from a state."""
    if not np.isfinite(dt):
        raise ValueError(f"dt is {dt} s; it must be finite")
    many, times, one = _states(spec.model, x, t)
    n, length = spec.model.n, abs(float(dt))
    interval = np.array([length])
    count = max(int(counts(interval, at, at + length, y)[0]) for at, y in zip(times.tolist(), many, strict=True))
    out, Phi = np.empty((len(many), n)), np.empty((len(many), n, n))
    kernels.load(spec).evaluate_step(len(many), times, float(dt), count, many, given, out, Phi)
    return (out[0], Phi[0]) if one else (out, Phi)


def measure(spec: KernelSpec, sensor: int, numbers: Array, m: int, given: Given, x: Any, t: Any) -> Array:
    """h of a station with m components, (m,) or (K, m)."""
    many, times, one = _states(spec.model, x, t)
    out = np.empty((len(many), spec.model.width))
    kernels.load(spec).evaluate_measurement(len(many), sensor, times, many, given, numbers, out)
    out = out[:, :m]
    return out[0] if one else out


def measurement_jacobian(spec: KernelSpec, sensor: int, numbers: Array, m: int, given: Given, x: Any, t: Any) -> Array:
    """H = dh/dx of a station with m components, (m, n) or (K, m, n)."""
    many, times, one = _states(spec.model, x, t)
    M, n = spec.model.width, spec.model.n
    out = np.empty((len(many), M, n))
    kernels.load(spec).evaluate_measurement_jacobian(len(many), sensor, times, many, given, numbers, out)
    out = out[:, :m]
    return out[0] if one else out


class _Held:
    """A place that stays where it is first, or last, known at other times: for checks that ask at one time of all stations."""

    def __init__(self, place: Any) -> None:
        self._place = place

    def __getattr__(self, name: str) -> Any:
        return getattr(self._place, name)

    def value(self, t: float) -> tuple[float, ...]:
        """Where it is at the time that is nearest."""
        span = getattr(self._place, "span", None)
        return tuple(self._place.value(t if span is None else min(max(t, span[0]), span[1])))


def singular_equation(
    model: Model, stations: Iterable[Station], numbers: Mapping[str, float], t: float, functions: Mapping[str, Any]
) -> str:
    """A line naming the first equation without a finite value at these states and parameters, or "" where all have one."""
    values = with_values({**numbers, "t": t, "dt": 1.0}, model.definitions, functions=functions, model=model)
    at = ", ".join(f"{name} = {numbers[name]:g}" for name in model.names)
    for d in model.definitions:
        if d.function == ROOT and isnan(values[d.names[0]]):
            return f"root {d.names[0]!r} has no solution at the prior mean ({at})"
    for state, equation in zip(model.states, model.dynamics, strict=True):
        if not np.isfinite(evaluate(equation, values)):
            return f"the dynamics of {state!r} have no finite value at the prior mean ({at})"
    moved, values = _with_rates(model, values)
    for station in _unlike(stations):
        sensor = model.sensor(station.sensor)
        there = dict(functions) | {STATION: _Held(station.place)}
        here = with_values(values | dict(station.numbers), sensor.definitions, functions=there, model=moved)
        for component, equation in zip(sensor.components, sensor.equations, strict=True):
            if not np.isfinite(evaluate(equation, here)):
                lost = next((d.names[0] for d in sensor.definitions if d.function == ROOT and isnan(here[d.names[0]])), None)
                if lost is not None:
                    return f"root {lost!r} of station {station.name!r} has no solution at the prior mean ({at})"
                return f"component {component!r} of station {station.name!r} has no finite value at the prior mean ({at})"
    return ""


class _Moved:
    """A model whose rates at one state are known: all that the state a light time before needs of it."""

    def __init__(self, model: Model) -> None:
        self.states, self.definitions = model.states, ()
        self.dynamics = tuple(text if text in model.states else f"{RATE}{s}" for s, text in _moves(model))


def _moves(model: Model) -> Iterable[tuple[str, str]]:
    """States with the text of their rates."""
    return zip(model.states, model.dynamics, strict=True)


def _with_rates(model: Model, values: Mapping[str, float]) -> tuple[Any, dict[str, float]]:
    """What stands for the model at these values, and they with the rates: forces are worked out once, not at every iteration.

    The model itself where measurements are of a state at another time by more than a straight way, or it has such names.
    """
    if model.looks_elsewhen or model.discrete or any(name.startswith(RATE) for name in values):
        return model, dict(values)
    return _Moved(model), dict(values) | {f"{RATE}{s}": evaluate(text, values) for s, text in _moves(model)}


def _unlike(stations: Iterable[Station]) -> Iterable[Station]:
    """Stations without those that have the place, the sensor and the numbers of one before, as blocks of a pass have.

    Which table of kernels' data its place is, is a number of each, and none that an equation is evaluated with.
    """
    found: dict[Any, Station] = {}
    for station in stations:
        place: Any = station.place
        try:
            hash(place)
        except TypeError:
            place = id(place)
        own = tuple((name, number) for name, number in dict(station.numbers).items() if name != STATION_TABLE)
        found.setdefault((station.sensor, place, own), station)
    return found.values()


def check_own_functions(
    model: Model, stations: Iterable[Station], numbers: Mapping[str, float], t: float, functions: Mapping[str, Any]
) -> None:
    """Raise ValueError where a function of the user's own, as it is called there, has other derivatives than differences."""
    own = {name: function for name, function in functions.items() if hasattr(function, "check")}
    if not own:
        return
    values = with_values({**numbers, "t": t, "dt": 1.0}, model.definitions, functions=functions, model=model)
    here = [(values, model.definitions)]
    for station in stations:
        definitions = model.sensor(station.sensor).definitions
        there = dict(functions) | {STATION: _Held(station.place)}
        here.append((with_values(values | dict(station.numbers), definitions, functions=there, model=model), definitions))
    for known, call in ((known, call) for known, definitions in here for d in definitions for call in d.calls):
        if call.function in own:
            arguments = [evaluate(text, known) for text in call.texts]
            if np.isfinite(arguments).all():
                own[call.function].check(call.function, *arguments)


CUT = {  # fragments of integrators whose steps end at the events of a model
    "arc_steps": ("events", "arc_steps_events"),
    "arc_adaptive": ("events", "arc_adaptive_events"),
    "noise_integral": ("noise_lobatto", "noise_steps_events"),
    "noise_steps": ("noise_steps_events",),
    "noise_adaptive": ("noise_adaptive_events",),
}


def cut_at_events(model: Model, fragments: Iterable[str]) -> tuple[str, ...]:
    """The fragments of an integrator; of a model with events those that look for them."""
    return tuple(part for name in fragments for part in (CUT.get(name, (name,)) if model.events else (name,)))


def fragments_of(
    model: Model,
    fragments: tuple[str, ...],
    integrator: Integrator,
    *,
    manoeuvres: bool,
    axes: str,
    noise_varies: bool,
    in_lanes: bool,
) -> tuple[str, ...]:
    """The fragments by the names of their files, in order; `axes` of the process noise, `in_lanes` if states move together.

    "transition" becomes the motion of the integrator and what happens on the way; "noise_scaled" and "noise_integral" become
    the axes of the noise, its integration and the same; "linearize_scaled" is replaced where states cannot be worked on
    together; that and "chain_noise_scaled" where the noise is not a multiple of one matrix.
    """
    parts = _parts_of(model, integrator, manoeuvres=manoeuvres, axes=axes)
    linearize = ("linearize_integral",) if noise_varies else ("linearize_each",)
    parts |= {
        "linearize_scaled": ("step_lanes", "linearize_scaled") if in_lanes and not noise_varies else linearize,
        "chain_noise_scaled": (f"chain_noise_{'integral' if noise_varies else 'scaled'}",),
    }
    return tuple(part for name in fragments for part in parts.get(name, (name,)))


def _parts_of(model: Model, integrator: Integrator, *, manoeuvres: bool, axes: str) -> dict[str, tuple[str, ...]]:
    """The fragments of the motion and of its noise."""
    events = "_manoeuvres" if manoeuvres else ""
    moved, noisy = cut_at_events(model, integrator.fragments), cut_at_events(model, integrator.noise_fragments)
    turned = "axes_orbit" if axes == "orbit" else "axes"
    return {
        "transition": ("matrices", *moved, f"transition{events}"),
        "noise_scaled": (turned, "noise_scaled", f"advance{events}"),
        "noise_integral": (turned, *noisy, f"advance{events}"),
    }


WHOLE = ("rates",)  # fragments that work on the equations themselves


def apart_of(model: Model, fragments: tuple[str, ...], integrator: Integrator, *, manoeuvres: bool, axes: str) -> Apart | None:
    """What is compiled apart from a kernel of these fragments; None for models without functions from outside."""
    if not model.reads_data or not {*WHOLE}.isdisjoint(fragments):
        return None
    parts = _parts_of(model, integrator, manoeuvres=manoeuvres, axes=axes)
    kind = next((name for name in ("noise_scaled", "noise_integral") if name in fragments), "")
    at_end = kind == "noise_scaled" and not manoeuvres
    axes = parts[kind][0] if at_end else ""
    return Apart(outside_fragments(model), parts["transition"], parts.get(kind, ()), axes)
