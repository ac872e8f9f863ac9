"""Space weather: both layouts of CelesTrak, the indices of density models, predictions, and broken files."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from piazzi import earth
from piazzi.earth import Epoch, read_space_weather
from piazzi.earth.space_weather import SpaceWeatherWarning

HEADER = (
    "DATE,BSRN,ND,KP1,KP2,KP3,KP4,KP5,KP6,KP7,KP8,KP_SUM,AP1,AP2,AP3,AP4,AP5,AP6,AP7,AP8,AP_AVG,CP,C9,ISN,F10.7_OBS,"
    "F10.7_ADJ,F10.7_DATA_TYPE,F10.7_OBS_CENTER81,F10.7_OBS_LAST81,F10.7_ADJ_CENTER81,F10.7_ADJ_LAST81"
)
# rows of SW-All.csv of CelesTrak
OCTOBER_1957 = """\
1957-10-01,1700,19,43,40,30,20,37,23,43,37,273,32,27,15,7,22,9,32,22,21,1.1,5,334,269.3,269.8,OBS,266.6,230.9,266.8,235.5
1957-10-02,1700,20,37,37,17,17,27,23,17,30,203,22,22,6,6,12,9,6,15,12,0.7,3,331,253.3,253.6,OBS,267.4,231.7,267.5,236.2
1957-10-03,1700,21,27,20,13,33,37,47,43,30,250,12,7,5,18,22,39,32,15,19,1.0,5,343,266.3,266.4,OBS,268.1,232.7,268.1,237.1
1957-10-04,1700,22,30,30,23,27,23,27,30,27,217,15,15,9,12,9,12,15,12,12,0.7,3,307,238.2,238.2,OBS,268.8,233.3,268.7,237.7
1957-10-05,1700,23,30,30,17,23,20,27,27,20,193,15,15,6,9,7,12,12,7,10,0.6,3,310,246.2,246.0,OBS,269.3,233.9,269.1,238.1
"""
PREDICTED = """\
1957-10-06,,,,,,,,,,,,,,,,,,,,8,,,,250.0,250.0,PRD,260.0,260.0,260.0,260.0
1957-11-05,,,,,,,,,,,,,,,,,,,,,,,,220.0,220.0,PRM,230.0,230.0,230.0,230.0
"""


def as_text(csv: str) -> str:
    """The same days in the fixed columns of version 1.2: I4,I3,I3,I5,I3,8I3,I4,8I4,I4,F4.1,I2,I4,F6.1,I2,5F6.1."""
    sections: dict[str, list[str]] = {"OBS": [], "PRD": [], "PRM": []}
    for row in csv.splitlines():
        c = row.split(",")
        year, month, day = c[0].split("-")
        line = f"{year:>4}{month:>3}{day:>3}{c[1]:>5}{c[2]:>3}" + "".join(f"{x:>3}" for x in c[3:11]) + f"{c[11]:>4}"
        line += "".join(f"{x:>4}" for x in c[12:20]) + f"{c[20]:>4}{c[21]:>4}{c[22]:>2}{c[23]:>4}{c[25]:>6}{0:>2}"
        line += f"{c[29]:>6}{c[30]:>6}{c[24]:>6}{c[27]:>6}{c[28]:>6}"
        assert len(line) == 130
        sections[c[26]].append(line)
    parts = ["DATATYPE CssiSpaceWeather", "VERSION 1.2", "# a comment"]
    for name, key in (("OBSERVED", "OBS"), ("DAILY_PREDICTED", "PRD"), ("MONTHLY_PREDICTED", "PRM")):
        parts += [f"NUM_{name}_POINTS {len(sections[key])}", f"BEGIN {name}", *sections[key], f"END {name}", ""]
    return "\n".join(parts)


@pytest.fixture(params=["csv", "text"])
def written(request, tmp_path):
    def write(rows: str):
        path = tmp_path / "weather"
        path.write_text(f"{HEADER}\n{rows}" if request.param == "csv" else as_text(rows))
        return path

    return write


def test_indices_of_a_measured_day(written):
    table = read_space_weather(written(OCTOBER_1957))
    indices = table.at(Epoch("1957-10-05T10:30:00 TT"))  # there was no UTC yet
    ap = np.array([int(x) for row in OCTOBER_1957.splitlines() for x in row.split(",")[12:20]], dtype=float)
    now = 4 * 8 + 3  # 09 to 12 h
    assert indices.f107 == 238.2 and indices.f107_average == 269.3 and not indices.predicted
    expected = [ap[32:40].mean(), ap[now], ap[now - 1], ap[now - 2], ap[now - 3], ap[now - 11 : now - 3].mean()]
    assert_allclose(indices.ap, [*expected, ap[now - 19 : now - 11].mean()], rtol=1e-15)


def test_predictions_are_warned_of_once_and_joined(written):
    table = read_space_weather(written(OCTOBER_1957 + PREDICTED))
    with pytest.warns(SpaceWeatherWarning, match=r"1957-10-21 are predicted \(weather, measured to 1957-10-05\)"):
        indices = table.at(Epoch("1957-10-21T12:00:00 TT"))
    assert indices.predicted
    assert indices.f107 == pytest.approx(250 - 30 * 14 / 30) and indices.f107_average == pytest.approx(260 - 30 * 15 / 30)
    assert_allclose(indices.ap, 15.0)
    table.at(Epoch("1957-10-22T12:00:00 TT"))
    assert table.ap3[5].tolist() == [8.0] * 8


def test_outside_is_refused_with_the_span(written):
    table = read_space_weather(written(OCTOBER_1957))
    for date in ("1957-10-03T12:00:00 TT", "1957-10-06T12:00:00 TT"):
        with pytest.raises(ValueError, match=f"from 1957-10-04 to 1957-10-05, not for {date[:10]}"):
            table.at(Epoch(date))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("269.3,269.8", "26x.3,269.8", "line 2: '26x.3' is not a number"),
        ("253.3,253.6", ",253.6", "line 3: a measured day without F10.7"),
        ("1957-10-03", "1957-13-03", "line 4: '1957-13-03' is no date"),
        ("1957-10-03", "1957-10-02", "line 4: 1957-10-02 comes after 1957-10-02"),
        ("1957-10-03", "1957-10-04", "line 4: after 1957-10-02 a day is missing"),
        ("266.3,266.4,OBS", "266.3,266.4,XYZ", "line 4: data type 'XYZ'"),
        (",1.0,5,343", ",1.0,343", "line 4: 30 cells, where the header has 31"),
        ("238.2,238.2", "-38.2,238.2", "line 5: '-38.2' is neither a flux nor an index"),
        ("1957-10-03", "99999999999-10-03", "line 4: '99999999999-10-03' is no date"),
        ("CP,C9,ISN", "CP,CP,CP,ISN", "line 2: 31 cells, where the header has 32"),
        ("AP_AVG", "APAVG", "no column AP_AVG"),
        ("DATE,BSRN", "DATES,BSRN", "no space weather of CelesTrak"),
    ],
)
def test_broken_files_are_said_with_their_line(tmp_path, old, new, said):
    text = f"{HEADER}\n{OCTOBER_1957}"
    assert old in text
    path = tmp_path / "sw.csv"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(ValueError, match=said) as caught:
        read_space_weather(path)
    assert str(caught.value).startswith("sw.csv")


def test_it_is_public():
    assert earth.read_space_weather is read_space_weather
