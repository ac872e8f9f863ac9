"""What is written is read back as the same, here and by readers of others."""

import random
from dataclasses import fields, replace

import ccsds_ndm
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from oem import OrbitEphemerisMessage

import piazzi as pz
from piazzi.formats import Observations, Segment
from piazzi.formats.dates import instants, read_dates
from piazzi.formats.write_ocm import ocm_text
from piazzi.formats.write_odm import oem_text, omm_text, opm_text
from piazzi.formats.write_tdm import tdm_text
from piazzi.formats.writing import dates, in_unit

MADE = "2020-01-01T00:00:00"
TDM = ["2", "4", "6", "8", "15", "AllKeywordsSequential", "AllKeywordsSequentialWithRollover", "AllKeywordsSingleDiff"]
OEM = [
    "OEMExample1.txt", "OEMExample3.txt", "OEMExample3.xml", "OEMExample5.txt", "OEMExample5ITRF.txt", "OEMExample6.txt",
    "oemLowerCaseValue.oem", "test_cov.oem", "ISS.resampled.truncated.txt",
]  # fmt: skip
OPM = [
    "OPMExample1.txt", "OPMExample2.txt", "OPMExample3.txt", "OPMExample3.xml", "OPMExample4.txt", "OPMExample5.txt",
    "OPM-dummy-emb.txt", "OPM-dummy-moon-EME2000.txt", "OPM-frame-mapper-gcrf.txt", "OPMExamplePartialManeuver.txt",
]  # fmt: skip


def again(text, path, reader):
    path.write_text(text)
    return reader(path)


def same_arc(one, other, time=1e-9):
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if field.name in ("lines", "said"):
            continue
        if field.name in ("epoch", "frame_epoch"):
            assert (a is None) == (b is None) and (a is None or abs(a - b) < 1 + time)
        elif field.name == "useable":
            assert all((u is None) == (v is None) and (u is None or abs(u - v) < time) for u, v in zip(a, b, strict=True))
        elif field.name in ("t", "covariance_t"):
            assert_allclose(a + (one.epoch - other.epoch), b, rtol=0, atol=time)
        elif field.name == "burns":
            assert len(a) == len(b)
            for u, v in zip(a, b, strict=True):
                assert abs(u.epoch - v.epoch) < time and u[1:2] + u[3:] == v[1:2] + v[3:]
        elif isinstance(a, np.ndarray):
            assert_array_equal(a, b, field.name)
        else:
            assert a == b, field.name


@pytest.mark.parametrize("name", [*(f"kvn/TDMExample{n}.txt" for n in TDM), "xml/TDMExample8.xml"])
def test_tracking_is_read_back_as_it_was(name, data_dir, tmp_path):
    rows = pz.read_tracking(data_dir / "ccsds/tdm" / name)
    text = tdm_text(rows, created=MADE)
    back = again(text, tmp_path / "a", pz.read_tracking)
    assert_array_equal(rows.value, back.value)
    assert_allclose(rows.t + (rows.epoch - back.epoch), back.t, rtol=0, atol=1e-9)
    for one, other in zip(rows.segments, back.segments, strict=True):
        assert replace(one, said=()) == replace(other, said=())
    for column in ("station", "object", "participant"):
        assert_array_equal(getattr(rows, column), getattr(back, column))
    assert rows.participants == back.participants and [rows.kinds[i] for i in rows.kind] == [back.kinds[i] for i in back.kind]
    assert tdm_text(back, created=MADE) == text


@pytest.mark.parametrize("name", OEM)
def test_ephemerides_are_read_back_as_they_were(name, data_dir, tmp_path):
    found = pz.read_ephemeris(data_dir / "ccsds/odm/oem" / name)
    text = oem_text(found, created=MADE)
    back = again(text, tmp_path / "a", pz.read_ephemeris)
    for one, other in zip(found.arcs, back.arcs, strict=True):
        same_arc(one, other)
    assert oem_text(back, created=MADE) == text


@pytest.mark.parametrize("name", OPM)
def test_states_are_read_back_as_they_were(name, data_dir, tmp_path):
    arc = pz.read_ephemeris(data_dir / "ccsds/odm/opm" / name).arcs[0]
    text = opm_text(arc, created=MADE)
    back = again(text, tmp_path / "a", pz.read_ephemeris).arcs[0]
    same_arc(arc, back)
    assert opm_text(back, created=MADE) == text


@pytest.mark.parametrize(
    "name", ["OMMExample1.txt", "OMMExample2.xml", "OMMExample3_utc.txt", "OMMExample4.txt", "OMMExample5.txt"]
)
def test_mean_elements_are_read_back_as_they_were(name, data_dir, tmp_path):
    mean = pz.read_ephemeris(data_dir / "ccsds/odm/omm" / name).mean[0]
    text = omm_text(mean, created=MADE)
    back = again(text, tmp_path / "a", pz.read_ephemeris).mean[0]
    assert abs(back.epoch - mean.epoch) < 1e-9
    assert replace(mean, said=(), epoch=back.epoch) == replace(back, said=())
    assert omm_text(back, created=MADE) == text


