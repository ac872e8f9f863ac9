"""Orbit comprehensive messages: what is written is read again, and what others may write is read by the standard's rules."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import piazzi as pz
from piazzi.formats import Arc, ocm_text
from piazzi.formats.ocm import used_by

EPOCH = pz.Epoch("2026-11-03T04:12:00 UTC")
STATE = np.array([7e6, 1e5, -2e5, 10.0, 7.5e3, 300.0])


def arc(count=3, **more):
    t = 60.0 * np.arange(count)
    states = STATE + np.outer(t, [*STATE[3:], 0, 0, 0])
    return Arc(
        epoch=EPOCH, t=t, position=states[:, :3], velocity=states[:, 3:], name="SAT", centre="EARTH", frame="GCRF",
        scale="UTC", **more,
    )  # fmt: skip


def covariance(seed=1):
    A = np.random.default_rng(seed).standard_normal((6, 6))
    return A @ A.T


def test_what_is_written_is_read_again(tmp_path):
    P = np.stack([covariance(1), covariance(2)])
    one = arc(
        covariance_t=np.array([0.0, 120.0]), covariance=P, covariance_frames=("GCRF", "GCRF"), spacecraft=(("mass", 7.0),)
    )
    od = {"OD_ID": "1", "OD_METHOD": "x", "OD_EPOCH": "2026-11-03T04:12:00", "DAYS_SINCE_FIRST_OBS": 1.5,
          "DAYS_SINCE_LAST_OBS": 0.25}  # fmt: skip
    (tmp_path / "x").write_text(ocm_text(one, determination=od))
    found = pz.read_ephemeris(tmp_path / "x")
    (back,) = found.arcs
    assert found.format == "OCM" and (back.name, back.frame, back.centre, back.scale) == ("SAT", "GCRF", "EARTH", "UTC")
    assert_allclose(back.position, one.position, rtol=1e-15)
    assert_allclose(back.velocity, one.velocity, rtol=1e-15)
    assert_allclose(back.covariance, P, rtol=1e-14)
    assert_allclose(back.covariance_t, one.covariance_t, atol=1e-9)
    assert dict(back.spacecraft) == {"mass": 7.0}
    first, last = used_by(back)
    assert (EPOCH - first, EPOCH - last) == (pytest.approx(1.5 * 86400.0), pytest.approx(0.25 * 86400.0))


def message(traj="", cov="", meta="EPOCH_TZERO = 2026-11-03T04:12:00\n"):
    return (
        f"CCSDS_OCM_VERS = 3.0\nCREATION_DATE = 2026-11-03T00:00:00\nORIGINATOR = X\nMETA_START\nTIME_SYSTEM = UTC\n{meta}"
        f"META_STOP\nTRAJ_START\n{traj}TRAJ_STOP\n{cov}"
    )


ROW = "7000.0 100.0 -200.0 0.01 7.5 0.3"


def read(tmp_path, text):
    (tmp_path / "m.ocm").write_text(text)
    return pz.read_ephemeris(tmp_path / "m.ocm")


def test_times_past_the_zero_of_the_message_and_units_that_it_states(tmp_path):
    traj = "TRAJ_TYPE = CARTPV\nTRAJ_UNITS = [m,m,m,m/s,m/s,m/s]\n"
    rows = f"0.0 {' '.join(str(x) for x in STATE)}\nCOMMENT x\n30.5 {' '.join(str(x) for x in STATE)}\n"
    (one,) = read(tmp_path, message(traj + rows)).arcs
    assert_allclose(one.position, [STATE[:3]] * 2)
    assert one.epoch == EPOCH and one.t[1] == pytest.approx(30.5)
    assert one.frame == "ICRF" and one.centre == "EARTH"  # as the standard has it where nothing is said


@pytest.mark.parametrize("ordering", ["LTM", "UTM", "FULL", "LTMWCC", "UTMWCC"])
def test_covariances_in_every_order(tmp_path, ordering):
    P = covariance()
    correlation = P / np.sqrt(np.outer(np.diag(P), np.diag(P)))
    full = {
        "FULL": P, "LTMWCC": np.tril(P) + np.triu(correlation, 1), "UTMWCC": np.triu(P) + np.tril(correlation, -1),
    }.get(ordering)  # fmt: skip
    values = P[np.tril_indices(6)] if ordering == "LTM" else P[np.triu_indices(6)] if ordering == "UTM" else full.ravel()
    cov = f"COV_START\nCOV_REF_FRAME = RSW_INERTIAL\nCOV_TYPE = CARTPV\nCOV_ORDERING = {ordering}\n"
    cov += f"0.0 {' '.join(map(repr, map(float, values)))}\nCOV_STOP\n"
    (one,) = read(tmp_path, message(f"TRAJ_TYPE = CARTPV\n0.0 {ROW}\n", cov)).arcs
    assert_allclose(one.covariance[0], 1e6 * P, rtol=1e-14)
    assert one.covariance_frames == ("RSW",)


def test_units_of_covariances_are_those_of_the_diagonal(tmp_path):
    P = covariance()
    units = "[" + ",".join(["m**2"] * 3 + ["m**2/s**2"] * 3) + "]"
    row = " ".join(map(repr, P[np.tril_indices(6)].tolist()))
    cov = f"COV_START\nCOV_TYPE = CARTPV\nCOV_UNITS = {units}\n0.0 {row}\nCOV_STOP\n"
    (one,) = read(tmp_path, message(f"TRAJ_TYPE = CARTPV\n0.0 {ROW}\n", cov)).arcs
    assert_allclose(one.covariance[0], P, rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (message("TRAJ_TYPE = KEPLERIAN\n0.0 1 2 3 4 5 6\n"), "line 4: trajectories of positions.*KEPLERIAN"),
        (message("TRAJ_TYPE = CARTPV\n0.0 1 2 3\n"), "line 10: a state of CARTPV is a date and 6 numbers, not 3"),
        (message("TRAJ_TYPE = CARTPV\n"), "line 8: the trajectory has no states"),
        (message(f"TRAJ_TYPE = CARTPV\n9 {ROW}\n0 {ROW}\n"), "line 11: the state is before the one above"),
        (message(f"TRAJ_TYPE = CARTPV\n0 {ROW}\n", meta=""), "no EPOCH_TZERO"),
        (message(f"TRAJ_TYPE = CARTPV\n0 {ROW}\n", "COV_START\nCOV_TYPE = CARTPV\n0 1 2\nCOV_STOP\n"), "line 14: a covariance"),
        (message(f"TRAJ_TYPE = CARTPV\n0 {ROW}\n")[:-10], "does not end with TRAJ_STOP"),
        (message(f"TRAJ_TYPE = CARTPV\n0 {ROW.replace('7.5', 'x')}\n"), "line 10: the state is 'x'; it must be a number"),
        (message().replace("= 3.0", "= 9.0"), "line 1: the version"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path, text, says):
    with pytest.raises(ValueError, match=says):
        read(tmp_path, text)


def as_xml(text):
    """The same message in XML."""
    names = {"META": "metadata", **{k: k.lower() for k in ("TRAJ", "PHYS", "COV", "OD", "USER")}}
    out, header = [], {}
    kind = ""
    for line in text.splitlines():
        mark, _, what = line.partition("_")
        if what in ("START", "STOP"):
            kind = mark if what == "START" else ""
            out.append(f"<{'' if kind else '/'}{names[mark]}>")
        elif "=" in line and not line.startswith("COMMENT"):
            key, value = (part.strip() for part in line.split("=", 1))
            value, _, unit = value.partition(" [") if not value.startswith("[") else (value, "", "")
            units = f' units="{unit.rstrip("]")}"' if unit else ""
            (out if kind else header.setdefault("h", [])).append(f"<{key}{units}>{value}</{key}>")
        elif line.strip() and not line.startswith("COMMENT"):
            out.append(f"<{kind.lower()}Line>{line.replace(' ', chr(10), 1)}</{kind.lower()}Line>")
    head = "".join(header["h"][1:])
    return (
        f'<?xml version="1.0"?>\n<ocm id="CCSDS_OCM_VERS" version="3.0"><header>{head}</header>\n' + "\n".join(out) + "\n</ocm>"
    )


def test_xml_says_the_same(tmp_path):
    P = np.stack([covariance(1), covariance(2)])
    one = arc(
        covariance_t=np.array([0.0, 120.0]), covariance=P, covariance_frames=("GCRF", "GCRF"), spacecraft=(("mass", 7.0),)
    )
    text = ocm_text(one, determination={"OD_ID": "1", "OD_METHOD": "x", "OD_EPOCH": "2026-11-03T04:12:00"})
    (kvn,), (xml,) = read(tmp_path, text).arcs, read(tmp_path, as_xml(text)).arcs
    for name in ("position", "velocity", "t", "covariance", "covariance_t"):
        np.testing.assert_array_equal(getattr(xml, name), getattr(kvn, name))
    assert (xml.name, xml.frame, xml.spacecraft, xml.said) == (kvn.name, kvn.frame, kvn.spacecraft, kvn.said)
    with pytest.raises(ValueError, match=r"line \d+: TRAJ_TYPE is given twice"):
        read(tmp_path, as_xml(text).replace("<TRAJ_TYPE>", "<TRAJ_TYPE>CARTPV</TRAJ_TYPE><TRAJ_TYPE>"))
