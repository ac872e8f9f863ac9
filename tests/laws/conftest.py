"""Laws over many sizes run the kernels' own source uncompiled; laws without vector lanes try these too."""

import os
from functools import wraps
from importlib import import_module

import pytest

from piazzi.estimate.registry import ESTIMATORS
from tests.laws.lanes import compared

COMPARES = os.environ.get("PIAZZI_LANES") == "1"
MOST_LINES = 24


@pytest.fixture(scope="class")
def uncompiled():
    """The same generated source on NumPy arrays: nothing is compiled."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIAZZI_JIT", "0")
        yield


# ---- with PIAZZI_LANES=1, every estimate that a law asks for is made with lanes too, and compared --------------------------


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    if not COMPARES or item.path.stem == "test_lanes":  # which compares by itself
        return (yield)
    record = {"estimates": 0, "in lanes": 0, "worst": {}}
    item.user_properties.append(("lanes", record))
    with pytest.MonkeyPatch.context() as patch:
        for entry in ESTIMATORS.values():
            module, name = entry.place.split(":")
            kind = getattr(import_module(module), name)
            patch.setattr(kind, "estimate", twice(kind, record))
        return (yield)


def twice(kind, record):
    """The `estimate` of an estimator, which records how far lanes are from none, and fails where it is more than rounding."""
    alone = kind.estimate

    @wraps(alone)
    def estimate(self, problem, tracking):
        if os.environ.get("PIAZZI_JIT") == "0" or os.environ.get("PIAZZI_LANES") != "1":
            return alone(self, problem, tracking)
        result = compared(lambda p, t: alone(self, p, t), problem, tracking)
        record["estimates"] += 1
        record["in lanes"] += result.in_lanes
        for what, apart in result.found.items():
            place = f"{kind.__name__}, {what}"
            record["worst"][place] = max(record["worst"].get(place, 0.0), apart)
        return result.one

    estimate.__wrapped__ = alone.__wrapped__  # what `nominal` calls is the estimator's own
    return estimate


def pytest_terminal_summary(terminalreporter):
    """The largest differences: of each result of each estimator, the law in which it is largest."""
    reports = [report for kind in ("passed", "failed") for report in terminalreporter.stats.get(kind, [])]
    records = [(report.nodeid, value) for report in reports for name, value in report.user_properties if name == "lanes"]
    if not records:
        return
    made, in_lanes = (sum(record[what] for _, record in records) for what in ("estimates", "in lanes"))
    worst = {}
    for law, record in records:
        for place, apart in record["worst"].items():
            worst[place] = max(worst.get(place, (0.0, "")), (apart, law.removeprefix("tests/laws/")))
    terminalreporter.section("lanes")
    terminalreporter.write_line(f"{made} estimates, {in_lanes} of them in lanes; where they differ at all, each in its unit:")
    for place, (apart, law) in sorted(worst.items(), key=lambda item: -item[1][0])[:MOST_LINES]:
        if apart:
            terminalreporter.write_line(f"{apart:7.1e} {place}: {law}")
