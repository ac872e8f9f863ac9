"""Interpolation of one and two variables: smooth, with errors as stated; lanes, compiled and uncompiled; edges; bad nodes."""

import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.outside.interpolation import Interpolation
from tests.kernels.outside import called


def one(x):
    return np.sin(2.0 * x) * np.exp(-0.3 * x)


def one_slope(x):
    return (2.0 * np.cos(2.0 * x) - 0.3 * np.sin(2.0 * x)) * np.exp(-0.3 * x)


def two(x, y):
    return np.sin(x) * np.cos(0.7 * y) + 0.1 * x * y


def two_slopes(x, y):
    return np.cos(x) * np.cos(0.7 * y) + 0.1 * y, -0.7 * np.sin(x) * np.sin(0.7 * y) + 0.1 * x


def grid(n, m, rng=None):
    x, y = np.linspace(0.0, 5.0, n), np.linspace(-2.0, 3.0, m)
    if rng is not None:
        x[1:-1] += rng.uniform(-0.3, 0.3, n - 2) * (x[1] - x[0])
    return x, y


@pytest.mark.parametrize("n", [12, 40, 160])
@pytest.mark.parametrize("uneven", [False, True])
def test_one_variable_is_as_near_as_stated(n, uneven):
    x, _ = grid(n, 2, np.random.default_rng(n) if uneven else None)
    f = Interpolation(x, one(x))
    at = np.linspace(0.0, 5.0, 4001)
    misses = [np.abs(np.array([g(u) for u in at]) - w(at)).max() for g, w in (
        (lambda u: f.value(u)[0], one), (lambda u: f.derivatives(u)[0, 0], one_slope))]  # fmt: skip
    for miss, stated in zip(misses, f.errors, strict=True):
        assert miss <= 3.0 * stated and stated <= 300.0 * miss
    assert_allclose([f.value(u)[0] for u in x], one(x), rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("n", [12, 40])
def test_two_variables_are_as_near_as_stated(n):
    x, y = grid(n, n + 3, np.random.default_rng(n))
    f = Interpolation((x, y), two(*np.meshgrid(x, y, indexing="ij")))
    rng = np.random.default_rng(1)
    at = np.stack([rng.uniform(0.0, 5.0, 3000), rng.uniform(-2.0, 3.0, 3000)], axis=1)
    found = np.array([[*f.value(*p), *f.derivatives(*p)[0]] for p in at])
    miss = np.abs(found - np.stack([two(*at.T), *two_slopes(*at.T)], axis=1)).max(axis=0)
    assert (miss <= 3.0 * np.array(f.errors)).all() and (np.array(f.errors) <= 300.0 * miss).all()


def test_cubics_are_exact_and_parabolas_through_three_nodes():
    x = np.array([0.0, 0.4, 1.1, 1.5, 2.7])
    cube = Interpolation(x, 2 * x**3 - x + 1)
    assert_allclose(cube.value(1.9), [2 * 1.9**3 - 1.9 + 1], rtol=1e-14)
    assert_allclose(cube.derivatives(1.9), [[6 * 1.9**2 - 1]], rtol=1e-14)
    few = Interpolation([0.0, 1.0, 3.0], [0.0, 1.0, 9.0])
    assert_allclose(few.value(2.0), [4.0], rtol=1e-15)
    line = Interpolation([1.0, 3.0], [1.0, 5.0])
    assert_allclose([*line.value(1.5), line.derivatives(2.5)[0, 0]], [2.0, 2.0], rtol=1e-15)
    y = np.array([-1.0, 0.0, 2.0, 2.5])
    both = Interpolation((x, y), np.outer(x**3 - x, y**3 + 1))
    assert_allclose(both.value(1.3, 1.1), [(1.3**3 - 1.3) * (1.1**3 + 1)], rtol=1e-13)
    assert_allclose(both.derivatives(1.3, 1.1), [[(3 * 1.3**2 - 1) * (1.1**3 + 1), (1.3**3 - 1.3) * 3 * 1.1**2]], rtol=1e-13)


def test_value_and_derivatives_are_continuous_and_derivatives_of_each_other():
    rng = np.random.default_rng(3)
    x, y = grid(9, 7, rng)
    f = Interpolation((x, y), rng.normal(size=(9, 7)))
    for u, v in [(x[3], 0.3), (1.1, y[2]), (x[4], y[4])]:
        e = 1e-9
        near = [np.append(f.value(u + s * e, v + r * e), f.derivatives(u + s * e, v + r * e)) for s in (-1, 1) for r in (-1, 1)]
        assert_allclose(near, [near[0]] * 4, atol=1e-6)
    for u, v in rng.uniform([0.1, -1.9], [4.9, 2.9], (20, 2)):
        h = 1e-5
        by = [(f.value(u + h, v)[0] - f.value(u - h, v)[0]) / (2 * h), (f.value(u, v + h)[0] - f.value(u, v - h)[0]) / (2 * h)]
        assert_allclose(f.derivatives(u, v)[0], by, atol=1e-7)


@pytest.mark.parametrize("partials", [False, True])
@pytest.mark.parametrize("variables", [1, 2])
@pytest.mark.parametrize("outside", ["refuse", "clamp"])
def test_lanes_have_the_same_bits_and_edges_hold_or_have_no_value(partials, variables, outside):
    rng = np.random.default_rng(7)
    x, y = grid(9, 6, rng)
    f = Interpolation(x, one(x), outside) if variables == 1 else Interpolation((x, y), rng.normal(size=(9, 6)), outside)
    at = rng.uniform([-1.0, -3.0], [6.0, 4.0], (64, 2))
    at[:9, 0], at[9:15, 1] = x, y
    at = at[:, :variables]
    with called(f.signature, partials=partials) as g:
        data = np.concatenate([np.full(16, np.nan), f.block()])
        single, lanes = g.one(at, data, 16), g.lanes(at, data, 16)
        none = g.one(np.full((8, variables), np.nan), data, 16)
    assert_array_equal(single, lanes)
    assert np.isnan(none).all()
    inside = ((at >= [x[0], y[0]][:variables]) & (at <= [x[-1], y[-1]][:variables])).all(axis=1)
    assert 10 < inside.sum() < 60
    for p, row, within in zip(at, single, inside, strict=True):
        if within or outside == "clamp":
            held = np.clip(p, [x[0], y[0]][:variables], [x[-1], y[-1]][:variables])
            wanted = [*f.value(*held), *(np.where(p == held, f.derivatives(*held)[0], 0.0) if partials else [])]
            assert_allclose(row, wanted, rtol=1e-13, atol=1e-14)
        else:
            assert np.isnan(row).all()
            with pytest.raises(ValueError, match=r"argument \d is .*; its nodes go from"):
                f.value(*p)


def test_it_runs_in_a_problem_and_other_nodes_compile_nothing():
    def problem(n, factor=1.0):
        t, h = np.linspace(-10.0, 20.0, n), np.linspace(-3.0, 5.0, n + 2)
        rho = pz.Interpolation((t, h), factor * two(*np.meshgrid(t, h, indexing="ij")), ["refuse", "clamp"])
        model = pz.Model(["x"], ["-0.1*rho(t, x)"], [pz.Sensor("s", ["x"])], functions={"rho": rho})
        return pz.Problem(model, pz.Gaussian([1.0], [0.1]), [1e-6], pz.Station("s", "s", 1e-4), functions={"rho": rho})

    a, b = problem(40), problem(60, 2.0)
    assert a.spec("transition", "rates") is b.spec("transition", "rates")
    assert_allclose(a.dynamics([0.7], 2.0), [-0.1 * two(2.0, 0.7)], atol=1e-3)
    assert_allclose(a.dynamics_jacobian([0.7], 2.0), [[-0.1 * two_slopes(2.0, 0.7)[1]]], atol=1e-2)
    tracking = pz.simulate(a, np.arange(0.0, 3.0, 0.1), np.random.default_rng(0))
    assert pz.FactorGraph().estimate(a, tracking).success
    assert copy.deepcopy(a.functions["rho"]).checksum == a.functions["rho"].checksum != b.functions["rho"].checksum
    with pytest.raises(ValueError, match="'rho' has values from t = -10 to 20 s, and t = 25 s is outside"):
        pz.simulate(a, [0.0, 25.0], np.random.default_rng(0))


def test_files(tmp_path):
    path = tmp_path / "rho.csv"
    path.write_text("t,thrust\n0,1\n1,3\n2,9\n")
    assert_allclose(Interpolation.read(path).value(1.0), [3.0])
    path.write_text("t,h,rho\n0,0,1\n1,0,2\n0,5,3\n1,5,4\n")
    f = Interpolation.read(path, outside="clamp")
    assert_allclose(f.value(1.0, 7.0), [4.0])
    for text, message in (
        ("0,0,1\n1,0,2\n0,5,3\n", "nodes of two variables are a whole grid, 2 by 2; there is none for 1, 5"),
        ("0,0,1\n1,0,2\n0,5,3\n1,5,4\n1,5,4\n", "there is two for one node"),
        ("0,0,1,2\n1,0,2,3\n", "a row has one or two variables and a value, not 4 numbers"),
        ("0,1\n1,nan\n", "rho.csv, line 2: values must be finite"),
    ):
        path.write_text(text)
        with pytest.raises(ValueError, match=message):
            Interpolation.read(path)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (([0.0, 1.0, 1.0], [0.0] * 3), "nodes of an interpolation must ascend; node 2 is 1 after 1"),
        ((([0.0, 1.0], [0.0, np.nan]), [[0.0] * 2] * 2), "interpolation, variable 2, must be finite; node 1 is not"),
        (([0.0, 1.0], [0.0] * 3), r"values of an interpolation have shape \(3,\); its nodes make \(2,\)"),
        (([0.0, 1.0], [0.0, np.inf]), "must be finite; that of node 1 is inf"),
        (([0.0, 1.0], ["a", 1]), "values of an interpolation must be made of numbers"),
        (([1.0], [1.0]), "must be two numbers or more"),
        (([0.0, 1.0], [0.0, 1.0], "hold"), "outside is 'hold'; it must be 'refuse' or 'clamp'"),
        (([0.0, 1.0], [0.0, 1.0], "refuse", 1e-3), "an error of 0.001: they are too few to tell an error"),
        ((np.arange(20.0), np.arange(20.0) % 2, "refuse", 1e-3), "an error of 0.001: they leave one of about"),
    ],
)
def test_bad_nodes_are_refused(given, message):
    with pytest.raises(ValueError, match=message):
        Interpolation(*given)
