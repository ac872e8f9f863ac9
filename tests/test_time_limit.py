"""Equations that keep SymPy busy are refused after a stated time, in any thread, and nothing else is touched."""

import random
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
import sympy as sp

import piazzi as pz
from piazzi.expressions import ExpressionError, symbol, time_limit, to_sympy
from piazzi.expressions.time_limit import TooSlowError, each_with_time_limit, with_time_limit
from piazzi.kernels.generate import model_source
from piazzi.model.derivation import derive, derive_sensor
from piazzi.model.jacobian import jacobian
from tests.waiting import HANGS

SLOW = "1"
for _ in range(26):  # 14 levels take 3 s, 18 take 34 s
    SLOW = f"({SLOW}+pi)**(1/3)"


def spin():
    while True:
        pass


def swallow():
    while True:
        try:
            spin()
        except BaseException:
            if random.random() < 0.3:
                raise


def test_a_slow_equation_is_refused(monkeypatch):
    monkeypatch.setattr(time_limit, "SECONDS", 0.3)
    with pytest.raises(ExpressionError, match=r"SymPy needs more than 0.3 s for this: write it in a simpler way"):
        to_sympy(SLOW, {})
    assert to_sympy("x + x", {"x": symbol("x")}) == 2 * symbol("x")


def test_so_are_slow_derivatives(monkeypatch):
    monkeypatch.setattr(time_limit, "SECONDS", 0.2)

    class Slow(sp.Function):
        def fdiff(self, argindex=1):
            spin()

    x = symbol("x")
    with pytest.raises(ValueError, match=r"derivatives of equation 2: SymPy needs more than 0.2 s"):
        jacobian(sp.Matrix([x**2, Slow(x)]), [x])
    assert jacobian(sp.Matrix([x**2, sp.Abs(x) * symbol("y")]), [x, symbol("y")]) == sp.Matrix(
        [[2 * x, 0], [sp.sign(x) * symbol("y"), sp.Abs(x)]]
    )


@pytest.mark.parametrize("call", [spin, swallow])
def test_in_threads_each_has_its_own_limit(call):
    """Some end, some are interrupted, none disturbs another."""

    def run(i):
        try:
            return with_time_limit(call if i % 2 else lambda: sum(range(1000)), 0.05)
        except TooSlowError:
            return "slow"

    with ThreadPoolExecutor(8) as threads:
        assert list(threads.map(run, range(32))) == [499500, "slow"] * 16
        assert list(threads.map(lambda i: i, range(100))) == list(range(100))


def test_nested_limits_end_their_own_block():
    def inner():
        with pytest.raises(TooSlowError):
            with_time_limit(spin, 0.05)
        return with_time_limit(spin, 10.0)

    with pytest.raises(TooSlowError, match=r"more than 0\.3 s"):
        with_time_limit(inner, 0.3)


def test_errors_and_results_come_through():
    with pytest.raises(ZeroDivisionError):
        with_time_limit(lambda: 1 / 0, 1.0)
    assert with_time_limit(lambda: 7) == 7


def test_an_end_at_the_limit_leaves_nothing_behind():
    """Whatever the moment: the interruption comes in the call, or never."""
    outcomes = set()
    for i in range(300):
        seconds = 0.002 + 0.00001 * (i % 40)
        end = time.thread_time() + 0.0022

        def call(end=end):
            while time.thread_time() < end:
                pass
            return "done"

        try:
            outcomes.add(with_time_limit(call, seconds))
        except TooSlowError:
            outcomes.add("slow")
        for _ in range(100):
            pass
    assert outcomes <= {"done", "slow"}


def test_watching_threads_end():
    for _ in range(20):
        with_time_limit(lambda: None)
    end = time.monotonic() + HANGS
    while any("_run" in str(t) for t in threading.enumerate()) and time.monotonic() < end:
        time.sleep(0.01)
    assert not any("_run" in str(t) for t in threading.enumerate())


