"""Kernels cannot be called wrongly: bundles are made by name, and a call is checked for number, kinds and sizes."""

import ast
import pickle
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import piazzi as pz
from piazzi import kernels
from piazzi.kernels.bundle import Belief, Beliefs, Gate, Given, Innovations, Measured, Run
from piazzi.kernels.entries import definitions, flat, opened, signatures
from piazzi.kernels.library import PlainEntry
from piazzi.kernels.members import BUNDLES, MOST_KINDS
from piazzi.problem.inputs import prepare

FRAGMENTS = sorted((Path(kernels.__file__).parent / "fragments").glob("*.py"))
MOST_ARGUMENTS = 8


def run(**changes):
    members = {
        "epochs": 3,
        "t_prior": 0.0,
        "t": np.arange(3.0),
        "count": np.ones(3, dtype=np.int64),
        "scale": np.ones(3),
        "first_row": np.arange(4),
        "Q": np.eye(2),
    }
    return Run(**(members | changes))


def without(name):
    members = dict(zip(Run.slots, run().members, strict=True))
    del members[name]
    return members


WRONG = {
    "a member is missing": (lambda: Run(**without("scale")), TypeError, "missing: scale"),
    "one that there is not": (lambda: run(R=np.eye(2)), TypeError, "unknown: R"),
    "by position": (lambda: Belief(np.zeros(2), np.eye(2)), TypeError, "Belief is made by names"),
    "integers for numbers": (lambda: run(t=np.arange(3)), TypeError, "Run.t must be contiguous float64, not int64"),
    "numbers for integers": (lambda: run(count=np.ones(3)), TypeError, "Run.count must be contiguous int64, not float64"),
    "single precision": (lambda: run(t=np.arange(3, dtype="f4")), TypeError, "Run.t must be contiguous float64"),
    "another byte order": (lambda: run(t=np.arange(3).astype(">f8")), TypeError, "Run.t must be contiguous float64"),
    "not contiguous": (lambda: run(t=np.arange(6.0)[::2]), TypeError, "Run.t must be contiguous"),
    "a transpose": (lambda: run(Q=np.arange(4.0).reshape(2, 2).T), TypeError, "Run.Q must be contiguous"),
    "a list": (lambda: run(t=[0.0, 1.0, 2.0]), TypeError, "Run.t must be an array, not list"),
    "an array for a number": (lambda: run(t_prior=np.zeros(1)), TypeError, "Run.t_prior must be one number"),
    "half an epoch": (lambda: run(epochs=2.5), TypeError, "Run.epochs must be one whole number"),
    "a flat matrix": (lambda: run(Q=np.zeros(4)), TypeError, r"Run.Q has shape \(4,\); it must have 2 axes"),
    "a matrix that is not square": (lambda: run(Q=np.zeros((2, 3))), ValueError, r"Run.Q has shape \(2, 3\), but N is 2"),
    "too few times": (lambda: run(t=np.zeros(2)), ValueError, r"Run.t has shape \(2,\), but K is 3"),
    "more epochs than times": (lambda: run(epochs=4), ValueError, r"Run.t has shape \(3,\), but K is 4"),
    "text for a number": (lambda: run(t_prior="noon"), TypeError, "Run.t_prior must be one number, not 'noon'"),
    "one row too few": (lambda: run(first_row=np.arange(3)), ValueError, r"Run.first_row has shape \(3,\), but K is 3"),
}


@pytest.mark.parametrize("name", WRONG)
def test_bundles_refuse_what_kernels_would_misread(name):
    make, kind, message = WRONG[name]
    with pytest.raises(kind, match=message):
        make()


@pytest.fixture(scope="module")
def case():
    problem, tracking = pz.load("b612-range")
    fragments = ("transition", problem.noise_fragment, "decorrelate", "update_components", "epoch", "filter")
    return problem, prepare(problem, tracking), problem.spec(*fragments)


def arguments(case):
    problem, inputs, _ = case
    (J, M), n = inputs.z.shape, problem.model.n
    return [*inputs.bundles(problem), Beliefs.empty(K=inputs.epochs, N=n), Innovations.empty(J=J, M=M)]


def swapped(args):
    args[0], args[1] = args[1], args[0]
    return args


CALLS = {
    "one too few": (lambda a: a[:-1], TypeError, "kernel run_filter takes 6 arguments, not 5"),
    "one too many": (lambda a: [*a, 7], TypeError, "kernel run_filter takes 6 arguments, not 7"),
    "two exchanged": (swapped, TypeError, "argument 0 of kernel run_filter must be a Run, not Given"),
    "an array": (lambda a: [a[0].t, *a[1:]], TypeError, "argument 0 of kernel run_filter must be a Run, not ndarray"),
    "room for fewer epochs": (
        lambda a: [*a[:4], Beliefs.empty(K=99, N=4), a[5]],
        ValueError,
        "kernel run_filter: K is 99 in Beliefs, 100 elsewhere",
    ),
    "another state": (
        lambda a: [*a[:3], Belief(mean=np.zeros(5), covariance=np.eye(5)), *a[4:]],
        ValueError,
        "kernel run_filter: N is 5 in Belief, 4 elsewhere",
    ),
    "wider measurements": (
        lambda a: [*a[:5], Innovations.empty(J=100, M=2)],
        ValueError,
        "kernel run_filter: M is 2 in Innovations, 1 elsewhere",
    ),
}


