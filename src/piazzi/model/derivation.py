"""Everything that follows from a model's equations by differentiation, as SymPy.  Jacobians are derived here, never typed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from piazzi.expressions import symbol, to_sympy
from piazzi.model.model import STEP, TIME, Model
from piazzi.model.sensor import Sensor

if TYPE_CHECKING:
    import sympy as sp


@dataclass(frozen=True)
class Derivation:
    """Symbols and matrices of one model.

    Attributes
    ----------
    x : estimated values (n), p : given parameters, t : time, dt : step (of a discrete model)
    f : matrix (states, 1); F : df/dx, matrix (states, n)
    """

    x: tuple[sp.Symbol, ...]
    p: tuple[sp.Symbol, ...]
    t: sp.Symbol
    dt: sp.Symbol
    f: sp.Matrix
    F: sp.Matrix


@lru_cache(maxsize=64)
def derive(model: Model) -> Derivation:
    """Dynamics and their Jacobian; raises ExpressionError for an equation outside the language."""
    import sympy as sp

    symbols = {name: symbol(name) for name in (*model.names, *model.given, TIME, STEP)}
    x = tuple(symbols[name] for name in model.names)
    remembered = [symbols[name] if model.discrete else sp.Integer(0) for name, _ in model.memory]
    f = sp.Matrix([*(to_sympy(e, symbols) for e in model.dynamics), *remembered])
    return Derivation(x, tuple(symbols[p] for p in model.given), symbols[TIME], symbols[STEP], f, jacobian(f, x))


@lru_cache(maxsize=256)
def derive_sensor(model: Model, sensor: Sensor) -> tuple[sp.Matrix, sp.Matrix, tuple[sp.Symbol, ...]]:
    """h (m, 1), its Jacobian H (m, n), and the symbols of the station's own numbers."""
    import sympy as sp

    own = model.numbers(sensor)
    symbols = {name: symbol(name) for name in (*model.names, *model.given, *own, TIME)}
    h = sp.Matrix([to_sympy(e, symbols) for e in sensor.equations])
    return h, jacobian(h, [symbols[name] for name in model.names]), tuple(symbols[name] for name in own)


def jacobian(f: sp.Matrix, x: Sequence[sp.Symbol]) -> sp.Matrix:
    """df/dx where every value is real: the derivative of ``abs`` is ``sign``, and that of ``sign`` zero.

    SymPy's own derivative of ``abs(log(x))`` allows for a complex logarithm, which has no compiled form.
    """
    import sympy as sp

    class Sign(sp.Function):  # type: ignore[misc]
        def fdiff(self, argindex: int = 1) -> Any:
            return sp.S.Zero

    class Magnitude(sp.Function):  # type: ignore[misc]
        def fdiff(self, argindex: int = 1) -> Any:
            return Sign(self.args[0])

    real = f.replace(sp.Abs, Magnitude).replace(sp.sign, Sign)
    return real.jacobian(list(x)).replace(Magnitude, sp.Abs).replace(Sign, sp.sign)


def constant_acceleration_step(model: Model) -> tuple[tuple[sp.Expr, ...], sp.Symbol]:
    """One Taylor step of the founding text, and the symbol of its length.

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