@pytest.mark.slow
def test_a_program_refuses_it(tmp_path):
    code = f"""
import piazzi as pz
model = pz.Model(["x"], ["-x*{SLOW}"], [pz.Sensor("s", ["x"])])
problem = pz.Problem(model, pz.Gaussian(1.0, 0.1), 0.01, pz.Station("s", "s", 0.1))
try:
    pz.ExtendedKalmanFilter().estimate(problem, pz.Tracking([0.0, 1.0], [1.1, 0.4]))
except ValueError as error:
    print(error)
"""
    environment = {"PIAZZI_CACHE": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=HANGS, check=True
    )
    assert "SymPy needs more than 5 s for this" in done.stdout


def test_a_profiler_can_watch_what_comes_after_a_limit():
    """CPython 3.11 with a profiler stood still at the next generator, looking for an interruption that never came."""
    program = """
import sys
from piazzi.expressions.time_limit import with_time_limit
sys.setprofile(lambda *event: None)
with_time_limit(lambda: None)
print(sum(i for i in range(3)))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=HANGS)
    assert done.stdout == "3\n"


def test_each_of_several_has_the_limit_for_itself():
    def work(seconds):
        end = time.thread_time() + seconds
        while time.thread_time() < end:
            pass
        return seconds

    assert each_with_time_limit(work, [0.1] * 6, 0.4) == [0.1] * 6
    with pytest.raises(TooSlowError) as found:
        each_with_time_limit(work, [0.1, 0.1, 5.0, 0.1], 0.4)
    assert found.value.at == 2


# A sine of so many turns takes three times as long with each level: for the digits of its argument that it drops.
DIGITS = "pi/7"
for _ in range(7):
    DIGITS = f"sin({DIGITS}*10**20)"


def source(**changes):
    """Of a model that was derived with time enough, when there is no more than 0.05 s for any of its equations."""
    given = {"states": ["x", "v"], "dynamics": ["v", "-x"], "sensors": [pz.Sensor("s", ["x", "v"])]} | changes
    model = pz.Model(**given)
    derive(model)
    for sensor in model.sensors:
        derive_sensor(model, sensor)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time_limit, "SECONDS", 0.05)
        return model_source(model, pz.Taylor(2).scheme, 1)


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"dynamics": ["v", f"-x*{DIGITS}*v"]}, "the dynamics of v"),  # a common part of v's rate and its derivatives
        ({"dynamics": ["v", f"{DIGITS}*x"]}, "the dynamics of v"),  # and a constant derivative
        ({"sensors": [pz.Sensor("s", {"range": "x", "rate": f"sin(v + {DIGITS})"})]}, "rate of sensor s"),
        ({"definitions": {"d": f"x*{DIGITS}"}, "dynamics": ["d*v", "-x"]}, "definition d"),
    ],
)
def test_code_that_takes_long_is_refused_with_its_equation(changes, place):
    with pytest.raises(ValueError, match=rf"^code of {place}: SymPy needs more than 0.05 s for this$"):
        source(**changes)


def test_so_are_common_parts_that_take_long_to_find(monkeypatch):
    monkeypatch.setattr(sp, "cse", lambda *arguments, **options: spin())
    with pytest.raises(ValueError, match=r"^code of the dynamics of x, the dynamics of v: SymPy needs more than 0.1 s"):
        source()


def test_limits_leave_the_code_as_it_is():
    assert source(sensors=[]).count("def scalar_f") == 2


def test_a_clock_that_jumps_is_no_work_of_sympys(monkeypatch):
    """As one does where the whole machine was stopped for a while."""
    start = time.monotonic()
    monkeypatch.setattr(time_limit, "_clock", lambda: lambda: 100.0 if time.monotonic() - start > 0.1 else 0.0)

    def wait():
        time.sleep(0.4)
        return 7

    assert with_time_limit(wait, 0.2) == 7
