"""Compiling leaves the process as it was, and leaves out only passes that Numba has."""

import gc

import pytest

from piazzi.kernels import build
from piazzi.kernels.settings import own_settings

DOUBLED = "from piazzi.kernels.compiled import *\n\n\n@entry\ndef run(x: Array):\n    x[0] = 2.0 * x[0]\n"


def test_operators_are_resolved_once_for_their_types(monkeypatch):
    """Numba looks through all it knows of an operator at each place; behind a build it does so again."""
    from numba.core import types

    resolve, seen = types.Function.get_call_type, []

    def counted(function, context, args, kws):
        seen.append((id(function), args))
        return resolve(function, context, args, kws)

    monkeypatch.setattr(types.Function, "get_call_type", counted)
    build.compile_entries(DOUBLED.replace("2.0 * x[0]", "2.0 * x[0] + 3.0 * x[1] + 4.0 * x[2]"))
    assert len(seen) == len(set(seen)) > 1
    assert types.Function.get_call_type is counted


@pytest.mark.parametrize("enabled", [True, False])
@pytest.mark.parametrize("source", [DOUBLED, "raise OSError"])
def test_no_garbage_is_looked_for_while_kernels_are_compiled(enabled, source, monkeypatch):
    seen = []
    original = build.fill
    monkeypatch.setattr(build, "fill", lambda *given: (seen.append(gc.isenabled()), original(*given))[1])
    was = gc.isenabled()
    (gc.enable if enabled else gc.disable)()
    try:
        if source == DOUBLED:
            build.compile_entries(source)
        else:
            with pytest.raises(OSError):
                build.compile_entries(source)
        assert seen == [False]
        assert gc.isenabled() == enabled
    finally:
        (gc.enable if was else gc.disable)()


def test_passes_that_are_left_out_are_among_numbas():
    with own_settings():
        from numba.core.compiler import DefaultPassBuilder, Flags, StateDict

        from piazzi.kernels import compiler

        state = StateDict()
        state.flags, state.func_ir = Flags(), None
        names = {one.name() for one, _ in DefaultPassBuilder.define_nopython_pipeline(state).passes}
    assert names >= {*compiler._NOTHING_TO_DO}
