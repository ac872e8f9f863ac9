"""Pieces of a study: scored as `compare` scores single runs, alike in any company, with rows for what fails."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.evaluate import evaluate
from piazzi.evaluate.bounds import posterior_bounds
from piazzi.simulation import true_problem
from piazzi.study import Study
from piazzi.study.bound import bound_at
from piazzi.study.pieces import run_task
from piazzi.study.plan import MOST_EPOCHS
from piazzi.study.runs import simulated
from piazzi.study.score import NUMBERS
from piazzi.study.tasks import Task
from tests.laws.problems import b612, satellite
from tests.study.estimators import Refusing
from tests.study.studies import drawn_truth, small


def assert_equals_compare(study, piece, runs):
    """Every number of a piece against `evaluate` of the same estimators on the same tracking."""
    for i, run in enumerate(piece.task.runs):
        for label, estimator in study.variants.items():
            estimate = estimator.estimate(runs.assumed, runs.tracking(i))
            for found in (e for e in (estimate, estimate.delayed) if e is not None):
                row, r = evaluate(label, found), study.rows.index((label, found.view))
                numbers = {name: piece.arrays[name][r, i] for name in NUMBERS}
                for name in ("rmse", "rmse_last_half"):
                    assert_allclose(numbers[name], list(getattr(row, name).values()), rtol=1e-7, err_msg=f"{label} {run}")
                for name in ("mean_nees", "mean_nees_last_half", "mean_nis"):
                    assert_allclose(numbers[name], getattr(row, name), rtol=1e-6, err_msg=f"{label} {run}")
                assert bool(piece.arrays["success"][r, i]) == row.success
                assert bool(piece.arrays["diverged"][r, i]) == row.diverged
                error = (found.mean - found.tracking.truth)[study.kept]
                lengths = [np.sqrt((error[:, list(c)] ** 2).sum(axis=1)) for c in study.groups.values()]
                assert_allclose(piece.arrays["error"][r, i], np.transpose(lengths), rtol=1e-5)


def test_numbers_are_those_of_compare():
    study = small(vary={"truth.Q.scale": [1, 100]})
    for point in (0, 1):
        task = Task(point, 3, 6)
        assert_equals_compare(study, run_task(study, task), simulated(study, task))


def test_divergence_is_that_of_compare():
    """A filter that believes in no process noise where there is much: some of these runs diverge, some do not."""
    study = Study(b612((0, 0, 1.0, 1.0), truth=None), np.arange(40) * 0.1, ["ekf"], 40, vary={"assumed.Q.scale": [0.01]})
    task = Task(0, 0, 40)
    piece = run_task(study, task)
    assert 0 < piece.arrays["diverged"].sum() < 40
    assert_equals_compare(study, piece, simulated(study, task))


@pytest.mark.parametrize("count", [1, 5, 9])
def test_a_run_has_the_same_bits_in_any_company(count):
    study = small(problem=drawn_truth())
    whole, part = run_task(study, Task(0, 0, 24)), run_task(study, Task(0, 11, count))
    for name in set(whole.arrays) - {"seconds"}:
        assert_array_equal(part.arrays[name], whole.arrays[name][:, 11 : 11 + count], err_msg=name)


def test_memory_is_cut_into_blocks_without_a_trace(monkeypatch):
    study = small()
    whole = run_task(study, Task(0, 0, 24))
    monkeypatch.setattr(Study, "largest_piece", 7)
    cut = run_task(study, Task(0, 0, 24))
    for name in set(whole.arrays) - {"seconds"}:
        assert_array_equal(cut.arrays[name], whole.arrays[name], err_msg=name)


def test_an_estimator_that_raises_has_a_row_that_says_so():
    study = small(estimators={"ekf": "ekf", "refusing": Refusing(1.5)})
    piece = run_task(study, Task(0, 0, 24))
    z = simulated(study, Task(0, 0, 24)).z[:, 0, 0]
    refused = z > 1.5
    assert 0 < refused.sum() < 24
    assert_array_equal(piece.arrays["success"], [np.ones(24), ~refused])
    assert_array_equal(np.isnan(piece.arrays["mean_nees"][1]), refused)
    assert [(row, run) for row, run, _ in piece.messages] == [(1, run) for run in np.flatnonzero(refused)]
    assert piece.messages[0][2] == f"first measurement {z[refused][0]:.3g} is too large"


def test_a_run_without_a_truth_fails_in_every_row():
    """Started on the planet's centre of attraction, the truth is not finite; the others are there."""
    problem = b612(truth=None, prior=pz.Gaussian([1.0, 0, 0, 0], np.diag([1e-4, 1e-4, 1e2, 1e2])))
    study = small(problem=problem, epochs=200)
    piece = run_task(study, Task(0, 0, 24))
    runs = simulated(study, Task(0, 0, 24))
    lost = np.array([bool(text) for text in runs.wrong])
    if lost.any():
        assert not piece.arrays["success"][:, lost].any()
        assert "truth is not finite" in piece.messages[0][2]
    barred = small(problem=b612(truth=pz.Truth(accept=["-1 - x**2"])), runs=2)
    piece = run_task(barred, Task(0, 0, 2))
    assert not piece.arrays["success"].any()
    assert "none of 1000 truths" in piece.messages[0][2]
    assert len(piece.messages) == 3 * 2


