"""Every keyword of a TDM's data, and every flag of its metadata: measured, used, or left out and said; and by how much."""

from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi import earth
from piazzi.determination.sensing import measured, of_object
from piazzi.earth.stations import Coordinates
from piazzi.formats import KINDS
from piazzi.formats.tdm_keywords import DATA, OF_PARTICIPANT

C = 299792458.0
MEASURED, USED, SAID = "measured", "used", "left out, and said"
KEYWORDS = {
    "RANGE": MEASURED, "DOPPLER_INSTANTANEOUS": MEASURED, "DOPPLER_INTEGRATED": MEASURED, "DOPPLER_COUNT": MEASURED,
    "RECEIVE_FREQ": MEASURED, "RECEIVE_PHASE_CT": MEASURED, "ANGLE_1": MEASURED, "ANGLE_2": MEASURED, "DOR": MEASURED,
    "VLBI_DELAY": MEASURED,
    "TRANSMIT_FREQ": USED, "TRANSMIT_FREQ_RATE": USED, "CLOCK_BIAS": USED, "CLOCK_DRIFT": USED, "PRESSURE": USED,
    "RHUMIDITY": USED, "TEMPERATURE": USED,
    "CARRIER_POWER": SAID, "PC_N0": SAID, "PR_N0": SAID, "MAG": SAID, "RCS": SAID, "STEC": SAID, "TROPO_DRY": SAID,
    "TROPO_WET": SAID, "TRANSMIT_PHASE_CT": SAID,
}  # fmt: skip
TWO_WAY = {"MODE": "SEQUENTIAL", "PATH": "1,2,1", "TURNAROUND_NUMERATOR": "240", "TURNAROUND_DENOMINATOR": "221"}
DIFFERENCE = {"MODE": "SINGLE_DIFF", "PATH_1": "2,1", "PATH_2": "2,3"}
AVERAGED = {"INTEGRATION_INTERVAL": "10", "INTEGRATION_REF": "START"}
MOUNT = {**TWO_WAY, "ANGLE_TYPE": "AZEL"}
METADATA = {
    "DOPPLER_INTEGRATED": {**TWO_WAY, **AVERAGED}, "DOR": DIFFERENCE, "VLBI_DELAY": DIFFERENCE,
    "ANGLE_1": MOUNT, "ANGLE_2": MOUNT,
}  # fmt: skip
SENT = [("TRANSMIT_FREQ_1", -100, 2.1e9)]


def site(name, longitude):
    return earth.Station(name, (Coordinates(tuple(earth.geodetic_to_position(0.3, longitude, 100.0))),))


SITES = [site("DSS-25", 0.2), site("DSS-14", 0.21)]


def tdm(tmp_path, rows, **metadata):
    path = tmp_path / "a.tdm"
    meta = {"TIME_SYSTEM": "UTC", "PARTICIPANT_1": "DSS-25", "PARTICIPANT_2": "SAT", "PARTICIPANT_3": "DSS-14", **metadata}
    lines = [
        "CCSDS_TDM_VERS = 2.0", "CREATION_DATE = 2024-05-05T00:00:00", "ORIGINATOR = X", "META_START",
        *(f"{key} = {text}" for key, text in meta.items()), "META_STOP", "DATA_START",
        *(f"{key} = {(np.datetime64('2024-05-05T12:00:00') + np.timedelta64(t, 's'))} {value!r}" for key, t, value in rows),
        "DATA_STOP",
    ]  # fmt: skip
    path.write_text("\n".join(lines) + "\n")
    return path


def seen(tmp_path, rows, *, corrections="applied", range="two-way", **metadata):  # noqa: A002
    found = pz.read_tracking(tdm(tmp_path, rows, **metadata), range=range)
    sigma = np.array([np.nan if KINDS[kind].auxiliary else 0.1 for kind in found.kinds])[found.kind]
    return measured(replace(found, sigma=sigma), SITES, corrections=corrections)


