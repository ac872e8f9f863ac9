"""Compiled object code -> functions that Python calls.  Needs llvmlite only: no Numba, no unpickling, no linker."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

POINTER, INTEGER, REAL = "pointer", "integer", "real"
_C_TYPES = {POINTER: ctypes.c_void_p, INTEGER: ctypes.c_int64, REAL: ctypes.c_double}
# Numba's wrapper mentions these for its error path, which kernels never take: they raise nothing
_NEVER_CALLED = (
    "NRT_Free",
    "NRT_MemInfo_call_dtor",
    "numba_do_raise",
    "numba_gil_ensure",
    "numba_gil_release",
    "numba_runtime_build_excinfo_struct",
    "numba_unpickle",
)


class Entry:
    """A compiled function.  Arrays are passed by address: they must be contiguous float64 or int64, which is checked."""

    def __init__(self, address: int, kinds: tuple[str, ...], keep: Any) -> None:
        self._call = ctypes.CFUNCTYPE(None, *(_C_TYPES[k] for k in kinds))(address)
        self._keep = keep  # the code lives as long as something can call it

    def __call__(self, *args: Any) -> None:
        self._call(*_addresses(args))

    def after(self, first: Ready, *args: Any) -> None:
        """The call with arguments that are ready before the others."""
        self._call(*first.values, *_addresses(args))

    def bind(self, *args: Any) -> Callable[[], None]:
        """The call with these arguments, for repeating: arrays are looked up once, and read and written where they are."""
        ready = _addresses(args)

        def again(call: Any = self._call, keep: Any = (args, self._keep)) -> None:
            call(*ready)

        return again


class Ready(NamedTuple):
    """Arguments whose arrays have been looked up: their values for a call, and the arguments themselves, which must live on."""

    values: tuple[Any, ...]
    arguments: tuple[Any, ...]


def ready(*args: Any) -> Ready:
    """Arguments that are the same in many calls; raises TypeError where a kernel cannot take one."""
    return Ready(tuple(_addresses(args)), args)


_ARRAY, _FLOAT, _INDEX = np.ndarray, np.dtype(np.float64), np.dtype(np.int64)
_HEADER: int = object.__basicsize__
_read = ctypes.c_void_p.from_address


def _field_after_header(a: np.ndarray[Any, Any]) -> int | None:
    return _read(id(a) + _HEADER).value


def _attribute(a: np.ndarray[Any, Any]) -> int | None:
    return a.ctypes.data


# NumPy's C interface fixes the address of the numbers as the first field after an array's header; reading it there takes a
# sixth of the time of the attribute, which is for interpreters that lay objects out otherwise
_probe = np.zeros(1)
_data_pointer = _field_after_header if _field_after_header(_probe) == _attribute(_probe) else _attribute


def _addresses(args: tuple[Any, ...]) -> list[Any]:
    """The arguments with arrays replaced by the addresses of their numbers; one loop, because it runs at every call."""
    out = []
    for a in args:
        if type(a) is _ARRAY or isinstance(a, _ARRAY):
            kind = a.dtype
            if not a.flags.c_contiguous or (kind is not _FLOAT and kind is not _INDEX and kind not in (_FLOAT, _INDEX)):
                raise TypeError(f"a kernel needs contiguous float64 or int64, not {kind} with strides {a.strides}")
            out.append(_data_pointer(a))
        else:
            out.append(a)
    return out


class PlainEntry:
    """The same function uncompiled: arrays are seen as flat ones."""

    def __init__(self, function: Callable[..., None]) -> None:
        self._function = function

    def __call__(self, *args: Any) -> None:
        with np.errstate(all="ignore"):
            self._function(*[a.reshape(-1) if isinstance(a, np.ndarray) else a for a in args])

    def after(self, first: Ready, *args: Any) -> None:
        """The call with arguments that are ready before the others."""
        self(*first.arguments, *args)

    def bind(self, *args: Any) -> Callable[[], None]:
        """The call with these arguments, for repeating."""
        return lambda: self(*args)


def _keep_freed_memory() -> None:
    """Let what a run frees stay with the process, up to 32 MiB, for the next run.

    Pages that the system hands out cost a fault each at their first touch: up to a fifth of a filter over a thousand epochs.
    The GNU C library keeps twice the largest block that was ever mapped and freed (mallopt(3), M_TRIM_THRESHOLD), so one such
    block, never touched, does it; other C libraries do as they do.
    """
    np.empty(1 << 24, dtype=np.uint8)


@cache
def _prepare() -> None:
    """Make this process ready for compiled code and its results, once."""
    import llvmlite.binding as llvm

    _keep_freed_memory()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    anywhere = ctypes.cast(ctypes.pythonapi.Py_IsInitialized, ctypes.c_void_p).value
    for name in _NEVER_CALLED:
        if llvm.address_of_symbol(name) is None:
            llvm.add_symbol(name, anywhere)


def machine_options() -> dict[str, Any]:
    """Options of the machine that code is loaded for: those that Numba compiles it with.

    On x86 both sides have the same by default; elsewhere, code model and relocations decide how far the code may lie from what
    it calls.
    """
    import llvmlite.binding as llvm

    family = llvm.Target.from_default_triple().name
    reloc = "static" if family.startswith("x86") else "pic" if family.startswith("ppc") else "default"
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return {"cpu": cpu, "features": features, "opt": 3, "reloc": reloc, "codemodel": "jitdefault", "jit": True}


def load_objects(objects: Mapping[str, bytes], symbols: Mapping[str, tuple[str, tuple[str, ...]]]) -> dict[str, Entry]:
    """Entries by name from object files and, for each, its symbol and the kinds of its arguments."""
    import llvmlite.binding as llvm

    _prepare()
    entries, options = {}, machine_options()
    for name, code in objects.items():
        target = llvm.Target.from_triple(llvm.get_process_triple())
        machine = target.create_target_machine(**options)  # the engine's own: it is freed with it
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        symbol, kinds = symbols[name]
        entries[name] = Entry(engine.get_function_address(symbol), kinds, engine)
    return entries
