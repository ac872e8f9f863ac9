"""What a bundle of arrays is: members with their sizes, checked when it is made (`bundle` has the bundles there are)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from piazzi.kernels.address import address

FLOATS, INDICES, INTEGER, REAL = "floats", "indices", "integer", "real"
TYPES = {FLOATS: np.dtype(np.float64), INDICES: np.dtype(np.int64)}
MOST_KINDS = 1000
BUNDLES: dict[str, type[Bundle]] = {}


class Slot(NamedTuple):
    """A member: what it is, and its size along each axis, as a name and what is added to it; None where it is one number."""

    kind: str
    shape: tuple[tuple[str, int], ...] | None

    @classmethod
    def of(cls, text: str) -> Slot:
        """The member that a declaration describes."""
        if text in ("int", "float"):
            return cls({"int": INTEGER, "float": REAL}[text], None)
        kind, sizes = (INDICES, text[6:]) if text.startswith("int64 ") else (FLOATS, text)
        parts = [size.partition("+") for size in sizes.split()]
        return cls(kind, tuple((name, int(more or 0)) for name, _, more in parts))


class Kind:
    """A class of bundles with its sizes; there is one of each, so that it is known again by identity."""

    __slots__ = ("bundle", "sizes")

    def __init__(self, bundle: type[Bundle], sizes: Mapping[str, int]) -> None:
        self.bundle, self.sizes = bundle, {name: size for name, size in sizes.items() if name != "*"}


class Bundle:
    """Members that have been checked and whose addresses have been looked up; a subclass declares them.

    Attributes
    ----------
    members : arrays and numbers, in the order of the declaration
    values : the same as object code takes them
    kind : what a kernel has to have seen once
    """

    slots: ClassVar[Mapping[str, Slot]] = {}
    _types: ClassVar[tuple[Any, ...]]
    _kinds: ClassVar[dict[Any, Kind]]
    _plans: ClassVar[dict[Any, tuple[list[tuple[Any, Any]], Kind]]]
    __slots__ = ("kind", "members", "values")

    def __init_subclass__(cls, **slots: str) -> None:
        cls.slots = {name: Slot.of(text) for name, text in slots.items()}
        cls._types = tuple(None if slot.shape is None else TYPES[slot.kind] for slot in cls.slots.values())
        cls._kinds, cls._plans = {}, {}
        for i, name in enumerate(slots):
            setattr(cls, name, property(_member(i)))
        BUNDLES[cls.__name__] = cls

    def __init__(self, *positional: Any, **members: Any) -> None:
        """A bundle of these members.

        Raises
        ------
        TypeError
            For members that are missing or not declared, of another type or number of axes, or not contiguous.
        ValueError
            For arrays whose sizes contradict each other.
        """
        if positional or members.keys() != self.slots.keys():
            wanted, given = set(self.slots), set(members)
            lacking, foreign = ", ".join(sorted(wanted - given)), ", ".join(sorted(given - wanted))
            name = type(self).__name__
            raise TypeError(f"{name} is made by names; missing: {lacking or 'none'}; unknown: {foreign or 'none'}")
        found: list[Any] = [members[name] for name in self.slots]
        shapes = []
        for value, wanted_type in zip(found, self._types, strict=True):
            if wanted_type is None:
                shapes.append(type(value))
            elif type(value) is np.ndarray and value.dtype is wanted_type and value.flags.c_contiguous:
                shapes.append(value.shape)
        kind = self._kinds.get(tuple(shapes)) if len(shapes) == len(found) else None
        self._keep(found, self._judged(members, tuple(shapes)) if kind is None else kind)

    def _judged(self, members: Mapping[str, Any], shapes: tuple[Any, ...]) -> Kind:
        """The kind of a bundle of these members, which is remembered by their shapes."""
        sizes: dict[str, int] = {}
        for member, slot in self.slots.items():
            checked(f"{type(self).__name__}.{member}", slot, members[member], sizes)
        kind = self._of(sizes)
        if len(shapes) == len(self.slots) and len(self._kinds) < MOST_KINDS:
            self._kinds[shapes] = kind
        return kind

    @classmethod
    def _of(cls, sizes: Mapping[str, int]) -> Kind:
        key = frozenset(sizes.items())
        found = cls._kinds.get(key)
        if found is None:
            found = cls._kinds[key] = Kind(cls, sizes)
        return found

    def _keep(self, members: list[Any], kind: Kind) -> None:
        self.members, self.kind = tuple(members), kind
        self.values = [m if t is None else address(m) for m, t in zip(members, self._types, strict=True)]

    @classmethod
    def empty(cls, **sizes: int) -> Any:
        """A bundle of new arrays, their numbers whatever they are; of any size is one number long."""
        plan = cls._plans.get(tuple(sizes.items()))
        if plan is None:
            known = {"*": 1, **sizes}
            shapes = [tuple([known[name] + more for name, more in slot.shape or ()]) for slot in cls.slots.values()]
            plan = [*zip(shapes, cls._types, strict=True)], cls._of(sizes)
            if len(cls._plans) < MOST_KINDS:
                cls._plans[tuple(sizes.items())] = plan
        out: Bundle = cls.__new__(cls)
        out.members = tuple([np.empty(shape, of) for shape, of in plan[0]])
        out.values, out.kind = [*map(address, out.members)], plan[1]
        return out

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """A member."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (type(self), dict(zip(self.slots, self.members, strict=True)))


def _member(i: int) -> Callable[[Bundle], Any]:
    return lambda bundle: bundle.members[i]


def _remade(kind: type[Bundle], members: dict[str, Any]) -> Bundle:
    """Addresses mean nothing in another process."""
    return kind(**members)


def checked(what: str, slot: Slot, value: Any, sizes: dict[str, int]) -> None:
    """Raise TypeError or ValueError unless a value fits a slot; `sizes` are known so far, and learn from it."""
    if slot.shape is None:
        if (slot.kind == INTEGER and not isinstance(value, (int, np.integer))) or isinstance(value, np.ndarray):
            raise TypeError(f"{what} must be one {'whole ' if slot.kind == INTEGER else ''}number, not {value!r}")
        return
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{what} must be an array, not {type(value).__name__}")
    check_array(what, slot.kind, value)
    if value.ndim != len(slot.shape):
        raise TypeError(f"{what} has shape {value.shape}; it must have {len(slot.shape)} axes")
    for (name, more), size in zip(slot.shape, value.shape, strict=True):
        if name != "*" and sizes.setdefault(name, size - more) != size - more:
            raise ValueError(f"{what} has shape {value.shape}, but {name} is {sizes[name]} elsewhere")


def check_array(what: str, kind: str, value: np.ndarray[Any, Any]) -> None:
    """Raise TypeError unless a kernel can take the array."""
    if value.dtype != TYPES[kind] or not value.flags.c_contiguous:
        raise TypeError(f"{what} must be contiguous {TYPES[kind]}, not {value.dtype} with strides {value.strides}")
