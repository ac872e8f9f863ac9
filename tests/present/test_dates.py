"""Axes of time with dates: marks at round readings of the clock, the same in pictures and on pages."""

from datetime import datetime
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from piazzi.earth import Epoch
from piazzi.evaluate.quantities import Display
from piazzi.present.dates import Calendar
from piazzi.present.figures.difference import difference_page
from piazzi.present.figures.style import time_axis
from piazzi.present.figures.tracked import schedule
from piazzi.present.report import write_page
from piazzi.present.report.blocks import Axis, Chart, Code, Line, Section, Tab
from tests.determination.fixing import observations

SPANS = [0.02, 1.0, 20.0, 90.0, 600.0, 7200.0, 86400.0, 3e5, 1e6, 3.6e6, 5.9e6, 3e7, 9e7]
BEGINS = ["2026-11-03T10:07:31.25 UTC", "2016-12-31T23:59:40 UTC", "1801-01-01T20:43:17.8 TT"]


@pytest.mark.parametrize("begin", BEGINS)
@pytest.mark.parametrize("span", SPANS)
def test_marks_are_where_the_clock_shows_what_they_say(begin, span):
    calendar = Calendar(Epoch(begin))
    marks = calendar.ticks(0.0, span, 6)
    assert calendar.scale == begin.split()[-1] and calendar.label == f"time [{calendar.scale}]"
    assert 2 <= len(marks) <= 8 and all(-1e-3 <= m.t <= span + 1e-3 for m in marks)
    assert all(a.t < b.t for a, b in pairwise(marks))
    day = ""
    for mark in marks:
        date = (Epoch(begin) + mark.t).to(calendar.scale, digits=3).split()[0]
        day = mark.below or day
        if ":" in mark.text:
            clock = date[11:] if "." in date or "." not in mark.text else f"{date[11:]}.000"
            assert clock.ljust(12, "0").startswith(mark.text), (date, mark)
            assert not day or date[:10] == day
        else:
            assert ":00:00" in date or date.endswith("T00:00:00"), date
            said = datetime.fromisoformat(date)
            wanted = [f"{said:%b} {said.day}", f"{said:%b}", f"{said.year}"]
            assert mark.text in wanted and day in ("", str(said.year))


def test_a_day_is_said_where_it_begins_and_at_the_first_mark():
    marks = Calendar(Epoch("2026-11-03T20:00:00 UTC")).ticks(0.0, 8 * 3600.0, 8)
    assert [(m.text, m.below) for m in marks[:2]] == [("20:00", "2026-11-03"), ("21:00", "")]
    assert [m.below for m in marks if m.text == "00:00"] == ["2026-11-04"]


def test_axes_of_pictures_have_dates():
    from matplotlib.figure import Figure

    ax = Figure(figsize=(6, 3)).add_subplot()
    times = np.linspace(0.0, 86400.0, 50)
    show = time_axis(ax, times, Epoch("2026-11-03T10:00:00 UTC"))
    ax.plot(times * show.factor, times)
    assert (ax.get_xlabel(), show.unit) == ("time [UTC]", "h")
    texts = [label.get_text() for label in ax.get_xticklabels()]
    at = ax.get_xticks()[texts.index("00:00\n2026-11-04")]
    assert at == pytest.approx(14.0)
    ax.set_xlim(0.0, 0.5)  # closer
    assert ax.get_xticklabels()[0].get_text() == "10:00\n2026-11-03"


@pytest.mark.parametrize("begin", BEGINS)
def test_pages_mark_what_pictures_mark(open_page, tmp_path, begin):
    calendar, ends = Calendar(Epoch(begin)), np.array([0.0, max(SPANS)])
    chart = Chart("Height", Axis("time", Display("s")), Axis("height", Display("m")), [Line(ends, ends, "probe")])
    tab = Tab("Dates", "", [], [Section("Over time", [chart])], times=ends, epoch=Epoch(begin))
    page = open_page(write_page(tmp_path / "p.html", "Dates", [tab]))
    for span in 1.013 * np.array(SPANS):
        found = page.evaluate("(span) => TABS[0].calendar.ticks(0, span, 6)", float(span))
        wanted = calendar.ticks(0.0, float(span), 6)
        assert [(m["text"], m["below"]) for m in found] == [(m.text, m.below) for m in wanted], span
        np.testing.assert_allclose([m["t"] for m in found], [m.t for m in wanted], rtol=0, atol=2e-3)
    assert page.locator("#t0 svg text.label").all_text_contents()[-1] == calendar.label
    date, clock, scale = page.evaluate("() => TABS[0].calendar.text(19, 10)").split()
    wanted = (Epoch(begin) + 19.0).to(calendar.scale, digits=3)
    assert (date, scale) == (wanted[:10], calendar.scale) and clock.startswith(wanted[11:].split()[0])


def test_code_keeps_its_lines(open_page, tmp_path):
    words = '[states]\n# <b>what</b> moves\nx = "length"\x1b[31m'
    tab = Tab("Code", "", [], [Section("Made", [Code(words)])])
    page = open_page(write_page(tmp_path / "p.html", "Code", [tab]))
    assert page.locator("pre").inner_text().splitlines() == words.replace("\x1b", "\\x1b").splitlines()


def test_pictures_of_tracking_and_differences_have_dates():
    from matplotlib.figure import Figure

    t = np.arange(0.0, 7200.0, 600.0)
    rows = observations(np.ones((len(t), 3)), t, 1.0)
    ax = schedule(Figure().add_subplot(), rows)
    assert ax.get_xlabel() == f"time [{rows.segments[0].scale}]"
    epoch, three = Epoch("2026-11-03T10:00:00 UTC"), np.ones((len(t), 3))
    found = SimpleNamespace(epoch=epoch, t=t, position=three, sigma=three, letters="RTN", names=("a", "b"))
    figure = difference_page(found)
    assert [ax.get_xlabel() for ax in figure.axes] == ["", "", "time [UTC]"]
    assert figure.axes[2].get_xticklabels()[0].get_text() == "10:00\n2026-11-03"
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["3 sigma"]


def test_an_axis_has_two_marks_however_narrow(open_page, tmp_path):
    ends = np.array([0.0, 1.0])
    chart = Chart("c", Axis("x", Display("m")), Axis("y", Display("m")), [Line(ends, ends, "probe")], time=False)
    page = open_page(write_page(tmp_path / "p.html", "Narrow", [Tab("Narrow", "", [], [Section("s", [chart])])]))
    for low, high in ((-47000.0, 49000.0), (-1.0, 1.0), (0.3, 7.0), (1e6, 1e6 + 3)):
        marks = page.evaluate("([low, high]) => ticks(scaleOf({ scale: 'linear' }, low, high, 0, 150), 90)", [low, high])
        assert len(marks) >= 2 and all(low <= m <= high for m in marks), (low, high, marks)
    assert page.evaluate("ticks(scaleOf({ scale: 'linear' }, 1, 1, 0, 150), 90)") in ([], [1], [None])
