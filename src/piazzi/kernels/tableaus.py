"""Butcher tableaus: coefficients of explicit Runge-Kutta methods, and the check of a user's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

Row = tuple[float, ...]
Tableau = tuple[tuple[Row, ...], Row, Row]

TOLERANCE = 1e-10  # of a row's sum: coefficients written with ten digits pass, a wrong one does not


def tableau(a: Any, b: Any, c: Any = None) -> Tableau:
    """The method's `a` as rows below the diagonal, its weights `b` and its nodes `c` (the row sums where not given).

    Raises
    ------
    ValueError
        Unless `a` is strictly lower triangular, every row adds up to its node and the weights add up to 1.
    """
    weights = _numbers(b, "weights b")
    if not weights:
        raise ValueError("a tableau needs at least one weight in b")
    given = list(a)
    if len(given) == len(weights) - 1:  # the first row is empty, and often left out
        given = [(), *given]
    if len(given) != len(weights):
        raise ValueError(f"the tableau has {len(given)} rows in a and {len(weights)} weights in b; every stage needs both")
    rows = tuple(_explicit_row(row, i) for i, row in enumerate(given))
    nodes = tuple(sum(row) for row in rows) if c is None else _numbers(c, "nodes c")
    if len(nodes) != len(rows):
        raise ValueError(f"the tableau has {len(nodes)} nodes in c for {len(rows)} stages")
    for i, (row, node) in enumerate(zip(rows, nodes, strict=True)):
        if abs(sum(row) - node) > TOLERANCE * _size(row):
            raise ValueError(f"row {i} of a adds up to {sum(row):.12g}, but its node c[{i}] is {node:.12g}; they must be equal")
    if abs(sum(weights) - 1) > TOLERANCE * _size(weights):
        raise ValueError(f"the weights b add up to {sum(weights):.12g}; they must add up to 1")
    return rows, weights, nodes


def _size(row: Row) -> float:
    return 1.0 + sum(abs(v) for v in row)


def _numbers(values: Any, what: str) -> Row:
    try:
        out = tuple(float(v) for v in values)
    except (TypeError, ValueError):
        raise ValueError(f"{what} of the tableau are {values!r}; they must be numbers") from None
    for i, v in enumerate(out):
        if not isfinite(v):
            raise ValueError(f"{what} of the tableau: number {i} is {v}; it must be finite")
    return out


def _explicit_row(row: Any, i: int) -> Row:
    """The `i` numbers before the diagonal."""
    numbers = _numbers(row, f"coefficients a[{i}]")
    for j, v in enumerate(numbers[i:], start=i):
        if v != 0:
            raise ValueError(f"a[{i}][{j}] is {v:g}: an explicit method has zeros on and above the diagonal")
    return (numbers + (0.0,) * i)[:i]


def _sparse(entries: Mapping[int, float], width: int) -> Row:
    return tuple(entries.get(j, 0.0) for j in range(width))


def _sparse_tableau(a: Sequence[Mapping[int, float]], b: Mapping[int, float]) -> Tableau:
    return tableau([_sparse(row, i) for i, row in enumerate(a)], _sparse(b, len(a)))


EULER = tableau([()], [1.0])
MIDPOINT = tableau([(), (0.5,)], [0.0, 1.0])
HEUN = tableau([(), (1.0,)], [0.5, 0.5])
RALSTON = tableau([(), (2 / 3,)], [0.25, 0.75])  # Ralston (1962): smallest error bound of all with two stages
CLASSICAL = tableau([(), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)], [1 / 6, 1 / 3, 1 / 3, 1 / 6], [0.0, 0.5, 0.5, 1.0])
DORMAND_PRINCE_5 = tableau(  # Dormand and Prince (1980), the solution of order 5; its seventh stage only serves the error
    [
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ],
    [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    [0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0],
)
# Order 8 with embedded orders 5 and 3: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), II.5
DORMAND_PRINCE_8 = _sparse_tableau(
    [
        {},
        {0: 0.05260015195876773},
        {0: 0.0197250569845379, 1: 0.0591751709536137},
        {0: 0.02958758547680685, 2: 0.08876275643042054},
        {0: 0.2413651341592667, 2: -0.8845494793282861, 3: 0.924834003261792},
        {0: 0.037037037037037035, 3: 0.17082860872947386, 4: 0.12546768756682242},
        {0: 0.037109375, 3: 0.17025221101954405, 4: 0.06021653898045596, 5: -0.017578125},
        {0: 0.03709200011850479, 3: 0.17038392571223998, 4: 0.10726203044637328, 5: -0.015319437748624402,
         6: 0.008273789163814023},
        {0: 0.6241109587160757, 3: -3.3608926294469414, 4: -0.868219346841726, 5: 27.59209969944671, 6: 20.154067550477894,
         7: -43.48988418106996},
        {0: 0.47766253643826434, 3: -2.4881146199716677, 4: -0.590290826836843, 5: 21.230051448181193, 6: 15.279233632882423,
         7: -33.28821096898486, 8: -0.020331201708508627},
        {0: -0.9371424300859873, 3: 5.186372428844064, 4: 1.0914373489967295, 5: -8.149787010746927, 6: -18.52006565999696,
         7: 22.739487099350505, 8: 2.4936055526796523, 9: -3.0467644718982196},
        {0: 2.273310147516538, 3: -10.53449546673725, 4: -2.0008720582248625, 5: -17.9589318631188, 6: 27.94888452941996,
         7: -2.8589982771350235, 8: -8.87285693353063, 9: 12.360567175794303, 10: 0.6433927460157636},
    ],
    {0: 0.054293734116568765, 5: 4.450312892752409, 6: 1.8915178993145003, 7: -5.801203960010585, 8: 0.3111643669578199,
     9: -0.1521609496625161, 10: 0.20136540080403034, 11: 0.04471061572777259},
)  # fmt: skip
# weights of the two error estimates: the solution minus the embedded ones of order 5 and 3
ERROR_5 = _sparse(
    {0: 0.01312004499419488, 5: -1.2251564463762044, 6: -0.4957589496572502, 7: 1.6643771824549864, 8: -0.35032884874997366,
     9: 0.3341791187130175, 10: 0.08192320648511571, 11: -0.022355307863886294}, 12,
)  # fmt: skip
ERROR_3 = _sparse(
    {0: -0.18980075407240762, 5: 4.450312892752409, 6: 1.8915178993145003, 7: -5.801203960010585, 8: -0.4226823213237919,
     9: -0.1521609496625161, 10: 0.20136540080403034, 11: 0.02265179219836082}, 12,
)  # fmt: skip
