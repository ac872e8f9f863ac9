"""The table of options: what `determine`, the command line and a case take is one list."""

import inspect
from dataclasses import fields

import click
import pytest

import piazzi as pz
from piazzi.cli.case import said_case
from piazzi.cli.conventions import _OPTIONS
from piazzi.cli.determine import command
from piazzi.determination.case import ANSWERS, OPTIONS, Case
from piazzi.determination.case_file import keys, read_case
from piazzi.formats.conventions import WORDS


def test_the_call_and_the_command_take_what_the_table_has():
    taken = set(inspect.signature(pz.determine).parameters) - {"tracking", "announce", "notes", "conventions", "frame"}
    assert taken == {name for name, option in OPTIONS.items() if option.python}
    made = {p.name for p in command.params if isinstance(p, click.Option)} - {"help_all"}
    of_command = {name for name, option in OPTIONS.items() if option.flags is not None}
    assert made == {*of_command, *(name.replace("-", "_") for name, *_ in _OPTIONS)}
    assert {f.name for f in fields(Case)} == {*OPTIONS, "answers", "published"}


def test_every_convention_is_an_answer():
    assert {*WORDS, "time", "sigma", "interval", "frame", *(name.replace("-", "_") for name, *_ in _OPTIONS)} <= set(ANSWERS)


def test_help_shows_eight():
    assert len([name for name, option in OPTIONS.items() if option.usual]) + 1 == 8  # and --sigma


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ({"gues": "x"}, "unknown option gues; did you mean 'guess'"),
        ({"mass": "-3"}, "mass is -3; it must be positive"),
        ({"mass": "three"}, "mass is 'three', which is no number"),
        ({"mass": "3km"}, "mass is '3km'; it must be in a unit such as kg"),
        ({"com": "nan"}, "com is nan"),
        ({"span": "last .. first"}, "it ends before it begins"),
        ({"span": "2026-11-04Z .. 2026-11-03Z"}, "it ends before it begins"),
        ({"with_": "grpah"}, "with: .*did you mean 'graph'"),
        ({"epoch": "2016-02-13T16:00:00"}, "epoch: .*no time scale"),
        ({"span": "first"}, "two ends"),
        ({"step": "60x"}, "length of time such as 60s, 10min"),
        ({"covariance": "scald"}, "covariance is 'scald'; did you mean 'scaled'"),
        ({"strict": "yes"}, "true or false"),
        ({"interval": "long"}, "interval is 'long'; write a length of time"),
    ],
)
def test_what_cannot_be_is_refused(words, says):
    with pytest.raises(ValueError, match=says):
        Case.of(words)


def test_numbers_may_be_joined_to_their_units():
    found = Case.of({"mass": "0.4t", "area": "2800cm**2", "com": "251mm", "interval": "10ms"})
    assert (found.mass, found.area, found.com) == pytest.approx((400.0, 0.28, 0.251))
    assert found.answers["interval"] == pytest.approx(0.01) and Case.of({"area": "0.28m2"}).area == 0.28
    assert Case.of({"mass": "405"}).mass == Case.of({"mass": "405kg"}).mass == Case.of({"mass": 405}).mass == 405.0


def test_later_words_override_and_nothing_says_nothing():
    first = Case.of({"mass": "3", "interval-reference": "start", "with": ["ekf"], "sigma": ["10m"]})
    assert (first.mass, first.with_, first.answers) == (3.0, ["ekf"], {"interval_reference": "start", "sigma": ["10m"]})
    then = first.told({"mass": 4, "with_": (), "forces": None, "sigma": ["1m"]}, "--{}")
    assert (then.mass, then.with_, then.forces, then.answers["sigma"]) == (4.0, ["ekf"], "default", ["1m"])


def test_a_word_that_is_none_is_refused_by_the_call():
    with pytest.raises(ValueError, match="unknown option gues; did you mean 'guess'"):
        pz.determine("nowhere.tdm", gues="x")


