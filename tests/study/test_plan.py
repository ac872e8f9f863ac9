"""What a study is: its grid, its names, its specification."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.study import Study
from piazzi.study.variations import problems_at
from tests.laws.problems import b612, satellite
from tests.study.studies import small


def test_points_are_the_product_of_the_axes_of_the_problem():
    study = small(vary={"R.scale": [1, 4], "Q.scale": ["0.5", "2", "8"]})
    assert study.points == 6
    assert [study.point(i) for i in range(6)] == [(r, q) for r in (1, 4) for q in (0.5, 2, 8)]
    assert study.estimates == 6 * 24 * 2


def test_settings_are_varied_for_the_estimators_that_have_them():
    study = small(estimators=("ekf", "window", "graph"), vary={"lag": [5, 10], "R.scale": [1, 2]})
    assert list(study.variants) == ["ekf", "window:5", "window:10", "graph"]
    assert study.variants["window:10"] == pz.SlidingWindow(lag=10)
    assert study.points == 2
    both = small(estimators=("iekf",), vary={"iterations": [2, 3], "gate": [0.99]})
    assert list(both.variants) == ["iekf:iterations=2:gate=0.99", "iekf:iterations=3:gate=0.99"]


def test_rows_have_every_view():
    assert small().rows == (("ekf", "realtime"), ("window:5", "realtime"), ("window:5", "delayed"))


@pytest.mark.parametrize(
    ("axis", "world", "assumed"),
    [("R.scale", 4, 4), ("assumed.R.scale", 1, 4), ("truth.R.scale", 4, 1), ("R.earth.scale", 4, 4)],
)
def test_scopes(axis, world, assumed):
    problem = satellite()
    study = Study(problem, np.arange(9) * 15.0, ["ekf"], vary={axis: [4]})
    R = problem.stations[0].noise
    assert_array_equal(study.problems(0)[0].stations[0].noise, world * R)
    assert_array_equal(study.problems(0)[1].stations[0].noise, assumed * R)


def test_what_happens_keeps_its_own_noise_and_parameters_in_step():
    problem = satellite(truth=pz.Truth(parameters={"mu": 3.9e14}, process_noise=pz.ProcessNoise([1.0, 2, 3, 4], "step")))
    study = Study(problem, [0.0, 15.0], ["ekf"], vary={"Q.scale": [3.0], "mu": [4e14], "P.scale": [0.25], "substeps": [30]})
    for found in study.problems(0):
        assert_array_equal(found.truth.process_noise.covariance, [3.0, 6, 9, 12])
        assert found.truth.parameters == {"mu": 4e14}
        assert found.parameters["mu"] == 4e14
        assert_array_equal(found.process_noise.covariance, 3 * problem.process_noise.covariance)
        assert_array_equal(found.prior.covariance, problem.prior.covariance / 4)
        assert found.integrator == pz.Taylor(30)


@pytest.mark.parametrize(
    ("vary", "message"),
    [
        ({"R.scal": [1]}, "nothing here is called 'R.scal', so it cannot be varied; did you mean 'R.scale'?"),
        ({"lga": [1]}, "did you mean 'lag'?"),
        ({"assumed.lag": [1]}, "'assumed.lag'"),
        ({"truth.truth.R.scale": [1]}, "cannot be varied"),
        ({"R.scale": []}, "over no values"),
        ({"R.scale": [1, 1.0]}, "takes the value 1.0 twice"),
        ({"R.scale": ["nan"]}, "value 0 of R.scale is nan"),
        ({"R.scale": [-1]}, "R.scale = -1: a scale must be positive"),
        ({"Q.scale": [-1]}, "Q.scale = -1"),
        ({"R.scale": ["small"]}, "R.scale is 'small'; it must be a number"),
        ({"substeps": [0]}, "substeps = 0"),
        ({"lag": [0]}, "SlidingWindow with lag = 0"),
        ({"lag": ["long"]}, "SlidingWindow with lag = long"),
        ({"mu": [float("inf")]}, "value 0 of mu is inf"),
    ],
)
def test_refusals_name_the_value(vary, message):
    with pytest.raises(ValueError, match=r"\A[^\n]*\Z") as caught:
        small(vary=vary)
    assert message in str(caught.value)


def test_a_grid_of_millions_says_how_many_before_it_starts():
    vary = {name: list(np.linspace(1, 2, 200)) for name in ("R.scale", "Q.scale", "P.scale")}
    with pytest.raises(ValueError, match=r"200 x 200 x 200 has 8,000,000 points, with 24 runs of 2 estimators 384,000,000"):
        small(vary=vary)


@pytest.mark.parametrize(
    ("change", "message"), [({"runs": 0}, "runs is 0"), ({"seed": -1}, "seed is -1"), ({"runs": 1.5}, "1.5")]
)
def test_numbers_that_are_none(change, message):
    with pytest.raises(ValueError, match=message):
        small(**change)


def test_unknown_estimators_rules_and_times_are_refused_at_once():
    with pytest.raises(ValueError, match="unknown estimator 'efk'"):
        small(estimators=("efk",))
    with pytest.raises(ValueError, match="no estimators"):
        small(estimators=())
    with pytest.raises(ValueError, match="unknown name 'z'"):
        small(problem=b612(truth=pz.Truth(accept=["z"])))
    with pytest.raises(ValueError, match="times must increase"):
        Study(b612(), [0.0, 0.0], ["ekf"])


def test_specification_tells_studies_apart():
    one = small()
    assert one.digest == small().digest
    others = [
        small(runs=25), small(seed=1), small(estimators=("ekf",)), small(vary={"R.scale": [1]}), small(problem=b612()),
        small(epochs=31), small(estimators={"ekf": "iekf", "window:5": "window:5"}), small(name="other"),
        small(problem=b612(truth=pz.Truth(accept=["x"]))),
    ]  # fmt: skip
    assert len({one.digest, *(o.digest for o in others)}) == 1 + len(others)


def test_a_study_travels_to_workers():
    study = small(vary={"R.scale": [1, 2]})
    again = pickle.loads(pickle.dumps(study))
    assert again.digest == study.digest
    assert again.variants == study.variants


def test_study_of_a_scenario_follows_it_unless_told_otherwise():
    study = Study.of("founding-study-mismatched", runs=3)
    assert (study.runs, study.points) == (3, 4)
    assert [axis.name for axis in study.axes] == ["assumed.Q.scale"]
    assert len(study.variants) == 9
    assert list(Study.of("b612-range").variants) == ["ekf"]


def test_values_are_put_in_whatever_the_order_of_axes():
    study = small(vary={"assumed.mu": [900.0], "truth.mu": [1100.0]})
    world, assumed = problems_at(study.problem, study.axes, (900.0, 1100.0))
    assert (world.parameters["mu"], assumed.parameters["mu"]) == (1100.0, 900.0)


def test_windows_that_differ_in_more_than_their_length_keep_their_names():
    study = pz.Study.of("b612-range", runs=4, estimators=["window:100", "window:100:huber"], vary={"lag": [10, 20]})
    assert [(label, e.lag, e.loss is None) for label, e in study.variants.items()] == [
        ("window:10", 10, True),
        ("window:20", 20, True),
        ("window:100:huber:lag=10", 10, False),
        ("window:100:huber:lag=20", 20, False),
    ]
    with pytest.raises(ValueError, match="length in seconds"):
        pz.Study.of("b612-range", runs=4, estimators=["window:3s"], vary={"lag": [5, 20]})


def test_huge_axes_are_counted_at_once():
    with pytest.raises(ValueError, match="1,000,000 points"):
        pz.Study.of("b612-range", runs=4, vary={"R.scale": [1.0 + 1e-6 * i for i in range(1_000_000)]})
    with pytest.raises(ValueError, match="estimates are allowed"):
        lags, iterations = list(range(1, 100_001)), list(range(1, 100_001))
        pz.Study.of("b612-range", runs=4, estimators=["window:5"], vary={"lag": lags, "iterations": iterations})
