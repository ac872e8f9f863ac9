"""The comparison and its contract: every estimator keeps a row, and the JSON is strict."""

import json
import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import piazzi as pz
from piazzi.cli.compare import rows as comparison_rows
from piazzi.estimate import Estimate
from piazzi.evaluate import Comparison, compare, evaluate, posterior_bounds
from piazzi.evaluate.comparison_table import columns, sentences
from piazzi.evaluate.consistency import Check
from piazzi.evaluate.quantities import ideal
from piazzi.present.report.words import points
from piazzi.present.squares import nees_of
from piazzi.scenarios import load_scenario
from tests.evaluate.conftest import made

ROW = {
    "estimator", "view", "success", "message", "iterations", "seconds", "position_rmse", "velocity_rmse",
    "position_rmse_last_half", "velocity_rmse_last_half", "mean_nees", "mean_nees_last_half", "mean_nis", "diverged",
    "nees_ideal", "nees_ideal_last_half",
    "position_crlb", "velocity_crlb", "position_crlb_last_half", "velocity_crlb_last_half", "convergence_time",
    "nees_low", "nees_high", "nees_last_half_low", "nees_last_half_high", "nees_effective_epochs",
    "nis_low", "nis_high", "whiteness", "whiteness_high", "bias", "bias_high", "residual_rms", "apart",
}  # fmt: skip
ERRORS = {k for k in ROW if any(word in k for word in ("rmse", "nees", "crlb", "convergence"))}  # not known without truth
ERRORS |= {"apart"}  # nor how far the first estimator is from itself
pytestmark = pytest.mark.usefixtures("uncompiled")
POSITION = {"position": ["a", "b"]}


@dataclass(frozen=True)
class Ready:
    """An estimator that has its answer already, or an error."""

    result: Any

    def estimate(self, problem, tracking) -> Estimate:
        if isinstance(self.result, BaseException):
            raise self.result
        return self.result


def compared(**results: Any) -> Comparison:
    first = next(r for r in results.values() if isinstance(r, Estimate))
    return compare(first.problem, first.tracking, {name: Ready(r) for name, r in results.items()}, source="here.npz")


def parts(comparison: Comparison) -> tuple[Any, ...]:
    """What tables and sentences are made of."""
    return comparison.problem.model, comparison.rows, comparison.tracking.values


@pytest.fixture
def good() -> Estimate:
    rng = np.random.default_rng(2)
    return made(rng.standard_normal((41, 2)), np.eye(2), truth=np.zeros((41, 2)), groups=POSITION)


@pytest.fixture
def singular() -> Estimate:
    """Errors of one direction, as large as a covariance of rank 1 says, in four states; rank 2 at the first epoch."""
    rng = np.random.default_rng(2)
    along = np.array([1.0, 2.0, -1.0, 0.5])
    covariance = np.broadcast_to(np.outer(along, along), (40, 4, 4)).copy()
    covariance[0] += np.diag([0.0, 0.0, 0.0, 1.0])
    return made(rng.standard_normal((40, 1)) * along, covariance, truth=np.zeros((40, 4)), groups={"position": ["a", "b"]})


def strict(text: str) -> Any:
    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    return json.loads(text, parse_constant=refuse)


def test_rows_hold_what_the_definitions_say(good):
    row = compared(good=good).rows[0]
    length = np.linalg.norm(good.mean, axis=1)
    assert row.rmse["position"] == pytest.approx(np.sqrt((length**2).mean()))
    assert row.rmse_last_half["position"] == pytest.approx(np.sqrt((length[20:] ** 2).mean()))  # rows K//2 onward
    assert row.mean_nees == pytest.approx((length**2).mean())
    assert row.mean_nees_last_half == pytest.approx((length[20:] ** 2).mean())
    assert row.mean_nis == pytest.approx((good.innovations**2).mean())
    assert (row.seconds, row.iterations, row.success, row.message) == (0.25, 41, True, "")


def test_json_is_the_contract(good):
    document = strict(compared(good=good).to_json())
    assert document["schema"] == "piazzi.compare/1"
    assert (document["source"], document["epochs"], document["states"]) == ("here.npz", 41, ["a", "b"])
    (row,) = document["rows"]
    assert set(row) == ROW
    assert row["velocity_rmse"] is None  # the model names no such group


def test_further_groups_have_their_own_keys(good):
    model = replace(good.problem.model, groups={"clock": ["b"]})
    estimate = replace(good, problem=replace(good.problem, model=model))
    (row,) = strict(compared(good=estimate).to_json())["rows"]
    assert set(row) == ROW | {"clock_rmse", "clock_rmse_last_half", "clock_crlb", "clock_crlb_last_half"}
    assert row["position_rmse"] is None


