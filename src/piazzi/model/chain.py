"""Definitions as stages, and the chain rule over their names: no definition is ever put in the place of its name."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from piazzi.expressions import symbol, to_sympy
from piazzi.model.definitions import Definition, needed
from piazzi.model.events import on_side
from piazzi.model.functions import AT, ROOT, STATION, STATION_TABLE, Signature
from piazzi.model.jacobian import jacobian
from piazzi.model.sensor import Parameter, Sensor
from piazzi.model.stages import AnyStage, Call, Elsewhen, Solve, Stage, Verdict

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
    def functions(self) -> Any: ...
    @property
    def events(self) -> Any: ...
    @property
    def slots(self) -> Mapping[str, int]: ...
    @property
    def discrete(self) -> bool: ...
    @property
    def parameters(self) -> tuple[Parameter, ...]: ...
    @property
    def sensors(self) -> tuple[Sensor, ...]: ...
    def numbers(self, sensor: Sensor) -> tuple[str, ...]: ...


class Chain:
    """Definitions as symbols, each with its derivatives by the values `x`, which are symbols too.

    `x` are the estimated values, and within a root its unknown besides; `sides` are those of events, by name.
    """

    def __init__(
        self,
        model: Equations,
        symbols: dict[str, sp.Symbol],
        x: Sequence[sp.Symbol],
        sides: Mapping[str, sp.Symbol] | None = None,
    ) -> None:
        self.model, self.symbols, self.x, self.sides = model, symbols, tuple(x), sides or {}
        self.values: list[AnyStage] = []
        self.partials: list[AnyStage] = []
        self._by_x: dict[sp.Symbol, dict[int, sp.Expr]] = {}  # definition -> number of the value -> derivative, or its symbol
        self._lookups: dict[tuple[Any, ...], tuple[tuple[sp.Symbol, ...], bool]] = {}

    def define(self, definitions: Sequence[Definition], wanted: Collection[str]) -> None:
        """Add those of the definitions that are wanted; `symbols` gets their names."""
        for d in definitions:
            if not set(d.provides) & set(wanted):
                continue
            if d.function == ROOT:
                self._root(d, wanted)
            elif d.function == AT:
                self._elsewhen(d)
            elif d.function:
                self._call(d)
            else:
                self._value(d.names[0], to_sympy(d.texts[0], self.symbols))
            for name in self.sides.keys() & set(d.provides):
                self._take_side(name)

    def define_dynamics(self) -> None:
        """Add the definitions that the dynamics need and that are not there yet."""
        missing = [d for d in self.model.definitions if d.names[0] not in self.symbols]
        self.define(missing, needed(self.model.dynamics, self.model.definitions))

    def _new(self, name: str) -> sp.Symbol:
        """A symbol for a name, another one each time where a root works it out twice."""
        import sympy as sp

        new = symbol(name) if name not in self.symbols else sp.Dummy(name, real=True)
        self.symbols[name] = new
        return new

    def _value(self, name: str, value: sp.Expr) -> None:
        import sympy as sp

        row = self.derivative(sp.Matrix([value]))
        new = self._new(name)
        slopes = {j: row[0, j] for j in range(len(self.x)) if row[0, j] != 0}
        self._known(new, value, slopes)

    def _take_side(self, name: str) -> None:
        """Put an event on its side for all that use it by name; its derivatives stay."""
        value, new = self.symbols[name], self._new(name)
        stage = Stage((new,), (on_side(value, self.sides[name]),))
        self.values.append(stage)
        self.partials.append(stage)
        self._by_x[new] = self._by_x.get(value, {})

    def _known(self, new: sp.Symbol, value: sp.Expr, slopes: Mapping[int, sp.Expr]) -> None:
        """A stage of a value and its derivatives."""
        import sympy as sp

        named = {j: sp.Dummy(f"{new.name}_by_{self.x[j].name}", real=True) for j, slope in slopes.items() if slope.free_symbols}
        self.values.append(Stage((new,), (value,)))
        self.partials.append(Stage((new, *named.values()), (value, *(slopes[j] for j in named))))
        self._by_x[new] = dict(slopes) | named

    def _call(self, d: Definition) -> None:
        """Outputs of a function from outside; a rotation is a table of nine numbers and three sums."""
        arguments = tuple(to_sympy(text, self.symbols) for text in d.texts)
        if d.function == STATION:
            signature, place = Signature.of_station(), self.symbols[STATION_TABLE]
        else:
            signature, place = dict(self.model.functions)[d.function], self.model.slots[d.function]
        if signature.kind == "rotation":
            self._rotation(d, signature, place, arguments)
            return
        called = [*d.names, *(f"{d.function}_{i}" for i in range(len(d.names), signature.outputs))]
        for name, new in zip(d.names, self._outputs(called, signature, place, arguments), strict=False):
            self.symbols[name] = new

    def _outputs(
        self, names: Sequence[str], signature: Signature, place: Any, arguments: tuple[sp.Expr, ...]
    ) -> tuple[sp.Symbol, ...]:
        """Symbols of the outputs of a call, by these names, which is made once for each set of arguments."""
        import sympy as sp

        by_argument = self.derivative(sp.Matrix(arguments))
        used = [j for j in range(len(self.x)) if any(by_argument[k, j] != 0 for k in range(len(arguments)))]
        key = (signature.function, place, arguments)
        if key in self._lookups:
            return self._lookups[key]
        outputs = tuple(sp.Dummy(name, real=True) for name in names)
        self._lookups[key] = outputs
        self.values.append(Call(outputs, signature.function, arguments, place))
        if not used:
            self.partials.append(self.values[-1])
            self._by_x |= {o: {} for o in outputs}
            return outputs
        by = [getattr(argument, "name", argument) for argument in arguments]
        known = {(i, k): sp.Dummy(f"{names[i]}_by_{by[k]}", real=True) for i, k in signature.partials}
        self.partials.append(Call((*outputs, *known.values()), f"{signature.function}_partials", arguments, place))
        for i, o in enumerate(outputs):
            slopes = {j: sum(known[i, k] * by_argument[k, j] for k in range(len(arguments)) if (i, k) in known) for j in used}
            self._slopes(o, {j: slope for j, slope in slopes.items() if slope != 0})
        return outputs

    def _slopes(self, new: sp.Symbol, slopes: Mapping[int, sp.Expr]) -> None:
        """A stage of the derivatives of a value that is there already."""
        import sympy as sp

        named = {
            j: sp.Dummy(f"{new.name}_by_{self.x[j].name}", real=True)
            for j, slope in slopes.items()
            if slope.free_symbols and not slope.is_Symbol
        }
        if named:
            self.partials.append(Stage(tuple(named.values()), tuple(slopes[j] for j in named)))
        self._by_x[new] = dict(slopes) | named

    def _rotation(self, d: Definition, signature: Signature, place: Any, arguments: tuple[sp.Expr, ...]) -> None:
        import sympy as sp

        table = Signature.of_table(9, signature.terms)
        names = [f"{d.function}_{i}{j}" for i in "xyz" for j in "xyz"]
        W = sp.Matrix(3, 3, self._outputs(names, table, place, arguments[:1]))
        turned = (W.T if signature.transposed else W) * sp.Matrix(arguments[1:])
        for name, value in zip(d.names, turned, strict=False):
            self._value(name, value)

    def _elsewhen(self, d: Definition) -> None:
        """The states at another instant: to second order in the offset, or by a step of the dynamics."""
        import sympy as sp

        offset = to_sympy(d.texts[0], self.symbols)
        states = [symbol(name) for name in self.model.names]
        if len(d.texts) > 1:
            self.define_dynamics()
            rates = dict(zip(states, (to_sympy(e, self.symbols) for e in self.model.dynamics), strict=False))
            for name, state in zip(d.names, states, strict=False):
                rate = rates[state]
                second = rates.get(rate) if rate.is_Symbol else None
                self._value(name, state + offset * rate + (offset**2 / 2 * second if second is not None else 0))
            return
        n, nd = len(states), len(self.model.dynamics)
        by_offset = self.derivative(sp.Matrix([offset]))
        outputs = tuple(self._new(name) for name in d.names)
        everything = outputs + tuple(sp.Dummy(f"{states[i]}_then", real=True) for i in range(len(outputs), nd))
        self.values.append(Elsewhen(everything, offset))
        Phi = tuple(sp.Dummy(f"Phi_{new.name}_{x.name}", real=True) for new in everything for x in states)
        rates_there = tuple(sp.Dummy(f"{new.name}_by_offset", real=True) for new in everything)
        self.partials.append(Elsewhen(everything, offset, Phi, rates_there))
        for i, new in enumerate(outputs):
            slopes = {j: rates_there[i] * by_offset[0, j] for j in range(len(self.x)) if by_offset[0, j] != 0}
            for j, value in enumerate(self.x):
                if value in states:
                    slopes[j] = slopes.get(j, 0) + Phi[i * n + states.index(value)]
            self._slopes(new, slopes)

    def _root(self, d: Definition, wanted: Collection[str]) -> None:
        """The solution, by Newton's method; its derivative by the implicit function theorem, -(dg/dtau)^-1 dg/dx."""
        import sympy as sp

        (name,), (equation, start) = d.names, d.texts
        if any(call.function == AT and len(call.texts) > 1 for call in d.calls):
            self.define_dynamics()  # here, so that no iteration works them out again
        trial = sp.Dummy(name, real=True)
        newton = Chain(self.model, {**self.symbols, name: trial}, [trial])
        own = {n for inner in d.inner for n in inner.provides}
        newton.define(d.inner, own)
        g = sp.Matrix([to_sympy(equation, newton.symbols)])
        slope = newton.derivative(g)[0, 0]
        if slope == 0:
            raise ValueError(f"root {name!r}: its equation does not depend on {name!r}")
        tau = self._new(name)
        first, last_slope = to_sympy(start, self.symbols), sp.Dummy("slope", real=True)
        solve = Solve((tau, last_slope), trial, first, d.iterations, tuple(newton.partials), g[0, 0], slope)
        self.values.append(solve)
        self.partials.append(solve)
        n = len(self.x)
        there = Chain(self.model, self.symbols, [*self.x, tau])
        there._by_x = dict(self._by_x)
        there.define(d.inner, own)
        residual = to_sympy(equation, self.symbols)
        row = there.derivative(sp.Matrix([residual]))
        self.values += there.values
        self.partials += there.partials
        self._slopes(tau, {j: -row[0, j] / row[0, n] for j in range(n) if row[0, j] != 0})
        for new, slopes in there._by_x.items():
            if new not in self._by_x:
                total = {
                    j: slopes.get(j, 0) + slopes.get(n, 0) * self._by_x[tau].get(j, 0)
                    for j in range(n)
                    if j in slopes or (n in slopes and j in self._by_x[tau])
                }
                self._slopes(new, total)
        self._judge([n for n in d.provides if n in wanted], residual, last_slope * tau)

    def _judge(self, names: Sequence[str], residual: sp.Expr, scale: sp.Expr) -> None:
        """Let these names stand for values that are not numbers where the residual of a root is not small."""
        import sympy as sp

        values = tuple(self.symbols[name] for name in names)
        sound = tuple(sp.Dummy(name, real=True) for name in names)
        self.values.append(Verdict(sound, values, sp.Add.make_args(residual), scale))
        self.partials.append(self.values[-1])
        for name, value, new in zip(names, values, sound, strict=True):
            self.symbols[name], self._by_x[new] = new, self._by_x[value]

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
