"""Copies of everything public: equal, as immutable as what they are of, and of their own."""

import copy
import inspect
import pickle
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from tests.determination.fixing import observations as fixes

HOW = {"copy": copy.copy, "deepcopy": copy.deepcopy, "pickle": lambda value: pickle.loads(pickle.dumps(value))}
LIVE = {
    "ekf": pz.ExtendedKalmanFilter(),
    "components": pz.ExtendedKalmanFilter(update="components"),
    "gate": pz.ExtendedKalmanFilter(gate=0.999, iterations=2),
    "ukf": pz.UnscentedKalmanFilter(),
    "srekf": pz.SquareRootKalmanFilter(gate=0.999),
    "window": pz.SlidingWindow(lag=4),
    "loss": pz.SlidingWindow(lag_seconds=0.9, loss="huber"),
}


@pytest.fixture(autouse=True)
def plain(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def radar():
    model = pz.Model(["x", "v"], ["v", "-x"], [pz.Sensor("range", ["sqrt((x - a)**2 + 1)"])])
    stations = [pz.Station(name, "range", 0.01, {"a": a}) for name, a in (("east", 3), ("west", -3))]
    return pz.Problem(model, pz.Gaussian([1, 0], np.eye(2)), pz.ProcessNoise([0, 0.01]), stations)


def tracking_of(problem):
    return pz.simulate(problem, np.cumsum(np.random.default_rng(3).uniform(0.1, 0.4, 12)), np.random.default_rng(4))


def observations():
    epoch, segment = pz.Epoch("2020-01-01 UTC"), pz.formats.Segment("UTC", corrections=(pz.formats.Correction("range", 1.0),))
    return pz.Observations(
        epoch=epoch, t=[0.0, 1.0], value=[1.0, 2.0], kinds=("range",), kind=0, segments=(segment,), participants=("A",),
        sigma=[1.0, np.nan], extra={"catalogue": np.array(["U", "V"]), "band": np.array("r")}, place=0,
        places=[[1.0, 2.0, 3.0]],
    )  # fmt: skip


def arc():
    return pz.formats.Arc(
        epoch=pz.Epoch("2020-01-01 UTC"), t=[0.0, 1.0], position=np.ones((2, 3)), covariance_frames=("RTN",),
        covariance_t=[0.0], covariance=np.eye(6)[None], frame="GCRF",
    )  # fmt: skip


def determined():
    """Of four exact fixes of a circle, by two-body motion."""
    t = np.array([0.0, 300.0, 600.0, 900.0])
    a = t * np.sqrt(3.986004415e14 / 7e6**3)
    place = 7e6 * np.stack([np.cos(a), np.sin(a), 0.0 * a], -1)
    return pz.determine(fixes(place, t, 1.0), forces="none")


def samples():
    """One of every public class, by its name."""
    problem = radar()
    tracking = tracking_of(problem)
    estimate = pz.SlidingWindow(lag=4).estimate(problem, tracking)
    prediction = pz.predict(problem, problem.prior, 0.0, 1.0)
    settings = [
        pz.BatchLeastSquares(),
        pz.ExtendedKalmanFilter(gate=0.99),
        pz.FactorGraph(start=pz.Bank()),
        pz.SlidingWindow(lag=3),
    ]
    settings += [
        pz.Smoother(),
        pz.SquareRootKalmanFilter(),
        pz.UnscentedKalmanFilter(),
        pz.Bank(),
        pz.Cauchy(),
        pz.Huber(),
        pz.Tukey(),
    ]
    settings += [pz.Schedule(every=10.0), pz.passes(problem, tracking)[0]]
    steps = [
        pz.Discrete(),
        pz.DormandPrince(),
        pz.DormandPrince5(),
        pz.Euler(),
        pz.Heun(),
        pz.Kepler(),
        pz.Midpoint(),
        pz.Ralston(),
    ]
    steps += [pz.RungeKutta([[0, 0], [1, 0]], [0.5, 0.5]), pz.RungeKutta4(), pz.RungeKutta8(), pz.Taylor()]
    steps += [pz.GaussJackson()]
    sessions = [
        pz.ExtendedKalmanFilter().start(problem),
        pz.UnscentedKalmanFilter().start(problem),
        pz.SlidingWindow().start(problem),
    ]
    parts = [problem.model, problem.prior, problem.process_noise, problem.stations[0], problem.model.sensors[0]]
    others = [pz.Manoeuvre(1.0, [1.0, 0.0], 0.1), pz.Parameter("mu"), pz.Truth([1.0, 0.0]), pz.Epoch("2020-01-01 UTC")]
    others += [observations(), pz.Ephemeris(arcs=(arc(),)), pz.Table([0.0, 1.0, 2.0], [0.0, 1.0, 0.5])]
    results = [estimate, estimate.predict([9.0]), pz.compare(problem, tracking, {"ekf": settings[1]}), prediction]
    results += [pz.observability(problem, tracking), pz.windows(problem, tracking, [2, 3])]
    results += [pz.update(problem, prediction, "east", [3.0]), pz.Study.of("b612-range", runs=2)]
    thrust = "def thrust(t):\n    return (2.0 * t,)\n\n\ndef thrust_partials(t):\n    return (2.0 * t, 2.0)\n"
    others += [pz.Interpolation([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 0.5, 0.2]), pz.InitialOrbits((), 0, 0), pz.Estimated("cr")]
    others += [pz.Function(thrust, arguments=1)]
    results += [pz.propagate(problem, [10.0, 11.0]), determined(), pz.Following()]
    found = [problem, tracking, *settings, *steps, *sessions, *parts, *others, *results]
    return {type(value).__name__: value for value in found}


@pytest.fixture(scope="module")
def every():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        return samples()


# an alias is no class of its own
PUBLIC = [name for name in pz.__all__ if inspect.isclass(getattr(pz, name)) and getattr(pz, name).__name__ == name]


@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("name", [name for name in PUBLIC if name not in ("Integrator", "progress")])  # a protocol; a terminal
def test_everything_public_has_copies(every, name, how):
    value = every[name]
    check_same(value, HOW[how](value), name)


def check_same(one, other, where):
    assert type(one) is type(other), where
    if isinstance(one, np.ndarray):
        assert_array_equal(one, other, err_msg=where)
        assert one.dtype == other.dtype, where
        assert other.flags.writeable <= one.flags.writeable, f"{where} has become writable"
    elif is_dataclass(one):
        for field in fields(one):
            check_same(getattr(one, field.name), getattr(other, field.name), f"{where}.{field.name}")
    elif isinstance(one, Mapping):
        assert list(one) == list(other), where
        for key, value in one.items():
            check_same(value, other[key], f"{where}[{key!r}]")
    elif isinstance(one, (list, tuple)):
        assert len(one) == len(other), where
        for i, (a, b) in enumerate(zip(one, other, strict=True)):
            check_same(a, b, f"{where}[{i}]")
    elif isinstance(one, (str, int, float, bool, type(None))):
        assert one == other or np.isnan([one, other]).all(), where


@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("name", LIVE)
def test_a_copy_of_a_live_estimate_goes_on_by_itself(name, how):
    """To the bits of a session that was never copied; and what it is a copy of stays where it was, and goes on likewise."""
    problem = radar()
    tracking = tracking_of(problem)
    rows = [(str(s), z, float(t)) for s, z, t in zip(tracking.row_stations, tracking.values, tracking.row_times, strict=True)]
    for cut in (0, 1, 12, 13):  # before the first, in the middle of an epoch, and after it
        alone, original = LIVE[name].start(problem), LIVE[name].start(problem)
        for row in rows[:cut]:
            alone.update(*row)
            original.update(*row)
        before = shown(original)
        other = HOW[how](original)
        check_same(before, shown(other), name)
        for row in rows[cut:]:
            other.update(*row)
        check_same(before, shown(original), name)
        for row in rows[cut:]:
            alone.update(*row)
            original.update(*row)
        check_same(shown(alone), shown(other), name)
        check_same(shown(alone), shown(original), name)
        other.predict(9.0)
        alone.predict(9.0)
        check_same(shown(alone), shown(other), name)


def shown(session):
    names = (
        "time",
        "mean",
        "covariance",
        "innovation",
        "innovation_covariance",
        "rejected",
        "refused",
        "times",
        "means",
        "success",
    )
    return {name: copy.deepcopy(getattr(session, name)) for name in names if hasattr(session, name)}


@pytest.mark.parametrize("how", HOW)
def test_what_a_window_refused_is_its_own(how):
    live = pz.SlidingWindow(lag=2).start(radar())
    for t in (1.0, 2.0, 3.0):
        live.update("east", 3.0, t)
    assert live.update("east", 3.0, 0.5) is False
    other = HOW[how](live)
    assert other.refused == [(0.5, "east")]
    assert other.update("west", 3.0, 0.25) is False
    assert live.refused == [(0.5, "east")]


@pytest.mark.parametrize("how", HOW)
@pytest.mark.parametrize("name", LIVE)
def test_a_live_estimate_that_cannot_be_used_has_copies_too(name, how):
    """Though it has no checkpoint."""
    problem = pz.Problem(
        pz.Model(["x"], ["x**3"], [pz.Sensor("s", ["x"])]), pz.Gaussian([1], [1]), stations=[pz.Station("a", "s", 1)]
    )
    live = LIVE[name].start(problem)
    for t in range(4):
        live.update("a", 1.0 + t, float(t))
    assert not live.success
    other = HOW[how](live)
    assert other.message == live.message != ""
    assert_array_equal(other.mean, live.mean)