def test_a_model_without_groups_reports_each_state():
    estimate = made(np.ones((4, 2)), np.eye(2), truth=np.zeros((4, 2)))
    (row,) = strict(compared(one=estimate).to_json())["rows"]
    assert (row["a_rmse"], row["b_rmse_last_half"]) == (1, 1)


def test_without_truth_errors_are_null_and_the_rest_stands(good):
    bare = replace(good, tracking=replace(good.tracking, truth=None))
    comparison = compared(good=bare)
    (row,) = strict(comparison.to_json())["rows"]
    assert row["success"] is True
    assert {k for k, v in row.items() if v is None} == ERRORS
    assert "no truth to compare with" in str(comparison)


@pytest.mark.parametrize("names", [["ekf"], ["ekf", "graph"]])
def test_a_truth_that_ends_before_the_last_half_is_told(good, names):
    """Errors are known then, but none of those that estimators are compared by."""
    truth = good.tracking.truth.copy()
    truth[len(truth) // 2 :] = np.nan
    comparison = compare(good.problem, replace(good.tracking, truth=truth), names)
    assert all(row.rmse["position"] is not None and row.rmse_last_half["position"] is None for row in comparison.rows)
    assert "The truth of the last half of the run is not known, so its errors are unknown." in rendered(comparison, 100)
    assert points(comparison)


def test_numbers_that_are_not_finite_become_null(good):
    mean = good.mean.copy()
    mean[30] = np.nan
    (row,) = strict(compared(lost=replace(good, mean=mean)).to_json())["rows"]
    assert (row["success"], row["diverged"]) == (False, True)
    assert row["position_rmse"] is None
    assert row["mean_nees"] is None
    assert "epoch 30" in row["message"]


@pytest.mark.parametrize(
    "error", [ValueError("no good"), RuntimeError("broken"), ZeroDivisionError(), np.linalg.LinAlgError("x")]
)
def test_one_that_fails_leaves_the_others_their_rows(good, error):
    comparison = compared(before=good, bad=error, after=good)
    assert [(r.estimator, r.success) for r in comparison.rows] == [("before", True), ("bad", False), ("after", True)]
    assert not comparison.success
    assert set(comparison.estimates) == {"before", "after"}
    assert str(error) in comparison.rows[1].message
    assert strict(comparison.to_json())["rows"][1]["seconds"] is None
    assert "bad did not succeed" in str(comparison)


def test_ctrl_c_is_no_failure_of_an_estimator(good):
    with pytest.raises(KeyboardInterrupt):
        compared(good=good, stopped=KeyboardInterrupt())


def test_a_window_has_two_rows(good):
    late = replace(good, mean=0.1 * good.mean, view="delayed")
    comparison = compared(window=replace(good, delayed=late))
    assert [(r.estimator, r.view) for r in comparison.rows] == [("window", "realtime"), ("window", "delayed")]
    assert comparison.rows[1].rmse["position"] == pytest.approx(0.1 * comparison.rows[0].rmse["position"])
    assert list(comparison.views) == [("window", "realtime"), ("window", "delayed")]


def test_estimators_are_announced_before_they_start(good):
    said: list[str] = []
    compare(good.problem, good.tracking, {"a": Ready(good), "b": Ready(good)}, announce=said.append)
    assert said == ["a", "b"]


def test_a_tracking_that_does_not_fit_is_refused_at_the_door(good):
    stranger = pz.Tracking([0.0, 1.0], [1.0, 2.0], ["elsewhere", "elsewhere"])
    with pytest.raises(ValueError, match="elsewhere"):
        compare(good.problem, stranger, {"a": Ready(good)})


def test_evaluate_alone_gives_the_same_row(good):
    bounds = posterior_bounds(good.problem, good.tracking)
    assert evaluate("good", good, bounds) == compared(good=good).rows[0]


def test_the_failed_estimators_of_the_registry_have_all_their_views(monkeypatch):
    """A graph that raises has one delayed row, a window two."""
    scenario = load_scenario("b612-range")
    tracking = pz.Tracking(scenario.times, np.ones(len(scenario.times)))

    def broken(self, problem, tracking):
        raise RuntimeError("no")

    for kind in (pz.FactorGraph, pz.SlidingWindow, pz.ExtendedKalmanFilter):
        monkeypatch.setattr(kind, "estimate", broken)
    rows = compare(scenario.problem, tracking, ["graph", "window:5", "ekf"]).rows
    assert [(r.estimator, r.view, r.success) for r in rows] == [
        ("graph", "delayed", False),
        ("window:5", "realtime", False),
        ("window:5", "delayed", False),
        ("ekf", "realtime", False),
    ]
    assert {r.message for r in rows} == {"RuntimeError: no"}

    class Own(pz.FactorGraph):
        """A user's: views come with the class, wherever it stands."""

    rows = compare(scenario.problem, tracking, {"own": Own()}).rows
    assert [(r.view, r.success) for r in rows] == [("delayed", False)]


def test_bounds_and_tests_stand_beside_errors(good):
    """The row has what the functions behind it say; without them, as in a quick look, it has none."""
    comparison = compared(good=good)
    (row,) = comparison.rows
    bounds = posterior_bounds(good.problem, good.tracking)
    assert row.crlb["position"] == pytest.approx(np.sqrt(np.trace(bounds.realtime, axis1=1, axis2=2).mean()))
    assert row.crlb_last_half["position"] == pytest.approx(np.sqrt(np.trace(bounds.realtime[20:], axis1=1, axis2=2).mean()))
    assert row.tests.nis.statistic == pytest.approx(row.mean_nis)
    assert row.tests.nees_last_half.statistic == pytest.approx(row.mean_nees_last_half)
    quick = compare(good.problem, good.tracking, {"good": Ready(good)}, thorough=False).rows[0]
    assert (quick.crlb, quick.tests.nis) == ({}, None)
    assert quick.rmse == row.rmse


def test_tests_that_fail_are_named(good):
    comparison = compared(good=good, loud=replace(good, innovations=3 * good.innovations))
    assert comparison.rows[0].tests.nis.passed
    assert not comparison.rows[1].tests.nis.passed
    text = rendered(comparison, 250)
    assert re.search(r"^loud .* NIS ", text, re.M)
    assert re.search(r"loud fails the .*NIS.* tests? \(5 % level\)", text)


def test_dataset_has_every_number_with_its_unit(good):
    data = compared(good=good).to_dataset()
    assert data["position_rmse"].item() == compared(good=good).rows[0].rmse["position"]
    assert data["position_crlb"].attrs["units"] == "m"
    assert data["estimator"].values.tolist() == ["good"]
    assert np.isnan(data["velocity_rmse"].item())


def test_many_epochs_do_without_the_bound(good, monkeypatch):
    whole = compared(good=good).rows[0].tests
    monkeypatch.setattr("piazzi.evaluate.comparison.LONGEST", 40)
    monkeypatch.setattr("piazzi.evaluate.consistency_tests.LONGEST", 40)
    (row,) = strict(compared(good=good).to_json())["rows"]
    assert row["position_rmse"] > 0
    assert row["position_crlb"] is None
    assert row["nees_low"] is None
    assert row["nis_low"] == whole.nis.low  # innovations need no linearisation where no two rows share an epoch


# ---- how it looks --------------------------------------------------------------------------------------------------------


def rendered(comparison: Comparison, width: int) -> str:
    from rich.console import Console

    console = Console(width=width, color_system=None)
    with console.capture() as captured:
        console.print(comparison)
    return captured.get()


@pytest.mark.parametrize("width", [20, 40, 79, 80, 100, 140, 1000])
def test_no_width_is_exceeded_and_no_number_broken(good, width):
    comparison = compared(ekf=good, graph=replace(good, mean=0.5 * good.mean, view="delayed"))
    text = rendered(comparison, width)
    assert max(map(len, text.splitlines())) <= width
    value = f"{comparison.rows[0].rmse_last_half['position']:.3f}"
    assert value in text or width < 40


def test_wide_terminals_see_more(good):
    comparison = compared(ekf=good)
    assert "whole run" in rendered(comparison, 200)
    assert "iterations" not in rendered(comparison, 75)
    assert "position RMSE, last half:" in rendered(comparison, 45)


def test_large_errors_are_shown_in_kilometres(good):
    text = str(compared(ekf=replace(good, mean=1e6 * good.mean, covariance=1e12 * good.covariance)))
    assert " km " in text
    assert "e+" not in text


def test_sentences_name_the_best_the_dishonest_and_the_lost(good):
    text = str(
        compared(
            honest=good,
            cautious=replace(good, covariance=100 * good.covariance),
            wayward=replace(good, mean=100 + good.mean),
        )
    )
    assert "Smallest position error in the last half of the run: honest" in text
    assert "Errors of honest are consistent with the covariance" in text
    assert re.search(r"Errors of cautious are about 0\.(09\d*|10?|11) times what the covariance predicts", text)
    assert "wayward diverged" in text


def test_html_escapes_what_users_wrote(good):
    page = compare(good.problem, good.tracking, {"<script>alert(1)</script>": Ready(good)})._repr_html_()
    assert "<script>" not in page
    assert "&lt;script&gt;" in page
    assert page.count("<tr>") == 2


def test_without_truth_residuals_and_the_first_estimator_judge(good):
    """Whoever ends elsewhere is named with how far; one that failed is no measure."""
    bare = replace(good, tracking=replace(good.tracking, truth=None), view="delayed")
    lost = replace(bare, mean=bare.mean + np.array([4.0, 0.0]))
    comparison = compared(failed=replace(bare, failure="no"), batch=bare, near=replace(bare, mean=bare.mean + 0.5), lost=lost)
    assert [row["apart"] for row in comparison.to_dict()["rows"][1:]] == [None, pytest.approx(0.5), pytest.approx(4.0)]
    text = str(comparison)
    assert "The last states of lost are 4 sigma from those of batch" in text
    assert {"last state from batch", "residual RMS"} <= {c.name for c in columns(*parts(comparison))}
    assert "residual RMS" not in {c.name for c in columns(*parts(compared(good=good)))}  # errors are known
    rows = comparison_rows(comparison)
    assert rows[3]["residual_rms"] == comparison.rows[3].residual_rms[""]
    assert comparison.to_dataset()["residual_rms"].values.tolist() == [row.residual_rms[""] for row in comparison.rows]


def test_what_a_gate_rejected_is_told(good):
    gated = replace(good, details={"rejected": np.zeros(len(good.innovations), dtype=bool), "rejected_count": 3})
    comparison = compared(plain=good, gated=gated)
    plain, row = comparison.to_dict()["rows"]
    assert "rejected" not in plain
    assert row["rejected"] == 3
    assert f"The gate of gated rejected 3 of {len(good.tracking.row_times)} measurements." in str(comparison)


def test_outliers_and_modes_are_told(good):
    weights = np.ones(len(good.innovations))
    weights[:2] = 0.05
    modes = [{"probability": 0.75, "cost": 3.0}, {"probability": 0.25, "cost": 4.0}]
    comparison = compared(
        plain=good,
        robust=replace(good, details={"weights": weights}),
        bank=replace(good, details={"modes": modes}),
        sure=replace(good, details={"modes": modes[:1]}),
    )
    plain, robust, bank, _ = comparison.to_dict()["rows"]
    assert not {"outliers", "modes"} & plain.keys()
    assert robust["outliers"] == 2
    assert bank["modes"] == modes
    text = str(comparison)
    assert f"robust classified 2 of {len(good.tracking.row_times)} measurements as outliers." in text
    assert "bank found 2 solutions, with probabilities 75 % and 25 %." in text
    assert "sure found" not in text
    for first, second in (("robust", "plain"), ("plain", "robust")):
        estimates = {"plain": good, "robust": replace(good, details={"weights": weights})}
        found = compared(**{first: estimates[first], second: estimates[second]}).to_dataset()["outliers"].values
        assert sorted(found.tolist(), key=np.isnan)[0] == 2
        assert np.isnan(found).sum() == 1


def test_errors_of_a_singular_covariance_are_judged_by_its_rank(singular):
    """Beside the number of states they would be called half as large as they are."""
    comparison = compared(flat=singular)
    row = comparison.to_dict()["rows"][0]
    assert (row["nees_ideal"], row["nees_ideal_last_half"]) == (41 / 40, 1.0)
    assert row["mean_nees_last_half"] == pytest.approx(np.mean(singular.mean[20:, 0] ** 2))
    assert [c.unit for c in columns(*parts(comparison)) if c.name == "mean NEES"] == ["ideal 1.02", "ideal 1"]
    assert "Errors of flat are consistent with the covariance (NEES of this one run)." in str(comparison)
    assert [p.heading for p in points(comparison) if "consistent with" in p.text] == ["Consistent covariance"]
    squares = nees_of(comparison)
    assert (squares.expected, squares.ideal) == (41 / 40, "ideal 1.02")


def test_what_is_ideal_is_told_for_all_rows(singular):
    """From the smallest to the largest where they differ, and over the states whose truth is known."""
    truth = singular.tracking.truth.copy()
    regular = made(singular.mean, np.eye(4), truth=truth)
    truth[:, 3] = np.nan
    partly = made(singular.mean, np.eye(4), truth=truth)
    rows = [evaluate("any", e, thorough=False) for e in (singular, regular, partly)]
    assert [r.nees_ideal_last_half for r in rows] == [1.0, 4.0, 3.0]
    assert ideal(r.nees_ideal_last_half for r in rows) == "ideal 1 to 4"
    assert ideal([None]) == "ideal -"


# ---- one verdict ---------------------------------------------------------------------------------------------------------


CLAIM = re.compile(
    r"(?:Errors|Innovations) of ([\w, ]+?) are (consistent with the covariance|about .*? what the covariance predicts)"
)


def by_claim(texts) -> dict[str, set[str]]:
    """Which estimators each claim is made of; "all" is everyone."""
    found = [match for text in texts for match in CLAIM.findall(text)]
    return {claim: set(re.split(r", | and ", names)) for names, claim in found}


@pytest.mark.parametrize("known", [True, False], ids=["truth", "no truth"])
@pytest.mark.parametrize("thorough", [True, False], ids=["tests", "no tests"])
def test_terminal_and_page_pass_the_same_verdict(good, known, thorough):
    """On errors, else innovations, as large as the covariance predicts, three times that, a twentieth, and on a lost run."""
    if known:
        results = {f"by{c}": replace(good, mean=c * good.mean) for c in (1, 3)} | {"small": replace(good, mean=good.mean / 20)}
        results["lost"] = replace(good, mean=100 + good.mean)
    else:
        bare = replace(good, tracking=replace(good.tracking, truth=None))
        results = {f"by{c}": replace(bare, innovations=c * good.innovations) for c in (1, 3)}
        results["small"] = replace(bare, innovations=good.innovations / 20)
    first = results["by1"]
    comparison = compare(first.problem, first.tracking, {n: Ready(r) for n, r in results.items()}, thorough=thorough)
    terminal, page = (
        by_claim(sentences(*parts(comparison))),
        by_claim(p.text for p in points(comparison)),
    )
    assert terminal == page
    assert [names for claim, names in terminal.items() if claim.startswith("consistent")] == [{"by1"}]
    sizes = {name: float(claim.split()[1]) for claim, names in terminal.items() for name in names if "about" in claim}
    assert set(sizes) == {"by3", "small"}
    assert sizes["by3"] == pytest.approx(60 * sizes["small"], rel=0.05)  # two digits are shown
    headings = {p.heading: p.text for p in points(comparison)}
    assert "by3" in headings["Optimistic covariance"] and "small" in headings["Pessimistic covariance"]
    assert ("lost" in headings.get("Diverged", "")) == ("lost diverged" in str(comparison)) == known


def test_a_test_decides_where_there_is_one(good):
    """A run so correlated in time that twice the errors prove nothing, and one in which a tenth more is significant."""
    row = compared(ekf=replace(good, mean=2 * good.mean)).rows[0]
    size = row.mean_nees_last_half
    for high, word in ((2 * size, "consistent with the covariance"), (0.9 * size, "what the covariance predicts")):
        judged = replace(row, tests=replace(row.tests, nees_last_half=Check(size, 0.0, high, 5.0)))
        comparison = replace(compared(ekf=good), rows=(judged,))
        assert word in str(comparison)
        assert any(word in p.text for p in points(comparison))


# ---- estimators by name --------------------------------------------------------------------------------------------------


def test_estimators_may_be_named_as_on_the_command_line(good):
    problem, tracking = pz.load("b612-range", seed=1)
    named = compare(problem, tracking, ["ekf", "window:5"])
    given = compare(problem, tracking, {"ekf": pz.ExtendedKalmanFilter(), "window:5": pz.SlidingWindow(5)})
    assert [r.estimator for r in named.rows] == ["ekf", "window:5", "window:5"]
    for name, estimate in named.estimates.items():
        np.testing.assert_array_equal(estimate.mean, given.estimates[name].mean)


@pytest.mark.parametrize(
    ("estimators", "says"),
    [
        (["ekf", "grph"], "unknown estimator 'grph'.* 'graph'"),
        (["ekf", "ekf"], "estimator 'ekf' is named twice"),
        ("ekf", "estimators is 'ekf'; it must be a list of names or a mapping"),
        ([pz.ExtendedKalmanFilter()], "estimators has ExtendedKalmanFilter.*: give names, or a mapping of names to estimators"),
        ([], "there are no estimators to compare"),
    ],
)
def test_estimators_that_are_none(good, estimators, says):
    with pytest.raises(ValueError, match=says):
        compare(good.problem, good.tracking, estimators)
