"""The functions of the language, each said once.

Everything that reads, checks, evaluates, derives, prints or runs an equation reads this table.  A new function is a new line
here; `docs/how-to/new-function.md` has one as an example.
SymPy and NumPy are looked up by name when they are wanted: reading and checking equations imports neither.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    import sympy as sp

Growth = Literal["same", "magnitude", "root", "doubled", "logarithm", "exponential"]


@dataclass(frozen=True)
class Function:
    """A function of the language.

    Parameters
    ----------
    name : how an equation writes it
    value : its value at floats; raises ArithmeticError or ValueError where it has none
    arity : number of arguments; of a `variadic` one, the fewest
    sympy : name of the class that SymPy has for it; "" for none, as where `build` makes something else or there are `partials`
    build : SymPy object from SymPy arguments, where that is not the class itself
    partials : for a function that SymPy does not know, its derivatives as equations in the arguments ``a``, ``b``, ...
    array : name of NumPy's function, where that is not `name`; or a function of arrays that gives NaN where there is no value
    kernel : its word in the source of kernels; "" where nothing is left of it there
    code : definition of that word in the words of kernels, for one that is not of their own
    cost : in multiplications, by which the printer puts what takes longest last
    ulps : bound on the error of the compiled function in units in the last place; None for that of the C library
    growth : how an exact constant that comes out compares with those that go in (see `bounds`): "magnitude" of a "same" that
        SymPy merges with powers, "doubled" for cos(asin(a)), which is sqrt(1 - a**2)
    size : digits before the decimal point of its largest value; None where they are those of its arguments
    exact : whether fractions give a fraction
    variadic : whether it takes more arguments than `arity`
    derived : only what derivatives are made of: no equation may use it
    """

    name: str
    value: Callable[..., Any]
    arity: int = 1
    sympy: str = ""
    build: Callable[..., Any] | None = None
    partials: tuple[str, ...] = ()
    array: str | Callable[..., Any] = ""
    kernel: str = ""
    code: str = ""
    cost: int = 4
    ulps: float | None = None
    growth: Growth = "same"
    size: float | None = None
    exact: bool = False
    variadic: bool = False
    derived: bool = False

    @property
    def on_arrays(self) -> Callable[..., Any]:
        """The function of NumPy arrays, NaN where there is no value."""
        if callable(self.array):
            return self.array
        import numpy as np

        function: Callable[..., Any] = getattr(np, self.array or self.name)
        return function


def _exp(argument: Any) -> Any:
    """exp with a Float term of its argument, if any, as the same double in a fraction.

    SymPy takes exp(x + 750.4) apart into exp(750.4)*exp(x), and exp(750.4) is no double: with a fraction it does not.
    """
    import sympy as sp

    if argument.is_Add:
        argument = sp.Add(*(sp.Rational(float(term)) if term.is_Float else term for term in argument.args))
    return sp.exp(argument)


def _abs(argument: Any) -> Any:
    """abs, as a root where SymPy cannot tell that x**1.5 is real and would take its real part."""
    import sympy as sp

    magnitude = sp.Abs(argument)
    return sp.sqrt(argument**2) if magnitude.has(sp.re, sp.im, sp.arg) else magnitude


def _sqrt(argument: Any) -> Any:
    import sympy as sp

    return sp.sqrt(argument)


def _hypot(a: Any, b: Any) -> Any:
    return _sqrt(a**2 + b**2)


def _extreme(name: str) -> Callable[..., Any]:
    def of_arrays(*values: Any) -> Any:
        import numpy as np

        return getattr(np, name).reduce(np.broadcast_arrays(*values))

    return of_arrays


def _sign(x: float) -> float:
    return float(x > 0) - float(x < 0)


def _step(x: float) -> float:
    return 0.5 + 0.5 * _sign(x)


_ROWS = (
    Function("sin", math.sin, sympy="sin", kernel="sin", ulps=2.5, growth="doubled", size=0.0),
    Function("cos", math.cos, sympy="cos", kernel="cos", ulps=2.5, growth="doubled", size=0.0),
    Function("tan", math.tan, sympy="tan", kernel="tan", ulps=4.0, growth="doubled"),
    Function("asin", math.asin, sympy="asin", array="arcsin", kernel="asin", ulps=2.5, size=0.5),
    Function("acos", math.acos, sympy="acos", array="arccos", kernel="acos", ulps=3.0, size=0.5),
    Function("atan", math.atan, sympy="atan", array="arctan", kernel="atan", ulps=2.0, size=0.5),
    Function("sinh", math.sinh, sympy="sinh", kernel="sinh", growth="doubled"),
    Function("cosh", math.cosh, sympy="cosh", kernel="cosh", growth="doubled"),
    Function("tanh", math.tanh, sympy="tanh", kernel="tanh", growth="doubled", size=0.0),
    Function("exp", math.exp, sympy="exp", build=_exp, kernel="exp", ulps=1.0, growth="exponential"),
    Function("log", math.log, sympy="log", kernel="log", ulps=1.0, growth="logarithm"),
    Function("sqrt", math.sqrt, build=_sqrt, kernel="sqrt", ulps=0.5, growth="root"),
    Function("abs", abs, sympy="Abs", build=_abs, array="fabs", kernel="fabs", ulps=0.0, growth="magnitude", exact=True),
    Function("sign", _sign, sympy="sign", kernel="sign", ulps=0.0, size=0.0),
    Function("atan2", math.atan2, 2, "atan2", array="arctan2", kernel="atan2", ulps=2.0, size=0.5),
    Function("hypot", math.hypot, 2, build=_hypot, growth="doubled"),
    Function("min", min, 2, "Min", array=_extreme("minimum"), kernel="minimum", ulps=0.0, exact=True, variadic=True),
    Function("max", max, 2, "Max", array=_extreme("maximum"), kernel="maximum", ulps=0.0, exact=True, variadic=True),
    Function("heaviside", _step, sympy="Heaviside", kernel="heaviside", ulps=0.0, derived=True),
)
TABLE: dict[str, Function] = {function.name: function for function in _ROWS}


def arities() -> dict[str, int]:
    """The functions that an equation may call, and how many arguments each takes, or takes at least."""
    return {f.name: f.arity for f in TABLE.values() if not f.derived}


@cache
def symbol(name: str) -> sp.Symbol:
    """Return the real SymPy symbol that stands for `name` everywhere."""
    import sympy as sp

    return sp.Symbol(name, real=True)


def of_sympy(expr: Any) -> Function | None:
    """The function that a SymPy call is of, None where the language has none."""
    import sympy as sp

    kind = type(expr).__name__
    for function in TABLE.values():
        if kind != (function.sympy or function.name):
            continue
        if getattr(expr.func, "row", None) == function if function.partials else getattr(sp, kind, None) is expr.func:
            return function
    return None
