"""Harmonics of the field that are estimated or considered, as what is added to those of the model.

Sources: Cunningham 1970, Celestial Mechanics 2, 207; Montenbruck and Gill, Satellite Orbits (2000), 3.2.4 and 3.2.5.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import factorial, sqrt

from piazzi.earth.force_text import Force

HIGHEST = 9  # degree; each is a digit of the name
HARMONICS = tuple(
    f"{kind}{n}{m}" for n in range(2, HIGHEST + 1) for m in range(n + 1) for kind in ("C", "S") if kind == "C" or m
)


def harmonics(names: Sequence[str], gm: float, radius: float) -> Force:
    """Accelerations of fully normalised coefficients such as C20: parameters `delta_C20`, on GM and radius of the field."""
    wanted: dict[str, None] = {}  # terms of the recursion, each behind those that it takes
    sums: list[list[str]] = [[], [], []]
    for name in names:
        for axis, of in zip(sums, _acceleration(name, wanted), strict=True):
            axis.append(of)
    text = {"harmonic_q": "field_radius/r**2"} | {term: line for term in wanted for line in [_term(term)]}
    text |= {f"harmonic_{a}": " + ".join(of) for a, of in zip("xyz", sums, strict=True)}
    pull = tuple(f"field_gm/field_radius**2*harmonic_{a}" for a in "xyz")
    values = {"field_gm": gm, "field_radius": radius}
    return Force("harmonics_on", text, pull, tuple(f"delta_{name}" for name in names), values, fixed=True)  # type: ignore[arg-type]


def _acceleration(name: str, wanted: dict[str, None]) -> tuple[str, str, str]:
    """The three components of one coefficient along the axes fixed to the Earth, over GM/R^2."""
    n, m = int(name[1]), int(name[2])
    size = f"{sqrt((2 - (m == 0)) * (2 * n + 1) * factorial(n - m) / factorial(n + m))!r}*delta_{name}"
    down = (n - m + 2) * (n - m + 1)
    same, other = ("V", "W") if name[0] == "C" else ("W", "V")  # a sine takes the one where a cosine takes the other
    sign = "-" if name[0] == "C" else "+"
    if m == 0:
        up, across, middle = _use(wanted, ("V", n + 1, 1), ("W", n + 1, 1), ("V", n + 1, 0))
        return f"-{size}*{up}", f"-{size}*{across}", f"-{n + 1}*{size}*{middle}"
    up, across, low, beside, middle = _use(
        wanted, (same, n + 1, m + 1), (other, n + 1, m + 1), (same, n + 1, m - 1), (other, n + 1, m - 1), (same, n + 1, m)
    )
    return (
        f"0.5*{size}*({down}*{low} - {up})",
        f"{sign}0.5*{size}*({across} + {down}*{beside})",
        f"-{n - m + 1}*{size}*{middle}",
    )


def _use(wanted: dict[str, None], *terms: tuple[str, int, int]) -> list[str]:
    """Names of terms, which are put behind those that they are made of; those of W of order 0 are zero."""
    return [_used(wanted, *term) for term in terms]


def _used(wanted: dict[str, None], kind: str, n: int, m: int) -> str:
    if kind == "W" and m == 0:
        return "0"
    for before in _before(kind, n, m):
        _used(wanted, *before)
    name = f"{kind}_{n}_{m}"
    wanted[name] = None
    return name


def _before(kind: str, n: int, m: int) -> Iterable[tuple[str, int, int]]:
    """What a term is made of."""
    if n == m:
        return [("V", n - 1, n - 1), ("W", n - 1, n - 1)] if n else []
    return [(kind, n - 1, m), *([(kind, n - 2, m)] if n - 2 >= m else [])]


def _term(name: str) -> str:
    """The recursion that gives a term."""
    kind, n, m = name[0], *map(int, name.split("_")[1:])
    if n == 0:
        return "field_radius/r"
    if n == m:
        V, W = (f"{k}_{n - 1}_{n - 1}" if k == "V" or n > 1 else "0" for k in "VW")
        first, second, sign = (V, W, "-") if kind == "V" else (W, V, "+")
        return f"{2 * n - 1}*harmonic_q*(bx*{first} {sign} by*{second})"
    ahead = f"{(2 * n - 1) / (n - m)!r}*bz*harmonic_q*{kind}_{n - 1}_{m}"
    return ahead if n - 2 < m else f"{ahead} - {(n + m - 1) / (n - m)!r}*field_radius*harmonic_q*{kind}_{n - 2}_{m}"
