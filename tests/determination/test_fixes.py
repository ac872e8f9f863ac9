"""Orbits from positions: the truth is found, the covariance is honest, and nothing depends on axes, epoch or order of rows."""

import json

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.determination import Guess
from piazzi.determination.against import against
from piazzi.estimate.chi_square import quantile
from tests.determination.fixing import CR_A_M, EPOCH, STATE, observations, truth

T = np.arange(0.0, 43200.0, 900.0)
SIGMA = 5.0


@pytest.fixture(scope="module")
def path():
    return truth(T)


@pytest.fixture(scope="module")
def noisy(path):
    return path[:, :3] + SIGMA * np.random.default_rng(1).standard_normal((len(T), 3))


@pytest.fixture(scope="module")
def found(noisy):
    return pz.determine(observations(noisy, T, SIGMA))


def test_exact_fixes_give_the_orbit_back(path):
    found = pz.determine(observations(path[:, :3], T, 1e-3))
    assert found.determined
    assert found.verdict["seen"].ok and found.verdict["alone"].ok and found.verdict["converged"].ok
    assert np.abs(found.orbit.at(EPOCH)[:3] - STATE[:3]).max() < 1e-3  # the truth goes by shorter steps
    assert np.abs(found.orbit.at(EPOCH + float(T[-1])) - path[-1])[:3].max() < 1e-3
    assert abs(next(one["value"] for one in found.to_dict()["estimated"] if one["name"] == "cr_a_m") - CR_A_M) < 1e-6


def test_covariance_is_honest_over_seeds(path):
    """NEES of the six states and the constant at the answer: the mean of 20 is within chi-square's bounds of 99.9 %."""
    runs, total = 20, 0.0
    for seed in range(runs):
        noise = SIGMA * np.random.default_rng(100 + seed).standard_normal((len(T), 3))
        one = pz.determine(observations(path[:, :3] + noise, T, SIGMA), forces="default sphere=yes")
        facts = one.to_dict()
        error = np.array(facts["mean"]) - np.append(path[-1], CR_A_M)
        P = np.array(facts["covariance"])
        scale = np.sqrt(np.diag(P))
        total += error / scale @ np.linalg.solve(P / np.outer(scale, scale), error / scale)
    assert quantile(0.0005, 7 * runs) < total < quantile(0.9995, 7 * runs)


def test_covariance_in_the_axes_of_the_orbit_and_of_the_earth(found):
    for axes in ("RTN", "ITRF", "EME2000"):
        P = found.orbit.covariance(axes=axes)
        np.linalg.cholesky(P)
        assert np.trace(P[:3, :3]) == pytest.approx(np.trace(found.orbit.covariance()[:3, :3]), rel=1e-9)
    later = found.orbit.covariance(found.epoch + 86400.0)
    assert np.trace(later[:3, :3]) > np.trace(found.orbit.covariance()[:3, :3])


def test_nothing_depends_on_the_axes_of_the_fixes(noisy, found):
    dates = [EPOCH + float(t) for t in T]
    for frame in ("ITRF", "EME2000", "TEME"):
        turned = earth.transform(noisy, None, "GCRF", frame, dates, earth.SubdailyEOP())[0]
        other = pz.determine(observations(turned, T, SIGMA, frame))
        assert np.abs(other.orbit.at() - found.orbit.at())[:3].max() < 2e-4
        assert other.analysis.residual == pytest.approx(found.analysis.residual, abs=2e-4)


def test_nothing_depends_on_the_epoch_or_the_order_of_rows(noisy, found):
    mixed = np.random.default_rng(3).permutation(len(T))
    other = pz.determine(observations(noisy[mixed], T[mixed] - 7200.0, SIGMA, epoch=EPOCH + 7200.0))
    assert np.abs(other.orbit.at() - found.orbit.at())[:3].max() < 1e-4
    assert any("out of order" in text for text in other.setup.assumed)


def test_the_frame_and_epoch_of_the_answer(noisy, found):
    other = pz.determine(observations(noisy, T, SIGMA), frame="EME2000", epoch="2015-05-05T06:00:07 TT")
    when = pz.Epoch("2015-05-05T06:00:07 TT")
    assert other.epoch == when or abs(other.epoch - when) < 1e-9
    facts = other.to_dict()
    assert facts["epoch"].endswith(" TT") and facts["frame"] == "EME2000"
    turned = earth.transform(np.array(facts["mean"][:3]), np.array(facts["mean"][3:6]), "EME2000", "GCRF", when)
    assert np.abs(np.concatenate(turned) - found.orbit.at(when))[:3].max() < 1e-4


def test_anisotropic_sigmas_turn_with_their_axes(noisy):
    dates = [EPOCH + float(t) for t in T]
    turned = earth.transform(noisy, None, "GCRF", "ITRF", dates, earth.SubdailyEOP())[0]
    sigma = np.tile([5.0, 20.0, 50.0], len(T))
    found = pz.determine(observations(turned, T, sigma, "ITRF"))
    assert found.determined and len(found.problem.stations) == len(T)
    assert {one["station"] for one in found.to_dict()["residuals"]} == {"fixes"}


def test_three_values_for_six_are_not_seen(path):
    found = pz.determine(observations(path[:1, :3], T[:1], SIGMA), guess=_guess(STATE))
    assert not found.determined
    assert found.verdict["seen"].ok is False
    assert found.to_dict()["success"] in (True, False)


