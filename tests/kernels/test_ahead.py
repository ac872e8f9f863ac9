"""Kernels that will be needed are compiled several at a time, by processes that fill the cache and do nothing else."""

import logging

import numpy as np
import pytest

import piazzi as pz
from piazzi import kernels
from piazzi.estimate.ahead import specs_of
from piazzi.estimate.registry import parse
from piazzi.kernels import KernelSpec, ahead, cache, folder, load

MODEL = pz.Model(["x"], ["-x"], [pz.Sensor("range", "x")])
FRAGMENTS = (("rates",), ("matrices", "arc_steps", "transition", "propagate"))


@pytest.fixture
def specs(tmp_path, monkeypatch):
    """Two small modules, compiled nowhere yet; two processors."""
    monkeypatch.setenv("PIAZZI_CACHE", str(tmp_path))
    monkeypatch.delenv("PIAZZI_JIT", raising=False)
    monkeypatch.setattr(ahead, "processors", lambda: 2)
    monkeypatch.setattr(ahead, "DEAR", 2)
    monkeypatch.setattr(ahead, "ANY", 2)
    for remembered in (folder.private_folder, folder.writable_folder):
        remembered.cache_clear()
    yield [KernelSpec(MODEL, pz.RungeKutta4().scheme, fragments) for fragments in FRAGMENTS]
    for remembered in (folder.private_folder, folder.writable_folder):
        remembered.cache_clear()


@pytest.mark.slow
def test_what_is_missing_is_compiled_by_others_with_progress(specs, caplog):
    assert cache.missing(specs) == specs
    with caplog.at_level(logging.INFO, "piazzi.kernels"):
        assert ahead.compile_ahead(specs) == 2
        assert sorted(message.split(":")[0] for message in caplog.messages) == ["compiling 1 of 2", "compiling 2 of 2"]
        assert cache.missing(specs) == []
        assert load(specs[0]).evaluate_dynamics is not None
        assert len(caplog.messages) == 2  # nothing was compiled here
    assert ahead.compile_ahead(specs) == 0


def test_few_modules_or_one_processor_begin_no_process(specs, monkeypatch):
    monkeypatch.setattr(ahead, "interpreter", None)
    monkeypatch.setattr(ahead, "ANY", 3)
    assert ahead.compile_ahead(specs) == 0
    monkeypatch.setattr(ahead, "ANY", 2)
    assert ahead.compile_ahead(specs[:1]) == 0
    monkeypatch.setattr(ahead, "processors", lambda: 1)
    assert ahead.compile_ahead(specs) == 0


@pytest.mark.parametrize("program", ["raise SystemExit(3)", "import sys; sys.stdin.buffer.read(1)"])
def test_processes_that_end_early_leave_it_to_whoever_needs_it(specs, monkeypatch, program):
    monkeypatch.setattr(ahead, "PROGRAM", program)
    ahead.compile_ahead(specs)
    assert cache.missing(specs) == specs


def test_what_an_estimator_is_said_to_need_is_what_it_loads(specs, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", "0")
    problem = pz.Problem(MODEL, pz.Gaussian([1.0], [1.0]), [0.01], pz.Station("here", "range", [0.1]))
    tracking = pz.simulate(problem, np.arange(5.0), np.random.default_rng(0))
    loaded = []
    real = kernels.load
    monkeypatch.setattr(kernels, "load", lambda spec: loaded.append(spec) or real(spec))
    for text in ("ekf", "ekf:gate=0.99", "srekf", "ukf", "smoother", "window:5", "graph"):
        loaded.clear()
        estimator = parse(text)
        estimator.estimate(problem, tracking)
        said = specs_of(estimator, problem)
        assert said and {id(spec) for spec in said} <= {id(spec) for spec in loaded}, text
