"""Everything that follows from a model's equations by differentiation, as SymPy.  Jacobians are derived here, never typed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

from piazzi.expressions import symbol, to_sympy
from piazzi.expressions.time_limit import TooSlowError, each_with_time_limit
from piazzi.model.definitions import STEP, TIME, Definitions, needed
from piazzi.model.sensor import Parameter, Sensor

if TYPE_CHECKING:
    import sympy as sp


class Equations(Protocol):
    """What is derived of a `Model`, and shown."""

    def __hash__(self) -> int: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def given(self) -> tuple[str, ...]: ...
    @property
    def dynamics(self) -> tuple[str, ...]: ...
    @property
    def memory(self) -> Any: ...
    @property
    def definitions(self) -> Any: ...
    @property
    def discrete(self) -> bool: ...
    @property
    def parameters(self) -> tuple[Parameter, ...]: ...
    @property
    def sensors(self) -> tuple[Sensor, ...]: ...
    def numbers(self, sensor: Sensor) -> tuple[str, ...]: ...


@dataclass(frozen=True)
class Stage:
    """Values that are worked out together: symbols and what they are, in terms of symbols that came before."""

    symbols: tuple[sp.Symbol, ...]
    values: tuple[sp.Expr, ...]


@dataclass(frozen=True)
class Derivation:
    """Symbols and matrices of one model.

    Attributes
    ----------
    x : estimated values (n), p : given parameters, t : time, dt : step (of a discrete model)
    f : matrix (states, 1); F : df/dx, matrix (states, n)
    values, partials : what has to be worked out before f, and before f and F, in this order
    """

    x: tuple[sp.Symbol, ...]
    p: tuple[sp.Symbol, ...]
    t: sp.Symbol
    dt: sp.Symbol
    f: sp.Matrix
    F: sp.Matrix
    values: tuple[Stage, ...] = ()
    partials: tuple[Stage, ...] = ()


@dataclass(frozen=True)
class SensorDerivation:
    """h (m, 1), H (m, n), the symbols of the station's own numbers, and what comes before h, and before h and H."""

    h: sp.Matrix
    H: sp.Matrix
    own: tuple[sp.Symbol, ...]
    values: tuple[Stage, ...] = ()
    partials: tuple[Stage, ...] = ()


class _Chain:
    """Definitions as symbols, each with its derivatives by the estimated values, which are symbols too."""

    def __init__(self, x: Sequence[sp.Symbol]) -> None:
        self.x = tuple(x)
        self.values: list[Stage] = []
        self.partials: list[Stage] = []
        self._by_x: dict[sp.Symbol, dict[int, sp.Expr]] = {}  # definition -> number of the value -> derivative, or its symbol

    def define(self, definitions: Definitions, symbols: dict[str, sp.Symbol], wanted: Collection[str]) -> None:
        """Add those of the definitions that are wanted; `symbols` gets their names."""
        import sympy as sp

        for name, text in definitions:
            if name not in wanted:
                continue
            value = to_sympy(text, symbols)
            new = symbol(name)
            row = self.derivative(sp.Matrix([value]))
            slopes = {j: row[0, j] for j in range(len(self.x)) if row[0, j] != 0}
            named = {j: sp.Dummy(f"{name}_by_{self.x[j]}", real=True) for j, slope in slopes.items() if slope.free_symbols}
            self.values.append(Stage((new,), (value,)))
            self.partials.append(Stage((new, *named.values()), (value, *(slopes[j] for j in named))))
            symbols[name], self._by_x[new] = new, slopes | named

    def derivative(self, f: sp.Matrix) -> sp.Matrix:
        """df/dx with the derivatives of the definitions in f by their symbols: the chain rule, one link long."""
        import sympy as sp

        defined = [d for d in self._by_x if d in f.free_symbols]
        if not defined:
            return jacobian(f, self.x)
        direct = jacobian(f, [*self.x, *defined])
        n = len(self.x)
        out = sp.MutableDenseMatrix(direct[:, :n])
        for k, d in enumerate(defined):
            for j, slope in self._by_x[d].items():
                for i in range(f.rows):
                    if direct[i, n + k] != 0:
                        out[i, j] += direct[i, n + k] * slope
        return sp.ImmutableMatrix(out)


@lru_cache(maxsize=64)
def derive(model: Equations) -> Derivation:
    """Dynamics and their Jacobian; raises ExpressionError for an equation outside the language."""
    import sympy as sp

    symbols = {name: symbol(name) for name in (*model.names, *model.given, TIME, STEP)}
    x = tuple(symbols[name] for name in model.names)
    chain = _Chain(x)
    chain.define(model.definitions, symbols, needed(model.dynamics, model.definitions))
    remembered = [symbols[name] if model.discrete else sp.Integer(0) for name, _ in model.memory]
    f = sp.Matrix([*(to_sympy(e, symbols) for e in model.dynamics), *remembered])
    p = tuple(symbols[name] for name in model.given)
    F = chain.derivative(f)
    return Derivation(x, p, symbols[TIME], symbols[STEP], f, F, tuple(chain.values), tuple(chain.partials))


@lru_cache(maxsize=256)
def derive_sensor(model: Equations, sensor: Sensor) -> SensorDerivation:
    """What a sensor sees and its derivatives."""
    import sympy as sp

    own = model.numbers(sensor)
    symbols = {name: symbol(name) for name in (*model.names, *model.given, *own, TIME)}
    chain = _Chain([symbols[name] for name in model.names])
    numbers = tuple(symbols[name] for name in own)
    wanted = needed(sensor.equations, sensor.definitions, model.definitions)
    chain.define(model.definitions, symbols, wanted)
    chain.define(sensor.definitions, symbols, wanted)
    h = sp.Matrix([to_sympy(e, symbols) for e in sensor.equations])
    return SensorDerivation(h, chain.derivative(h), numbers, tuple(chain.values), tuple(chain.partials))


def jacobian(f: sp.Matrix, x: Sequence[sp.Symbol]) -> sp.Matrix:
    """df/dx where every value is real: the derivative of ``abs`` is ``sign``, and that of ``sign`` zero.

    SymPy's own derivative of ``abs(log(x))`` allows for a complex logarithm, which has no compiled form.

    Raises
    ------
    ValueError
        Where SymPy takes more than 5 s for the derivatives of one equation.
    """
    import sympy as sp

    class Sign(sp.Function):  # type: ignore[misc]
        def fdiff(self, argindex: int = 1) -> Any:
            return sp.S.Zero

    class Magnitude(sp.Function):  # type: ignore[misc]
        def fdiff(self, argindex: int = 1) -> Any:
            return Sign(self.args[0])

    def row(i: int) -> sp.Matrix:
        real = f[i, :].replace(sp.Abs, Magnitude).replace(sp.sign, Sign)
        return real.jacobian(list(x)).replace(Magnitude, sp.Abs).replace(Sign, sp.sign)

    try:
        rows = each_with_time_limit(row, range(f.rows))
    except TooSlowError as error:
        raise ValueError(f"derivatives of equation {error.at + 1}: {error}") from None
    return sp.Matrix(f.rows, len(x), [entry for found in rows for entry in found])


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