@pytest.mark.parametrize("jit", ["1", "0"])
@pytest.mark.parametrize("name", CALLS)
def test_kernels_refuse_calls_that_do_not_fit(name, jit, case, monkeypatch):
    monkeypatch.setenv("PIAZZI_JIT", jit)
    change, kind, message = CALLS[name]
    with pytest.raises(kind, match=message):
        kernels.load(case[2]).run_filter(*change(arguments(case)))


def test_also_after_a_call_that_did(case):
    """What was checked once is remembered by what stood in each place."""
    entry = kernels.load(case[2]).run_filter
    good = arguments(case)
    entry(*good)
    entry(*good)
    with pytest.raises(ValueError, match="K is 99 in Beliefs"):
        entry(*good[:4], Beliefs.empty(K=99, N=4), good[5])
    problem, n = case[0], case[0].model.n
    entry = kernels.load(problem.spec("transition", "rates")).evaluate_dynamics
    good = [2, np.zeros(2), np.ones((2, n)), problem.given_bundle, np.empty((2, n))]
    entry(*good)
    with pytest.raises(TypeError, match="argument 3 of kernel evaluate_dynamics must be a Given, not ndarray"):
        entry(*good[:3], good[4], good[3])
    with pytest.raises(TypeError, match=r"argument 0 of kernel evaluate_dynamics \(K: int K\) must be one whole number"):
        entry(good[1], good[0], *good[2:])


def test_what_a_model_is_told_has_its_size(case):
    problem = case[0]
    entry = kernels.load(problem.spec("transition", "rates")).evaluate_dynamics
    x = np.ones((1, problem.model.n))
    with pytest.raises(ValueError, match="kernel evaluate_dynamics: P is 7 in Given"):
        entry(1, np.zeros(1), x, Given(parameters=np.zeros(7), manoeuvres=np.zeros(1), data=np.zeros(1)), np.empty_like(x))


def test_what_is_remembered_does_not_grow():
    for K in range(MOST_KINDS + 10):
        Beliefs.empty(K=K, N=1)
        Belief(mean=np.zeros(K % 600), covariance=np.empty((K % 600, K % 600)))
    for kind in (Belief, Beliefs):
        assert max(len(kind._known), len(kind._plans), len(kind._kinds)) <= MOST_KINDS


def test_a_fragment_is_lent_for_a_block():
    """Another text under the same name is another kernel; none may stand in the place of one that there is."""
    problem, _ = pz.load("b612-range")
    text = "from piazzi.kernels.vocabulary import *\n\n@entry\ndef run_once(out: Array) -> None:\n    out[0] = {}\n"
    for value in ("1.0", "2.0"):
        out = np.zeros(1)
        with pytest.MonkeyPatch.context() as patch, kernels.fragment("tried", text.format(value)):
            patch.setenv("PIAZZI_JIT", "0")
            kernels.load(problem.spec("transition", "tried")).run_once(out)
        assert out == float(value)
    with pytest.raises(ValueError, match="there is a kernel fragment 'filter' already"), kernels.fragment("filter", text):
        pass


def test_a_bundle_within_an_entry_is_none_of_its_arguments():
    text = "@entry\ndef go(nu: Array, k: int) -> None:\n    own = Row(nu, scratch(MN), scratch(WORK))\n    own.nu[k] = 1.0\n"
    assert signatures(opened(text)) == {"go": ("floats", "integer")}
    with pytest.raises(ValueError, match="kernel entry 'go' does not say what 'k' is"):
        opened("@entry\ndef go(k):\n    pass\n")


def test_arrays_by_themselves_are_checked_at_every_call(case):
    problem, n = case[0], case[0].model.n
    entry = kernels.load(problem.spec("transition", "rates")).evaluate_dynamics
    x, out, t = np.ones((2, n)), np.empty((2, n)), np.zeros(2)
    entry(2, t, x, problem.given_bundle, out)
    with pytest.raises(
        TypeError, match=r"argument 1 of kernel evaluate_dynamics \(t: K\) must be contiguous float64, not int64"
    ):
        entry(2, np.arange(2), x, problem.given_bundle, out)
    with pytest.raises(TypeError, match=r"argument 0 of kernel evaluate_dynamics \(K: int K\) must be one whole number"):
        entry(2.0, t, x, problem.given_bundle, out)


