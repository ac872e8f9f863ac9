"""The table of options: what `determine`, the command line and a case take is one list."""

import inspect
from dataclasses import fields

import click
import pytest

import piazzi as pz
from piazzi.cli.conventions import _OPTIONS
from piazzi.cli.determine import command
from piazzi.determination.case import ANSWERS, OPTIONS, Case
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
        ({"with_": "grpah"}, "with: .*did you mean 'graph'"),
        ({"epoch": "2016-02-13T16:00:00"}, "epoch: .*no time scale"),
        ({"span": "first"}, "two ends"),
        ({"step": "60"}, "length of time such as 60s"),
        ({"covariance": "scald"}, "covariance is 'scald'; did you mean 'scaled'"),
        ({"strict": "yes"}, "true or false"),
        ({"interval": "long"}, "interval is 'long', which is no number"),
    ],
)
def test_what_cannot_be_is_refused(words, says):
    with pytest.raises(ValueError, match=says):
        Case.of(words)


def test_later_words_override_and_nothing_says_nothing():
    first = Case.of({"mass": "3", "interval-reference": "start", "with": ["ekf"], "sigma": ["10m"]})
    assert (first.mass, first.with_, first.answers) == (3.0, ["ekf"], {"interval_reference": "start", "sigma": ["10m"]})
    then = first.told({"mass": 4, "with_": (), "forces": None, "sigma": ["1m"]}, "--{}")
    assert (then.mass, then.with_, then.forces, then.answers["sigma"]) == (4.0, ["ekf"], "default", ["1m"])


def test_a_word_that_is_none_is_refused_by_the_call():
    with pytest.raises(ValueError, match="unknown option gues; did you mean 'guess'"):
        pz.determine("nowhere.tdm", gues="x")
