"""The table of observations: columns, selection, putting together, conventions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import piazzi as pz
from piazzi.formats import Conventions, Correction, Observations, Segment, concatenate
from piazzi.formats.conventions import with_conventions

EPOCH = pz.Epoch("2020-01-01T00:00:00 UTC")


def table(who="BER", **columns):
    given = {
        "epoch": EPOCH, "t": [0.0, 1.0, 2.0], "value": [1.0, 2.0, 0.5], "kinds": ("range", "azimuth"), "kind": [0, 0, 1],
        "segments": (Segment("UTC"),), "participants": (who, "SAT"), "station": 0, "object": 1,
        "files": ("a.tdm",), "line": [3, 4, 5],
    }  # fmt: skip
    return Observations(**(given | columns))


def test_columns_of_one_number_take_no_memory():
    rows = table()
    assert rows.sigma.shape == (3,) and rows.sigma.strides == (0,)
    assert rows.station.strides == (0,)
    big = table(t=np.arange(1e6), value=np.ones(10**6), kind=0, line=0)
    assert sum(c.nbytes for c in (big.t, big.value)) == 16_000_000
    assert big[::2].station.strides == (0,)
    assert len(big[::2]) == 500_000


def test_rows_are_chosen_by_mask_slice_and_index():
    rows = table(extra={"catalogue": np.array(["U", "V", "V"])})
    assert_array_equal(rows[rows.of_kind("range")].line, [3, 4])
    assert_array_equal(rows[[2, 0]].value, [0.5, 1.0])
    assert_array_equal(rows[1:].extra["catalogue"], ["V", "V"])
    assert rows.stations == ("BER",) and rows.objects == ("SAT",)
    assert rows[1].instant(0) - EPOCH == 1.0


def test_nothing_can_be_written_into_a_table():
    rows = table()
    for name in ("t", "value", "sigma"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(rows, name)[0] = 1.0


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"value": [1.0, 2.0]}, "column 'value' has shape"),
        ({"kinds": ("range", "azimut")}, "'azimut' is no kind of measurement; did you mean 'azimuth'"),
        ({"station": [0, 1, 2]}, "column 'station' goes from 0 to 2"),
        ({"segment": [0, 0, 1]}, "column 'segment'"),
        ({"t": [0.0, np.nan, 1.0]}, "the time of row 1 is not finite"),
    ],
)
def test_a_table_that_cannot_be_is_refused(columns, says):
    with pytest.raises(ValueError, match=says):
        table(**columns)


def test_tables_are_put_together_about_the_first_epoch():
    later = table("POT", epoch=EPOCH + 3600.0, kinds=("azimuth",), kind=0, files=("b.tdm",), sigma=[1.0, 2.0, 3.0],
                  place=[-1, 0, 0], places=[[1.0, 2.0, 3.0]], open=("a",), left_out=(("comment", 2),))  # fmt: skip
    both = concatenate([table(open=("a",), left_out=(("comment", 1),)), later])
    assert_allclose(both.t, [0, 1, 2, 3600, 3601, 3602], rtol=0, atol=0)
    assert both.participants == ("BER", "SAT", "POT")
    assert [both.participants[i] for i in both.station] == ["BER"] * 3 + ["POT"] * 3
    assert [both.kinds[i] for i in both.kind] == ["range", "range", "azimuth", "azimuth", "azimuth", "azimuth"]
    assert_array_equal(both.segment, [0, 0, 0, 1, 1, 1])
    assert_array_equal(both.file, [0, 0, 0, 1, 1, 1])
    assert_array_equal(both.place, [-1, -1, -1, -1, 0, 0])
    assert_array_equal(both.sigma, [np.nan, np.nan, np.nan, 1, 2, 3])
    assert both.open == ("a",) and both.left_out == (("comment", 3),)
    assert concatenate([table(), table()]).station.strides == (0,)


def test_rows_of_one_time_keep_their_order():
    rows = table(t=[2.0, 1.0, 1.0])
    assert_array_equal(rows.in_order().line, [4, 5, 3])


def test_seconds_of_tdb_are_those_of_the_epochs():
    rows = table(t=[0.0, 86400.0 * 90, 86400.0 * 200])
    for row, seconds in enumerate(rows.seconds("TDB")):
        jd, zero = rows.instant(row).jd("TDB"), EPOCH.jd("TDB")
        assert_allclose(seconds, ((jd[0] - zero[0]) + (jd[1] - zero[1])) * 86400.0, rtol=0, atol=2e-9)
    with pytest.raises(ValueError, match="TT or TDB"):
        rows.seconds("UTC")


def test_what_the_user_says_fills_in_what_the_file_does_not():
    rows = table(sigma=[5.0, np.nan, np.nan], open=("say which range it is: --range", "say sigmas: --sigma"),
                 segments=(Segment("UTC", corrections=(Correction("troposphere", 2.0, True),)),))  # fmt: skip
    told = with_conventions(rows, Conventions.of(range="two-way", sigma=["range=10m", "range.BER=20m", "azimuth=1mrad"]))
    assert (told.segments[0].way, told.segments[0].range_is) == ("two-way", "half")
    assert_array_equal(told.sigma, [5.0, 20.0, 1e-3])
    assert told.open == ()
    assert with_conventions(rows, Conventions.of(sigma="3 m")).open == rows.open  # the azimuth still has none


def test_what_a_file_says_is_not_overridden():
    said = Segment("UTC", tag="transmit", way="three-way", range_is="sum", frame="GCRF", interval=1.0,
                   corrections=(Correction("range", 1.0, False), Correction("mag")))  # fmt: skip
    rows = table(
        segments=(said, Segment("UTC")), segment=[0, 0, 1], tag=[1, 1, 3], open=("when: --tag bounce", "over: --interval 1")
    )
    told = with_conventions(
        rows, Conventions.of(tag="bounce", range="two-way", frame="ITRF", interval=60, corrections="applied")
    )
    assert (told.segments[0].tag, told.segments[0].way, told.segments[0].frame, told.segments[0].interval) == (
        "transmit", "three-way", "GCRF", 1.0,
    )  # fmt: skip
    assert told.segments[0].corrections == (Correction("range", 1.0, False), Correction("mag", None, True))
    assert (told.segments[1].tag, told.segments[1].frame, told.segments[1].interval) == ("bounce", "ITRF", 60.0)
    assert_array_equal(told.tag, [1, 1, 2])
    assert told.open == ()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ({"range": "twoway"}, "did you mean 'two-way'"),
        ({"angles": "apparant"}, "did you mean 'apparent'"),
        ({"tag": "recieve"}, "did you mean 'receive'"),
        ({"interval": -1}, "positive"),
        ({"time": "BER=GPST"}, "'GPST' is no time scale"),
        ({"sigma": "rang=1m"}, "rang"),
        ({"sigma": "range=1s"}, "1s is no sigma of range: write it as range=1m"),
        ({"sigma": "-1m"}, "must be positive"),
        ({"sigma": "much"}, "cannot be read"),
    ],
)
def test_words_that_mean_nothing_are_refused(words, says):
    with pytest.raises(ValueError, match=says):
        Conventions.of(**words)
