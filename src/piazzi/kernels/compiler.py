"""Numba told to make only what is kept: of a helper the intermediate code, for its callers; of an entry one object file.

By itself Numba optimises every helper and turns it into machine code that nothing ever calls, because all are inlined; that is
half of the time that a kernel takes to compile.  An entry's object code is not loaded here either: `library` does that.
"""

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder

LINE = 64  # bytes that a processor fetches at a time


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
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


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
