"""What is wrong with files of tracking: one line that says it and how to mend it, or what was done where it is no error."""

import pytest

from piazzi.cli.main import main

GUESS = "a=7078km e=0.001 i=98.2deg raan=10deg argp=0deg nu=0deg epoch=2020-01-01T00:00:00Z"
RANGES = "RANGE = 2020-01-01T00:00:00 7000\nRANGE = 2020-01-01T00:01:00 7100\n"
UNITS = "RANGE = 2020-01-01T00:00:00 9\n"
TURNED = "ANGLE_TYPE = RADEC\nREFERENCE_FRAME = EME2000\nCORRECTION_ABERRATION_DIURNAL = 0.001\nCORRECTIONS_APPLIED = NO\n"
ANGLES = "ANGLE_1 = 2020-01-01T00:00:00 100\nANGLE_2 = 2020-01-01T00:00:00 20\n"


def segment(data, *, scale="UTC", path="1,2,1", extra=""):
    return (
        f"META_START\nTIME_SYSTEM = {scale}\nPARTICIPANT_1 = DSS\nPARTICIPANT_2 = SAT\nMODE = SEQUENTIAL\n"
        f"PATH = {path}\n{extra}META_STOP\nDATA_START\n{data}DATA_STOP\n"
    )


def message(*segments):
    return "CCSDS_TDM_VERS = 2.0\nCREATION_DATE = 2020-01-01T00:00:00\nORIGINATOR = X\n" + "".join(segments)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Status, standard output and lines of standard error of a command on a file with this text."""
    monkeypatch.setenv("PIAZZI_JIT", "0")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dss.toml").write_text(
        '[[stations]]\nname = "DSS"\nlatitude = "50 deg"\nlongitude = "8 deg"\nheight = "99 m"\n'
    )
    (tmp_path / "bon.toml").write_text(
        '[[stations]]\nname = "BON"\nlatitude = "50 deg"\nlongitude = "8 deg"\nheight = "99 m"\n'
    )

    def command(verb, text, *words):
        (tmp_path / "in").write_text(text)
        status = main([verb, "in", *words])
        out, err = capsys.readouterr()
        return status, " ".join(out.split()), err.splitlines()

    return command


def determine(run, text, *words):
    return run("determine", text, "--forces", "none", "--guess", GUESS, "--show", *words)


@pytest.mark.parametrize(
    ("text", "words", "says"),
    [
        (message(segment(RANGES), segment(RANGES, scale="GPS")), (), "TIME_SYSTEM is GPS, and UTC in line 5"),
        (message(segment(RANGES)), ("--range", "two-way", "--sigma", "1m"), "where is station DSS? Give it with --stations"),
        (
            message(segment(RANGES)),
            ("--range", "two-way", "--sigma", "1m", "--stations", "bon.toml"),
            "no station DSS in --stations; known: BON",
        ),
        ("time,station,range\n2020-01-01T00:00:00Z,DSS,7000\n", ("--sigma", "1m"), '--columns "range=range[m]"'),
        ("time,station,azimuth [h]\n2020-01-01T00:00:00Z,DSS,7\n", (), "hours of right ascension are 15 deg each"),
        (
            message(segment("RECEIVE_FREQ_1 = 2020-01-01T00:00:00 4e8\n")),
            ("--sigma", "1Hz"),
            "does not say which frequency was sent (TRANSMIT_FREQ)",
        ),
        (message(segment("RECEIVE_FREQ_3 = 2020-01-01T00:00:00 4e8\n")), ("--sigma", "1Hz"), "RECEIVE_FREQ_3"),
        (message(segment(UNITS, extra="RANGE_UNITS = RU\n")), ("--range", "two-way"), "--range-unit 0.28m"),
        (
            message(segment(ANGLES, path="2,1", extra=TURNED)),
            ("--sigma", "1arcsec", "--angles", "astrometric", "--stations", "dss.toml"),
            "'aberration_diurnal' is not applied, and cannot be",
        ),
        (message(segment(RANGES)), ("--sigma", "1m", "--stations", "dss.toml"), "--range two-way or --range round-trip"),
    ],
    ids=[
        "mixed time systems", "nowhere", "another station", "no unit", "hours", "two-way frequency", "frequency of nobody",
        "range units", "aberration", "half or all",
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line(run, text, words, says):
    status, out, lines = determine(run, text, *words)
    assert status == 2 and out == "" and len(lines) == 1
    assert says in lines[0] and lines[0].startswith("piazzi: ")


def test_rows_that_are_there_twice_and_out_of_order_are_told(run):
    rows = RANGES + "RANGE = 2020-01-01T00:00:30 7050\nRANGE = 2020-01-01T00:00:30 7050\n"
    status, out, _ = run("tracking", message(segment(rows)))
    assert status == 0 and "1 row out of order. 1 row of a time and kind that was there before." in out
    status, out, _ = determine(run, message(segment(rows)), "--range", "two-way", "--sigma", "1m", "--stations", "dss.toml")
    assert status == 0 and "rows were out of order, and are sorted by time" in out
    assert "weather at DSS: standard for its height" in out


def test_files_of_several_time_systems_go_together(run, tmp_path):
    (tmp_path / "b").write_text(message(segment(RANGES, scale="GPS")))
    status, out, _ = run("tracking", message(segment(RANGES)), "b")
    assert status == 0 and "dates in GPS" in out and "dates in UTC" in out


def test_what_is_open_is_listed_and_no_error(run):
    status, out, lines = run("tracking", "time,station,range\n2020-01-01T00:00:00Z,DSS,7000\n")
    assert status == 0 and not lines and "Open: units of range:" in out and "--range one-way, two-way or round-trip" in out
