"""The motion and the measurements of a dear model, compiled once: every estimator's kernel calls them.

Compiled into each kernel, many forces are compiled as often as there are estimators.  So of a model with functions from outside
each of the functions below, a *unit*, is a module of its own with one entry.  An estimator's kernel then holds its algebra
alone, which depends on sizes: one that was compiled for other forces serves.  Where the units are it is told as it is loaded.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from piazzi.kernels.bundle import Given
from piazzi.kernels.steps import axes_source
from piazzi.model import Model

MOVED = "t: float, dt: float, count: int, x: State, p: Given"
MEASURED = "sensor: int, t: float, x: State, p: Given, s: Array, at: int"
GIVEN = tuple(Given.slots)
_ROOM = {"State": "N", "Square": "NN", "Times": "1"}  # numbers of one problem; with more lanes of each
_EXTERNAL = {"float": "float", "int": "int", "Array": "Array"}


class Unit(NamedTuple):
    """A function that is compiled apart: which part of a model it is of, what it takes, what it gives, in how many lanes."""

    part: str
    takes: str
    gives: str = ""
    lanes: bool = False

    @property
    def arguments(self) -> dict[str, str]:
        """Names of the arguments with their kinds."""
        return dict(argument.split(": ") for argument in self.takes.split(", "))


UNITS = {
    "propagate": Unit("motion", MOVED, "State"),
    "transition": Unit("motion", MOVED, "State Square"),
    "advance": Unit("noise", f"{MOVED}, Q: Square, scale: float", "State Square Square"),
    "measure_into": Unit("sensors", f"{MEASURED}, out: Array, row: int"),
    "innovate": Unit("sensors", f"{MEASURED}, z: Array, row: int, nu: Array, H: Array, out: int"),
    "propagate_lanes": Unit("motion", MOVED, "State", lanes=True),
    "transition_lanes": Unit("motion", MOVED, "State Square", lanes=True),
    "transition_each": Unit("motion", MOVED.replace("t: float, dt: float", "t: Times, dt: Times"), "State Square", lanes=True),
    "measure_lanes": Unit("sensors", f"{MEASURED}, h: Array", lanes=True),
    "innovate_lanes": Unit("sensors", f"{MEASURED}, z: Array, nu: Array, H: Array", lanes=True),
}


@dataclass(frozen=True)
class Apart:
    """Fragments that are compiled apart from estimators: of functions from outside, the motion, and process noise along it.

    `axes`, of the noise, where that needs the motion at the end of an interval only.
    """

    outside: tuple[str, ...]
    motion: tuple[str, ...]
    noise: tuple[str, ...] = ()
    axes: str = ""

    def own(self, fragments: Iterable[str]) -> tuple[str, ...]:
        """Those of the fragments of a kernel that remain in it."""
        gone = {*self.outside, *self.motion, *self.noise, "step_lanes"} - {"matrices", self.axes}
        return tuple(name for name in fragments if name not in gone)


def entry_name(unit: str) -> str:
    """The entry of a unit's module."""
    return f"called_{unit}"


def symbol(unit: str) -> str:
    """What an estimator's object code calls a unit."""
    return f"piazzi_{unit}"


def entry_source(name: str) -> str:
    """Source of the entry of a unit's module: what it takes comes through memory, and what it gives goes there."""
    unit, kinds = UNITS[name], {"State": "Array", "Square": "Array", "Times": "Array"}
    results = [f"y{i}" for i in range(len(unit.gives.split()))]
    takes = [f"{a}: {kinds.get(kind, kind)}" for a, kind in unit.arguments.items()]
    takes += [f"into{i}: Array" for i in range(len(results))]
    call = f"{name}({', '.join(_loaded(a, kind, unit.lanes) for a, kind in unit.arguments.items())})"
    body = [f"{', '.join(results)} = {call}" if results else call]
    body += [_stored(f"into{i}", y, unit.lanes) for i, y in enumerate(results)]
    return f"@entry\ndef {entry_name(name)}({', '.join(takes)}) -> None:\n" + "".join(f"    {line}\n" for line in body)


def _loaded(name: str, kind: str, lanes: bool) -> str:
    if kind == "Times":
        return f"load_packs({name}, 0, 1, LANES)[0]"
    if kind == "State":
        return f"load_packs({name}, 0, N, LANES)" if lanes else f"load_vector({name}, 0, N)"
    return f"load_matrix({name}, 0, N, N)" if kind == "Square" else name


def _stored(where: str, value: str, lanes: bool) -> str:
    return f"store_packs({where}, 0, {value}, LANES)" if lanes else f"store({where}, 0, {value})"


def calling_source(name: str, n: int) -> str:
    """Source of a unit as an estimator's kernel has it, for a model of `n` values: a call of what is elsewhere."""
    unit = UNITS[name]
    by = "_LANES" if unit.lanes else ""
    before, passed, kinds = [], [], []
    for a, kind in unit.arguments.items():
        if kind == "Given":
            passed += [f"{a}.{slot}" for slot in GIVEN]
            kinds += ["Array"] * len(GIVEN)
        elif kind in _ROOM:
            before.append(f"{a}_at = scratch({'LANES' if kind == 'Times' else _ROOM[kind] + by})")
            before.append(_stored(f"{a}_at", f"vector({a})" if kind == "Times" else a, unit.lanes))
            passed.append(f"{a}_at")
            kinds.append("Array")
        else:
            passed.append(a)
            kinds.append(_EXTERNAL[kind])
    gives = unit.gives.split()
    for i, kind in enumerate(gives):
        before.append(f"into{i} = scratch({_ROOM[kind]}{by})")
    passed += [f"into{i}" for i in range(len(gives))]
    results = [_given_back(f"into{i}", kind, n, unit.lanes) for i, kind in enumerate(gives)]
    body = [*before, f"{entry_name(name)}({', '.join(passed)})", *([f"return {', '.join(results)}"] if results else [])]
    head = f"{entry_name(name)} = external({', '.join([repr(symbol(name)), *kinds, *['Array'] * len(gives)])})\n\n\n"
    return f"{head}@inline\ndef {name}({', '.join(unit.arguments)}):\n" + "".join(f"    {line}\n" for line in body) + "\n\n"


def _given_back(where: str, kind: str, n: int, lanes: bool) -> str:
    if kind == "Square" and lanes:
        return f"matrix({', '.join(f'load_packs({where}, {i} * N_LANES, N, LANES)' for i in range(n))})"
    return _loaded(where, kind, lanes)


ADVANCE = """@inline
def advance(t, dt, count, x, p, Q, scale):
    y, Phi = transition(t, dt, count, x, p)
    return y, Phi, scale * noise_in_axes(Q, y)


"""


def algebra_source(model: Model, apart: Apart, together: bool, common: str) -> str:
    """What an estimator's kernel has of a model whose motion is apart; `common` are its sizes and functions of rows.

    `together` if it moves states in lanes, be it in one.
    """
    calls = "".join(calling_source(name, model.n) for name in UNITS if _is_called(name, apart, together))
    return common + axes_source(model) + calls + (ADVANCE if apart.axes else "")


def called_units(reached: Iterable[str], apart: Apart, together: bool) -> list[str]:
    """The units among the functions that a module's entries reach."""
    found = set(reached)
    return [name for name in UNITS if name in found and _is_called(name, apart, together)]


def _is_called(name: str, apart: Apart, together: bool) -> bool:
    unit = UNITS[name]
    return (together or not unit.lanes) and (unit.part != "noise" or bool(apart.noise and not apart.axes))
