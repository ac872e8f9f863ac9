"""What the parts of a kernel define and need is checked before it is compiled, and a source that fails is kept."""

import ast
import tempfile
import traceback

import pytest

import piazzi as pz
from piazzi.kernels import KernelSpec
from piazzi.kernels.build import compile_entries
from piazzi.kernels.names import check_names, needed, provided

MODEL = pz.Model(["x", "v"], ["v", "-x"], [pz.Sensor("range", "x")])


def source_of(*fragments: str) -> str:
    return KernelSpec(MODEL, pz.RungeKutta4().scheme, fragments).source("plain")


def test_parts_that_fit_together_are_a_kernel():
    assert "def evaluate_step(" in source_of("matrices", "arc_steps", "transition", "functions")


def test_a_name_that_nothing_defines_is_told_with_the_fragment_that_has_it():
    with pytest.raises(
        ValueError, match=r"fragment 'functions': '\w+' needs '\w+', which no part .*; it is in .*transition"
    ) as caught:
        source_of("matrices", "functions")
    assert "\n" not in str(caught.value)


def test_two_definitions_of_a_function_are_refused():
    with pytest.raises(ValueError, match=r"function '\w+' is defined in 'linearize_each' and in 'linearize_scaled'"):
        source_of("matrices", "arc_steps", "transition", "linearize_each", "linearize_scaled")
    with pytest.raises(ValueError, match="function 'f' is defined twice in 'a'"):
        check_names({"a": "def f(x):\n    return x\n\ndef f(x):\n    return x\n"})


def test_names_of_a_function_of_its_own_are_no_needs():
    tree = ast.parse("N = 3\ndef f(x, y):\n    z = x\n    for i in range(N):\n        z += g(i, y)\n    return z\n")
    assert provided(tree) == ["N", "f"]
    assert needed(tree.body[1]) == {"N", "g", "range"}


def test_what_no_entry_calls_may_lack_what_it_needs():
    check_names({"a": "@entry\ndef run(x):\n    g(x)\n\ndef g(x):\n    pass\n\ndef idle(x):\n    return nothing(x)\n"})
    with pytest.raises(ValueError, match="fragment 'a': 'g' needs 'nothing'"):
        check_names({"a": "@entry\ndef run(x):\n    g(x)\n\ndef g(x):\n    return nothing(x)\n"})


def test_the_source_of_a_build_that_failed_is_kept_and_named(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    text = "from piazzi.kernels.compiled import *\n\n\n@entry\ndef run(x: Array):\n    x[0] = nothing_of_this_name\n"
    with pytest.raises(Exception, match="nothing_of_this_name") as caught:
        compile_entries(text)
    (kept,) = tmp_path.glob("failed-*.py")
    assert kept.read_text() == text
    assert str(kept) in "".join(traceback.format_exception(caught.value))
