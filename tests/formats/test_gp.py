"""Mean elements of catalogues: keywords of OMM as JSON and as tables, against the same set in two lines."""

import json

import numpy as np
import pytest

import piazzi as pz

SET = {
    "OBJECT_NAME": "A, B", "OBJECT_ID": "2020-003C", "EPOCH": "2020-12-29T03:57:59.406624", "MEAN_MOTION": 15.27989249,
    "ECCENTRICITY": 0.0013356, "INCLINATION": 97.297, "RA_OF_ASC_NODE": 66.4161, "ARG_OF_PERICENTER": 110.6345,
    "MEAN_ANOMALY": 334.7107, "EPHEMERIS_TYPE": 0, "CLASSIFICATION_TYPE": "U", "NORAD_CAT_ID": 45018, "ELEMENT_SET_NO": 999,
    "REV_AT_EPOCH": 5327, "BSTAR": 8.4553e-05, "MEAN_MOTION_DOT": 2.241e-05, "MEAN_MOTION_DDOT": 0, "RCS_SIZE": None,
}  # fmt: skip
SILENT = {"CENTER_NAME": "EARTH", "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC", "MEAN_ELEMENT_THEORY": "SGP4"}


def table(*sets):
    lines = [",".join(SET), *(",".join(f'"{v}"' if v is not None else "" for v in one.values()) for one in sets)]
    return "\r\n".join(lines) + "\r\n"


@pytest.mark.parametrize(
    "text",
    [
        json.dumps(SET),
        json.dumps([SET, SET | {"OBJECT_NAME": "C"}], indent=2),
        json.dumps([{k: str(v) for k, v in (SILENT | SET).items() if v is not None}]),
        table(SET),
    ],
)
def test_one_set_in_every_form(tmp_path, text):
    path = tmp_path / "gp.txt"
    path.write_text(text, newline="")
    found = pz.read_ephemeris(path)
    one, elements = found.mean[0], dict(found.mean[0].elements)
    assert (one.name, one.identifier, one.frame, one.centre, one.theory) == ("A, B", "2020-003C", "TEME", "EARTH", "SGP4")
    assert abs(one.epoch - pz.Epoch("2020-12-29T03:57:59.406624 UTC")) < 1e-9
    assert [m.name for m in found.mean[1:]] == (["C"] if text.startswith("[") and '"C"' in text else [])
    assert elements["mean_motion"] == pytest.approx(15.27989249 * 2 * np.pi / 86400, rel=1e-14)
    assert elements["inclination"] == pytest.approx(np.radians(97.297), rel=1e-14)
    assert bool(found.assumed) == ("TEME" not in text)


@pytest.mark.parametrize(
    "text, what",
    [
        (json.dumps(SET).replace("97.297", '"97.2x7"'), "line 1: INCLINATION is '97.2x7'"),
        (json.dumps([SET, {k: v for k, v in SET.items() if k != "EPOCH"}], indent=1), "line 22: the message has no EPOCH"),
        (json.dumps(SET)[:-9], "line 1: it is no JSON"),
        (table(SET).replace('"999"', '"999","0"'), "line 2: the line has 19 cells; the header names 18"),
        (table(), "line 1: there are no elements"),
    ],
)
def test_each_mistake_has_one_line(tmp_path, text, what):
    path = tmp_path / "gp.txt"
    path.write_text(text)
    with pytest.raises(ValueError, match=what) as error:
        pz.read_ephemeris(path)
    assert "gp.txt: " in str(error.value) and "\n" not in str(error.value)
