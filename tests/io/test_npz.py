"""The founding layout: read as DESIGN says, given back bit for bit, and never a way in for anything else."""

import io
import os
import pickle
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.io import save
from piazzi.io.npz import read_npz
from tests.references.drawn import covariances, same_bits, same_problem, same_tracking

GOOD = {
    "R": 1.2e-5,
    "Q": np.diag([0.01, 0.01, 0.0025, 0.0025]),
    "dt": 15,
    "meas": np.linspace(1.5, 1.2, 20),
    "x0": np.array([0, 2e7, 4500, 0]),
    "P0": np.diag([1e12, 9e12, 6.4e5, 6.4e5]),
    "truth": np.ones((20, 4)) * 2e7,
}


def put(path, **changes):
    np.savez(path, **{k: v for k, v in (GOOD | changes).items() if v is not None})
    return path


def test_a_founding_file_is_the_satellite_problem_with_its_own_numbers(tmp_path):
    problem, tracking = pz.load(put(tmp_path / "a.npz", dt=14.2))
    base, _ = pz.load("satellite-bearing")
    assert problem.model is base.model
    assert problem.integrator == pz.Taylor(15)
    assert (problem.process_noise.per, problem.process_noise.method) == ("second", "scaled")
    assert_array_equal(problem.process_noise.covariance, GOOD["Q"])
    assert_array_equal(problem.covariance, GOOD["P0"])
    assert problem.station_noise[0, 0, 0] == GOOD["R"]
    assert_array_equal(tracking.times, np.arange(20) * 14.2)
    assert_array_equal(tracking.values[:, 0], GOOD["meas"])
    assert_array_equal(tracking.truth, GOOD["truth"])


def test_the_recording_of_the_founding_paper(data_dir):
    problem, tracking = pz.load(data_dir / "satellite" / "slide_example.npz")
    assert tracking.truth.shape == (1441, 4)
    assert problem.integrator == pz.Taylor(15)
    assert same_problem(problem, pz.load("satellite-bearing")[0]) is False  # it has no truth half
    assert_array_equal(problem.covariance, pz.load("satellite-bearing")[0].covariance)


def test_keys_may_be_bare_numbers_or_arrays_of_one(tmp_path):
    problem, tracking = read_npz(
        put(tmp_path / "a.npz", R=np.array([[2e-5]]), dt=np.array([[3]]), meas=GOOD["meas"][:, None], truth=None)
    )
    assert problem.station_noise[0, 0, 0] == 2e-5
    assert tracking.truth is None
    assert tracking.times[1] == 3.0


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.data())
def test_round_trip_is_exact(tmp_path, data):
    K = data.draw(st.integers(1, 30))
    meas = np.array(data.draw(st.lists(st.floats(allow_infinity=False), min_size=K, max_size=K)))
    meas[0] = np.nan_to_num(meas[0])
    dt = data.draw(st.floats(1e-3, 1e4))
    truth = data.draw(st.none() | st.just(np.random.default_rng(K).normal(size=(K, 4))))
    numbers = {
        "Q": covariances(data.draw, 4, definite=False),
        "P0": covariances(data.draw, 4),
        "R": data.draw(st.floats(1e-9, 1.0)),
    }
    problem, tracking = read_npz(put(tmp_path / "a.npz", dt=dt, meas=meas, truth=truth, **numbers))
    save(tmp_path / "b.npz", problem, tracking)
    again, measured = read_npz(tmp_path / "b.npz")
    assert same_problem(again, problem)
    assert same_tracking(measured, tracking)
    assert same_bits(measured.times, np.arange(K) * dt)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"problem": "b612-range"}, "its model is not that of satellite-bearing"),
        ({"times": [0.0, 15.0, 31.0]}, "its epochs are not k dt"),
        ({"integrator": pz.RungeKutta4(15)}, "its integrator is not"),
        ({"prior_time": -5.0}, "its prior is not at the first epoch"),
        ({"process_noise": np.eye(4)}, "its process noise is not Q dt"),
        ({"truth": pz.Truth(measurement_noise=False)}, "its truth differs"),
    ],
)
def test_what_the_layout_cannot_hold_is_told(tmp_path, change, says):
    base = pz.load(change.pop("problem", "satellite-bearing"))[0]
    times = change.pop("times", np.arange(3) * 15.0)
    problem = pz.Problem(**{f: getattr(base, f) for f in base.__dataclass_fields__} | change)
    with pytest.raises(ValueError, match=f"{says}.*; .nc can"):
        save(tmp_path / "a.npz", problem, pz.Tracking(times, np.ones(3)))
    assert os.listdir(tmp_path) == []