def test_the_table_has_every_keyword():
    known = {name if name[-2:-1] != "_" or name.startswith("ANGLE") else name[:-2] for name in DATA}
    assert {*KEYWORDS} == known | {*OF_PARTICIPANT}


@pytest.mark.parametrize("keyword", [name for name, what in KEYWORDS.items() if what == MEASURED])
def test_what_is_measured(tmp_path, keyword):
    name = f"{keyword}_1" if keyword in ("RECEIVE_PHASE_CT",) else keyword
    partner = {"ANGLE_1": [("ANGLE_2", 0, 45.0)], "ANGLE_2": [("ANGLE_1", 0, 45.0)]}.get(keyword, [])
    found = seen(tmp_path, [*SENT, (name, 0, 40.0), *partner], **METADATA.get(keyword, TWO_WAY))
    assert np.isfinite(found.tracking.values).any() and len(found.sensors) == 1 and not found.left_out


@pytest.mark.parametrize("keyword", [name for name, what in KEYWORDS.items() if what == SAID])
def test_what_says_nothing_of_the_orbit_is_counted(tmp_path, keyword):
    name = f"{keyword}_1" if keyword in OF_PARTICIPANT else keyword
    found = seen(tmp_path, [("RANGE", 0, 1000.0), (name, 0, 1.0)], **TWO_WAY)
    assert len(found.tracking.row_times) == 1
    ((reason, count),) = found.left_out.items()
    assert reason.endswith("which say nothing of the orbit") and count == 1


def test_clocks_of_stations_move_times(tmp_path):
    plain = seen(tmp_path, [("RANGE", 10, 1000.0), ("RANGE", 20, 1000.0)], **TWO_WAY)
    late = [("RANGE", 10, 1000.0), ("RANGE", 20, 1000.0), ("CLOCK_BIAS", 0, 0.25)]
    found = seen(tmp_path, late, **TWO_WAY)
    t = found.tracking.times + (found.epoch - plain.epoch)
    assert t == pytest.approx(plain.tracking.times - 0.25, abs=1e-9)
    assert any("clock's bias, 0.25 s" in text for text in found.assumed)
    found = seen(tmp_path, [*late, ("CLOCK_DRIFT", 0, 1e-3)], **TWO_WAY)
    t = found.tracking.times + (found.epoch - plain.epoch)
    assert t == pytest.approx(plain.tracking.times - 0.25 - np.array([0.010, 0.020]), abs=1e-9)


def test_weather_is_that_of_the_file(tmp_path):
    weather = [("PRESSURE", 0, 900.0), ("TEMPERATURE", 0, 280.0), ("RHUMIDITY", 0, 50.0)]
    found = seen(tmp_path, [("RANGE", 0, 1000.0), *weather], corrections="open", **TWO_WAY)
    numbers = found.stations[0].numbers
    assert numbers["pressure"] == pytest.approx(9e4) and numbers["temperature"] == 280.0
    assert numbers["vapour"] == pytest.approx(0.5 * 991.0, rel=0.01)  # half of what saturates air at 280 K


def change(tmp_path, rows, before, after, **said):
    """Values and times of the same rows with other metadata, less those before."""
    one, other = (seen(tmp_path, rows, **{**TWO_WAY, **meta}, **said) for meta in (before, after))
    shift = other.epoch - one.epoch
    return (
        other.tracking.values[:, 0] - one.tracking.values[:, 0], other.tracking.row_times + shift - one.tracking.row_times,
        one, other,
    )  # fmt: skip


def test_range_units(tmp_path):
    for unit, number in (("KM", 1500.0), ("s", 1500e3 / C)):
        found = seen(tmp_path, [("RANGE", 0, number)], **TWO_WAY, RANGE_UNITS=unit)
        assert found.tracking.values[0, 0] == pytest.approx(1500e3, rel=1e-12)
    with pytest.raises(ValueError, match="--range-unit"):
        seen(tmp_path, [("RANGE", 0, 1e6)], **TWO_WAY, RANGE_UNITS="RU")


