"""What a study says, against the same made from its runs by other means."""

import json
import shutil

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.present.study_table import columns
from piazzi.study import run_study
from piazzi.study.store import read_store
from piazzi.study.summary import QUANTILES, wilson
from tests.laws.problems import b612
from tests.references.chi_square import mean_bounds
from tests.study.estimators import Refusing
from tests.study.studies import small


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    study = small(runs=50, estimators={"ekf": "ekf", "window:5": "window:5", "picky": Refusing(1.5)}, vary={"R.scale": [1, 4]})
    return run_study(study, tmp_path_factory.mktemp("s") / "s.nc", workers=0)


def test_lines_are_points_times_rows(stored):
    lines = stored.summary.lines
    assert [(line.point["R.scale"], line.estimator, line.view) for line in lines] == [
        (scale, *row) for scale in (1, 4) for row in stored.rows
    ]
    assert not stored.summary.success


def test_numbers_over_runs(stored):
    line, row = stored.summary.lines[0], stored.row(0, 0)
    assert (line.runs, line.failed) == (50, 0)
    half = row.numbers["rmse_last_half"][:, 0]
    assert line.rmse_last_half["position"] == pytest.approx(np.sqrt(np.mean(half**2)))
    assert_allclose(line.rmse_last_half_quantiles["position"], np.quantile(half, QUANTILES))
    bound, bound_last_half, count = stored.bound(0, "realtime")
    assert count == 50
    assert line.over_bound["position"] == pytest.approx(np.sqrt(np.mean(half**2)) / bound_last_half[0])
    assert_allclose(line.history.bound, bound)
    assert_allclose(line.history.rms, np.sqrt((row.error.astype(float) ** 2).mean(axis=0)))
    assert line.mean_nees == pytest.approx(row.numbers["mean_nees"].mean())
    assert line.seconds > 0


def test_failed_runs_are_counted_and_left_out(stored):
    line, row = stored.summary.lines[3], stored.row(0, 3)
    assert line.failed == (~row.success).sum() > 0
    assert line.mean_nis == pytest.approx(row.numbers["mean_nis"][row.success].mean())
    assert np.isfinite(line.history.rms).all()


def test_bounds_of_mean_nees_hold_for_gaussian_errors():
    """99 % of means of M chi-square variables of n degrees of freedom."""
    from piazzi.study.summary import Row, _history

    rng = np.random.default_rng(0)
    M, T, n = 40, 4000, 4
    nees = rng.chisquare(n, (M, T))
    row = Row({}, np.ones(M, bool), np.zeros(M, bool), np.ones((M, T, 1)), nees, np.full((M, T), n))
    inside = _history(row, np.ones((T, 1))).inside
    assert inside == pytest.approx(0.99, abs=5 * np.sqrt(0.99 * 0.01 / T))


def test_bounds_of_mean_nees_hold_for_ranks_that_differ():
    """From run to run and from epoch to epoch; where there is no direction, there is no NEES."""
    from piazzi.study.summary import Row, _history

    rng = np.random.default_rng(1)
    M, T = 10, 4000
    rank = rng.integers(0, 4, (M, T))
    rank[:, 0] = 0
    nees = np.where(rank > 0, rng.chisquare(np.maximum(rank, 1)), np.nan)
    history = _history(Row({}, np.ones(M, bool), np.zeros(M, bool), np.ones((M, T, 1)), nees, rank), np.ones((T, 1)))
    assert history.inside == pytest.approx(0.99, abs=5 * np.sqrt(0.99 * 0.01 / T))
    assert np.isnan(history.nees[0])
    assert history.ideal == pytest.approx(2.0, abs=0.05)
    assert history.band is None


