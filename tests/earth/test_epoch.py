"""Epochs: every scale against ERFA called directly, exact sums, leap seconds on both sides, and what is refused."""

import copy
import datetime as dt
import pickle
import warnings

import erfa
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from piazzi.earth import Epoch, scales
from piazzi.earth.eop import tables

# end of the UTC days that ended with a leap second, 1972 to 2016 (IERS Bulletin C)
LEAP_DAYS = [
    *(
        "1972-06-30",
        "1972-12-31",
        "1973-12-31",
        "1974-12-31",
        "1975-12-31",
        "1976-12-31",
        "1977-12-31",
        "1978-12-31",
        "1979-12-31",
    ),
    *(
        "1981-06-30",
        "1982-06-30",
        "1983-06-30",
        "1985-06-30",
        "1987-12-31",
        "1989-12-31",
        "1990-12-31",
        "1992-06-30",
        "1993-06-30",
    ),
    *(
        "1994-06-30",
        "1995-12-31",
        "1997-06-30",
        "1998-12-31",
        "2005-12-31",
        "2008-12-31",
        "2012-06-30",
        "2015-06-30",
        "2016-12-31",
    ),
]


def instants(count, seed, first=-1262304000 + 86400 * 366 * 2, last=8.0e8):
    """Whole seconds and fractions of random instants, by default 1962 to 2025."""
    rng = np.random.default_rng(seed)
    return np.floor(rng.uniform(first, last, count)), rng.uniform(0, 1, count)


def seconds_apart(a, b):
    return ((a[0] - b[0]) + (a[1] - b[1])) * 86400


def jd_of(scale, whole, fraction):
    day, seconds, part = scales.reading(scale, whole, fraction)
    length = scales.length_of_day(day) if scale == "UTC" else 86400.0
    return 2400000.5 + day, (seconds + part) / length


def test_every_scale_agrees_with_erfa_at_random_instants():
    whole, fraction = instants(20_000, 1)
    tt = jd_of("TT", whole, fraction)
    tai = erfa.tttai(*tt)
    assert_allclose(seconds_apart(jd_of("TAI", whole, fraction), tai), 0, atol=1e-10)
    assert_allclose(seconds_apart(jd_of("UTC", whole, fraction), erfa.taiutc(*tai)), 0, atol=1e-10)
    assert_allclose(seconds_apart(jd_of("TCG", whole, fraction), erfa.tttcg(*tt)), 0, atol=1e-10)
    assert_allclose(seconds_apart(jd_of("GPS", whole, fraction), tai), -19.0, atol=1e-10)
    tdb = jd_of("TDB", whole, fraction)
    assert_allclose(seconds_apart(tdb, erfa.tttdb(*tt, erfa.dtdb(*tt, 0.0, 0.0, 0.0, 0.0))), 0, atol=1e-10)


@pytest.mark.parametrize("scale", scales.SCALES)
def test_a_hundred_thousand_round_trips_keep_a_nanosecond(scale):
    whole, fraction = instants(100_000, 2)
    back = scales.to_tt(scale, *scales.reading(scale, whole, fraction, tables()), tables())
    assert_allclose((back[0] - whole) + (back[1] - fraction), 0, atol=1e-9)


# Values of the SOFA test suite (t_sofa_c.c: taitt, utctai, tttcg, tcgtt)
@pytest.mark.parametrize(
    ("source", "day", "target", "expected"),
    [
        ("TAI", 0.892482639, "TT", 0.892855139),
        ("UTC", 0.892100694, "TAI", 0.8924826384444444444),
        ("TT", 0.892482639, "TCG", 0.8924900312508587113),
        ("TCG", 0.892862531, "TT", 0.8928551387488816828),
    ],
)
def test_values_of_the_sofa_test_suite(source, day, target, expected):
    one, two = Epoch.from_jd(2453750.5, day, source).jd(target)
    assert one == 2453750.5
    assert two == pytest.approx(expected, abs=1e-14)


@pytest.mark.parametrize("day", LEAP_DAYS)
def test_both_sides_of_every_leap_second(day):
    last, leap = Epoch(f"{day}T23:59:59 UTC"), Epoch(f"{day}T23:59:60 UTC")
    after = Epoch(f"{day} UTC") + 86401.0
    assert leap - last == 1.0
    assert after - leap == 1.0
    assert leap.to("UTC") == f"{day}T23:59:60 UTC"
    assert (leap + 0.25).to("UTC") == f"{day}T23:59:60.25 UTC"
    assert after.to("UTC").endswith("-01T00:00:00 UTC")
    assert (after + (-1e-10)).to("UTC", digits=3) == after.to("UTC")  # the carry of rounding goes over the leap second
    tai = [float(v) for v in erfa.utctai(*leap.jd("UTC"))]
    assert seconds_apart(leap.jd("TAI"), tai) == pytest.approx(0, abs=1e-9)


def test_other_days_have_no_leap_second():
    with pytest.raises(ValueError, match="did not end with a leap second"):
        Epoch("2015-12-31T23:59:60 UTC")
    with pytest.raises(ValueError, match="no time of a day"):
        Epoch("2016-12-31T22:59:60 UTC")


def test_differences_between_times_in_utc_are_whole_seconds():
    start = Epoch("2016-02-13T16:00:00 UTC")
    assert Epoch("2016-02-13T17:00:00 UTC") - start == 3600.0
    assert Epoch("2026-02-13T16:00:00 UTC") - start == 3653 * 86400.0 + 1.0  # the leap second of 2016
    assert (start + 3600.0).to("UTC") == "2016-02-13T17:00:00 UTC"


