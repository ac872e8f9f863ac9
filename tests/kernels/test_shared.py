"""Functions that several generated modules have are made once, and none that differs anywhere below it."""

from types import ModuleType

import pytest

from piazzi.kernels.shared import MOST_SHARED, fill

SOURCE = """from piazzi.kernels.plain import *
N = 6
Given = namedtuple("Given", ["parameters"])


@inline
def double(x):
    return 2 * x


@inline
def size():
    return N


@inline
def both(x):
    return double(x) + later(x)


@inline
def later(x):
    return size() * x


@entry
def run(x: float) -> None:
    both(x)
"""


def module(source, shared):
    made = ModuleType("piazzi_generated")
    fill(made, source, shared)
    return made


def same(a, b):
    return {name for name in ("Given", "double", "size", "both", "later", "run") if getattr(a, name) is getattr(b, name)}


def test_the_same_functions_are_the_same_object_but_for_entries():
    shared = {}
    first, second = module(SOURCE, shared), module("\n\n" + SOURCE, shared)
    assert same(first, second) == {"Given", "double", "size", "both", "later"}


@pytest.mark.parametrize(
    ("old", "new", "kept"),
    [
        ("N = 6", "N = 7", {"Given", "double"}),
        ("N = 6", "N, M = 6, 7", set()),
        ("2 * x", "3 * x", {"Given", "size", "later"}),
        ("size() * x", "size() - x", {"Given", "double", "size"}),
        ('"parameters"', '"parameters", "data"', {"double", "size", "both", "later"}),
    ],
)
def test_what_reaches_a_difference_is_made_anew(old, new, kept):
    shared = {}
    first, second = module(SOURCE, shared), module(SOURCE.replace(old, new), shared)
    assert same(first, second) == kept
    fresh = module(SOURCE.replace(old, new), {})
    assert second.both(5.0) == fresh.both(5.0)
    assert first.both(5.0) == 40.0


def test_functions_that_call_each_other_are_told_apart():
    source = """def even(n):
    return n == 0 or odd(n - 1)


def odd(n):
    return n != 0 and even(n - 1)
"""
    shared = {}
    first, second = module(source, shared), module(source.replace("n != 0 and", "n != 0 and n < 9 and"), shared)
    assert first.even is not second.even
    assert first.odd is not second.odd
    assert (first.even(10), second.even(10)) == (True, False)


def test_so_many_are_remembered():
    shared = {}
    for i in range(MOST_SHARED // 5 + 10):
        module(SOURCE.replace("N = 6", f"N = {i}").replace("2 * x", f"{i} * x"), shared)
    assert 0 < len(shared) <= MOST_SHARED + 6
