"""The result by its contract: keys and their order, units, counts, frames and scales, and that files say the same."""

import json
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi import earth
from piazzi.determination.against import against
from piazzi.formats import Ephemeris, oem_text
from piazzi.orbit import state_axes
from tests.determination.fixing import EPOCH, observations, truth
from tests.determination.schema import check

T = np.arange(0.0, 86400.0, 1800.0)
SIGMA = 10.0


@pytest.fixture(scope="module")
def path():
    return truth(T)[:, :3] + SIGMA * np.random.default_rng(1).standard_normal((len(T), 3))


@pytest.fixture(scope="module")
def found(path):
    wrong = path.copy()
    wrong[10] += 5e3
    return pz.determine(observations(wrong, T, SIGMA))


@pytest.fixture(scope="module")
def facts(found):
    return json.loads(json.dumps(found.to_dict(), allow_nan=False))


def test_the_object_is_that_of_the_schema(facts):
    check(facts, 3 * len(T))
    assert facts["frame"] == "GCRF" and facts["epoch"].endswith(" UTC") and facts["elements"]["kind"] == "keplerian"


def test_where_there_is_no_orbit_the_object_has_the_same_keys(facts):
    from piazzi.determination.document import undetermined
    from piazzi.determination.initial_result import InitialOrbits, UndeterminedError

    other = json.loads(json.dumps(undetermined(UndeterminedError(InitialOrbits((), 0, 0)), "SAT"), allow_nan=False))
    check(other)
    assert other["determined"] is False and other["verdict"]["seen"]["ok"] is False and other["orbits"]["schema"]
    assert [one["ok"] for one in list(other["verdict"].values())[1:]] == [None] * 5


def test_other_programs_read_the_products(found, tmp_path):
    """States and covariances as the packages `oem` and `sgp4` have them; every covariance is positive definite there."""
    import ccsds_ndm
    from oem import OrbitEphemerisMessage
    from sgp4.api import Satrec

    found.write(tmp_path / "a.oem", span="first .. last+1d", step=1800.0)
    (segment,) = OrbitEphemerisMessage.open(tmp_path / "a.oem").segments
    covariances = list(segment.covariances)
    assert len(covariances) == len(list(segment)) > 90
    for one in covariances:
        scale = np.sqrt(np.diag(one.matrix))
        np.linalg.cholesky(one.matrix)
        assert np.linalg.eigvalsh(one.matrix / np.outer(scale, scale))[0] > 0.0
    again = ccsds_ndm.from_file(str(tmp_path / "a.oem")).segments[0].data.covariance_matrix_numpy
    assert_allclose(again, [one.matrix for one in covariances], rtol=1e-15, atol=0.0)
    np.linalg.cholesky(again)
    state = list(segment)[5]
    assert_allclose(1e3 * np.append(state.position, state.velocity), found.orbit.at(EPOCH + 9000.0), rtol=0, atol=1e-5)
    found.write(tmp_path / "a.tle")
    one, two = (tmp_path / "a.tle").read_text().splitlines()[-2:]
    elements = Satrec.twoline2rv(one, two)
    found.write(tmp_path / "a.omm")
    (mean,) = pz.read_ephemeris(tmp_path / "a.omm").mean
    assert abs(dict(mean.elements)["mean_motion"] - elements.no_kozai / 60.0) < 1e-9 * elements.no_kozai
    for t in (0.0, 43200.0, T[-1]):
        epoch = EPOCH + t
        failed, r, v = elements.sgp4(*epoch.jd("UTC"))
        place = earth.transform(1e3 * np.array(r), 1e3 * np.array(v), "TEME", "GCRF", epoch)[0]
        assert not failed and np.linalg.norm(place - found.orbit.at(epoch)[:3]) < 2e3


@pytest.mark.parametrize(("views", "ok"), [(("realtime", "delayed"), True), (("delayed", "delayed"), False)])
def test_an_answer_of_real_time_may_differ_by_more(views, ok):
    """In the middle of the rows a filter knows half of them: two sigma of its own are no disagreement with a fit of all."""
    from types import SimpleNamespace

    from piazzi.determination.verdict import agreed

    estimates = {
        name: SimpleNamespace(view=view, success=True, mean=np.full((1, 6), 2.0 * i), covariance=np.eye(6)[None])
        for i, (name, view) in enumerate(zip("ab", views, strict=True))
    }
    found = agreed(SimpleNamespace(solution=0), "a", estimates)
    assert (found.ok, found.figure) == (ok, 2.0)


