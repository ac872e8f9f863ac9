"""Another date, span, field, degree, step, or set of forces compiles nothing: counted in compilations, and in files."""

import logging
from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.kernels import cache, folder

STATES = ["x", "y", "z", "vx", "vy", "vz"]
OWN = """
def drag(x, y, z, data, at):
    return (-data[at]*math.exp((7e6 - math.sqrt(x*x + y*y + z*z))/data[at + 1]),)


def drag_partials(x, y, z, data, at):
    r = math.sqrt(x*x + y*y + z*z)
    f = -data[at]*math.exp((7e6 - r)/data[at + 1])
    k = -f/(data[at + 1]*r)
    return f, k*x, k*y, k*z
"""


def problem(epoch="2016-02-13T16:00:00 UTC", degree=8, step=30.0, switches=1.0, field="EGM2008", data=(1e-9, 5e4), start=0.0):
    """A satellite under a field, the Sun, sunlight and drag of one's own; a start is the time of its prior."""
    forces = earth.Forces(gravity=field, degree=degree, radiation="cannonball", tides=(), relativity=False, bodies=("sun",))
    functions = forces.functions(epoch) | {"drag": pz.Function(OWN, 3, data=data)}
    dynamics = dict(forces.dynamics)
    dynamics |= {name: f"{dynamics[name]} + drag(x, y, z)*{name}" for name in ("vx", "vy", "vz")}
    model = pz.Model(
        STATES,
        dynamics,
        [pz.Sensor("place", ["x", "y", "z"])],
        list(forces.parameters),
        definitions=forces.definitions,
        functions=functions,
    )
    values = {name: (switches if name.endswith("_on") else value) for name, value in forces.values.items()}
    return pz.Problem(
        model,
        pz.Gaussian([7e6, 0.0, 0.0, 0.0, 5.3e3, 5.3e3], [1e4] * 3 + [1.0] * 3),
        [0.0] * 3 + [1e-9] * 3,
        pz.Station("place", "place", [25.0] * 3),
        {"cr_a_m": 0.02, **values},
        pz.RungeKutta4(max_step=step),
        start,
        epoch=epoch,
        functions=functions,
    )


def run(p, count=6, every=60.0):
    start = p.prior_time
    tracking = pz.simulate(p, start + every * np.arange(1, count), np.random.default_rng(0))
    found = pz.ExtendedKalmanFilter().estimate(p, tracking)
    assert found.success, found.message
    return found


@pytest.mark.slow
def test_only_another_model_compiles(tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("PIAZZI_CACHE", str(tmp_path))
    monkeypatch.delenv("PIAZZI_JIT", raising=False)
    monkeypatch.setattr(cache, "_loaded", {})  # kernels of algebra serve other tests of the same sizes
    for remembered in (folder.private_folder, folder.writable_folder):
        remembered.cache_clear()
    try:
        with caplog.at_level(logging.INFO, "piazzi.kernels"):
            first = run(problem())
            made = len(caplog.records)
            files = sorted(tmp_path.rglob("*"))
            assert made and files
            others = {
                "date": problem(epoch="2019-07-01T00:00:00 UTC"),
                "start": problem(start=86400.0 * 3),
                "degree": problem(degree=40),
                "field": problem(field=_field()),
                "step": problem(step=7.0),
                "switches": problem(switches=0.0),
                "data": problem(data=(2e-9, 6e4)),
            }
            means = {what: run(p).mean for what, p in others.items()}
            run(problem(), count=60, every=600.0)  # a span of another day
            run(replace(problem(), prior=pz.Gaussian([7.1e6, 0.0, 0.0, 0.0, 5.2e3, 5.3e3], [1e4] * 3 + [1.0] * 3)))
            assert len(caplog.records) == made, [r.getMessage() for r in caplog.records[made:]]
            assert sorted(tmp_path.rglob("*")) == files
            assert all(np.abs(mean - first.mean).max() > 0.0 for mean in means.values()), "the data are not used"
            edited = problem()
            own = pz.Function(OWN.replace("7e6", "6.9e6"), 3, data=(1e-9, 5e4))
            functions = dict(edited.functions) | {"drag": own}
            model = replace(edited.model, functions=functions)
            run(replace(edited, model=model, functions=functions))
            assert len(caplog.records) > made
    finally:
        for remembered in (folder.private_folder, folder.writable_folder):
            remembered.cache_clear()


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    """Compiled mode, with nothing compiled before."""
    monkeypatch.setenv("PIAZZI_CACHE", str(tmp_path))
    monkeypatch.delenv("PIAZZI_JIT", raising=False)
    for remembered in (folder.private_folder, folder.writable_folder):
        remembered.cache_clear()
    yield tmp_path
    for remembered in (folder.private_folder, folder.writable_folder):
        remembered.cache_clear()


def edited(own, sensor="place"):
    """The problem with a drag of this text, and a sensor of this name."""
    p = problem()
    functions = dict(p.functions) | {"drag": pz.Function(own, 3, data=(1e-9, 5e4))}
    model = replace(p.model, functions=functions, sensors=[pz.Sensor(sensor, ["x", "y", "z"])])
    return replace(p, model=model, functions=functions, stations=[pz.Station("place", sensor, [25.0] * 3)])


@pytest.mark.slow
def test_an_edit_of_a_force_compiles_the_motion_once_for_all_estimators_and_nothing_of_theirs(empty_cache, caplog):
    def compiled(p, *estimators):
        tracking = pz.Tracking(times, np.tile(p.prior.mean[:3], (len(times), 1)), ["place"] * len(times))
        with caplog.at_level(logging.INFO, "piazzi.kernels"):
            caplog.clear()
            for estimator in estimators:
                estimator.estimate(p, tracking)
        return sorted(record.getMessage().split()[1] for record in caplog.records)

    times = 30.0 * np.arange(1.0, 40.0)
    ekf, smoother, graph = pz.ExtendedKalmanFilter(), pz.Smoother(), pz.FactorGraph(max_iterations=1)
    one = edited(OWN.replace("7e6", "6.8e6"))
    assert compiled(one, ekf) == ["advance", "filter", "innovate"]
    assert compiled(one, ekf, smoother) == ["smoother"]  # which is its algebra only
    another = edited(OWN.replace("7e6", "6.9e6"))
    assert compiled(another, ekf, smoother) == ["advance"]
    assert compiled(another, ekf, smoother) == []
    assert {"advance", "innovate"}.isdisjoint(compiled(another, graph))
    assert compiled(edited(OWN.replace("7e6", "6.9e6"), sensor="fix"), ekf) == ["innovate"]  # another sensor, the same motion


@pytest.mark.parametrize("lanes", [1, 8])
def test_sigma_points_are_moved_by_a_unit_in_any_number_of_lanes(lanes, monkeypatch):
    monkeypatch.setattr("piazzi.estimate.root.machine_lanes", lambda: lanes)
    calls = pz.UnscentedKalmanFilter().root(problem()).spec(problem()).parts("compiled")[1]
    assert calls == ["advance", "measure_into", "innovate", "propagate_lanes"]


def _field():
    """A field of another name and radius."""
    from piazzi.earth.fields import gravity_field

    return replace(gravity_field("EGM2008"), name="other", radius=6378137.0)
