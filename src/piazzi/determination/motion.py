"""What is added to the forces of a determination: values for parts of the time, processes, manoeuvres.

All of it is text of the language, with numbers as parameters and times as data: other dates and numbers compile nothing.  What
begins or ends at an instant does so over a ramp of a millisecond about it, at whose ends the steps of the integrator end
too: so every stage of a step sees one side, forwards and backwards in time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from piazzi.determination.burns import ORBIT, Burn
from piazzi.determination.ramps import RAMP, pieces, profiles
from piazzi.determination.unknowns import Asked, Label
from piazzi.earth import Epoch, rotation
from piazzi.earth.force_options import SUNLIGHT
from piazzi.earth.force_text import ORBIT_AXES, along_axes
from piazzi.model import Model
from piazzi.model.pruning import used_definitions
from piazzi.model.renaming import renamed
from piazzi.outside.function import Function
from piazzi.problem import Gaussian, Manoeuvre
from piazzi.problem.checks import Array

IMPULSE = 1.0  # s, over which an impulse acts, about its middle: what that moves is far below a millimetre
MOST = 60  # values of one unknown
_TNW = {
    "push_t": {a: f"v{a}/speed" for a in "xyz"},
    "push_n": {a: f"(h{b}*v{c} - h{c}*v{b})/(h*speed)" for a, b, c in ("xyz", "yzx", "zxy")},
    "push_w": {a: f"h{a}/h" for a in "xyz"},
}


class Process(NamedTuple):
    """A Gauss-Markov process: name of its state, of its time constant, that time (s), steady sigma, unit."""

    state: str
    parameter: str
    time: float
    sigma: float
    unit: str
    label: Label


class Push(NamedTuple):
    """A manoeuvre with the names of its constants, and the matrix from its axes to those they are along."""

    burn: Burn
    dv: tuple[str, str, str]
    scale: str
    turned: Array


@dataclass(frozen=True, eq=False)
class Extra:
    """Definitions, functions and accelerations beside those of the forces, processes, manoeuvres, and when steps end."""

    definitions: Mapping[str, str] = field(default_factory=dict)
    functions: Mapping[str, Any] = field(default_factory=dict)
    added: Mapping[str, str] = field(default_factory=dict)
    processes: tuple[Process, ...] = ()
    pushes: tuple[Push, ...] = ()
    edges: tuple[float, ...] = ()
    labels: Mapping[str, Label] = field(default_factory=dict)

    @property
    def manoeuvres(self) -> tuple[Manoeuvre, ...]:
        """What makes steps end: sudden changes of nothing."""
        return tuple(Manoeuvre(t, np.zeros(3)) for t in sorted(set(self.edges)))

    def and_(self, other: Extra) -> Extra:
        """Both."""
        added = {state: " + ".join(e.added[state] for e in (self, other) if state in e.added)
                 for state in (*self.added, *(s for s in other.added if s not in self.added))}  # fmt: skip
        return Extra(
            {**self.definitions, **other.definitions}, {**self.functions, **other.functions}, added,
            (*self.processes, *other.processes), (*self.pushes, *other.pushes), (*self.edges, *other.edges),
            {**self.labels, **other.labels},
        )  # fmt: skip


class Numbers(NamedTuple):
    """Roles and values of parameters."""

    roles: dict[str, str]
    values: dict[str, Any]


Definitions = Mapping[str, str]


def by_parts(name: str, one: Asked, before: Gaussian, first: float, last: float, epoch: Epoch, definitions: Definitions,
             numbers: Numbers) -> Extra:  # fmt: skip
    """A parameter with a value for each part of the time from `first` to `last`; the outer ones hold beyond."""
    count = max(ceil((last - first) / one.what.period - 1e-6), 1)
    if count > MOST:
        raise ValueError(f"{one.option} {one.what}: that makes {count} values; at most {MOST} of one unknown are taken")
    names = [f"{name}_{k}" for k in range(1, count + 1)]
    inner = [first + one.what.period * k for k in range(1, count)]
    for each in names:
        numbers.roles[each], numbers.values[each] = one.role, before
    numbers.roles[name], numbers.values[name] = "fixed", float(np.ravel(before.mean)[0])
    labels = {}
    for k, each in enumerate(names):
        start, end = (epoch + t for t in (first + one.what.period * k, first + one.what.period * (k + 1)))
        span = f"from {_minute(start)} to {_minute(end)}" if k < count - 1 else f"from {_minute(start)} on"
        labels[each] = Label(f"{one.what.label}/{start.to('UTC')[:19]}", f"{words_of(name)} {span}")
    if count == 1:
        return Extra(instead(definitions, name, names[0]), labels=labels)
    now = {f"{name}_now": f"{name}_of(t, {', '.join(names)})"}
    edges = tuple(t + side for t in inner for side in (-RAMP / 2, RAMP / 2))
    function = Function(pieces(count), count + 1, 1, [(0, k) for k in range(1, count + 1)], inner)
    return Extra({**instead(definitions, name, f"{name}_now"), **now}, {f"{name}_of": function}, edges=edges, labels=labels)


def process(
    name: str, one: Asked, sigma: float, relative: bool, unit: str, definitions: Definitions, numbers: Numbers
) -> Extra:
    """A parameter with a Gauss-Markov process beside it, which is the logarithm of a factor where it is `relative`."""
    state, tau = f"{name}_change", f"{name}_tau"
    numbers.roles[tau], numbers.values[tau] = "fixed", one.what.period
    what = "logarithm of a factor of {}" if relative else "{} beside its constant"
    label = Label(one.what.label, f"{what.format(words_of(name))}, correlated over {one.what.per[1:] if one.what.per else ''}")
    own = Process(state, tau, one.what.period, sigma, "" if relative else unit, label)
    text = {} if relative else instead(definitions, name, f"({name} + {state})")  # coefficients have all that is said of them
    return Extra(text, processes=(own,), labels={state: label})


def manoeuvres(burns: Sequence[Burn], epoch: Epoch, numbers: Numbers) -> Extra:
    """Manoeuvres as accelerations, with their constants."""
    if not burns:
        return Extra()
    labels: dict[str, Label] = {}
    sums: dict[str, list[str]] = {}
    engines: dict[str, str] = {}
    pushes = [_push(k, burn, engines, numbers, labels) for k, burn in enumerate(burns, start=1)]
    for k, push in enumerate(pushes, start=1):
        for name, direction in zip(push.dv, _directions(push.burn.axes), strict=True):
            sums.setdefault(direction, []).append("*".join([*([push.scale] if push.scale else []), name, f"burn_{k}"]))
    windows = [_window(burn, epoch) for burn in burns]
    function = Function(profiles(len(burns)), 1, len(burns), [], [x for pair in windows for x in pair])
    definitions = {
        **ORBIT_AXES, "speed": "sqrt(vx**2 + vy**2 + vz**2)",
        ", ".join(f"burn_{k}" for k in range(1, len(burns) + 1)): "burning(t)",
        **{direction: " + ".join(parts) for direction, parts in sums.items()},
    }  # fmt: skip
    edges = tuple(t + side for pair in windows for t in pair for side in (-RAMP / 2, RAMP / 2))
    added = _accelerations(sums)
    used = used_definitions(definitions, list(added.values()))
    return Extra(used, {"burning": function}, added, (), tuple(pushes), edges, labels)


def _push(k: int, burn: Burn, engines: dict[str, str], numbers: Numbers, labels: dict[str, Label]) -> Push:
    """The constants of a manoeuvre: those of its velocity, and of the scale of its thrust where that is estimated."""
    date, local = str(burn.epoch).replace(" UTC", "Z"), burn.axes in ORBIT
    turned = np.eye(3) if local else np.asarray(rotation(burn.axes, "GCRF", burn.epoch))
    given, spread = turned @ burn.dv, burn.sigma if local else (max(burn.sigma),) * 3
    names = (f"dv_{k}_1", f"dv_{k}_2", f"dv_{k}_3")
    for name, value, sigma, axis in zip(names, given.tolist(), spread, burn.axes if local else "XYZ", strict=True):
        numbers.roles[name] = "estimated" if sigma > 0 else "fixed"
        numbers.values[name] = Gaussian(value, sigma**2) if sigma > 0 else value
        labels[name] = Label(f"dv@{date}/{axis}", f"velocity gained along {axis} at {date}")
    scale = ""
    if burn.scale:
        key = burn.engine or f"@{date}"
        scale = engines.setdefault(key, f"thrust_{len(engines) + 1}")
        numbers.roles[scale], numbers.values[scale] = "estimated", Gaussian(1.0, burn.scale**2)
        whose = f"of {burn.engine}" if burn.engine else f"at {date}"
        labels[scale] = Label(f"thrust{'.' if burn.engine else ''}{key}", f"scale of the thrust {whose}")
    return Push(burn, names, scale, turned)


def _directions(axes: str) -> tuple[str, str, str]:
    known = {"RTN": ("push_radial", "push_along", "push_cross"), "TNW": ("push_t", "push_n", "push_w")}
    return known.get(axes, ("push_x", "push_y", "push_z"))


def _accelerations(sums: Mapping[str, Any]) -> dict[str, str]:
    """The sums along their directions, as text for the rate of each component of the velocity."""
    local = {name: name.removeprefix("push_") for name in ("push_radial", "push_along", "push_cross") if name in sums}
    out: dict[str, list[str]] = {f"v{a}": [] for a in "xyz"}
    if local:
        for a, text in zip("xyz", along_axes(local, list(local)), strict=True):
            out[f"v{a}"].append(text)
    for a in "xyz":
        out[f"v{a}"] += [f"{name}*{_TNW[name][a]}" for name in _TNW if name in sums]
        out[f"v{a}"] += [f"push_{a}"] if f"push_{a}" in sums else []
    return {state: " + ".join(parts) for state, parts in out.items() if parts}


def _window(burn: Burn, epoch: Epoch) -> tuple[float, float]:
    """When the engine is on, seconds of the problem."""
    start = burn.epoch - epoch
    return (start, start + burn.duration) if burn.duration else (start - IMPULSE / 2, start + IMPULSE / 2)


def instead(definitions: Definitions, name: str, text: str) -> dict[str, str]:
    """Those definitions that use a name, with text in its place."""
    changed = {left: renamed(right, {name: text}) for left, right in definitions.items()}
    return {left: right for left, right in changed.items() if right != definitions[left]}


def with_processes(model: Model, processes: Sequence[Process]) -> Model:
    """The model with these states behind its own; names that were parameters become states."""
    if not processes:
        return model
    new = [p.state for p in processes]
    rates = dict(zip(model.states, model.dynamics, strict=True)) | {p.state: f"-{p.state}/{p.parameter}" for p in processes}
    return replace(
        model,
        states=(*model.states, *new),
        dynamics=tuple(rates.values()),
        parameters=tuple(p for p in model.parameters if p.name not in new),
        groups=dict(model.groups),
        units={**dict(model.units), **{p.state: p.unit for p in processes if p.unit}},
        memory=dict(model.memory),
    )


def process_noise(processes: Sequence[Process], states: int) -> Array | None:
    """Density (n, n) of what drives them, None without any."""
    if not processes:
        return None
    density = np.zeros(states)
    density[states - len(processes) :] = [2.0 * p.sigma**2 / p.time for p in processes]
    return np.diag(density)


def words_of(name: str) -> str:
    """What a parameter is, in words."""
    known = {"cd_a_m": "drag coefficient times area over mass", "cr_a_m": "coefficient of sunlight times area over mass"}
    return (known | SUNLIGHT).get(name, name.replace("_", " "))


def _minute(epoch: Epoch) -> str:
    return epoch.to("UTC")[:16].replace("T", " ")