def test_range_modulus_is_refused_unless_it_is_none(tmp_path):
    values, _, _, _ = change(tmp_path, [("RANGE", 0, 1500.0)], {}, {"RANGE_MODULUS": "0.0"})
    assert values == 0.0
    with pytest.raises(ValueError, match="known up to a modulus"):
        seen(tmp_path, [("RANGE", 0, 1500.0)], **TWO_WAY, RANGE_MODULUS="3000.0")


@pytest.mark.parametrize("word", ["COHERENT", "CONSTANT", "ONE_WAY"])
def test_range_mode_is_of_range_units_only(tmp_path, word):
    values, times, _, other = change(tmp_path, [("RANGE", 0, 1500.0)], {}, {"RANGE_MODE": word})
    assert values == 0.0 and times == 0.0 and other.observations.segments[0].range_mode == word.lower()


@pytest.mark.parametrize(("word", "tag"), [("TRANSMIT", "transmission"), ("RECEIVE", "reception")])
def test_tags_of_times(tmp_path, word, tag):
    found = seen(tmp_path, [("RANGE", 0, 1500.0)], **TWO_WAY, TIMETAG_REF=word)
    assert found.sensors[0].name == f"range_two_way_{tag}"


def test_path_and_mode(tmp_path):
    found = pz.read_tracking(
        tdm(tmp_path, [("RANGE", 0, 1500.0)], **{**TWO_WAY, "PATH": "1,2,3"}), range="three-way", sigma="range=1m"
    )
    one = measured(found, SITES, corrections="applied")
    assert one.sensors[0].name == "range_three_way_reception" and one.labels == {"DSS-14": "DSS-14"}
    assert one.tracking.values[0, 0] == 750e3  # the mean of the legs
    found = pz.read_tracking(tdm(tmp_path, [("RANGE", 0, 1500.0)], MODE="SEQUENTIAL", PATH="2,1"), sigma="range=1m")
    assert measured(found, SITES, corrections="applied").sensors[0].name == "range_one_way_reception"
    with pytest.raises(ValueError, match="not determined from yet"):
        seen(tmp_path, [("RANGE", 0, 1.0)], **DIFFERENCE)


@pytest.mark.parametrize("reference", ["START", "MIDDLE", "END"])
def test_counts(tmp_path, reference):
    meta = {"INTEGRATION_INTERVAL": "30", "INTEGRATION_REF": reference}
    for keyword in ("DOPPLER_INTEGRATED", "RECEIVE_FREQ"):
        found = seen(tmp_path, [*SENT, (keyword, 0, 2.0)], **TWO_WAY, **meta)
        assert found.sensors[0].name.endswith(f"_{reference.lower()}") and found.stations[0].numbers["count"] == 30.0
    with pytest.raises(ValueError, match="--interval-reference"):
        seen(tmp_path, [("DOPPLER_INTEGRATED", 0, 2.0)], **TWO_WAY, INTEGRATION_INTERVAL="30")


def test_frequencies(tmp_path):
    """An offset is added; the turnaround and what was sent are numbers of the station, each piece of a ramp its own."""
    rows = [*SENT, ("RECEIVE_FREQ", 0, 1e5)]
    values, _, one, _ = change(tmp_path, rows, {}, {"FREQ_OFFSET": "2.28e9"})
    assert values == pytest.approx(2.28e9)
    numbers = one.stations[0].numbers
    assert numbers["turnaround"] == pytest.approx(240 / 221) and numbers["transmit_frequency"] == 2.1e9
    ramped = [("TRANSMIT_FREQ_1", -100, 2.1e9), ("TRANSMIT_FREQ_RATE_1", -100, 10.0), ("TRANSMIT_FREQ_RATE_1", 30, -5.0),
              ("RECEIVE_FREQ", 20, 1e5), ("RECEIVE_FREQ", 50, 1e5)]  # fmt: skip
    found = seen(tmp_path, ramped, **TWO_WAY)
    sent = [(s.numbers["transmit_frequency"], s.numbers["transmit_rate"], s.numbers["since"]) for s in found.stations]
    first = pz.Epoch("2024-05-05T12:00:00 UTC") - found.epoch
    assert sent == [(2.1e9, 10.0, pytest.approx(first - 100.0)), (2.1e9 + 1300.0, -5.0, pytest.approx(first + 30.0))]
    with pytest.raises(ValueError, match="TURNAROUND_NUMERATOR"):
        seen(tmp_path, rows, MODE="SEQUENTIAL", PATH="1,2,1")


