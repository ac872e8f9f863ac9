"""Everything that follows from a model's equations by differentiation, as SymPy.  Jacobians are derived here, never typed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from piazzi.expressions import symbol, to_sympy
from piazzi.model.chain import Chain, Equations
from piazzi.model.definitions import STEP, TIME, needed
from piazzi.model.sensor import Sensor
from piazzi.model.stages import AnyStage

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True)
class Derivation:
    """Symbols and matrices of one model.

    Attributes
    ----------
    x : estimated values (n), p : given parameters, t : time, dt : step (of a discrete model)
    f : matrix (states, 1); F : df/dx, matrix (states, n)
    values, partials : what has to be worked out before f, and before f and F, in this order
    sides : for each event, the side of it that the equations are on
    """

    x: tuple[sp.Symbol, ...]
    p: tuple[sp.Symbol, ...]
    t: sp.Symbol
    dt: sp.Symbol
    f: sp.Matrix
    F: sp.Matrix
    values: tuple[AnyStage, ...] = ()
    partials: tuple[AnyStage, ...] = ()
    sides: tuple[sp.Symbol, ...] = ()


@dataclass(frozen=True)
class EventDerivation:
    """Values g (E, 1) of events, their derivatives G (E, n + 1) by the estimated values and by time, and what comes before."""

    g: sp.Matrix
    G: sp.Matrix
    partials: tuple[AnyStage, ...]


@dataclass(frozen=True)
class SensorDerivation:
    """h (m, 1), H (m, n), the symbols of the station's own numbers, and what comes before h, and before h and H."""

    h: sp.Matrix
    H: sp.Matrix
    own: tuple[sp.Symbol, ...]
    values: tuple[AnyStage, ...] = ()
    partials: tuple[AnyStage, ...] = ()


@lru_cache(maxsize=64)
def derive(model: Equations, beside: bool = True) -> Derivation:
    """Dynamics and their Jacobian; raises ExpressionError for an equation outside the language.

    They are those of one side of each event, unless not `beside`: then events are definitions like others.
    """
    import sympy as sp

    symbols = {name: symbol(name) for name in (*model.names, *model.given, TIME, STEP)}
    x = tuple(symbols[name] for name in model.names)
    sides = {name: sp.Dummy(f"side_{name}", real=True) for _, name in model.events if beside}
    chain = Chain(model, symbols, x, sides)
    chain.define(model.definitions, needed(model.dynamics, model.definitions))
    remembered = [symbols[name] if model.discrete else sp.Integer(0) for name, _ in model.memory]
    f = sp.Matrix([*(to_sympy(e, symbols) for e in model.dynamics), *remembered])
    p = tuple(symbols[name] for name in model.given)
    F = chain.derivative(f)
    before = tuple(chain.values), tuple(chain.partials)
    return Derivation(x, p, symbols[TIME], symbols[STEP], f, F, *before, tuple(sides.values()))


@lru_cache(maxsize=64)
def derive_events(model: Equations) -> EventDerivation:
    """The events of a model and their derivatives; that by time is a partial one."""
    import sympy as sp

    symbols = {name: symbol(name) for name in (*model.names, *model.given, TIME)}
    chain = Chain(model, symbols, [symbols[name] for name in (*model.names, TIME)])
    names = [name for _, name in model.events]
    chain.define(model.definitions, needed(names, model.definitions))
    g = sp.Matrix([symbols[name] for name in names])
    return EventDerivation(g, chain.derivative(g), tuple(chain.partials))


@lru_cache(maxsize=256)
def derive_sensor(model: Equations, sensor: Sensor) -> SensorDerivation:
    """What a sensor sees and its derivatives."""
    import sympy as sp

    own = model.numbers(sensor)
    symbols = {name: symbol(name) for name in (*model.names, *model.given, *own, TIME)}
    chain = Chain(model, symbols, [symbols[name] for name in model.names])
    numbers = tuple(symbols[name] for name in own)
    wanted = needed(sensor.equations, sensor.definitions, model.definitions)
    chain.define(model.definitions, wanted)
    chain.define(sensor.definitions, wanted)
    h = sp.Matrix([to_sympy(e, symbols) for e in sensor.equations])
    return SensorDerivation(h, chain.derivative(h), numbers, tuple(chain.values), tuple(chain.partials))


def constant_acceleration_step(model: Equations) -> tuple[tuple[sp.Expr, ...], sp.Symbol]:
    """One step of constant acceleration, as in the founding text, and the symbol of its length.

    A state whose rate is itself a state (a position) is taken to second order, x + h v + h^2/2 dv/dt; every other to first
    order, v + h dv/dt.
    """
    import sympy as sp

    d = derive(model)
    h = sp.Dummy("h", real=True)  # no name, so that no parameter can have it
    rates = dict(zip(d.x, d.f, strict=False))
    nxt = []
    for state, rate in rates.items():
        second = rates.get(rate) if rate.is_Symbol else None
        nxt.append(state + h * rate + (h**2 / 2 * second if second is not None else 0))
    return tuple(nxt), h