def test_the_answer_stands_at_the_last_row_that_was_used(path):
    wrong = path.copy()
    wrong[-1] += 5e3
    found = pz.determine(observations(wrong, T, SIGMA))
    assert abs(found.epoch - (EPOCH + T[-2])) < 1e-9 and found.to_dict()["span"]["last"] == found.to_dict()["epoch"]
    assert {one["reason"] for one in found.to_dict()["rejected"]} == {"outlier"}
    asked = pz.determine(observations(wrong, T, SIGMA), epoch=EPOCH + T[-1])
    assert abs(asked.epoch - (EPOCH + T[-1])) < 1e-9
    np.testing.assert_allclose(asked.orbit.at(found.epoch), found.orbit.at(), rtol=0, atol=1e-3)


def test_a_page_makes_its_folder(found, tmp_path):
    assert found.report(tmp_path / "new" / "page").name == "report.html"


def test_counts_are_of_all_rows_and_of_those_used(found, facts):
    assert [one["count"] for one in facts["residuals"]] == [len(T)] * 3
    rows = found.residuals
    for one in facts["residuals"]:
        own = (rows["station"] == one["station"]) & (rows["kind"] == one["component"])
        assert one["used"] == int(rows["used"].where(own, False).sum())
        left = rows["o_minus_c"].values[own.values & rows["used"].values]
        assert one["rms"] == pytest.approx(np.sqrt(np.mean(left**2))) and one["mean"] == pytest.approx(np.mean(left))
    assert len(facts["rejected"]) == sum(one["count"] - one["used"] for one in facts["residuals"]) > 0


def test_residuals_are_a_dataset_of_these_variables(found, path):
    rows = found.residuals
    names = {"time", "station", "kind", "observed", "computed", "o_minus_c", "sigma", "weight", "used", "reason"}
    assert names <= set(rows.variables) and rows.sizes["measurement"] == 3 * len(T)
    assert_allclose(rows["observed"] - rows["computed"], rows["o_minus_c"], atol=1e-6)
    assert (rows["weight"].values[~rows["used"].values] == 0).all()
    assert all(rows["reason"].values[~rows["used"].values] != "")
    good = rows["used"].values
    assert 0.7 < np.std(rows["o_minus_c"].values[good]) / SIGMA < 1.3


def test_the_orbit_at_any_date_in_any_axes(found):
    when = EPOCH + 3600.0
    state = found.orbit.at(when)
    there = found.orbit.to("ITRF").at(when)
    r, v = earth.transform(state[:3], state[3:], "GCRF", "ITRF", when, earth.SubdailyEOP())
    assert_allclose(there, [*r, *v], rtol=1e-12)
    rtn = found.orbit.covariance(when, axes="RTN")
    A = state_axes(state[:3], state[3:])
    assert_allclose(rtn, A @ found.orbit.covariance(when) @ A.T, rtol=1e-6, atol=1e-12)
    elements = found.orbit.elements()
    assert elements["kind"] == "keplerian" and elements["names"][0] == "a"
    energy = 0.5 * found.orbit.at()[3:] @ found.orbit.at()[3:] - 3.986004418e14 / np.linalg.norm(found.orbit.at()[:3])
    assert elements["mean"][0] == pytest.approx(-3.986004418e14 / (2.0 * energy), rel=1e-7)
    assert found.orbit.at("2015-05-05T01:00:00 UTC").tolist() == state.tolist()


@pytest.mark.parametrize("epoch", ["2015-05-05T06:00:00 TT", "2015-05-05T06:00:00 TAI", "2015-05-05T06:00:00 GPS", None])
def test_epochs_are_told_in_the_scale_that_was_asked_for(found, path, epoch):
    other = pz.determine(observations(path, T, SIGMA), epoch=epoch, frame="EME2000")
    told = other.to_dict()
    assert told["frame"] == "EME2000" == told["elements"]["frame"]
    scale = "UTC" if epoch is None else epoch.split()[1]
    assert told["epoch"].endswith(f" {scale}")
    assert abs(pz.Epoch(told["epoch"]) - (EPOCH + T[-1] if epoch is None else pz.Epoch(epoch))) < 1e-6
    again = other.orbit.to("GCRF").at(EPOCH + 7200.0)
    plain = pz.determine(observations(path, T, SIGMA)).orbit.at(EPOCH + 7200.0)
    assert_allclose(again, plain, rtol=0, atol=1e-3)


