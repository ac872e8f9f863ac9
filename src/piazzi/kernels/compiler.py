"""Numba told to make only what is kept: of a helper the intermediate code, for its callers; of an entry one object file.

By itself Numba optimises every helper and turns it into machine code that nothing ever calls, because all are inlined; that is
half of the time that a kernel takes to compile.  An entry's object code is not loaded here either: `library` does that.

Whatever Piazzi uses of Numba that is not public is named in this file, and in `settings`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import types
from numba.core.cgutils import alloca_once, alloca_once_value, for_range, get_or_insert_function
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global

try:
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
except ImportError:  # then `public_way` is the only one
    JITCodeLibrary = CompilerBase = DefaultPassBuilder = object  # type: ignore[assignment,misc]

__all__ = [
    "AbstractTemplate",
    "AttributeTemplate",
    "alloca_once",
    "alloca_once_value",
    "calls_resolved_once",
    "entry_options",
    "for_range",
    "get_or_insert_function",
    "helper_options",
    "infer_global",
    "object_code",
    "public_way",
]

LINE = 64  # bytes that a processor fetches at a time
# Passes for functions within functions and for expressions of whole arrays: kernels have neither, and looking takes a tenth
_NOTHING_TO_DO = ("inline_closure_likes", "nopython_rewrites")


class _Unloaded(JITCodeLibrary):
    """Intermediate code that is never handed to the execution engine."""

    def add_ir_module(self, ir_module: Any) -> None:
        """Take in code, whose functions begin their stack at a line.

        Registers are put aside there, and one that lies across two lines costs twice.  Left alone, LLVM keeps to the 16 bytes
        of the calling convention, and the same code takes up to 1.7 times as long in one process as in another.
        """
        for function in ir_module.functions:
            if not function.is_declaration:
                function.attributes.alignstack = LINE
                function.attributes.add("nounwind")  # llvmlite writes the other only beside one of this kind
        super().add_ir_module(ir_module)  # type: ignore[no-untyped-call]

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return 0


class _Intermediate(_Unloaded):
    """Code of a helper as it was written: it is optimised where it is used."""

    def _optimize_final_module(self) -> None:
        pass


class _Object(_Unloaded):
    """Code of an entry with everything that it uses."""

    def object_code(self) -> bytes:
        """The object file."""
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return bytes(self._codegen._tm.emit_object(self._final_module))


class _Pipeline(CompilerBase):
    """Numba's usual passes into a library of our own."""

    kind: type[_Unloaded] = _Unloaded

    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.library = self.kind(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        passes = DefaultPassBuilder.define_nopython_pipeline(state)
        passes.passes = [(one, why) for one, why in passes.passes if one.name() not in _NOTHING_TO_DO]
        return [passes]


class HelperPipeline(_Pipeline):
    """For functions that other compiled functions call."""

    kind = _Intermediate

    def _compile_core(self) -> Any:
        """What Numba does for a function with machine code: callers know it by the built-in that calls it, here by any one."""
        result = super()._compile_core()  # type: ignore[no-untyped-call]
        result = result._replace(entry_point=[].append)
        self.state.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
        return result


class EntryPipeline(_Pipeline):
    """For functions that Python calls."""

    kind = _Object


_publicly = False


@contextmanager
def public_way() -> Iterator[None]:
    """Numba's own way for as long as the block lasts: no object code, longer compilation, nothing that is not public."""
    global _publicly  # noqa: PLW0603
    _publicly = True
    _forget_marked()
    try:
        yield
    finally:
        _publicly = False
        _forget_marked()


def _forget_marked() -> None:
    """Import anew, when they are wanted, the modules whose functions are marked for a way of compiling as they are imported."""
    for package, name in (("piazzi.kernels", "compiled"), ("piazzi.kernels.lanes", "elementary")):
        sys.modules.pop(f"{package}.{name}", None)
        vars(sys.modules[package]).pop(name, None)


@contextmanager
def calls_resolved_once() -> Iterator[None]:
    """What operators and built-in functions give for types is looked up once while the block lasts, in one thread.

    Numba goes through all that it knows of one at each place where it is called, a tenth of the time that a kernel takes.
    """
    function_type: Any = types.Function
    resolve = function_type.get_call_type
    found: dict[Any, tuple[Any, Any]] = {}

    def once(function: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws:
            return resolve(function, context, args, kws)
        key = (id(function), id(context), args)
        if key not in found:
            found[key] = resolve(function, context, args, kws), function  # an id lasts with it
        return found[key][0]

    function_type.get_call_type = once
    try:
        yield
    finally:
        function_type.get_call_type = resolve


def helper_options() -> dict[str, Any]:
    """What a function is compiled with that others call."""
    pipeline = {} if _publicly else {"pipeline_class": HelperPipeline}
    return {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, **pipeline}


def entry_options() -> dict[str, Any]:
    """What a function is compiled with that Python calls."""
    return {} if _publicly else {"pipeline_class": EntryPipeline}


def object_code(callback: Any) -> bytes:
    """The object file of an entry."""
    code: bytes = callback._library.object_code()
    return code
