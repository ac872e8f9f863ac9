"""A field and a table within a problem: the same compiled kernels whatever the degree, the span and the switch."""

import numpy as np
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth, kernels

TIMES = np.arange(0.0, 7200.0, 60.0)
PUSH = pz.Table(TIMES, 1e-6 * np.stack([np.cos(1e-3 * TIMES), np.sin(1e-3 * TIMES), 0.0 * TIMES], axis=1))


def problem(field, push=PUSH):
    model = pz.Model(
        ["x", "y", "z", "vx", "vy", "vz"],
        ["vx", "vy", "vz", "gx + px", "gy + py", "gz + pz"],
        [pz.Sensor("place", ["x", "y", "z"])],
        functions={"field": earth.Gravity.signature, "push": push.signature},
        definitions={("gx", "gy", "gz"): "field(x, y, z)", ("px", "py", "pz"): "push(t)"},
    )
    return pz.Problem(
        model,
        pz.Gaussian.from_sigma([7e6, 0.0, 0.0, 0.0, 5e3, 5.5e3], [100.0] * 3 + [0.1] * 3),
        pz.ProcessNoise([0.0, 0.0, 0.0, 1e-6, 1e-6, 1e-6], per="step"),
        [pz.Station("s", sensor="place", noise=[10.0] * 3)],
        {},
        pz.RungeKutta4(1),
        functions={"field": field, "push": push},
    )


def test_another_degree_compiles_nothing_and_moves_the_orbit():
    one = problem(earth.Gravity(degree=2))
    tracking = pz.simulate(one, np.arange(20) * 30.0, np.random.default_rng(0))
    ekf = pz.ExtendedKalmanFilter()
    means = [ekf.estimate(one, tracking).mean]
    spent = kernels.build_seconds()
    for field in (earth.Gravity(degree=20), earth.Gravity(degree=20, gradient_degree=2), earth.Gravity(degree=70)):
        other = problem(field, pz.Table(TIMES + 10.0 - 60.0, PUSH.values))
        means.append(ekf.estimate(other, tracking).mean)
    assert kernels.build_seconds() - spent < 1.0, "it was compiled again"
    assert_allclose(means[1], means[3], rtol=0, atol=1.0)
    assert np.abs(means[0] - means[1]).max() > 1e-3
