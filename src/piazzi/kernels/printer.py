"""SymPy expressions -> Python source over scalars, shaped for the compiler.

Common subexpressions are taken out once over all outputs together.  Powers by integers and halves become products of a
square root, a reciprocal and the base: ``pow`` is an order of magnitude slower and differs between maths libraries.
The source has no branches, so the same text serves floats and vector lanes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, TypeVar

from piazzi.expressions import time_limit
from piazzi.expressions.functions import of_sympy
from piazzi.expressions.time_limit import TooSlowError, each_with_time_limit, with_time_limit
from piazzi.model.stages import Call, Elsewhen, Solve, Stage, Verdict

if TYPE_CHECKING:
    import sympy as sp

    from piazzi.model.stages import AnyStage

    Spread = dict[sp.Symbol, sp.Expr]

A = TypeVar("A")
T = TypeVar("T")
CONVERGED = 1e-12  # of what is zero at a root, relative to its terms
_HEAD, _NAME = re.compile(r"(@inline\ndef \w+)\(([^)]*)\):\n(.*)", re.S), re.compile(r"\b[A-Za-z_]\w*")
_SLOW = 4  # cycles of a root or a quotient, in multiplications


class _Writer:
    """Statements of one function body; `temporaries` maps the text of a root, reciprocal or product to its name.

    Sums and products are written with what is known earliest first, so that only one operation waits for the slowest term:
    along an orbit the next substep cannot start before this one's position is there.
    """

    def __init__(self, names: Mapping[sp.Symbol, str]) -> None:
        self.names = dict(names)
        self.depths: dict[sp.Symbol, int] = {}
        self.lines: list[str] = []
        self.temporaries: dict[str, str] = {}
        self.shared = self.defined = 0  # names given to common parts, and to values of stages

    def name(self, symbol: sp.Symbol, name: str, value: sp.Expr) -> None:
        """Assign a shared subexpression."""
        text = self.text(value)
        self.lines.append(f"{name} = {text}")
        self.depths[symbol] = self.depth(value)
        self.names[symbol] = name

    def next_name(self) -> str:
        """A name for what is defined next."""
        self.defined += 1
        return f"d{self.defined - 1}"

    def defines(self, symbol: sp.Symbol) -> str:
        """A name for the symbol of what a call gives."""
        self.depths[symbol], self.names[symbol] = _SLOW, self.next_name()
        return str(self.names[symbol])

    def is_late_product(self, e: sp.Expr) -> bool:
        """Whether `e` is one slow factor times quick ones: better multiplied anew where it is used, the slow factor last."""
        if not e.is_Mul:
            return False
        *quick, slow = sorted(map(self.depth, e.args))
        return bool(slow > _SLOW and max(quick) + len(quick) <= _SLOW)

    def depth(self, e: sp.Expr) -> int:
        """Roughly how many operations come before the value of `e` is known."""
        if not e.args:
            return self.depths.get(e, 0)
        return max(self.depth(a) for a in e.args) + _cost(e)

    def temporary(self, text: str) -> str:
        if text not in self.temporaries:
            self.temporaries[text] = f"q{len(self.temporaries)}"
            self.lines.append(f"{self.temporaries[text]} = {text}")
        return self.temporaries[text]

    def atom(self, e: sp.Expr) -> str:
        """The expression as one name or literal."""
        text = self.text(e)
        return text if text.isidentifier() or _is_literal(text) else self.temporary(text)

    def text(self, e: sp.Expr) -> str:
        if not e.free_symbols:
            return repr(float(e.evalf(25)))
        if e.is_Symbol:
            return str(self.names[e])
        if e.is_Add:
            return self._sum(e)
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e.base, e.exp)
        return self._call(e)

    def _sum(self, e: sp.Expr) -> str:
        out = ""
        for term in sorted(e.as_ordered_terms(), key=self.depth):
            coefficient, _ = term.as_coeff_Mul()
            negative = coefficient.is_negative
            text = self._factor(-term if negative else term)
            out += (" - " if out else "-") + text if negative else (" + " if out else "") + text
        return out

    def _product(self, e: sp.Expr) -> str:
        coefficient, rest = e.as_coeff_Mul()
        if coefficient == -1:
            return f"-{self._factor(rest)}"
        factors = [] if coefficient == 1 else [repr(float(coefficient))]
        return "*".join(factors + [self._factor(f) for f in sorted(rest.args if rest.is_Mul else (rest,), key=self.depth)])

    def _factor(self, e: sp.Expr) -> str:
        text = self.text(e)
        return f"({text})" if e.is_Add or text.startswith("-") else text

    def _power(self, base: sp.Expr, exponent: sp.Expr) -> str:
        twice = float(2 * exponent) if exponent.is_Rational or exponent.is_Float else 0.5
        if not (twice.is_integer() and abs(twice) <= 128):
            if str(base) == "E":
                return f"exp({self.text(exponent)})"
            return f"pow({self.text(base)}, {self.text(exponent)})"
        if not twice:
            return "1.0"  # SymPy keeps x**0.0
        whole, half = divmod(int(twice), 2)
        b = self.atom(base)
        factors = [self.temporary(f"sqrt({b})")] if half else []
        if whole:
            factors.append(self._integer_power(b if whole > 0 else self.temporary(f"1.0/{b}"), abs(whole)))
        return factors[0] if len(factors) == 1 else self.temporary("*".join(factors))

    def _integer_power(self, b: str, k: int) -> str:
        """b^k by repeated squaring."""
        if k == 1:
            return b
        half = self.temporary(f"{b}*{b}") if k > 3 or k % 2 == 0 else b
        if k == 2:
            return half
        if k == 3:
            return self.temporary(f"{b}*{b}") + f"*{b}"
        rest = self._integer_power(half, k // 2)
        rest = rest if rest.isidentifier() else self.temporary(rest)
        return f"{rest}*{b}" if k % 2 else rest

    def _call(self, e: sp.Expr) -> str:
        function = of_sympy(e)
        if function is None:
            raise ValueError(f"no compiled form for {type(e).__name__!r} in {e}")
        if function.variadic:
            text = self.atom(e.args[0])
            for other in e.args[1:]:
                text = f"{function.kernel}({text}, {self.atom(other)})"
            return text
        return f"{function.kernel}({', '.join(self.text(a) for a in e.args[: function.arity])})"


def _cost(e: sp.Expr) -> int:
    """Cycles of the operation at the root of an expression, in multiplications."""
    if e.is_Function:
        function = of_sympy(e)
        return function.cost if function else _SLOW
    return _SLOW if e.is_Pow and not (e.exp.is_Integer and e.exp > 0) else 1


def _is_literal(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return not text.startswith("-")


def function(
    name: str,
    arguments: Sequence[str],
    names: Mapping[sp.Symbol, str],
    outputs: Sequence[sp.Expr],
    stages: Sequence[AnyStage] = (),
    called: Sequence[str] = (),
) -> str:
    """Source of an inlined scalar function that returns the tuple of `outputs`; `called` names the equation of each.

    `names` gives each SymPy symbol its argument's name.  Stages are worked out first, in their order; common subexpressions are
    taken out of each by itself, so that the source and the time to make it grow with the number of stages.

    Raises
    ------
    ValueError
        Where SymPy takes more than 5 s for one equation.
    """
    writer, called = _Writer(names), called or [name] * len(outputs)
    in_time(lambda i: f"definition {stages[i].symbols[0]}", lambda stage: _define(writer, stage), stages)
    results = _written(writer, outputs, called)
    body = "".join(f"    {line}\n" for line in [*writer.lines, f"return ({', '.join(results)},)"])
    return f"@inline\ndef {name}({', '.join(arguments)}):\n{body}\n\n"


def with_used(source: str) -> str:
    """The source of a function with the arguments that it uses: whatever a problem has besides, it stays the same.

    It is then compiled once for all of them.
    """
    head, taken, body = _HEAD.findall(source)[0]
    used = {*_NAME.findall(body)}
    return f"{head}({', '.join(a for a in taken.split(', ') if a in used)}):\n{body}"


def call_of(source: str, given: Mapping[str, str]) -> str:
    """A call of the function of a source: `given` has the text of each argument that it may take."""
    head, taken, _ = _HEAD.findall(source)[0]
    return f"{head.split()[-1]}({', '.join(given[a] for a in taken.split(', ') if a)})"


def in_time(called: Callable[[int], str], write: Callable[[A], T], items: Sequence[A]) -> list[T]:
    """What is written for each item; raises ValueError, with what the item is `called`, where SymPy takes too long for it."""
    try:
        return each_with_time_limit(write, items) if items else []
    except TooSlowError as error:
        raise ValueError(f"code of {called(error.at)}: {error}") from None


def _define(writer: _Writer, stage: AnyStage) -> None:
    """Write a definition and its derivatives."""
    match stage:
        case Stage():
            _define_values(writer, stage)
        case Call():
            place = str(stage.place) if isinstance(stage.place, int) else f"int({writer.text(stage.place)})"
            arguments = [writer.atom(a) for a in stage.arguments]
            call = f"{stage.function}({', '.join([*arguments, 'p.data', f'int(p.data[{place}])'])})"
            writer.lines.append(f"({', '.join(writer.defines(s) for s in stage.symbols)},) = {call}")
        case Elsewhen():
            _define_elsewhen(writer, stage)
        case Solve():
            _define_root(writer, stage)
        case Verdict():
            _define_verdict(writer, stage)


def _define_values(writer: _Writer, stage: Stage) -> None:
    shared, reduced = _common(stage.values)
    spread: Spread = {}
    for part in shared:
        _place(writer, part, spread)
    for symbol, value in zip(stage.symbols, reduced, strict=True):
        writer.name(symbol, writer.next_name(), value.xreplace(spread))


def _define_elsewhen(writer: _Writer, stage: Elsewhen) -> None:
    """The state `offset` later by one step, with the transition matrix and the rates there."""
    offset, y = writer.atom(stage.offset), writer.next_name()
    n = sum(name.startswith("x") and name[1:].isdigit() for name in writer.names.values())
    state = f"vector({', '.join(f'x{i}' for i in range(n))})"
    if stage.transition:
        R = writer.next_name()
        writer.lines.append(f"{y}, {R} = elsewhen_jacobian(t, {offset}, {state}, identity_rows(), p)")
    else:
        writer.lines.append(f"{y} = elsewhen(t, {offset}, {state}, p)")
    writer.lines += [f"{writer.defines(s)} = {y}[{i}]" for i, s in enumerate(stage.symbols)]
    writer.lines += [f"{writer.defines(s)} = {R}[{i // n}][{i % n}]" for i, s in enumerate(stage.transition)]
    if stage.rates:
        f = writer.next_name()
        writer.lines.append(f"{f} = dynamics(t + {offset}, {y}, p)")
        writer.lines += [f"{writer.defines(s)} = {f}[{i}]" for i, s in enumerate(stage.rates)]


def _define_root(writer: _Writer, stage: Solve) -> None:
    """Newton's iteration, from a start in as many lanes as the state has."""
    (root, slope), trial = map(writer.defines, stage.symbols), writer.defines(stage.unknown)
    writer.lines += [f"{trial} = {writer.text(stage.start)} + 0.0*x0", f"{slope} = {trial}"]
    outside, writer.lines = writer.lines, []
    for inner in stage.inner:
        _define(writer, inner)
    writer.lines.append(f"{slope} = {writer.text(stage.slope)} + 0.0*x0")
    writer.lines.append(f"{trial} = {trial} - {writer.atom(stage.residual)}/{slope}")
    body, writer.lines = writer.lines, outside
    writer.lines += [f"for _ in range({stage.iterations}):", *(f"    {line}" for line in body), f"{root} = {trial}"]


