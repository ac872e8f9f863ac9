"""Compiled object code -> functions that Python calls.  Needs llvmlite only: no Numba, no unpickling, no linker."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from piazzi.kernels.address import address
from piazzi.kernels.entries import flat, slot_of
from piazzi.kernels.members import (
    BUNDLES,
    FLOATS,
    INDICES,
    INTEGER,
    MOST_KINDS,
    REAL,
    TYPES,
    Bundle,
    check_array,
    checked,
)

_C_TYPES = {FLOATS: ctypes.c_void_p, INDICES: ctypes.c_void_p, INTEGER: ctypes.c_int64, REAL: ctypes.c_double}
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


class _Callable:
    """A function of bundles, arrays and numbers, which are checked: how many, of what kind, and all sizes.

    That is done once for every kind of problem; the type of an array by itself, which has no kind, in every call.
    """

    def __init__(self, name: str, signature: tuple[str, ...], sizes: Mapping[str, int]) -> None:
        self.name, self.signature = name, signature
        self._sizes = dict(sizes)
        self._slots = [None if argument in BUNDLES else slot_of(argument) for argument in signature]

    def _check(self, args: tuple[Any, ...]) -> None:
        if len(args) != len(self.signature):
            raise TypeError(f"kernel {self.name} takes {len(self.signature)} arguments, not {len(args)}")
        known = dict(self._sizes)
        for i, (a, kind) in enumerate(zip(args, self.signature, strict=True)):
            if kind not in BUNDLES:
                continue
            if type(a).__name__ != kind:
                raise TypeError(f"{self._argument(i)} must be a {kind}, not {type(a).__name__}")
            for name, size in a.kind.sizes.items():
                if known.setdefault(name, size) != size:
                    raise ValueError(f"kernel {self.name}: {name} is {size} in {kind}, {known[name]} elsewhere")
        for i, (a, slot) in enumerate(zip(args, self._slots, strict=True)):
            if slot is not None:
                checked(self._argument(i), slot, a, known)

    def _argument(self, i: int) -> str:
        """How a message calls an argument: its place, and its sizes where it has some."""
        _, sized, _ = self.signature[i].partition(": ")
        return f"argument {i} of kernel {self.name}" + (f" ({self.signature[i]})" if sized else "")


class Entry(_Callable):
    """A compiled function."""

    def __init__(self, name: str, address: int, signature: tuple[str, ...], sizes: Mapping[str, int], keep: Any) -> None:
        super().__init__(name, signature, sizes)
        self._seen = set[tuple[Any, ...]]()  # what has been checked: kinds of bundles, shapes, whole numbers
        self._loose = [(i, TYPES[slot.kind]) for i, slot in enumerate(self._slots) if slot and slot.kind in TYPES]
        self.address = address
        self._call = ctypes.CFUNCTYPE(None, *(_C_TYPES[k] for k in flat(signature)))(address)
        self._keep = keep  # the code lives as long as something can call it

    def __call__(self, *args: Any) -> None:
        try:
            self._call(*self._values(args))
        except ctypes.ArgumentError:
            self._check(args)
            raise

    def bind(self, *args: Any) -> Callable[[], None]:
        """The call with these arguments, for repeating: arrays are looked up once, and read and written where they are."""
        ready = self._values(args)

        def again(call: Any = self._call, keep: Any = (args, self._keep)) -> None:
            call(*ready)

        return again

    def _values(self, args: tuple[Any, ...]) -> list[Any]:
        """The arguments as object code takes them; one loop, because it runs at every call."""
        out: list[Any] = []
        kinds: list[Any] = []
        for a in args:
            if isinstance(a, Bundle):
                out += a.values
                kinds.append(a.kind)
            elif isinstance(a, np.ndarray):
                out.append(address(a))
                kinds.append(a.shape)
            else:
                out.append(a)
                kinds.append(a if type(a) is int else type(a))
        seen = tuple(kinds)
        if seen not in self._seen:
            self._check(args)
            if len(self._seen) >= MOST_KINDS:
                self._seen.clear()
            self._seen.add(seen)
        for i, wanted in self._loose:
            if args[i].dtype is not wanted or not args[i].flags.c_contiguous:
                check_array(self._argument(i), wanted, args[i])
        return out


class PlainEntry(_Callable):
    """The same function uncompiled: arrays are seen as flat ones."""

    def __init__(self, name: str, function: Callable[..., None], signature: tuple[str, ...], sizes: Mapping[str, int]) -> None:
        super().__init__(name, signature, sizes)
        self._function = function

    def __call__(self, *args: Any) -> None:
        self._check(args)
        members = [m for a in args for m in (a.members if isinstance(a, Bundle) else (a,))]
        with np.errstate(all="ignore"):
            self._function(*[m.reshape(-1) if isinstance(m, np.ndarray) else m for m in members])

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


def say_where(symbol: str, address: int) -> None:
    """Tell code that is loaded from now on where a function is that it calls."""
    import llvmlite.binding as llvm

    _prepare()
    llvm.add_symbol(symbol, address)


def load_objects(
    objects: Mapping[str, bytes], symbols: Mapping[str, tuple[str, tuple[str, ...]]], sizes: Mapping[str, int]
) -> dict[str, Entry]:
    """Entries by name from object files and, for each, its symbol and what it takes; `sizes` are those of the model."""
    import llvmlite.binding as llvm

    _prepare()
    entries, options = {}, machine_options()
    for name, code in objects.items():
        target = llvm.Target.from_triple(llvm.get_process_triple())
        machine = target.create_target_machine(**options)  # the engine's own: it is freed with it
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        engine.finalize_object()
        symbol, signature = symbols[name]
        entries[name] = Entry(name, engine.get_function_address(symbol), signature, sizes, engine)
    return entries
