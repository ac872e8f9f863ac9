"""Elementary functions of the kernels against wider arithmetic: stated accuracy, the same bits in lanes, all exceptions."""

import ast
from functools import cache
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from piazzi.expressions.functions import TABLE
from piazzi.kernels.lanes import elementary
from tests.kernels.test_lanes import call
from tests.references import minimax

W = 4
ONE_OPERATION = {"sqrt", "fabs", "minimum", "maximum"}
NUMPYS = {"atan2": np.arctan2, "atan": np.arctan, "asin": np.arcsin, "acos": np.arccos}
SPECIAL = [0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 5e-324, -5e-324, 1e-310, 2.3e-308, 1e-300, 1e300, -1.7e308, 0.5, 2.0]
needs_wider = pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="no arithmetic wider than a double here")


def arguments(name: str) -> list[np.ndarray]:
    """Random arguments over the whole range that the function reduces itself, and next to where it is hardest."""
    rng, n = np.random.default_rng(0), 20_000
    signs, spread = rng.choice([-1.0, 1.0], n), np.exp(rng.uniform(-50, 50, n))
    turns = np.pi / 2 * rng.integers(-600_000, 600_000, n)
    angles = np.concatenate([rng.uniform(-7, 7, n), rng.uniform(-1e6, 1e6, n), turns, np.nextafter(turns, 0), signs / spread])
    unit = np.concatenate([rng.uniform(-1, 1, n), signs * (1 - 1e-9 * rng.random(n)), 1e-9 * rng.normal(size=n)])
    match name:
        case "sin" | "cos" | "tan":
            return [angles[np.abs(angles) < 1e6]]
        case "exp":
            return [np.concatenate([rng.uniform(-700, 700, n), rng.uniform(-1, 1, n), signs * np.exp(-30 * rng.random(n))])]
        case "log":
            return [np.concatenate([np.exp(rng.uniform(-660, 660, n)), rng.uniform(0.3, 3, n), 1 + 1e-6 * rng.normal(size=n)])]
        case "atan2":
            far, turn = spread * signs, rng.uniform(-np.pi, np.pi, n)
            return [np.concatenate([far, np.sin(turn), spread]), np.concatenate([far[::-1], np.cos(turn), spread * signs])]
        case "atan":
            return [np.concatenate([signs * spread, rng.normal(size=n)])]
        case _:
            return [unit]


@cache
def compiled(name: str, takes: int, w: int):
    """The function over whole arrays, `w` numbers at a time."""
    from piazzi.kernels import compiled as vocabulary

    names = [f"a{i}" for i in range(takes)]
    values = ", ".join(f"load_lanes({a}, i, 1, 1, {w})[0]" for a in names)
    scope = dict(vars(vocabulary))
    lines = [f"def run({', '.join(names)}, out, size):", f"    for i in range(0, int(size[0]), {w}):"]
    exec("\n".join([*lines, f"        store_lanes(out, i, 1, vector({name}({values})))"]), scope)
    return scope["run"]


@cache
def results(name: str, w: int) -> np.ndarray:
    given = arguments(name)
    return evaluate(name, given, w)


def evaluate(name: str, given: list[np.ndarray], w: int) -> np.ndarray:
    n = len(given[0]) // W * W
    out = np.full(n, np.nan)
    call(compiled(name, len(given), w), *(a[:n].copy() for a in given), out, np.array([float(n)]))
    return out


def stated() -> dict[str, float]:
    """Functions with a series of their own, and the bound of each; below that is one operation, which rounds once at most."""
    return {f.kernel: f.ulps for f in TABLE.values() if f.ulps is not None and f.ulps > 0.5}


NAMES = list(stated())


def test_functions_with_a_stated_accuracy_are_those_written_here():
    from piazzi.kernels.lanes import elementary

    assert set(NAMES) == {n for n in {f.kernel for f in TABLE.values()} & vars(elementary).keys() if n not in ONE_OPERATION}


@needs_wider
@pytest.mark.parametrize("name", NAMES)
def test_errors_stay_below_the_stated_bound(name):
    got, given = results(name, W), arguments(name)
    exact = (NUMPYS.get(name) or getattr(np, name))(*(np.longdouble(a[: len(got)]) for a in given))
    ulps = np.abs(got - exact) / np.spacing(np.abs(exact).astype(float))
    worst = int(np.argmax(ulps))
    assert ulps[worst] < stated()[name], [a[worst] for a in given]
    assert np.median(ulps) < 0.6  # and mostly the nearest double


@pytest.mark.parametrize("name", NAMES)
def test_lanes_give_the_bits_that_single_numbers_give(name):
    assert_array_equal(results(name, W), results(name, 1))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("w", [1, W])
def test_exceptions_are_those_of_the_c_library(name, w):
    """Zeros with their signs, infinities, NaN, subnormal and huge numbers: beside ordinary ones in other lanes."""
    x = np.array([v for pair in zip(SPECIAL, [0.3] * len(SPECIAL), strict=True) for v in pair])
    given = [np.repeat(x, len(x)), np.tile(x, len(x))] if name == "atan2" else [x]
    got = evaluate(name, given, w)
    with np.errstate(all="ignore"):
        expected = (NUMPYS.get(name) or getattr(np, name))(*given)
    assert_array_equal(np.isnan(got), np.isnan(expected))
    assert_array_equal(np.signbit(got)[~np.isnan(got)], np.signbit(expected)[~np.isnan(got)])
    assert_array_equal(np.isinf(got), np.isinf(expected))
    finite = np.isfinite(expected)
    np.testing.assert_allclose(got[finite], expected[finite], rtol=1e-15, atol=1e-323)


@pytest.mark.parametrize("name", ["sine_series", "cosine_series", "arc_series", "exponential_series", "logarithm_series"])
def test_the_coefficients_are_those_of_a_minimax_fit(name):
    """The polynomial is the one of `minimax` to what rounding of its coefficients to doubles may change."""
    source = ast.parse(Path(elementary.__file__).read_text(encoding="utf-8"))
    calls = [n for n in ast.walk(source) if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "polynomial"]
    found = {ast.literal_eval(c.args[0]): [ast.literal_eval(a) for a in c.args[1:]] for c in calls}[name]
    with mp.workdps(40):
        fit = minimax.fits()[name]
        made = minimax.minimax(fit)
        assert len(made) == len(found)
        apart = [mp.mpf(have) - want for have, want in zip(found, made, strict=True)]
        rounding = [mp.mpf(np.spacing(abs(have))) / 2 for have in found]
        along = [fit.begin + (fit.end - fit.begin) * (i + mp.mpf(1) / 2) / 500 for i in range(500)]
        allowed = max(abs(fit.relative(z)) * mp.polyval(rounding[::-1], abs(z)) for z in along)
        assert max(abs(fit.relative(z) * mp.polyval(apart[::-1], z)) for z in along) <= allowed


@pytest.mark.parametrize(("name", "exact"), [("QUARTER_TURN", lambda: mp.pi / 2), ("LN2", lambda: mp.log(2))])
def test_the_parts_of_a_constant_are_its_leading_bits(name, exact):
    """All parts but the last have 33 bits at most, so that multiples up to 2^20 are exact; the last is what is left."""
    *leading, last = getattr(elementary, name)
    with mp.workdps(60):
        left = exact()
        for part in leading:
            mantissa, _ = mp.frexp(part)
            assert mantissa * 2**33 == mp.floor(mantissa * 2**33)
            left -= mp.mpf(part)
        assert last == float(left)