def _define_verdict(writer: _Writer, stage: Verdict) -> None:
    """Add nothing to values where a residual is small, and NaN elsewhere."""
    terms, scale = [writer.atom(term) for term in stage.terms], writer.atom(stage.scale)
    residual, verdict = writer.next_name(), writer.next_name()
    writer.lines.append(f"{residual} = fabs({' + '.join(terms)})")
    size = " + ".join(f"fabs({term})" for term in (*terms, scale))
    writer.lines.append(f"{verdict} = choose({CONVERGED!r}*({size} - {residual}) + 1e-300, {residual}, 0.0, nan)")
    for symbol, value in zip(stage.symbols, stage.values, strict=True):
        value_name = writer.text(value)
        writer.lines.append(f"{writer.defines(symbol)} = {value_name} + {verdict}")


def _written(writer: _Writer, outputs: Sequence[sp.Expr], called: Sequence[str]) -> list[str]:
    """Texts of the outputs, their common parts written before."""
    equations = list(dict.fromkeys(called))
    try:
        shared, reduced = with_time_limit(lambda: _common(outputs), time_limit.SECONDS * max(len(equations), 1))
    except TooSlowError as error:
        raise ValueError(f"code of {', '.join(equations)}: {error}") from None
    rows = [[e for _, e in row] for _, row in groupby(zip(called, reduced, strict=True), key=lambda output: output[0])]
    spread: Spread = {}

    def write(item: int) -> list[str]:
        if item < len(shared):
            _place(writer, shared[item], spread)
            return []
        return [writer.text(e.xreplace(spread)) for e in rows[item - len(shared)]]

    def told(item: int) -> str:
        if item < len(shared):
            return _users(shared, item, called, reduced)
        return [what for what, _ in groupby(called)][item - len(shared)]

    return [text for row in in_time(told, write, range(len(shared) + len(rows))) for text in row]


