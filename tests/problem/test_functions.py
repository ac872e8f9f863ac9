"""The model's functions on one state or many: shapes, and what is refused."""

import numpy as np
import pytest

import piazzi as pz
from tests.laws.problems import b612, network


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def test_shapes():
    problem = network(np.random.default_rng(0))
    one, many = problem.mean, np.tile(problem.mean, (5, 1))
    for x, K in ((one, ()), (many, (5,))):
        assert problem.dynamics(x).shape == (*K, 4)
        assert problem.dynamics_jacobian(x).shape == (*K, 4, 4)
        assert problem.step(x, 0.1)[0].shape == (*K, 4)
        assert problem.step(x, 0.1)[1].shape == (*K, 4, 4)
        for station, m in (("north", 2), ("south", 3), ("east", 1)):
            assert problem.measure(station, x).shape == (*K, m)
            assert problem.measurement_jacobian(station, x).shape == (*K, m, 4)


def test_views_lists_and_integers_are_states():
    problem = b612()
    wide = np.arange(1.0, 17.0).reshape(2, 8)
    np.testing.assert_array_equal(problem.dynamics(wide[:, ::2]), problem.dynamics(np.ascontiguousarray(wide[:, ::2])))
    np.testing.assert_array_equal(problem.dynamics([12, 0, 0, 9]), problem.dynamics(problem.mean))


def test_given_states_are_not_changed():
    problem, x = b612(), np.array([12.0, 0.0, 0.0, 9.0])
    problem.step(x, 0.1)
    np.testing.assert_array_equal(x, [12.0, 0.0, 0.0, 9.0])


def test_wrong_shapes_and_names():
    problem = b612()
    with pytest.raises(ValueError, match=r"state has shape \(3,\); it must be \(4,\) or \(K, 4\) \(x, y, vx, vy\)"):
        problem.dynamics(np.zeros(3))
    with pytest.raises(ValueError, match="state has shape"):
        problem.measure("radar", np.zeros((1, 1, 4)))
    with pytest.raises(ValueError, match="unknown station 'rdar'; did you mean 'radar'"):
        problem.measure("rdar", problem.mean)
    with pytest.raises(ValueError, match="state is not made of real numbers"):
        problem.step(["a"] * 4, 0.1)
    with pytest.raises(ValueError, match=r"time has shape \(2,\); it must be one number or \(3,\)"):
        problem.dynamics(np.ones((3, 4)), np.zeros(2))
    for dt in (np.nan, np.inf):
        with pytest.raises(ValueError, match="dt is"):
            problem.step(problem.mean, dt)


def test_steps_go_back_in_time_too():
    problem = b612(integrator=pz.RungeKutta4(50))
    there, _ = problem.step(problem.mean, 0.5)
    back, _ = problem.step(there, -0.5, 0.5)
    np.testing.assert_allclose(back, problem.mean, atol=1e-7)


def test_a_discrete_model_has_no_rates():
    problem = pz.Problem(pz.Model(["x"], ["x + dt"], discrete=True), pz.Gaussian(0.0, 1.0))
    with pytest.raises(ValueError, match="the model is a step, x\\[k\\+1\\], and has no rates: use step"):
        problem.dynamics([1.0])
    assert problem.step([1.0], 0.5)[0] == pytest.approx([1.5])


def test_singular_states_give_infinity_or_nan_but_no_error():
    assert not np.isfinite(b612().dynamics(np.zeros(4))).all()
    assert not np.isfinite(b612().measurement_jacobian("radar", [10.0, 0, 0, 0])).all()