# every key of [determine]: its value in a case, and the same on the command line
SAID = {
    "guess": ("'a=7078km'", ["--guess", "a=7078km"]),
    "prior": ("'last.json'", ["--prior", "last.json"]),
    "from": ("'2026-11-03T04:12:00Z'", ["--from", "2026-11-03T04:12:00Z"]),
    "stations": ("['ilrs', 'own.toml']", ["--stations", "ilrs", "--stations", "own.toml"]),
    "with": ("['window:6h', 'ekf']", ["--with", "window:6h", "--with", "ekf"]),
    "forces": ("'gravity=EGM2008 degree=40'", ["--forces", "gravity=EGM2008 degree=40"]),
    "output": ("['a.oem', 'b.json']", ["-o", "a.oem", "-o", "b.json"]),
    "report": ("'page'", ["--report", "page"]),
    "title": ("'Night 7'", ["--title", "Night 7"]),
    "figures": ("'pictures'", ["--figures", "pictures"]),
    "format": ("'pdf,svg'", ["--format", "pdf,svg"]),
    "width": ("'3.5in'", ["--width", "3.5in"]),
    "json": ("true", ["--json"]),
    "estimate": ("['cd/12h cr']", ["--estimate", "cd/12h cr"]),
    "consider": ("['cr=0.1']", ["--consider", "cr=0.1"]),
    "manoeuvre": ("['2026-11-03T04:12:00Z dv=0,0.3,0m/s']", ["--manoeuvre", "2026-11-03T04:12:00Z dv=0,0.3,0m/s"]),
    "mass": ("405.0", ["--mass", "405"]),
    "area": ("0.28", ["--area", "0.28"]),
    "com": ("0.251", ["--com", "0.251"]),
    "epoch": ("'2026-11-03T04:12:00 TT'", ["--epoch", "2026-11-03T04:12:00 TT"]),
    "span": ("'first .. last+3d'", ["--span", "first .. last+3d"]),
    "step": ("'5min'", ["--step", "5min"]),
    "hold": ("'1/4'", ["--hold", "1/4"]),
    "covariance": ("'formal'", ["--covariance", "formal"]),
    "about": ("'sun'", ["--about", "sun"]),
    "object": ("'SAT'", ["--object", "SAT"]),
    "each": ("true", ["--each"]),
    "against": ("'other.oem'", ["--against", "other.oem"]),
    "strict": ("true", ["--strict"]),
    "anyway": ("true", ["--anyway"]),
    "show": ("true", ["--show"]),
    "follow": ("true", ["--follow"]),
    "range": ("'two-way'", ["--range", "two-way"]),
    "angles": ("'apparent'", ["--angles", "apparent"]),
    "tag": ("'receive'", ["--tag", "receive"]),
    "frame": ("'ITRF'", ["--frame", "ITRF"]),
    "corrections": ("'open'", ["--corrections", "open"]),
    "interval": ("10.0", ["--interval", "10"]),
    "participant": ("['TWIN=twin.oem', 'igs.sp3']", ["--participant", "TWIN=twin.oem", "--participant", "igs.sp3"]),
    "interval_reference": ("'middle'", ["--interval-reference", "middle"]),
    "range_unit": ("['DSS-25=0.28m']", ["--range-unit", "DSS-25=0.28m"]),
    "repair": ("'exponent'", ["--repair", "exponent"]),
    "time": ("['BER=GPS']", ["--time", "BER=GPS"]),
    "sigma": ("['10m', 'range.BER=5m']", ["--sigma", "10m", "--sigma", "range.BER=5m"]),
    "scale": ("'GPS'", ["--scale", "GPS"]),
    "columns": ("'time=T x=X[km]'", ["--columns", "time=T x=X[km]"]),
    "debias": ("'bias.dat'", ["--debias", "bias.dat"]),
}


def plain(value):
    """Lists and tuples alike, as a file and a command line give them."""
    return [plain(v) for v in value] if isinstance(value, list | tuple) else value


def test_every_key_of_a_case_is_here():
    assert set(SAID) == set(keys("determine"))


@pytest.mark.parametrize("key", SAID)
def test_a_key_says_what_its_option_says(tmp_path, key):
    text, words = SAID[key]
    (tmp_path / "case.toml").write_text(f"[determine]\n{key} = {text}\n")
    (tmp_path / "dashes.toml").write_text(f"[determine]\n{key.replace('_', '-')} = {text}\n")
    by_file = read_case(tmp_path / "case.toml")
    with command.make_context("determine", ["pass.tdm", *words]) as context:
        given = dict(context.params)
    files, by_option = said_case(given.pop("files"), given)
    assert files == ("pass.tdm",)
    name = keys("determine")[key]
    one, other, dashed = (
        case.answers[name] if name in ANSWERS else getattr(case, name)
        for case in (by_file, by_option, read_case(tmp_path / "dashes.toml"))
    )
    assert plain(one) == plain(other) == plain(dashed) and one not in (None, False, (), [])
    untouched = Case()
    rest = [f.name for f in fields(Case) if f.name not in (name, "answers")]
    assert all(getattr(by_file, n) == getattr(by_option, n) == getattr(untouched, n) for n in rest)
    assert set(by_file.answers) == set(by_option.answers) == ({name} if name in ANSWERS else set())


@pytest.mark.parametrize(
    ("key", "value", "name", "kept"),
    [
        ("object.name", "'SAT'", "object", "SAT"),
        ("object.id", "'1992-070B'", "identifier", "1992-070B"),
        ("object.norad", "22195", "norad", 22195),
        ("object.mass", "405", "mass", 405.0),
        ("object.area", "0.28", "area", 0.28),
        ("object.antenna", "[0.1, 0, -1.2]", "antenna", (0.1, 0.0, -1.2)),
        ("product.originator", "'ME'", "originator", "ME"),
        ("product.frame", "'ITRF'", "axes", "ITRF"),
        ("product.step", "'5min'", "step", 300.0),
        ("product.covariance_step", "'1h'", "covariance_step", 3600.0),
        ("product.interpolation", "'Lagrange 9'", "interpolation", ("LAGRANGE", 9)),
    ],
)
def test_keys_of_objects_and_products(tmp_path, key, value, name, kept):
    section, _, own = key.partition(".")
    (tmp_path / "case.toml").write_text(f"[{section}]\n{own} = {value}\n")
    assert getattr(read_case(tmp_path / "case.toml"), name) == kept
    assert keys(section)[own] == name