def _guess(state):
    return Guess(EPOCH, state[:3], state[3:], "test")


def test_estimators_agree(noisy):
    found = pz.determine(observations(noisy, T, SIGMA), with_=["graph", "batch", "smoother"])
    assert found.verdict["agreed"].ok is True
    assert found.verdict["agreed"].figure < 0.3


def test_too_small_sigmas_are_told(noisy):
    found = pz.determine(observations(noisy, T, SIGMA / 4))
    honest = found.verdict["honest"]
    assert honest.ok is False and honest.figure == pytest.approx(4.0, rel=0.2)
    assert found.determined


def test_the_object_is_json(found):
    facts = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert facts["schema"] == "piazzi.determine/1"
    assert facts["names"][:6] == ["x", "y", "z", "vx", "vy", "vz"] and facts["units"][:6] == ["m"] * 3 + ["m/s"] * 3
    assert list(facts["verdict"]) == ["seen", "alone", "converged", "honest", "agreed", "complete"]
    for sentence in facts["verdict"].values():
        assert set(sentence) == {"ok", "figure", "test", "sentence"}
    np.linalg.cholesky(np.array(facts["covariance"]))
    assert np.sqrt(np.diag(facts["covariance"])) == pytest.approx(facts["sigma"])
    (group,) = [g for g in facts["residuals"] if g["component"] == "x"]
    assert group["count"] == len(T) and 0.9 * len(T) < group["used"] <= len(T) and group["unit"] == "m"
    assert group["count"] - group["used"] == sum(r["component"] == "x" for r in facts["rejected"])


def test_residuals_and_what_is_printed(found):
    rows = found.residuals
    assert {"station", "kind", "observed", "computed", "o_minus_c", "sigma", "weight", "used", "reason"} <= set(rows)
    assert "time" in rows.coords and rows.sizes["measurement"] == 3 * len(T)
    assert np.allclose(rows["observed"] - rows["computed"], rows["o_minus_c"])
    assert "determined by graph" in str(found) and "Seen:" in str(found)


@pytest.mark.parametrize("ending", [".oem", ".opm"])
def test_products_are_read_back(found, tmp_path, ending):
    file = tmp_path / f"orbit{ending}"
    found.write(file)
    arc = pz.read_ephemeris(file).arcs[0]
    k = len(arc) - 1
    assert np.abs(arc.position[k] - found.orbit.at(arc.instant(k))[:3]).max() < 1e-4
    for P in arc.covariance:
        np.linalg.cholesky(P)
    assert file.read_text().count("COMMENT") >= 7


def test_an_earlier_determination_is_a_guess(found, noisy, tmp_path):
    file = tmp_path / "before.json"
    found.write(file)
    other = pz.determine(observations(noisy, T, SIGMA), guess=file)
    assert np.abs(other.orbit.at() - found.orbit.at())[:3].max() < 1e-4


def test_a_guess_a_thousand_kilometres_off(noisy, found):
    state = STATE + np.array([6e5, -6e5, 5e5, 50.0, -50.0, 50.0])
    other = pz.determine(observations(noisy, T, SIGMA), guess=_guess(state))
    assert other.determined
    assert np.abs(other.orbit.at() - found.orbit.at())[:3].max() < 1e-3


def test_gross_errors_are_found_and_nothing_else_is_lost(path):
    """Five of 48 fixes are 20 sigma off: all are left out and named, and of the good ones as many as chance says."""
    rng = np.random.default_rng(11)
    values = path[:, :3] + SIGMA * rng.standard_normal((len(T), 3))
    bad = rng.choice(len(T), 5, replace=False)
    values[bad] += 20.0 * SIGMA * np.array([1.0, -1.0, 1.0])
    found = pz.determine(observations(values, T, SIGMA))
    assert found.determined and not found.keep[bad].any()
    lost = np.setdiff1d(np.flatnonzero(~found.keep), bad)
    assert len(lost) <= 5  # 43 good ones, of which 1.8 % are beyond the gate
    facts = found.to_dict()
    assert {one["reason"] for one in facts["rejected"]} == {"outlier"}
    assert len(facts["rejected"]) == 3 * (5 + len(lost))
    good = pz.determine(observations(np.delete(values, bad, axis=0), np.delete(T, bad), SIGMA))
    assert np.abs(found.orbit.at(EPOCH) - good.orbit.at(EPOCH))[:3].max() < 0.1


def test_a_row_twice_counts_once(noisy, found):
    again = observations(np.vstack([noisy, noisy[-3:]]), np.append(T, T[-3:]), SIGMA)
    other = pz.determine(again)
    assert [one["reason"] for one in other.to_dict()["rejected"]].count("duplicate") == 9
    apart = np.abs(other.orbit.at() - found.orbit.at())[:3]  # where estimators begin counts a share of 1e-4
    assert (apart < 1e-3 * np.sqrt(np.diag(found.orbit.covariance())[:3])).all()


def test_the_difference_to_another_orbit(found, tmp_path):
    found.write(tmp_path / "own.oem", step=900.0)
    apart = against(found, tmp_path / "own.oem")
    assert apart.rms_3d < 1e-3 and apart.covered == 1.0