def test_counters(tmp_path):
    """A scale divides, a bias is what the count grows by without a shift, and a rollover cannot be undone."""
    rows = [*SENT, ("DOPPLER_COUNT", 0, 100.0), ("DOPPLER_COUNT", 10, 5100.0)]
    values, _, _, other = change(tmp_path, rows, {}, {"DOPPLER_COUNT_SCALE": "1000", "DOPPLER_COUNT_BIAS": "2.4e6"})
    assert values == pytest.approx([0.0, 5.0 - 5000.0]) and other.stations[0].numbers["beat"] == 2.4e6
    with pytest.raises(ValueError, match="rolled over"):
        seen(tmp_path, rows, **TWO_WAY, DOPPLER_COUNT_ROLLOVER="YES")


@pytest.mark.parametrize("way", ["two-way", "round-trip"])
def test_delays_are_taken_off(tmp_path, way):
    """What electronics add to a range, in the mean of the legs; and times are those at the antenna."""
    delays = {"TRANSMIT_DELAY_1": "1e-5", "RECEIVE_DELAY_1": "2e-5", "TRANSMIT_DELAY_2": "3e-6", "RECEIVE_DELAY_2": "4e-6"}
    rows = [("RANGE", 0, 1500.0), ("DOPPLER_INSTANTANEOUS", 0, 1.0)]
    values, times, _, other = change(tmp_path, rows, {}, delays, range=way)
    assert sorted(values) == pytest.approx([-0.5 * C * 3.7e-5, 0.0]) and times == pytest.approx([-2e-5, -2e-5], abs=1e-9)
    assert any("delays of DSS-25, SAT, DSS-25" in text for text in other.assumed)
    _, times, _, _ = change(tmp_path, rows, {"TIMETAG_REF": "TRANSMIT"}, {"TIMETAG_REF": "TRANSMIT", **delays}, range=way)
    assert times == pytest.approx([1e-5, 1e-5], abs=1e-9)


SIZES = {"RANGE": ("RANGE", 2.0, 2e3), "DOPPLER": ("DOPPLER_INSTANTANEOUS", 2.0, 2e3), "RECEIVE": ("RECEIVE_FREQ", 3.0, 3.0),
         "ANGLE_1": ("ANGLE_1", 1.0, np.pi / 180), "ANGLE_2": ("ANGLE_2", 1.0, np.pi / 180)}  # fmt: skip


@pytest.mark.parametrize("name", SIZES)
def test_corrections_are_added_where_they_are_not_applied(tmp_path, name):
    keyword, number, size = SIZES[name]
    more = {"ANGLE_1": [("ANGLE_2", 0, 45.0)], "ANGLE_2": [("ANGLE_1", 0, 45.0)]}.get(keyword, [])
    rows, meta = [*SENT, (keyword, 0, 40.0), *more], METADATA.get(keyword, TWO_WAY)
    stated = {f"CORRECTION_{name}": number}
    plain, none, done = (
        seen(tmp_path, rows, **meta, **own).tracking.values[0]
        for own in ({}, {**stated, "CORRECTIONS_APPLIED": "NO"}, {**stated, "CORRECTIONS_APPLIED": "YES"})
    )
    column = 1 if name == "ANGLE_2" else 0
    assert none[column] - plain[column] == pytest.approx(size) and (done == plain).all()


def test_the_correction_of_what_was_sent(tmp_path):
    rows = [*SENT, ("RECEIVE_FREQ", 0, 2.28e9)]
    own = {"CORRECTION_TRANSMIT": "7.0", "CORRECTIONS_APPLIED": "NO"}
    assert seen(tmp_path, rows, **TWO_WAY, **own).stations[0].numbers["transmit_frequency"] == 2.1e9 + 7.0


