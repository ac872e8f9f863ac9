"""Derivatives of equations by SymPy, for real values and within a limit of time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from piazzi.expressions.time_limit import TooSlowError, each_with_time_limit

if TYPE_CHECKING:
    import sympy as sp


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
