"""Tables over time: errors as stated, of rates too; the same bits in lanes; no value outside."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from piazzi.outside.pieces import pieces_of
from piazzi.outside.table import Table
from tests.kernels.outside import called

DAY = 86400.0


def orbit(t):
    return np.stack([7e6 * np.cos(1.1e-3 * t), 7e6 * np.sin(1.1e-3 * t), 1e5 * np.sin(3e-4 * t + 0.3)], axis=-1)


def rates(t):
    return np.stack([-7.7e3 * np.sin(1.1e-3 * t), 7.7e3 * np.cos(1.1e-3 * t), 30.0 * np.cos(3e-4 * t + 0.3)], axis=-1)


DENSE = np.linspace(0.0, DAY, 30011)


@pytest.mark.parametrize("error", [1.0, 1e-3, 1e-6])
@pytest.mark.parametrize("terms", [6, 12])
def test_pieces_of_a_function_keep_the_stated_error(error, terms):
    found = pieces_of(orbit, 0.0, DAY, error, terms)
    value, rate = found(DENSE)
    reached = np.abs(value - orbit(DENSE)).max(axis=0)
    assert (reached <= 1.1 * error).all() and (found.error <= error).all()
    assert (reached <= 1.1 * found.error + 3e-14 * 7e6).all()
    assert (np.abs(rate - rates(DENSE)).max(axis=0) <= 1.5 * found.rate_error + 1e-9).all()
    longer = pieces_of(orbit, 0.0, DAY, terms=terms, length=2 * found.length)
    assert (longer.error > error).any(), "pieces twice as long would have done"


@pytest.mark.parametrize("step", [300.0, 120.0, 60.0])
def test_a_table_of_samples_tells_its_error(step):
    t = np.arange(0.0, DAY + 1, step)
    table = Table(t, orbit(t))
    value, rate = table.pieces(DENSE)
    error, rate_error = table.errors
    reached, rates_reached = (np.abs(a).max(axis=0) for a in (value - orbit(DENSE), rate - rates(DENSE)))
    assert (reached <= 3.0 * error).all() and (rates_reached <= 3.0 * rate_error).all()
    assert (error <= 100.0 * reached).all()


def test_samples_may_be_at_any_times():
    t = np.sort(np.random.default_rng(0).uniform(0.0, 20000.0, 400))
    table = Table(t, orbit(t)[:, 0])
    at = np.linspace(t[20], t[-20], 999)
    error, _ = table.errors
    assert np.abs(table.pieces(at)[0][:, 0] - orbit(at)[:, 0]).max() <= 3.0 * error[0]
    assert_allclose(table.value(t[100])[0], orbit(t[100])[0], atol=3.0 * error[0])


def test_a_stated_error_that_samples_cannot_give_is_refused():
    t = np.arange(0.0, DAY + 1, 600.0)
    with pytest.raises(ValueError, match=r"samples of column . of a table are too far apart for an error of 1e-06"):
        Table(t, orbit(t), error=1e-6)
    table = Table(t[: len(t) // 2], orbit(t)[: len(t) // 2], error=1e4)
    assert (table.errors[0] <= 1e4).all()


def test_two_samples_are_a_line():
    table = Table([0.0, 10.0], [1.0, 6.0])
    assert_allclose(table.value(4.0), [3.0], rtol=1e-15)
    assert_allclose(table.derivatives(4.0), [[0.5]], rtol=1e-12)


@pytest.mark.parametrize("lanes", [8, 4, 2])
@pytest.mark.parametrize("columns", [1, 2, 3, 6, 15])
def test_lanes_have_the_same_bits_and_uncompiled_code_agrees(columns, lanes):
    t = np.arange(0.0, 6001.0, 60.0)
    table = Table(t, np.cos(np.outer(1e-3 * t, 1.0 + np.arange(columns))))
    at = np.random.default_rng(1).uniform(0.0, 6000.0, (64, 1))
    at[:3] = [[0.0], [6000.0], [60.0]]
    data = np.concatenate([np.full(16, np.nan), table.block()])
    with called(table.signature, partials=True, lanes=lanes) as f:
        one = f.one(at, data, 16)
        assert_array_equal(f.lanes(at, data, 16), one)
        outside = np.full((8, 1), 6000.0000001)
        outside[0], outside[1] = -1e-9, np.nan
        assert np.isnan(f.one(outside, data, 16)).all() and np.isnan(f.lanes(outside, data, 16)).all()
        plain = np.array([np.append(table.value(*r), table.derivatives(*r)) for r in at])
        assert_allclose(one, plain, rtol=0, atol=1e-13)
        value, rate = table.pieces(at[:, 0])
        assert_allclose(one, np.hstack([value, rate]), rtol=0, atol=1e-13)


def test_the_partials_are_those_of_differences():
    t = np.arange(0.0, 6001.0, 60.0)
    table = Table(t, orbit(t))
    ahead, behind = (np.array(table.value(1234.0 + h)) for h in (0.5, -0.5))
    assert_allclose(table.derivatives(1234.0)[:, 0], ahead - behind, rtol=1e-7)


def test_python_names_the_span():
    table = Table([0.0, 10.0, 20.0], [1.0, 6.0, 2.0])
    with pytest.raises(ValueError, match=r"t is 20.5 s; the table goes from 0 to 20 s"):
        table.value(20.5)


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0.0, 1.0, 1.0], [1.0, 2.0, 3.0], "times of a table must ascend; row 2 is 1 after 1"),
        ([0.0, 1.0], [1.0, np.nan], "values of a table must be finite; row 1"),
        ([0.0], [1.0], "a table has two or more times"),
        ([0.0, 1.0], [1.0, 2.0, 3.0], "a row of values for each"),
    ],
)
def test_bad_samples_are_refused(times, values, message):
    with pytest.raises(ValueError, match=message):
        Table(times, values)


def test_a_table_is_read_from_a_file(tmp_path):
    path = tmp_path / "thrust.csv"
    path.write_text("t,ax,ay\n# burn\n0,1,2\n10,2,4\n20,3,6\n")
    table = Table.read(path)
    assert table.signature.outputs == 2 and table.span == (0.0, 20.0)
    assert_allclose(table.value(15.0), [2.5, 5.0], rtol=1e-14)
    for text, message in (
        ("t,a\n0,1\n1,x\n", "thrust.csv, line 3: 'x' is not a number"),
        ("0,1\n1\n", "thrust.csv, line 2: 1 values, where the rows before have 2"),
        ("0,1\n1,nan\n", "thrust.csv, line 2: values must be finite"),
        ("t,a\n", "thrust.csv: a table has two columns"),
    ):
        path.write_text(text)
        with pytest.raises(ValueError, match=message):
            Table.read(path)
