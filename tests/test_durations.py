"""Lengths of time have one grammar, wherever they are written."""

from types import SimpleNamespace

import click
import pytest

import piazzi as pz
from piazzi.cli.conventions import told
from piazzi.cli.courses import span_of
from piazzi.cli.options import duration as option
from piazzi.determination.arcs import end_of
from piazzi.determination.burns import burns_of
from piazzi.determination.case_values import duration as key
from piazzi.determination.passing import span_of as when
from piazzi.determination.unknowns import Estimated
from piazzi.estimate.registry import parse
from piazzi.units import duration, positive_duration

TABLE = {
    "30s": 30.0, "30 s": 30.0, "0.5min": 30.0, "10min": 600.0, "10 min": 600.0, "6h": 21600.0, "6 hours": 21600.0,
    "1d": 86400.0,
    "1 day": 86400.0, "1day": 86400.0, "3 days": 259200.0, "1.5e1 s": 15.0, "2week": 1209600.0, "1yr": 31557600.0,
}  # fmt: skip
EPOCH = pz.Epoch("2026-11-03T00:00:00 UTC")
COURSE = SimpleNamespace(problem=SimpleNamespace(epoch=EPOCH), times=None)

READERS = {
    "option": option,
    "key of a case": lambda text: key(text, "step"),
    "--interval": lambda text: told({"interval": text})["interval"],
    "--to": lambda text: span_of(COURSE, None, text, text)[-1],
    "--step": lambda text: span_of(COURSE, None, "60d", text)[1],
    "--span": lambda text: end_of(f"first+{text}", EPOCH, EPOCH, EPOCH) - EPOCH,
    "--when": lambda text: when(f"2026-11-03T00:00:00Z .. +{text}", None)[1] - EPOCH,
    "a value per": lambda text: Estimated("cd", per=text).period,
    "a process": lambda text: Estimated("cd", per=f"~{text}").period,
    "a burn": lambda text: burns_of(f"2026-11-03T00:00:00Z dv=0,1,0m/s for={text}")[0].duration,
    "a window": lambda text: parse(f"window:{text}x2").lag_seconds,
}
JOINED = {"a burn"}  # one word in a list
SHORT = {"a window"}  # plain decimals, no exponent


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize(("text", "seconds"), TABLE.items())
def test_every_reader_takes_the_same_texts(reader, text, seconds):
    if (reader in JOINED and " " in text) or (reader in SHORT and "e1" in text):
        return
    if reader == "--step" and seconds > 5e6:
        return
    assert READERS[reader](text) == pytest.approx(seconds, rel=1e-15)


def test_a_number_alone_is_of_seconds_but_in_lists_and_windows():
    assert duration("90", "it") == 90.0
    assert all(
        READERS[name]("90") == 90.0 for name in ("option", "key of a case", "--interval", "--to", "--step", "--span", "--when")
    )
    assert parse("window:90").lag == 90  # states
    for name in ("a value per", "a process", "a burn"):
        with pytest.raises(ValueError, match="write a length of time such as"):
            READERS[name]("90")


@pytest.mark.parametrize(
    "text", ["", "s", "1x", "1 metre", "1km", "nan", "inf d", "1e400 s", "1 d 2 h", "--1d", "\N{ARABIC-INDIC DIGIT ONE}d"]
)
def test_what_is_no_length_of_time_is_refused_with_its_text(text):
    with pytest.raises(ValueError, match=r"it is .*; write a length of time such as 60s, 10min, 6h or 3d"):
        duration(text, "it")


@pytest.mark.parametrize("text", ["0s", "-1d", "-3"])
def test_lengths_are_positive_where_they_must_be(text):
    assert duration(text, "it") <= 0
    with pytest.raises(ValueError, match="must be a positive length of time"):
        positive_duration(text, "it")
    with pytest.raises(click.BadParameter):
        option(text)
