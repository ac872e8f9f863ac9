"""Window lengths: every number is the one that `compare` gives, and the full graph is timed on parts of the run."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import piazzi as pz
from piazzi.evaluate.window_lengths import head, steps_of, timed_sizes
from piazzi.present.report import Chart, page, windows_section, windows_tab
from tests.laws.problems import b612


@cache
def run():
    problem, tracking = pz.load("b612-range", seed=4)
    return problem, head(tracking, 60)


@cache
def trade():
    return pz.windows(*run(), [20, 1, 5, 5], source="here")


def test_rows_are_those_of_compare():
    problem, tracking = run()
    rows = pz.compare(problem, tracking, {f"window:{n}": pz.SlidingWindow(n) for n in (1, 5, 20)}).rows
    found = trade()
    assert found.lags.tolist() == [1, 5, 20]
    pairs = [row for pair in zip(found.realtime, found.delayed, strict=True) for row in pair]
    for ours, theirs in zip(pairs, rows, strict=True):
        assert (ours.estimator, ours.view) == (theirs.estimator, theirs.view)
        assert ours.rmse == theirs.rmse
        assert ours.mean_nees_last_half == theirs.mean_nees_last_half
    assert found.rmse("position").tolist() == [r.rmse_last_half["position"] for r in found.realtime]
    assert (found.microseconds_per_step > 0).all()


def test_the_ends_are_the_filter_and_the_graph():
    problem, tracking = run()
    ekf = pz.compare(problem, tracking, {"ekf": pz.ExtendedKalmanFilter()}).rows[0]
    assert trade().realtime[0].rmse["position"] == pytest.approx(ekf.rmse["position"], rel=1e-9)
    assert trade().graph.rmse["position"] <= trade().realtime[0].rmse["position"]


def test_the_graph_is_timed_from_few_epochs_to_all():
    timing = trade().timing
    assert timing.epochs[0] == 10
    assert timing.epochs[-1] == 60
    assert (np.diff(timing.epochs) > 0).all()
    assert (timing.seconds > 0).all()
    assert timed_sizes(4) == [4]


def test_json_is_strict_and_complete():
    document = json.loads(trade().to_json())
    assert document["schema"] == "piazzi.windows/1"
    assert document["lags"] == [1, 5, 20]
    assert [(r["lag"], r["view"]) for r in document["rows"]][:3] == [(1, "realtime"), (1, "delayed"), (5, "realtime")]
    assert len(document["timing"]["seconds"]) == len(document["timing"]["epochs"])
    assert document["graph"]["view"] == "delayed"


def test_dataset_has_units_and_both_views():
    data = trade().to_dataset()
    assert data["position_rmse"].dims == ("lag", "view")
    assert data["position_rmse"].sel(lag=5, view="delayed").item() == trade().delayed[1].rmse["position"]
    assert data["seconds"].attrs["units"] == "s"


def test_windows_of_a_singular_covariance_are_judged_by_its_rank():
    """Two unknown directions and no process noise: all windows have covariances of rank 2."""
    prior = pz.Gaussian.from_sigma([11, 0, 0, 10], [1e-3, 0, 0, 1e-3])
    problem = b612(truth=None, prior=prior, process_noise=pz.ProcessNoise(np.zeros(4), "step"))
    found = pz.windows(problem, pz.simulate(problem, np.arange(20) * 0.1, np.random.default_rng(0)), [1, 5], graph=False)
    assert found.ideal_nees("realtime", "delayed") == (2.0,)
    assert "(ideal 2)" in str(found)
    assert windows_section(found).blocks[3].title == "Mean NEES, last half, ideal 2"


def test_windows_without_any_uncertainty_have_no_nees_and_no_chart_of_it():
    prior = pz.Gaussian.from_sigma([11, 0, 0, 10], [0, 0, 0, 0])
    problem = b612(truth=None, prior=prior, process_noise=pz.ProcessNoise(np.zeros(4), "step"))
    found = pz.windows(problem, pz.simulate(problem, np.arange(20) * 0.1, np.random.default_rng(0)), [1, 5], graph=False)
    assert found.ideal_nees("realtime", "delayed") == ()
    charts = [block.title for block in windows_section(found).blocks if isinstance(block, Chart)]
    assert charts == ["RMSE of position, last half", "RMSE of velocity, last half", "Cost of a window"]
    assert "Cost of a window" in page("windows", [windows_tab(found)])


def test_without_truth_cost_and_nis_stand():
    problem, tracking = run()
    found = pz.windows(problem, pz.Tracking(tracking.row_times, tracking.values), [1, 3], graph=False)
    assert found.groups == ()
    assert found.graph is None
    assert found.timing is None
    assert np.isnan(found.rmse("position")).all()
    assert found.realtime[0].mean_nis > 0
    assert "no truth" in str(found)
    assert found._repr_html_()


def test_sentences_tell_who_diverged_and_how_much_covariances_say():
    """The factor is the root of the mean NEES over its ideal, 4; who diverged is named and not judged."""
    told, rows = trade().sentences(), trade().all_rows
    lost = {r.estimator for r in rows if r.diverged}
    assert lost and {s.split()[0] for s in told if "diverged" in s} == lost
    assert f"of {len(rows)} rows are" in told[-1] and int(told[-1].split()[2]) <= sum(not r.diverged for r in rows)
    problem, tracking = run()
    believed = replace(problem, stations=[replace_noise(s, 100.0) for s in problem.stations])
    cautious = pz.windows(believed, tracking, [20], graph=False)
    factors = sorted(np.sqrt(r.mean_nees_last_half / 4) for r in cautious.all_rows)
    assert f"about {factors[0]:.2g} to {factors[-1]:.2g} times what the covariance predicts" in cautious.sentences()[-1]


def replace_noise(station, factor):
    return pz.Station(station.name, station.sensor, station.noise * factor, station.numbers, schedule=station.schedule)


def test_one_that_fails_leaves_the_others_their_rows(monkeypatch):
    problem, tracking = run()
    estimate = pz.SlidingWindow.estimate

    def broken(self, problem, tracking):
        if self.lag == 3:
            raise RuntimeError("out of order")
        return estimate(self, problem, tracking)

    monkeypatch.setattr(pz.SlidingWindow, "estimate", broken)
    found = pz.windows(problem, tracking, [1, 3, 5], graph=False)
    assert [r.success for r in found.realtime] == [True, False, True]
    assert not found.success
    assert np.isnan(found.microseconds_per_step).tolist() == [False, True, False]
    assert "out of order" in str(found)
    assert json.loads(found.to_json())["rows"][2]["microseconds_per_step"] is None


def test_one_epoch():
    problem, tracking = run()
    one = pz.Tracking(tracking.row_times[:1], tracking.values[:1], truth=tracking.truth[:1])
    found = pz.windows(problem, one, [1, 200])
    assert found.success
    assert found.timing.epochs.tolist() == [1]
    assert str(found)


def test_steps_are_announced():
    said: list[str] = []
    problem, tracking = run()
    pz.windows(problem, tracking, [1, 2], announce=said.append)
    assert said[:3] == ["window:1", "window:2", "graph"]
    assert len(said) == steps_of([1, 2], tracking)


@pytest.mark.parametrize(("lags", "message"), [([], "no window lengths"), ([0], "lag is 0"), ([1.5], "lag is 1.5")])
def test_bad_lengths_are_refused(lags, message):
    with pytest.raises(ValueError, match=message):
        pz.windows(*run(), lags)


def test_head_keeps_rows_truth_and_stations():
    _, tracking = run()
    part = head(tracking, 7)
    assert len(part.times) == 7
    assert part.truth.shape == (7, 4)
    assert head(tracking, 60).values.tobytes() == tracking.values.tobytes()
