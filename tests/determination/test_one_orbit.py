"""An orbit is the same one however it is asked for, within a millimetre: edges of shadows lie within steps of any grid."""

from dataclasses import replace

import numpy as np

import piazzi as pz
from piazzi.determination.approach import approached
from piazzi.determination.course import course_of
from piazzi.determination.determining import prepared, solved
from piazzi.determination.fit import estimators
from piazzi.evaluate.information import predicted
from piazzi.problem.inputs import prepare
from tests.determination.fixing import observations, truth
from tests.determination.lasers import SIGMA, twelve_passes


def test_an_ephemeris_is_the_orbit_and_the_answer():
    given = twelve_passes()
    z = predicted(given.problem, prepare(given.problem, given.tracking), given.states)
    z += SIGMA * np.random.default_rng(5).standard_normal(z.shape)
    tracking = given.tracking
    measured = pz.Tracking(tracking.row_times, z, tracking.row_stations, epoch=tracking.epoch)
    found = solved(approached(replace(given, tracking=measured)), estimators(("graph",)))
    written = found.ephemeris(span="first .. last+12h", step=60.0)
    course = course_of(written, found.epoch)
    answer = course.beliefs(np.array([found.epoch - course.epoch]))[0][0]
    index = found.setup.solution
    np.testing.assert_allclose(answer[:3], found.estimate.mean[index, :3], rtol=0, atol=1e-3)
    (arc,) = written.arcs
    for k in range(0, len(arc.t), 97):
        alone = found.orbit.at(arc.epoch + float(arc.t[k]))
        np.testing.assert_allclose(arc.position[k], alone[:3], rtol=0, atol=1e-3)
        np.testing.assert_allclose(arc.velocity[k], alone[3:], rtol=0, atol=1e-6)
        P, own = arc.covariance[k], found.orbit.covariance(arc.epoch + float(arc.t[k]))
        scale = np.sqrt(np.diag(own))
        np.testing.assert_allclose(P / np.outer(scale, scale), own / np.outer(scale, scale), rtol=0, atol=1e-3)


def test_an_orbit_is_looked_for_where_forces_vary_by_chance():
    """Without a guess: the search is of the forces without the process, which the problem has."""
    t = np.arange(0.0, 7200.0, 600.0)
    made = prepared(observations(truth(t)[:, :3], t, 5.0), estimate="along~3h=1e-9m/s^2")
    assert len(made.problem.model.states) == 7
    np.testing.assert_allclose(made.states[0, :3], truth(t)[0, :3], rtol=0, atol=1e3)