def test_products_hold_the_same_orbit(found, tmp_path):
    found.write(tmp_path / "a.oem", span="first .. last+1h", step=600.0)
    arc = pz.read_ephemeris(tmp_path / "a.oem").arcs[0]
    assert_allclose(np.append(arc.position[7], arc.velocity[7]), found.orbit.at(arc.instant(7)), rtol=0, atol=1e-5)
    for P, t in zip(arc.covariance[::30], arc.covariance_t[::30], strict=True):
        np.linalg.cholesky(P)
        assert_allclose(np.diag(P), np.diag(found.orbit.covariance(arc.epoch + float(t))), rtol=1e-6)
    text = (tmp_path / "a.oem").read_text()
    for sentence in found.verdict.values():
        assert f"COMMENT {sentence.sentence[:60]}" in text
    assert "COMMENT Measurements from" in text and "COMMENT Earth orientation of" in text
    assert len(found.ephemeris(step=3600.0).arcs[0]) == 25
    for name in ("a.opm", "a.ocm", "a.nc", "a.csv", "a.json"):
        found.write(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 500
    with pytest.raises(ValueError, match="a product ends in"):
        found.write(tmp_path / "a.xyz")
    with pytest.raises(OSError, match="no folder"):
        found.write(tmp_path / "nowhere" / "a.oem")


def test_the_difference_to_another_orbit_is_told_along_its_axes_and_in_sigma(found, tmp_path):
    """An orbit 30 m ahead along the track is so, and nothing else."""
    arc = found.ephemeris(step=600.0).arcs[0]
    axes = np.array([state_axes(r, v)[1, :3] for r, v in zip(arc.position, arc.velocity, strict=True)])
    other = Ephemeris(arcs=(replace(arc, position=arc.position + 30.0 * axes),))
    (tmp_path / "other.oem").write_text(oem_text(other))
    told = replace(found, notes={"against": {"file": "other.oem", **against(found, tmp_path / "other.oem").to_dict()}})
    rms = told.to_dict()["against"]["rms"]
    assert rms["T"] == pytest.approx(30.0, rel=1e-3) and rms["R"] < 0.01 and rms["N"] < 0.01
    assert told.to_dict()["against"]["in_sigma"]["rms"]["T"] > 1.0
    assert "Against other.oem: rms R" in str(told) and "in sigma R" in str(told)


def test_covariances_that_are_too_small_are_written_larger_and_it_is_said(path, tmp_path):
    bold = pz.determine(observations(path, T, SIGMA / 3))
    factor = bold.verdict["honest"].figure
    assert bold.verdict["honest"].ok is False and 2 < factor < 4
    for name, formal in (("scaled.opm", None), ("formal.opm", True)):
        bold.write(tmp_path / name, formal=formal)
    scaled, formal = (pz.read_ephemeris(tmp_path / f"{name}.opm").arcs[0].covariance[0] for name in ("scaled", "formal"))
    assert_allclose(scaled, factor**2 * formal, rtol=1e-9)
    said = (tmp_path / "scaled.opm").read_text(), (tmp_path / "formal.opm").read_text()
    assert (
        f"times {factor**2:.3g}: the verdict finds errors {factor:.3g} times as large" in said[0]
        and "Covariances are those of the fit, though" in said[1]
    )


GEOS3 = (
    "x=5975.2904km y=2568.6400km z=3120.5845km vx=3.983846km/s vy=-2.071159km/s vz=-5.917095km/s "
    "epoch=1995-01-29T02:38:37Z frame=EME2000"
)
BOOK = ["range=92.5m", "azimuth=0.0224deg", "elevation=0.0139deg"]
KAENA = earth.Station.geodetic("932", np.radians(21.572056), np.radians(-158.266578), 300.2)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:1801-01-01.*Earth orientation tables")
@pytest.mark.parametrize(
    ("file", "rows", "words"),
    [
        ("lageos-2", 95, {}),
        ("ceres-1801", None, {}),
        ("sp3/gps_g01_g05_20150505.sp3", 3 * 288, {"object": "G05"}),
        (
            "geos3/7734.OBS",
            None,
            {"repair": "exponent", "stations": [KAENA], "sigma": BOOK, "guess": GEOS3, "estimate": "bias.range.932/pass=92.5m"},
        ),
    ],
)
def test_real_orbits_are_told_by_the_schema(data_dir, tmp_path, file, rows, words):
    """Lasers, a comet-hunter's quadrant, precise positions, and the first day of a radar."""
    path = data_dir / "earth" / file if "/" in file else file
    if "7734" in file:
        lines = [line for line in path.read_text().splitlines(keepends=True) if "95029" in line]
        (tmp_path / "day.obs").write_text("".join(lines))
        path, rows = tmp_path / "day.obs", 3 * len(lines)
    check(json.loads(json.dumps(pz.determine(path, **words).to_dict(), allow_nan=False)), rows)