@pytest.mark.slow
@pytest.mark.parametrize("change", [{"method": "integral"}, {"integrator": pz.RungeKutta8(2)}])
def test_problems_that_make_no_ensemble_are_the_same_study(change):
    """Integrated process noise makes no ensemble: run by run, by the same draws and scores."""
    study = Study(satellite(**change), np.arange(20) * 15.0, ["ekf", "smoother"], 5)
    task = Task(0, 0, 5)
    piece = run_task(study, task)
    assert piece.arrays["success"].all()
    assert_equals_compare(study, piece, simulated(study, task))
    bound = bound_at(study, 0)
    assert np.isfinite(bound["bound"]).all()


def test_an_ensemble_and_single_runs_are_the_same_truths(monkeypatch):
    study = small(problem=drawn_truth(), estimators=("ekf",))
    together = simulated(study, Task(0, 0, 9))
    monkeypatch.setattr(pz.Problem, "runs_in_ensemble", False)
    alone = simulated(study, Task(0, 0, 9))
    assert_allclose(alone.truth, together.truth, rtol=1e-11, atol=1e-11)
    assert_allclose(alone.z, together.z, rtol=1e-11, atol=1e-11)
    assert_array_equal(alone.truth[:, 0], together.truth[:, 0])


def test_mismatch_is_between_what_happens_and_what_is_believed():
    study = small(vary={"truth.R.scale": [100.0]})
    runs = simulated(study, Task(0, 0, 24))
    error = runs.z[:, :, 0] - np.array([study.problem.measure("radar", x, study.times)[:, 0] for x in runs.truth])
    assert error.std() == pytest.approx(10 * 0.1, rel=0.1)
    assert runs.assumed.stations[0].noise[0, 0] == 0.01
    piece = run_task(study, Task(0, 0, 24))
    assert piece.arrays["mean_nis"][0].mean() > 20


def test_bound_is_the_mean_of_the_bounds_of_the_runs():
    study = small(runs=9)
    runs, actual = simulated(study, Task(0, 0, 9)), true_problem(study.problem)
    found = bound_at(study, 0)
    for v, view in enumerate(("realtime", "delayed")):
        each = [np.diagonal(posterior_bounds(actual, runs.tracking(i)).of(view), axis1=1, axis2=2) for i in range(9)]
        variance = np.stack([np.mean(each, axis=0)[:, list(c)].sum(axis=1) for c in study.groups.values()], axis=1)
        assert_allclose(found["bound"][v], np.sqrt(variance[study.kept]), rtol=1e-5)
        assert_allclose(found["bound_whole"][v], np.sqrt(variance.mean(axis=0)), rtol=1e-8)
        assert_allclose(found["bound_last_half"][v], np.sqrt(variance[15:].mean(axis=0)), rtol=1e-8)
    assert_array_equal(found["bound_runs"], [9, 9])


def test_bound_is_the_same_mean_where_runs_come_in_pieces(monkeypatch):
    study = small(problem=drawn_truth(), runs=100)
    whole = bound_at(study, 0)
    assert whole["bound_runs"][0] > 64 >= whole["bound_runs"][1] - sum(map(bool, simulated(study, Task(0, 0, 100)).wrong))
    monkeypatch.setattr(Study, "largest_piece", 9)
    pieces = bound_at(study, 0)
    for name, values in whole.items():
        assert_allclose(pieces[name], values, rtol=1e-6 if name == "bound" else 1e-12)


def test_long_runs_are_kept_at_evenly_spaced_epochs():
    study = Study(satellite(), np.arange(1441) * 15.0, ["ekf"], 1)
    assert len(study.kept) == MOST_EPOCHS
    assert (study.kept[0], study.kept[-1]) == (0, 1440)
    assert_array_equal(np.diff(study.kept), 12)
    assert_array_equal(small().kept, np.arange(30))


def test_considered_parameters_count_in_a_study_too():
    """Their share of the covariance is not the ensemble's to add: such runs go one by one."""
    model = pz.Model(
        ["x", "v"], ["v", "-k*x"], [pz.Sensor("place", ["x"])], [pz.Parameter("k", "considered")], groups={"all": ["x", "v"]}
    )
    problem = pz.Problem(
        model,
        pz.Gaussian([1.0, 0.0], [0.1, 0.1]),
        pz.ProcessNoise([1e-4, 1e-4], "step"),
        [pz.Station("west", "place", 0.01)],
        {"k": pz.Gaussian(1.0, 0.04)},
        pz.RungeKutta4(2),
    )
    study = Study(problem, np.arange(10) * 0.3, ["ekf"], 3)
    task = Task(0, 0, 3)
    assert_equals_compare(study, run_task(study, task), simulated(study, task))


@pytest.mark.slow
def test_ranks_beyond_a_byte_are_kept(tmp_path, monkeypatch):
    """One state and 299 constants."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    names = [f"c{i}" for i in range(299)]
    model = pz.Model(
        ["x"],
        ["0"],
        [pz.Sensor("level", ["+".join(["x", *names])])],
        parameters=[pz.Parameter(c, role="estimated") for c in names],
    )
    constants = dict.fromkeys(names, pz.Gaussian(0.0, 1.0))
    problem = pz.Problem(model, pz.Gaussian(0.0, 1.0), None, [pz.Station("a", "level", 1.0)], constants)
    stored = Study(problem, np.arange(3.0), ["ekf"], 2).run(tmp_path / "s.nc", workers=0)
    row = stored.row(0, 0)
    assert row.success.all()
    assert (row.rank == 300).all()