LOOSE = {
    "more states than times": (
        lambda a: [3, *a[1:]],
        r"argument 1 of kernel evaluate_dynamics \(t: K\) has shape \(2,\), but K is 3",
    ),
    "too few times": (lambda a: [a[0], a[1][:1], *a[2:]], r"\(t: K\) has shape \(1,\), but K is 2 elsewhere"),
    "another state": (lambda a: [*a[:2], np.ones((2, 3)), *a[3:]], r"\(x: K N\) has shape \(2, 3\), but N is 4 elsewhere"),
    "a transpose": (lambda a: [*a[:4], np.empty((4, 2))], r"\(out: K N\) has shape \(4, 2\), but K is 2 elsewhere"),
    "flat": (lambda a: [*a[:4], np.empty(8)], r"\(out: K N\) has shape \(8,\); it must have 2 axes"),
}


@pytest.mark.parametrize("jit", ["1", "0"])
@pytest.mark.parametrize("name", LOOSE)
def test_arrays_by_themselves_have_the_size_that_the_entry_says(name, jit, case, monkeypatch):
    """Also after a call that did: what was checked once is remembered by the shapes."""
    monkeypatch.setenv("PIAZZI_JIT", jit)
    problem, n = case[0], case[0].model.n
    entry = kernels.load(problem.spec("transition", "rates")).evaluate_dynamics
    good = [2, np.zeros(2), np.ones((2, n)), problem.given_bundle, np.empty((2, n))]
    entry(*good)
    change, message = LOOSE[name]
    with pytest.raises((TypeError, ValueError), match=message):
        entry(*change(good))


def test_sizes_are_said_beside_the_entry():
    sizes = 'K="K", t="D+1", count="D+1", work="7"'
    text = f"@entry\n@sizes({sizes})\ndef go(K: int, t: Array, count: Indices, work: Array, w: Array):\n    pass\n"
    takes = signatures(opened(text))["go"]
    assert takes == ("K: int K", "t: D+1", "count: int64 D+1", "work: 7", "floats")
    assert flat(takes) == ["integer", "floats", "indices", "floats", "floats"]
    entry = PlainEntry("go", lambda *_: None, takes, {})
    good = [3, np.zeros(3), np.zeros(3, dtype=np.int64), np.zeros(7), np.zeros((5, 5))]
    entry(*good)
    with pytest.raises(ValueError, match=r"argument 3 of kernel go \(work: 7\) has shape \(6,\), with 6 in place of 7"):
        entry(*good[:3], np.zeros(6), good[4])
    with pytest.raises(
        ValueError, match=r"argument 2 of kernel go \(count: int64 D\+1\) has shape \(2,\), but D is 2 elsewhere"
    ):
        entry(*good[:2], good[2][:2], *good[3:])
    with pytest.raises(ValueError, match="kernel entry 'go' has no argument 'y' to be of size 'K'"):
        signatures(text.replace("(K=", "(y="))


def test_every_array_that_an_entry_of_the_package_takes_has_a_size():
    for path in FRAGMENTS:
        for name, takes in signatures(opened(path.read_text())).items():
            assert not {"floats", "indices"} & set(takes), f"{path.stem}: {name} takes an array of any size"


def test_members_are_seen_by_name_and_shared():
    t = np.arange(3.0)
    made = run(t=t)
    assert made.t is t
    assert made.epochs == 3
    with pytest.raises(AttributeError, match="no attribute 'R'"):
        made.R  # noqa: B018
    assert_array_equal(pickle.loads(pickle.dumps(made)).t, t)


def test_new_arrays_fit():
    gate = Measured.empty(J=5, M=2, S=3, U=4)
    assert {name: getattr(gate, name).shape for name in Measured.slots} == {
        "z": (5, 2),
        "station": (5,),
        "sensor": (3,),
        "numbers": (3, 4),
        "R": (3, 2, 2),
        "correlated": (3,),
    }
    assert gate.station.dtype == np.int64


def test_entries_are_opened_into_pointers():
    text = "@entry\ndef go(run: Run, w: Array, gate: Gate, k: int) -> None:\n    w[0] = run.t[k] * gate.limits[0]\n"
    source = opened(text)
    ast.parse(source)
    names = [f"run_{name}" for name in Run.slots] + ["w"] + [f"gate_{name}" for name in Gate.slots] + ["k"]
    assert [a.arg for a in ast.parse(source).body[0].args.args] == names
    assert signatures(source) == {"go": ("Run", "floats", "Gate", "integer")}
    assert flat(signatures(source)["go"]) == [
        *("integer", "real", "floats", "indices", "floats", "indices", "floats"),
        "floats",
        *("integer", "floats", "indices", "indices"),
        "integer",
    ]
    assert definitions(source).splitlines() == [
        f"Run = namedtuple('Run', {list(Run.slots)!r})",
        f"Gate = namedtuple('Gate', {list(Gate.slots)!r})",
    ]


def test_no_function_of_a_kernel_has_many_arguments():
    for path in FRAGMENTS:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                assert node.args.vararg is None, f"{path.stem}: {node.name} takes *{node.args.vararg.arg}"
                assert len(node.args.args) <= MOST_ARGUMENTS, f"{path.stem}: {node.name}"


def test_bundles_say_what_they_are():
    assert all(bundle.__doc__ and bundle.slots for bundle in BUNDLES.values())