def _common(expressions: Sequence[sp.Expr]) -> tuple[list[tuple[sp.Symbol, sp.Expr]], list[sp.Expr]]:
    """Common parts with symbols for them, and the expressions in terms of those."""
    import sympy as sp

    shared, reduced = sp.cse(list(expressions), symbols=sp.numbered_symbols("c", cls=sp.Dummy))
    return shared, reduced


def _place(writer: _Writer, part: tuple[sp.Symbol, sp.Expr], spread: Spread) -> None:
    """Write a common part, or add it to those that are spread: multiplied anew wherever they are used."""
    symbol, value = part
    whole = value.xreplace(spread)
    if writer.is_late_product(whole):
        spread[symbol] = whole
    else:
        writer.name(symbol, f"c{writer.shared}", whole)
    writer.shared += 1


def _users(shared: Sequence[tuple[sp.Symbol, sp.Expr]], at: int, called: Sequence[str], reduced: Sequence[sp.Expr]) -> str:
    """The equations that the common part of this number is a part of."""
    parts = {shared[at][0]}
    for symbol, value in shared[at + 1 :]:
        if value.free_symbols & parts:
            parts.add(symbol)
    return ", ".join(dict.fromkeys(what for what, e in zip(called, reduced, strict=True) if e.free_symbols & parts))