def test_covariances_have_seventeen_digits_their_axes_and_a_cholesky_factor(data_dir, tmp_path):
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6)) * np.array([1e2, 1e2, 1e2, 1e-1, 1e-1, 1e-1])[:, None]
    arc = pz.read_ephemeris(data_dir / "ccsds/odm/oem/test_cov.oem").arcs[0]
    arc = replace(arc, covariance=(root @ root.T)[None], covariance_frames=("RTN",), covariance_t=np.zeros(1))
    text = oem_text(pz.Ephemeris(arcs=(arc,)), created=MADE)
    block = text.split("COVARIANCE_START\n")[1].split("\n")
    assert block[1] == "COV_REF_FRAME = RTN"
    assert [len(line.split()) for line in block[2:8]] == [1, 2, 3, 4, 5, 6]
    assert all(len(word.lstrip("-").split("e")[0].replace(".", "")) == 17 for line in block[2:8] for word in line.split())
    back = again(text, tmp_path / "a", pz.read_ephemeris).arcs[0]
    np.linalg.cholesky(back.covariance[0])
    assert_allclose(back.covariance[0], arc.covariance[0], rtol=3e-16)


def test_what_cannot_be_written_is_said(data_dir):
    arc = pz.read_ephemeris(data_dir / "ccsds/odm/oem/OEMExample5.txt").arcs[0]
    for changed, says in [({"frame": None}, "axes"), ({"scale": None}, "time scale"), ({"centre": "\u2028"}, "centre")]:
        with pytest.raises(ValueError, match=f"the {says} of ISS must be known"):
            oem_text(pz.Ephemeris(arcs=(replace(arc, **changed),)))
    with pytest.raises(ValueError, match="positions and velocities"):
        oem_text(pz.Ephemeris(arcs=(replace(arc, velocity=np.array(np.nan)),)))
    with pytest.raises(ValueError, match="one state, and there are 49: write an OEM"):
        opm_text(arc)
    with pytest.raises(ValueError, match="no states"):
        oem_text(pz.Ephemeris(arcs=()))
    rows = pz.read_tracking(data_dir / "ccsds/odm/oem/OEMExample5.txt")
    with pytest.raises(ValueError, match="no keyword for x, y, z, vx, vy, vz"):
        tdm_text(rows)


@pytest.mark.parametrize("name", ["A\x9dB", "A\nB", "\x1b[31mA"])
def test_a_name_with_control_characters_stays_on_the_line_of_its_message(name, data_dir):
    arc = pz.read_ephemeris(data_dir / "ccsds/odm/oem/OEMExample5.txt").arcs[0]
    with pytest.raises(ValueError, match="positions and velocities") as told:
        oem_text(pz.Ephemeris(arcs=(replace(arc, name=name, velocity=np.array(np.nan)),)))
    assert str(told.value).isprintable()


def test_tracking_of_other_origin_gets_segments_that_the_format_can_say(tmp_path):
    segments = (Segment("UTC", way="two-way", tag="bounce"), Segment("TT", way="one-way", frame="GCRF", interval=10.0))
    rows = Observations(
        epoch=pz.Epoch("2020-01-01T00:00:00 TT"), t=[0.0, 1.0, 1.0, 2.0, 2.0, 3.0], value=[1.0, 0.1, 0.2, 0.3, 0.4, 5.0],
        kinds=("range", "azimuth", "elevation", "right_ascension", "declination", "range_rate"), kind=[0, 1, 2, 3, 4, 5],
        participants=("A", "SAT", "B"), station=[0, 0, 0, 0, 0, 2], object=1, segments=segments, segment=1,
    )  # fmt: skip
    back = again(tdm_text(rows, created=MADE), tmp_path / "a", pz.read_tracking)
    assert sorted(zip(back.t.tolist(), back.value.tolist(), [back.kinds[i] for i in back.kind], strict=True)) == sorted(
        zip(rows.t.tolist(), rows.value.tolist(), [rows.kinds[i] for i in rows.kind], strict=True)
    )
    assert [s.path for s in back.segments] == [("SAT", "A"), ("SAT", "A"), ("SAT", "B")]
    assert back.stations == ("A", "B") and back.objects == ("SAT",)
    with pytest.raises(ValueError, match="times are those of the bounce"):
        tdm_text(replace(rows, segment=0, tag=2))


def test_numbers_that_were_read_in_any_unit_are_found_again():
    rng = np.random.default_rng(1)
    for factor in (1e3, 1e6, 1e9, np.pi / 180, 299792458.0, 1e-2, 1 / 1000, 2 * np.pi / 86400):
        read = rng.normal(size=20000) * 10.0 ** rng.integers(-9, 9, 20000)
        assert_array_equal(in_unit(read * factor, factor) * factor, read * factor)


