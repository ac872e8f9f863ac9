"""Data of functions from outside in studies and files: sent once to a worker, told apart by checksum, kept."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import piazzi as pz
from piazzi.io.checkpoint import Progress, fingerprint, read_checkpoint, write_checkpoint
from piazzi.io.files import save
from piazzi.study.pool import Processes
from piazzi.study.tasks import Task

TIMES = np.arange(-100.0, 200.0, 0.125)


@pytest.fixture(autouse=True)
def uncompiled(monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")


def problem(scale=1.0):
    push = pz.Table(TIMES, scale * np.sin(TIMES / 30.0))
    model = pz.Model(["x"], ["push(t) - x"], [pz.Sensor("s", ["x"])], functions={"push": push})
    return pz.Problem(model, pz.Gaussian([0.0], [0.1]), [1e-4], pz.Station("s", "s", 1e-2), functions={"push": push})


def study(p):
    return pz.Study(p, np.arange(0.0, 5.0, 0.5), [pz.Smoother()], runs=4)


def test_data_are_sent_once_and_not_with_tasks():
    samples = problem().functions["push"].values.tobytes()
    sent = pickle.dumps(study(problem()))
    assert sent.count(samples) == 1
    assert len(sent) < 4 * len(samples)  # samples and their times, and what a study is without them
    pool = Processes.__new__(Processes)
    pool._first = sent
    assert samples not in pickle.dumps(Task(0, 0, 4)) and len(pickle.dumps(Task(0, 0, 4))) < 200


def test_copies_of_a_problem_share_their_data():
    p = problem()
    block = p.given_over(0.0, 10.0).data
    assert replace(p, name="other").functions["push"].data is p.functions["push"].data
    assert p.given_over(0.0, 5.0).data is block and not block.flags.writeable


def test_other_data_are_another_specification():
    one, same, other = (study(problem(scale)) for scale in (1.0, 1.0, 1.0 + 1e-15))
    assert one.digest == same.digest != other.digest
    tables = one.specification["problem"]
    assert tables["functions"] == {"push": problem().functions["push"].checksum}


def test_a_checkpoint_is_of_these_data_only(tmp_path):
    p = problem()
    live = pz.ExtendedKalmanFilter().start(p)
    live.update("s", [0.1], 0.5)
    progress = Progress(1, 0, b"0" * 32, b"0" * 32)
    write_checkpoint(tmp_path / "c.npz", fingerprint(p, pz.ExtendedKalmanFilter()), live.checkpoint(), progress)
    read_checkpoint(tmp_path / "c.npz", fingerprint(problem(), pz.ExtendedKalmanFilter()), live.saved_names)
    with pytest.raises(ValueError, match="the checkpoint was made with another problem or estimator"):
        read_checkpoint(tmp_path / "c.npz", fingerprint(problem(1.5), pz.ExtendedKalmanFilter()), live.saved_names)


def test_a_recording_holds_them(tmp_path):
    p = problem()
    tracking = pz.simulate(p, np.arange(0.0, 5.0, 0.5), np.random.default_rng(0))
    save(tmp_path / "r.nc", p, tracking)
    again = pz.load(tmp_path / "r.nc")[0]
    assert again.checksums == p.checksums
    np.testing.assert_array_equal(again.functions["push"].values, p.functions["push"].values)