@pytest.mark.parametrize("name", ["ABERRATION_YEARLY", "ABERRATION_DIURNAL"])
def test_aberration_that_is_not_applied_is_refused_by_name(tmp_path, name):
    meta = {**TWO_WAY, "ANGLE_TYPE": "RADEC", "REFERENCE_FRAME": "EME2000", f"CORRECTION_{name}": "0.005"}
    path = tdm(tmp_path, [("ANGLE_1", 0, 40.0), ("ANGLE_2", 0, 45.0)], **meta, CORRECTIONS_APPLIED="NO")
    found = pz.read_tracking(path, angles="apparent", range="two-way", sigma="0.001deg")
    with pytest.raises(ValueError, match=name.lower().split("_", maxsplit=1)[0]):
        measured(found, SITES)


@pytest.mark.parametrize(
    ("kind", "name"), [("AZEL", "azimuth_elevation"), ("XEYN", "xeyn"), ("XSYE", "xsye"), ("RADEC", "right")]
)
def test_types_of_angles(tmp_path, kind, name):
    own = {"REFERENCE_FRAME": "TOD"} if kind == "RADEC" else {}
    path = tdm(tmp_path, [("ANGLE_1", 0, 40.0), ("ANGLE_2", 0, 45.0)], **TWO_WAY, ANGLE_TYPE=kind, **own)
    found = measured(pz.read_tracking(path, angles="apparent", range="two-way", sigma="0.001deg"), SITES)
    assert found.sensors[0].name.startswith(name) and ("tod" in found.sensors[0].name) == (kind == "RADEC")


def test_quality_is_said(tmp_path):
    _, _, one, other = change(tmp_path, [("RANGE", 0, 1500.0)], {"DATA_QUALITY": "VALIDATED"}, {"DATA_QUALITY": "DEGRADED"})
    new = {*other.assumed} - {*one.assumed}
    assert new == {"rows that the file calls degraded are used as the others"}


def test_rows_of_no_object_stay_beside_those_of_the_one_that_is_asked_for(tmp_path):
    """A clock's bias has no satellite on its path, and moves the times of all."""
    path = tdm(tmp_path, [("RANGE", 0, 7000.0), ("CLOCK_BIAS", 0, 0.5)], **TWO_WAY, RANGE_UNITS="km")
    found = pz.read_tracking(path, sigma="1m")
    rows = of_object(replace(found, object=np.where(found.of_kind("clock_bias"), -1, found.object)), "SAT")
    assert rows.of_kind("clock_bias").sum() == 1 and rows.of_kind("range").sum() == 1


@pytest.mark.parametrize(
    ("rows", "told", "says"),
    [
        ([("DOPPLER_COUNT", 0, 5.0), *SENT], {**TWO_WAY, "TIMETAG_REF": "TRANSMIT"}, "times of reception, not of transmission"),
        ([("RECEIVE_FREQ_2", 0, 2e9)], {"MODE": "SEQUENTIAL", "PATH": "2,1", "TIMETAG_REF": "TRANSMIT"}, "not of transmit"),
        ([("RECEIVE_FREQ_2", 0, -1200.0)], {"MODE": "SEQUENTIAL", "PATH": "2,1"}, "FREQ_OFFSET"),
        ([("VLBI_DELAY", 0, 1e-4), ("CLOCK_BIAS", 0, 0.5)], DIFFERENCE, "delays between stations have the clock of"),
        ([("RANGE", 0, 7e3), ("CLOCK_BIAS", 0, 0.5)], {"MODE": "SEQUENTIAL", "PATH": "2,1"}, "one-way ranges have the clock"),
    ],
)  # fmt: skip
def test_what_would_be_wrong_in_silence_is_refused(tmp_path, rows, told, says):
    with pytest.raises(ValueError, match=says):
        seen(tmp_path, rows, **told)