@pytest.mark.parametrize("scale", ["UTC", "TAI", "TT", "TDB", "GPS", "TCG", "UT1"])
def test_dates_are_those_of_epoch_and_are_read_again(scale):
    rng = random.Random(1)
    epoch = pz.Epoch("2016-12-31T23:59:00 UTC")
    t = np.array([*(rng.uniform(0, 120) for _ in range(50)), 59.9999999999, 60.5, 61.0, 62.0, 0.0, 86400.0 * 400 + 0.25])
    texts = dates(scale, epoch, t)
    for text, seconds in zip(texts, t, strict=True):
        assert abs(pz.Epoch(text, scale) - (epoch + float(seconds))) < 6e-10, text
    readings, bad = read_dates(np.array(texts, dtype="S"))
    assert not bad.any()
    assert dates(scale, *instants(scale, readings, epoch)) == texts


@pytest.mark.parametrize("form", ["tdm", "oem", "opm", "omm"])
def test_a_reader_in_rust_takes_what_is_written(form, data_dir):
    folder = data_dir / "ccsds"
    if form == "tdm":
        for name in ("2", "4", "6", "8"):
            rows = pz.read_tracking(folder / f"tdm/kvn/TDMExample{name}.txt")
            found = ccsds_ndm.from_str(tdm_text(rows, created=MADE))
            assert sum(len(segment.data.observations) for segment in found.segments) == len(rows)
    elif form == "oem":
        given = pz.read_ephemeris(folder / "odm/oem/OEMExample3.txt")
        found = ccsds_ndm.from_str(oem_text(given, created=MADE))
        for arc, segment in zip(given.arcs, found.segments, strict=True):
            assert_array_equal([state.x for state in segment.data.state_vector], in_unit(arc.position[:, 0], 1e3))
            assert len(segment.data.covariance_matrix) == len(arc.covariance_frames)
    elif form == "opm":
        arc = pz.read_ephemeris(folder / "odm/opm/OPMExample2.txt").arcs[0]
        assert type(ccsds_ndm.from_str(opm_text(arc, created=MADE))).__name__ == "Opm"
    else:
        mean = pz.read_ephemeris(folder / "odm/omm/OMMExample1.txt").mean[0]
        assert type(ccsds_ndm.from_str(omm_text(mean, created=MADE))).__name__ == "Omm"


@pytest.mark.parametrize("name", ["OEMExample5.txt", "OEMExample8.txt", "test_cov.oem"])
def test_a_reader_in_python_takes_what_is_written(name, data_dir, tmp_path):
    given = pz.read_ephemeris(data_dir / "ccsds/odm/oem" / name)
    (tmp_path / "a.oem").write_text(oem_text(given, created=MADE))
    found = OrbitEphemerisMessage.open(tmp_path / "a.oem")
    for arc, segment in zip(given.arcs, found, strict=True):
        assert_allclose([state.position for state in segment.states], arc.position / 1e3, rtol=1e-15)
        blocks = [block.matrix for block in segment.covariances]
        assert len(blocks) == len(arc.covariance_frames)
        assert_allclose(np.reshape(blocks, (-1, 6, 6)), arc.covariance / 1e6, rtol=1e-15)


def test_a_comprehensive_message_is_read_by_another_reader(data_dir):
    arc = pz.read_ephemeris(data_dir / "ccsds/odm/oem/OEMExample3.txt").arcs[2]
    arc = replace(arc, frame="GCRF", centre="EARTH", spacecraft=(("mass", 1000.0), ("drag_area", 2.0)))
    told = {
        "OD_ID": "1", "OD_METHOD": "BWLS", "OD_EPOCH": "1996-12-28T22:00:02", "OBS_AVAILABLE": 300, "OBS_USED": 290,
        "ACTUAL_OD_SPAN": 3.5, "WEIGHTED_RMS": 0.98, "SENSORS": "7090, 7105",
    }  # fmt: skip
    text = ocm_text(arc, determination=told, created=MADE)
    found = ccsds_ndm.from_str(text).segment.data
    (trajectory,) = found.traj
    assert [line.values for line in trajectory.traj_lines] == in_unit(np.hstack([arc.position, arc.velocity]), 1e3).tolist()
    assert [block.cov_ref_frame for block in found.cov] == ["RTN", "EME2000"]
    lower = in_unit(arc.covariance, 1e6)[:, *np.tril_indices(6)]
    assert_array_equal([line.values for block in found.cov for line in block.cov_lines], lower)
    assert (found.od.obs_used, found.od.weighted_rms) == (290, 0.98)
    assert found.phys.wet_mass == 1000.0


@pytest.mark.parametrize(
    ("told", "says"),
    [({"OD_EPOC": 1}, "did you mean 'OD_EPOCH'"), ({"OD_ID": 1, "OD_METHOD": "x"}, "needs OD_EPOCH")],
)
def test_a_determination_has_the_keywords_of_the_standard(data_dir, told, says):
    arc = pz.read_ephemeris(data_dir / "ccsds/odm/oem/OEMExample5.txt").arcs[0]
    with pytest.raises(ValueError, match=says):
        ocm_text(arc, determination=told)
    with pytest.raises(ValueError, match="the axes of ISS must be known"):
        ocm_text(replace(arc, frame=None))
