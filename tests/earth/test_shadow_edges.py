"""Steps that end at the edges of the half-shadow, a day of low orbit: what they gain, against steps of a sixth."""

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth

pytestmark = pytest.mark.slow
EPOCH = pz.Epoch("2026-06-01T00:00:00 TT")
START = np.array([0.0, 6878e3, 0.0, -5831.6, 0.0, 4893.3])
TIMES = np.linspace(0.0, 86400.0, 289)


def orbit(step, edges):
    """Positions over a day."""
    forces = earth.Forces("EGM2008", degree=8, radiation="cannonball", tides=(), shadow_edges=edges)
    problem = pz.Problem(
        forces.model(),
        pz.Gaussian(START, np.ones(6)),
        [0.0] * 6,
        parameters={**forces.values, "cr_a_m": 0.02},
        integrator=pz.RungeKutta8(max_step=step),
        functions=forces.functions(EPOCH),
        epoch=EPOCH,
    )
    return problem.arc(TIMES, START).x[:, :3]


def test_a_day_of_low_orbit():
    truth = orbit(10.0, True)

    def off(step, edges):
        return np.linalg.norm(orbit(step, edges) - truth, axis=1).max()

    assert off(60.0, True) < 0.3e-3
    assert off(60.0, False) > 30 * off(60.0, True)


def test_the_option_is_events_of_the_model_where_there_is_a_shadow():
    forces = earth.Forces(degree=4, radiation="cannonball", shadow_edges=True)
    assert forces.model().events == (("sunlit", "sunlit"), ("half_lit", "half_lit"))
    assert earth.Forces(degree=4, shadow_edges=True).model().events == ()
    assert earth.Forces(degree=4, radiation="cannonball", shadows=(), shadow_edges=True).model().events == ()
    assert earth.Forces(degree=4, radiation="cannonball").model().events == ()