@given(
    st.integers(-6_000_000_000, 6_000_000_000),
    st.floats(0, 1, exclude_max=True),
    st.integers(-3_000_000_000, 3_000_000_000),
    st.floats(0, 1, exclude_max=True),
)
def test_whole_and_fraction_are_exact_at_any_span(whole, fraction, more, part):
    start = Epoch.at(whole, fraction)
    assert 0.0 <= start.fraction < 1.0
    span = (float(more), part)
    since = (start + span).since(start)
    assert (since[0] - more) + (since[1] - part) == pytest.approx(0, abs=1e-15)


@given(st.integers(-1_100_000_000, 800_000_000), st.integers(0, 999_999_999), st.sampled_from([*scales.SCALES]))
def test_text_and_back_is_the_same_instant(whole, nanoseconds, scale):
    epoch = Epoch.at(whole, nanoseconds * 1e-9)
    assert abs(Epoch(epoch.to(scale)) - epoch) <= 1e-9
    assert Epoch(str(epoch)) == Epoch(str(Epoch(str(epoch))))


def test_one_instant_in_many_words():
    same = [
        *("2016-02-13T16:00:00 UTC", "2016-02-13 16:00 utc", "2016-02-13T16:00:00Z", "2016-02-13T18:00:00+02:00"),
        *(
            "2016-044T16:00:00 UTC",
            "2016-02-13T16:00:00[UTC]",
            "2016-02-13T16:00:36 TAI",
            "2016-02-13T16:00:17 GPS",
            "2016-02-13T16:01:08.184 TT",
        ),
        dt.datetime(2016, 2, 13, 16, tzinfo=dt.UTC),
    ]
    assert {Epoch(when).to("UTC") for when in same} == {"2016-02-13T16:00:00 UTC"}
    assert Epoch(dt.datetime(2016, 2, 13, 16), "UTC") == Epoch(np.datetime64("2016-02-13T16:00:00"), "UTC") == Epoch(same[0])
    assert Epoch(same[0]).datetime() == same[-1]
    assert Epoch("JD 2451545.0 TT") == Epoch("MJD 51544.5 TT") == Epoch("2000-01-01T12:00 TT") == Epoch.at(0.0)


def test_an_astropy_time_is_taken_by_its_numbers():
    class Time:
        scale, jd1, jd2 = "utc", 2457432.0, 0.16666666666666666

    assert abs(Epoch(Time()) - Epoch("2016-02-13T16:00:00 UTC")) < 1e-9
    Time.jd1 = np.array([1.0, 2.0])
    with pytest.raises(TypeError, match="one instant; this Time has 2"):
        Epoch(Time())


def test_dates_before_1960_have_ut1_by_a_model_and_no_utc():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        first = Epoch("1801-01-01T08:00:00 UT1")
        assert Epoch(first.to("TT")).to("UT1") == "1801-01-01T08:00:00 UT1"
    assert (first - Epoch("1801-01-01T08:00:00 TT")) == pytest.approx(
        13.7, abs=1.0
    )  # Morrison and Stephenson 2004: 14 +- 1 s in 1800
    with pytest.raises(ValueError, match="no UTC before 1960; give it in UT1 or TT"):
        Epoch("1801-01-01 UTC")
    with pytest.raises(ValueError, match="no UTC before 1960; ask for UT1 or TT"):
        first.to("UTC")
    assert str(first).endswith(" TT")


@pytest.mark.parametrize(
    ("when", "message"),
    [
        ("2016-02-13T16:00:00", "has no time scale: add one of UTC"),
        ("2016-02-13 XYZ", "'XYZ' is no time scale; there are UTC"),
        ("2016-02-30 UTC", "the calendar has no such day"),
        ("2015-366 UTC", "the calendar has no such day"),
        ("2016-02-13T24:00:01 UTC", "no time of a day"),
        ("2016-02-13T16:60 UTC", "no time of a day"),
        ("yesterday UTC", "cannot be read"),
        ("", "cannot be read"),
        ("٢٠١٦-02-13 UTC", "cannot be read"),
        (dt.datetime(2016, 2, 13), "neither zone nor time scale"),
        (np.datetime64("NaT"), "NaT is no date"),
    ],
)
def test_what_is_no_date_is_refused_with_what_was_given(when, message):
    with pytest.raises(ValueError, match=message):
        Epoch(when)


def test_a_scale_said_twice_must_be_the_same():
    assert Epoch("2016-02-13 UTC", "utc") == Epoch("2016-02-13 UTC")
    with pytest.raises(ValueError, match="is in UTC, and TAI was said"):
        Epoch("2016-02-13 UTC", "TAI")
    with pytest.raises(TypeError, match="not of int"):
        Epoch(5)


def test_epochs_are_values():
    one, other = Epoch("2016-02-13T16:00:00 UTC"), Epoch("2016-02-13T16:00:01 UTC")
    assert one < other and one <= other and other > one and one != other
    assert len({one, other, Epoch(str(one))}) == 2
    assert pickle.loads(pickle.dumps(one)) == copy.deepcopy(one) == one
    assert repr(one) == "Epoch('2016-02-13T16:00:00 UTC')"
    assert eval(repr(one), {"Epoch": Epoch}) == one
    with pytest.raises(AttributeError):
        one.whole = 0.0
    with pytest.raises(TypeError):
        one + "1 h"