@pytest.mark.parametrize("rank", [2, 3])
def test_a_singular_covariance_is_judged_by_its_rank(tmp_path, rank):
    """Without process noise the covariance keeps the rank of the prior; errors this small are Gaussian."""
    prior = pz.Gaussian.from_sigma([11, 0, 0, 10], np.where(np.arange(4) < rank, 1e-3, 0.0))
    problem = b612(truth=None, prior=prior, process_noise=pz.ProcessNoise(np.zeros(4), "step"))
    stored = run_study(small(runs=40, problem=problem, estimators=("ekf", "smoother"), epochs=20), tmp_path / "s.nc", workers=0)
    low, high = mean_bounds(rank, 40, 0.01)
    for line in stored.summary.lines:
        assert line.history.ideal == rank
        assert line.history.band == pytest.approx((low, high), rel=0.01)
        assert low < line.mean_nees < high
        assert line.history.inside > 0.9
    assert next(c.unit for c in columns(stored.summary) if c.title == "mean NEES") == f"ideal {rank}"
    document = json.loads(json.dumps(stored.summary.to_dict(), allow_nan=False))
    assert document["rows"][0]["nees_bounds"] == pytest.approx([low, high], rel=0.01)
    assert document["rows"][0]["nees_ideal"] == rank


@pytest.mark.parametrize("count", [0, 1, 10, 99, 100])
def test_interval_of_a_rate_solves_wilsons_equation(count):
    """Its ends are the rates p with |count/of - p| = z sqrt(p (1 - p) / of)."""
    low, high = wilson(count, 100)
    assert 0 <= low <= count / 100 <= high <= 1
    for p in (low, high):
        if 0 < p < 1:
            assert abs(count / 100 - p) == pytest.approx(1.959963984540054 * np.sqrt(p * (1 - p) / 100), rel=1e-9)
    assert wilson(0, 0) is None


def test_interval_covers_the_rate_it_should():
    """Over many experiments with a rate of 10 %, 95 % of the intervals hold it, but for the grain of counts."""
    seen = np.random.default_rng(1).binomial(200, 0.1, 4000)
    held = np.mean([low <= 0.1 <= high for low, high in (wilson(int(c), 200) for c in seen)])
    assert 0.93 < held < 0.97


def test_json_is_strict_and_complete(stored):
    document = json.loads(json.dumps(stored.summary.to_dict(), allow_nan=False))
    assert document["schema"] == "piazzi.study/1"
    assert (document["runs"], document["epochs"], document["axes"]) == (50, 30, {"R.scale": [1, 4]})
    row = document["rows"][0]
    assert {"failed", "diverged", "diverged_interval", "rmse", "over_bound", "nees_bounds", "nees_inside", "seconds"} <= {*row}
    assert len(row["over_time"]["position"]["quantiles"]) == 3
    assert len(row["over_time"]["nees"]) == len(document["times"]) == 30
    assert document["messages"][0]["estimator"] == "picky"


def test_a_store_of_an_earlier_version_is_taken_as_of_full_rank(stored, tmp_path):
    import h5py

    old = shutil.copy(stored.path, tmp_path / "old.nc")
    with h5py.File(old, "r+") as file:
        del file["rank"]
    assert json.dumps(read_store(old).summary.to_dict()) == json.dumps(stored.summary.to_dict())


def test_any_netcdf_reader_opens_a_store(stored):
    import xarray

    expected = stored.row(1, 2).numbers["rmse"]
    with xarray.open_dataset(stored.path) as found:
        assert found["rmse"].dims == ("point", "row", "run", "group")
        assert found["error"].dims == ("point", "row", "run", "epoch", "group")
        assert_allclose(found["rmse"].values[1, 2], expected)


def test_absurd_shapes_are_refused_before_memory_is_asked_for(stored, tmp_path):
    """A file of some kilobytes that declares 3e8 runs asked for ten gigabytes."""
    small_file = tmp_path / "bomb.nc"
    with h5py.File(stored.path) as source, h5py.File(small_file, "w") as file:
        for name, data in source.items():
            shape = list(data.shape)
            if data.ndim >= 3 and not name.startswith("bound"):
                shape[2] = 300_000_000
                chunks = (1, 1, 4096, *shape[3:])
                file.create_dataset(name, shape=shape, dtype=data.dtype, chunks=chunks, fillvalue=data.fillvalue)
            else:
                file.create_dataset(name, data=data[()])
    assert small_file.stat().st_size < 100_000
    with pytest.raises(ValueError, match=r"bomb.nc: variable '\w+' (would take|has shape)"):
        read_store(small_file).summary.lines  # noqa: B018