class Evil:
    """Unpickling this would make a file."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return open, (self.path, "w")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"R": -1.0}, "key 'R' must be positive definite: the variance of 'bearing' is -1"),
        ({"R": 0.0}, "key 'R' must be positive definite"),
        ({"R": np.eye(2)}, "key 'R' has shape"),
        ({"R": None}, "there is no key 'R'"),
        ({"Q": GOOD["Q"] + np.triu(np.ones((4, 4)), 1)}, "key 'Q' is not symmetric"),
        ({"P0": -GOOD["P0"]}, "key 'P0' must be positive semidefinite"),
        ({"P0": np.full((4, 4), np.nan)}, "key 'P0' has nan"),
        ({"P0": np.diag([np.longdouble("1e4000")] * 4)}, "key 'P0' has inf"),
        ({"P0": np.full((4, 4), 1e308) + np.triu(np.ones((4, 4)), 1) * 1e307}, "key 'P0' is not symmetric"),
        ({"x0": np.array([np.nan, 2e7, 4500, 0])}, "key 'x0' of 'x' is nan"),
        ({"x0": np.ones(3)}, "key 'x0' has 3 values"),
        ({"x0": np.zeros(4)}, "no finite value at the prior mean"),
        ({"dt": 0.0}, "key 'dt' is 0"),
        ({"dt": -15}, "key 'dt' is -15"),
        ({"dt": np.inf}, "key 'dt' is inf"),
        ({"dt": 1e300}, "too many one-second substeps"),
        ({"dt": np.ones(3)}, "key 'dt' is an array of shape (3,)"),
        ({"meas": np.zeros(0), "truth": None}, "key 'meas' has no measurements"),
        ({"meas": np.full(20, np.nan)}, "key 'meas' has no measurements"),
        ({"meas": np.where(np.arange(20) == 5, np.inf, 1.0)}, "key 'meas' is inf at 5"),
        ({"meas": np.ones((20, 2))}, "key 'meas' has shape (20, 2)"),
        ({"meas": np.array(["a"] * 20)}, "key 'meas' is not made of real numbers"),
        ({"meas": np.ones(20, dtype=complex)}, "key 'meas' is not made of real numbers"),
        ({"meas": np.zeros(20, dtype=[("a", float)])}, "key 'meas' is not made of real numbers"),
        ({"truth": np.ones((4, 20))}, "key 'truth' has shape (4, 20)"),
        ({"truth": np.full((20, 4), np.inf)}, "truth of epoch 0"),
    ],
)
def test_wrong_numbers_are_told_with_file_and_key(tmp_path, change, says):
    with pytest.raises(ValueError, match=r"a\.npz: ") as error:
        pz.load(put(tmp_path / "a.npz", **change))
    assert says in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_objects_are_never_unpickled(tmp_path):
    trap = tmp_path / "trap"
    put(tmp_path / "a.npz", meas=np.array([Evil(str(trap))], dtype=object))
    with zipfile.ZipFile(tmp_path / "b.npz", "w") as archive:
        archive.writestr("meas.npy", pickle.dumps(Evil(str(trap))))
        for key in ("R", "Q", "dt", "x0", "P0"):
            archive.writestr(f"{key}.npy", pickle.dumps(Evil(str(trap))))
    (tmp_path / "c.npz").write_bytes(pickle.dumps(Evil(str(trap))))
    for name in "abc":
        with pytest.raises(ValueError, match=f"{name}.npz"):
            pz.load(tmp_path / f"{name}.npz")
    assert not trap.exists()


@pytest.mark.parametrize("cut", [0, 1, 100, 1000, -1, -30])
def test_truncated_files_are_told(tmp_path, cut):
    whole = put(tmp_path / "whole.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(whole[:cut] if cut else b"")
    with pytest.raises(ValueError, match=r"a.npz: the file is (empty|not a whole)"):
        pz.load(tmp_path / "a.npz")


def header(shape, descr="<f8"):
    """An .npy header that declares a shape, and nothing behind it."""
    text = f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {shape}, }}".encode()
    text += b" " * (64 - (len(text) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


@pytest.mark.parametrize(
    "content",
    [
        header((10**12,)),
        header((-1,)),
        header((2**63,)),
        header("(" * 200 + ")" * 200),
        header((20,), "|O"),
        header((20,), "<f999"),
        header((20,)) + b"\0" * 8,
        b"\x93NUMPY\x03\x00",
        b"\x93NUMPY",
        b"hello",
        header((True,)),
    ],
)
def test_arrays_that_are_not_what_they_declare_are_refused(tmp_path, content):
    put(tmp_path / "whole.npz")
    with zipfile.ZipFile(tmp_path / "whole.npz") as whole, zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        for info in whole.infolist():
            archive.writestr(info.filename, content if info.filename == "meas.npy" else whole.read(info))
    with pytest.raises(ValueError, match=r"a\.npz: key 'meas'"):
        pz.load(tmp_path / "a.npz")


def test_a_bomb_is_refused_before_it_is_read(tmp_path, monkeypatch):
    zeros = io.BytesIO()
    np.lib.format.write_array_header_1_0(zeros, {"descr": "<f8", "fortran_order": False, "shape": (2**24,)})
    put(tmp_path / "whole.npz", meas=None)
    with (
        zipfile.ZipFile(tmp_path / "whole.npz") as whole,
        zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
    ):
        for info in whole.infolist():
            archive.writestr(info.filename, whole.read(info))
        with archive.open("meas.npy", "w") as member:
            member.write(zeros.getvalue())
            for _ in range(8):
                member.write(bytes(2**24))
    monkeypatch.setattr(zipfile.ZipFile, "open", lambda *arguments: pytest.fail("it is opened"))
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="absurd"):
            pz.load(tmp_path / "a.npz")
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()


def test_honest_compression_is_read(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", **GOOD)
    assert same_tracking(pz.load(tmp_path / "a.npz")[1], pz.load(put(tmp_path / "b.npz"))[1])


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.data())
def test_damaged_bytes_are_read_or_told(tmp_path, data):
    content = bytearray(put(tmp_path / "whole.npz").read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    (tmp_path / "a.npz").write_bytes(bytes(content))
    try:
        pz.load(tmp_path / "a.npz")
    except ValueError as error:
        assert len(str(error).splitlines()) == 1
        assert str(error).isprintable()
