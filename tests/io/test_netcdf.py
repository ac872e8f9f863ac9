"""The native format: problems, measurements and estimates come back bit for bit, and damaged files are told."""

import json
import os

import h5py
import numpy as np
import pytest
import xarray
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi.estimate import Estimate
from piazzi.io import load_estimate, save, save_estimate
from piazzi.io.netcdf import read_estimate, read_netcdf, write_dataset, write_estimate, write_netcdf
from tests.references.drawn import TEXT, problems, same_bits, same_problem, same_tracking, trackings

QUIET = settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
ARRAYS = ("mean", "covariance", "innovations", "innovation_covariances")


@st.composite
def estimates(draw, problem, tracking, view="realtime"):
    """Any estimate: its numbers need not make sense."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    K, J, n, m = len(tracking.times), len(tracking.row_times), problem.model.n, problem.model.width
    arrays = [rng.normal(size=shape) for shape in ((K, n), (K, n, n), (J, m), (J, m, m))]
    arrays[2][0] = np.nan
    arrays[0][-1] = draw(st.sampled_from([1.0, np.nan, np.inf, -0.0]))
    details = draw(
        st.dictionaries(
            st.sampled_from(["cost", "solver", "lag"]), st.none() | st.integers() | st.floats(allow_nan=False) | st.text()
        )
    )
    if draw(st.booleans()):
        details["cross_covariances"] = rng.normal(size=(K - 1, n, n))
    delayed = draw(st.none() | estimates(problem, tracking, "delayed")) if view == "realtime" else None
    return Estimate(
        problem,
        tracking,
        *arrays,
        draw(st.integers(0, 10**9)),
        draw(st.floats(0, 1e6)),
        view,
        delayed,
        details,
        draw(st.just("") | TEXT),
    )


def same_estimate(a, b):
    if a is None or b is None:
        return a is b
    return (
        same_problem(a.problem, b.problem)
        and same_tracking(a.tracking, b.tracking)
        and all(same_bits(getattr(a, name), getattr(b, name)) for name in ARRAYS)
        and all(getattr(a, name) == getattr(b, name) for name in ("iterations", "seconds", "view", "failure", "message"))
        and a.details.keys() == b.details.keys()
        and all(same_detail(value, b.details[key]) for key, value in a.details.items())
        and same_estimate(a.delayed, b.delayed)
    )


def same_detail(a, b):
    return same_bits(a, b) if isinstance(a, np.ndarray) else a == b


@QUIET
@given(st.data())
def test_problem_and_measurements_come_back_bit_for_bit(tmp_path, data):
    problem = data.draw(problems())
    tracking = data.draw(trackings(problem))
    write_netcdf(tmp_path / "a.nc", problem, tracking)
    again, measured = read_netcdf(tmp_path / "a.nc")
    assert same_problem(again, problem)
    assert same_tracking(measured, tracking)


@QUIET
@given(st.data())
def test_estimates_come_back_bit_for_bit(tmp_path, data):
    problem = data.draw(problems())
    tracking = data.draw(trackings(problem))
    estimate = data.draw(estimates(problem, tracking))
    write_estimate(tmp_path / "a.nc", estimate)
    assert same_estimate(read_estimate(tmp_path / "a.nc"), estimate)
    assert same_tracking(read_netcdf(tmp_path / "a.nc")[1], tracking)


def test_an_estimate_that_was_saved_continues_as_it_was(tmp_path):
    problem, tracking = pz.load("template", seed=4)
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    save_estimate(tmp_path / "a.nc", estimate)
    again = load_estimate(tmp_path / "a.nc")
    assert same_estimate(again, estimate)
    assert_array_equal(pz.ExtendedKalmanFilter().estimate(again.problem, again.tracking).mean, estimate.mean)


def test_any_reader_finds_names_and_units(tmp_path):
    problem, tracking = pz.load("template", seed=4)
    save_estimate(tmp_path / "a.nc", pz.ExtendedKalmanFilter().estimate(problem, tracking))
    with xarray.open_dataset(tmp_path / "a.nc", group="estimate") as dataset:
        assert dataset["state_mean"].dims == ("time", "state")
        assert list(dataset["state"].values) == ["x", "v", "k"]
        assert list(dataset["unit"].values) == ["m", "m/s", "1/s^2"]
        assert list(dataset["component_name"].sel(station="north").values) == ["range", "range_rate"]
        assert list(dataset["component_unit"].sel(station="north").values) == ["m", "m/s"]
        assert dataset["time"].attrs["units"] == "s"
        assert dataset["time"].dtype == float
        assert dataset.attrs["view"] == "realtime"
        assert_array_equal(dataset["truth"], tracking.truth)


def test_to_dataset_has_the_numbers_of_the_estimate():
    problem, tracking = pz.load("b612-range")
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    dataset = estimate.to_dataset()
    assert_array_equal(dataset["state_mean"].sel(state="vx"), estimate.mean[:, 2])
    assert_array_equal(dataset["covariance"].sel(state="x", state_2="vy"), estimate.covariance[:, 0, 3])
    assert_array_equal(dataset["innovation"], estimate.innovations)


def test_estimates_in_plain_formats(tmp_path):
    problem, tracking = pz.load("b612-range")
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    save_estimate(tmp_path / "a.csv", estimate)
    save_estimate(tmp_path / "a.npz", estimate)
    header, *rows = (tmp_path / "a.csv").read_text().split("\n")[:-1]
    columns = zip(header.split(","), *(row.split(",") for row in rows), strict=True)
    table = {name: np.array([float(c) for c in cells]) for name, *cells in columns if name != "view"}
    assert same_bits(np.stack([table[s] for s in estimate.names], axis=1), estimate.mean)
    assert same_bits(table["cov_x_vy"], estimate.covariance[:, 0, 3])
    assert same_bits(table["sigma_x"] ** 2, np.sqrt(estimate.covariance[:, 0, 0]) ** 2)
    with np.load(tmp_path / "a.npz") as arrays:
        assert same_bits(arrays["covariance"], estimate.covariance)
        assert list(arrays["names"]) == list(estimate.names)


@pytest.fixture
def good(tmp_path):
    path = tmp_path / "good.nc"
    save_estimate(path, pz.ExtendedKalmanFilter().estimate(*pz.load("b612-range")))
    return path


def said(name, change):
    """Change the JSON of a variable: by a function of its content, or to another text."""

    def apply(root):
        text = root[name][()].tobytes().decode()
        if callable(change):
            content = json.loads(text)
            change(content)
            text = json.dumps(content)
        else:
            text = change
        del root[name]
        root[name] = np.frombuffer(text.encode(), dtype="S1")

    return apply


def variable(name, value):
    def change(root):
        del root[name]
        if value is not None:
            root[name] = value

    return change


def linked(root):
    del root["value"]
    root["value"] = h5py.ExternalLink("/etc/passwd", "/value")


def external(root):
    del root["value"]
    root.create_dataset("value", (1,), "u1", external=[("/etc/passwd", 0, 1)])


def endless(root):
    del root["value"]
    root.create_dataset("value", (10**12, 1), "f8", chunks=(1000, 1))


def virtual(root):
    del root["value"]
    layout = h5py.VirtualLayout((1,), "f8")
    layout[0:1] = h5py.VirtualSource("/tmp/other.h5", "value", (1,))
    root.create_virtual_dataset("value", layout)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (said("about", lambda a: a.update(format="other/1")), "its format is 'other/1'"),
        (
            said("about", lambda a: (a.pop("format"), a.update(schema="piazzi.study/1"))),
            "it holds no measurements: its schema is 'piazzi.study/1'",
        ),
        (said("about", lambda a: a.update(epoch=3)), "about.epoch: must be text"),
        (said("problem", "{"), "variable 'problem' is not JSON"),
        (said("problem", "[]"), "variable 'problem' is not a JSON object"),
        (said("problem", "[" * 100_000), "variable 'problem' is nested too deep"),
        (
            said("problem", lambda t: t["prior"].update(mean=[1, 0, 0, np.nan])),
            "prior.mean[3]: must be a finite number, not nan",
        ),
        (said("problem", lambda t: t["dynamics"].update(vx="__import__('os')")), "dynamics.vx: column"),
        (said("problem", lambda t: t["prior"].update(mean=[0, 0, 0, 0])), "no finite value at the prior mean"),
        (said("problem", lambda t: t.update(more=1)), "more: unknown key"),
        (said("problem", lambda t: t.pop("prior")), "prior.mean: is missing"),
        (variable("problem", np.ones(3)), "variable 'problem' is not text"),
        (variable("row_time", None), "there is no variable 'row_time'"),
        (variable("row_time", np.array(["a"], dtype="S1")), "variable 'row_time' is not made of real numbers"),
        (variable("row_time", np.arange(100)[::-1].astype(float)), "times must increase"),
        (variable("value", np.full((100, 1), np.inf)), "is inf"),
        (variable("value", np.ones((3, 1))), "measurements have shape"),
        (variable("truth", np.ones((3, 4))), "truth has shape"),
        (linked, "'value' is a link"),
        (external, "in another file"),
        (virtual, "in another file"),
        (endless, "absurd"),
        (variable("estimate", np.ones(3)), "'estimate' is not a group"),
        (variable("estimate", None), "no estimate"),
        (
            lambda root: variable("state_mean", np.ones((3, 4)))(root["estimate"]),
            "variable 'state_mean' has shape (3, 4); it must be (100, 4)",
        ),
        (lambda root: said("about", lambda a: a.update(view="sideways"))(root["estimate"]), "about.view: is 'sideways'"),
        (
            lambda root: said("about", lambda a: a.update(seconds="x"))(root["estimate"]),
            "about.seconds: must be a finite number",
        ),
        (lambda root: said("about", lambda a: a.pop("iterations"))(root["estimate"]), "lacks the view, the iterations"),
    ],
)
def test_what_is_wrong_in_a_file_is_told(good, change, says):
    with h5py.File(good, "r+") as root:
        change(root)
    with pytest.raises(ValueError, match=r"good\.nc: ") as error:
        load_estimate(good)
    assert says in str(error.value)
    assert str(error.value).isprintable()


@pytest.mark.parametrize(
    ("content", "says"), [(b"", "is empty"), (b"CDF\1" + bytes(99), "is classic"), (b"hello", "is not a NetCDF-4 file")]
)
def test_other_files_are_told(tmp_path, content, says):
    (tmp_path / "a.nc").write_bytes(content)
    with pytest.raises(ValueError, match=f"a.nc: the file {says}"):
        pz.load(tmp_path / "a.nc")


@pytest.mark.parametrize("cut", [8, 100, 0.3, 0.7, 0.99])
def test_truncated_files_are_told(good, cut):
    content = good.read_bytes()
    good.write_bytes(content[: int(cut * len(content)) if isinstance(cut, float) else cut])
    with pytest.raises(ValueError, match=r"good\.nc: "):
        load_estimate(good)


def test_nothing_is_left_where_writing_fails(tmp_path):
    problem, tracking = pz.load("b612-range")
    estimate = pz.ExtendedKalmanFilter().estimate(problem, tracking)
    odd = Estimate(problem, tracking, *(getattr(estimate, a) for a in ARRAYS), 1, 1.0, details={"a": object()})
    with pytest.raises(ValueError, match="detail 'a' of the estimate is a object"):
        save_estimate(tmp_path / "a.nc", odd)
    with pytest.raises(ValueError, match="files end in"):
        save(tmp_path / "a.xlsx", problem, tracking)
    with pytest.raises(OSError, match="there is no folder"):
        save(tmp_path / "none" / "a.nc", problem, tracking)
    assert os.listdir(tmp_path) == []


def test_what_a_determination_found_is_no_recording(tmp_path):
    """It has residuals and no problem: the line says what to name instead."""
    path = tmp_path / "found.nc"
    write_dataset(path, xarray.Dataset({"o_minus_c": (("measurement",), np.zeros(3))}))
    with pytest.raises(ValueError, match=r"found\.nc: it is what a determination found.*--scenario.*--with"):
        pz.load(path)
