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
    """A member: what it is; its size along each axis, as a name and what is added to it, None of a number or where unknown.

    A whole number may have to be `equal` to a size.  A number in place of a name is that long.
    """

    kind: str
    shape: tuple[tuple[str, int], ...] | None
    equal: str = ""

    @classmethod
    def of(cls, text: str) -> Slot:
        """The member that a declaration describes."""
        kind, _, rest = text.partition(" ")
        if kind in ("int", "float"):
            return cls({"int": INTEGER, "float": REAL}[kind], None, rest)
        kind, sizes = (INDICES, rest) if kind == "int64" else (FLOATS, text)
        return cls(kind, tuple(map(_axis, sizes.split())))


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

    members: tuple[Any, ...]
    values: list[Any]
    kind: Kind

    slots: ClassVar[Mapping[str, Slot]] = {}
    _types: ClassVar[tuple[Any, ...]]
    _kinds: ClassVar[dict[Any, Kind]]  # by shapes
    _known: ClassVar[dict[frozenset[tuple[str, int]], Kind]]  # by sizes
    _plans: ClassVar[dict[Any, tuple[list[tuple[Any, Any]], Kind]]]

    def __init_subclass__(cls, **slots: str) -> None:
        cls.slots = {name: Slot.of(text) for name, text in slots.items()}
        cls._types = tuple(slot.equal if slot.shape is None else TYPES[slot.kind] for slot in cls.slots.values())
        cls._kinds, cls._known, cls._plans = {}, {}, {}
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
        try:
            found: list[Any] = [members[name] for name in self.slots]
        except KeyError:
            found = []
        if positional or len(members) != len(found):
            wanted, given = set(self.slots), set(members)
            lacking, foreign = ", ".join(sorted(wanted - given)), ", ".join(sorted(given - wanted))
            name = type(self).__name__
            raise TypeError(f"{name} is made by names; missing: {lacking or 'none'}; unknown: {foreign or 'none'}")
        shapes: list[Any] = []
        values: list[Any] = []
        for value, wanted_type in zip(found, self._types, strict=True):  # one loop, because it runs in most calls
            if type(wanted_type) is str:
                shapes.append(value if wanted_type else type(value))
                values.append(value)
            elif type(value) is np.ndarray and value.dtype is wanted_type and value.flags.c_contiguous:
                shapes.append(value.shape)
                values.append(address(value))
        try:
            kind = self._kinds.get(tuple(shapes)) if len(shapes) == len(found) else None
        except TypeError:  # an array where a number should be
            kind = None
        if kind is None:
            kind = self._check(members, tuple(shapes))
            values = [m if type(t) is str else address(m) for m, t in zip(found, self._types, strict=True)]
        self.members, self.values, self.kind = tuple(found), values, kind

    def _check(self, members: Mapping[str, Any], shapes: tuple[Any, ...]) -> Kind:
        """The kind of a bundle of these members, which is remembered by their shapes."""
        sizes: dict[str, int] = {}
        for member, slot in self.slots.items():
            checked(f"{type(self).__name__}.{member}", slot, members[member], sizes)
        kind = self._of(sizes)
        if len(shapes) == len(self.slots):
            remember(self._kinds, shapes, kind)
        return kind

    @classmethod
    def _of(cls, sizes: Mapping[str, int]) -> Kind:
        key = frozenset(sizes.items())
        found = cls._known.get(key)
        return remember(cls._known, key, Kind(cls, sizes)) if found is None else found

    @classmethod
    def empty(cls, **sizes: int) -> Any:
        """A bundle of new arrays, their numbers whatever they are; of any size is one number long."""
        plan = cls._plans.get(tuple(sizes.items()))
        if plan is None:
            known = {"*": 1, **sizes}
            shapes = [tuple([known[name] + more for name, more in slot.shape or ()]) for slot in cls.slots.values()]
            plan = remember(cls._plans, tuple(sizes.items()), ([*zip(shapes, cls._types, strict=True)], cls._of(sizes)))
        out: Bundle = cls.__new__(cls)
        out.members = tuple([np.empty(shape, of) for shape, of in plan[0]])
        out.values, out.kind = [*map(address, out.members)], plan[1]
        return out

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """A member."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (type(self), dict(zip(self.slots, self.members, strict=True)))


def remember(known: dict[Any, Any], key: Any, value: Any) -> Any:
    """Keep a value, in a dictionary that begins anew where it has become large."""
    if len(known) >= MOST_KINDS:
        known.clear()
    known[key] = value
    return value


def _member(i: int) -> Callable[[Bundle], Any]:
    return lambda bundle: bundle.members[i]


def _remade(kind: type[Bundle], members: dict[str, Any]) -> Bundle:
    """Addresses mean nothing in another process."""
    return kind(**members)


def checked(what: str, slot: Slot, value: Any, sizes: dict[str, int]) -> None:
    """Raise TypeError or ValueError unless a value fits a slot; `sizes` are known so far, and learn from it."""
    if slot.kind not in TYPES:
        whole = (int, np.integer)
        if not isinstance(value, whole if slot.kind == INTEGER else (*whole, float, np.floating)):
            raise TypeError(f"{what} must be one {'whole ' if slot.kind == INTEGER else ''}number, not {value!r}")
        if slot.equal:
            name, more = _axis(slot.equal)
            _learn(f"{what} is {value}", name, int(value) - more, sizes)
        return
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{what} must be an array, not {type(value).__name__}")
    check_array(what, TYPES[slot.kind], value)
    if slot.shape is None:
        return
    if value.ndim != len(slot.shape):
        raise TypeError(f"{what} has shape {value.shape}; it must have {len(slot.shape)} axes")
    for (name, more), size in zip(slot.shape, value.shape, strict=True):
        _learn(f"{what} has shape {value.shape}", name, size - more, sizes)


def _axis(text: str) -> tuple[str, int]:
    """The name of a size, and what is added to it."""
    name, _, more = text.partition("+")
    return name, int(more or 0)


def _learn(found: str, name: str, size: int, sizes: dict[str, int]) -> None:
    """Take in the size of an axis; raise ValueError where it was another before."""
    if name.isdigit():
        if size != int(name):
            raise ValueError(f"{found}, with {size} in place of {name}")
    elif name != "*" and sizes.setdefault(name, size) != size:
        raise ValueError(f"{found}, but {name} is {sizes[name]} elsewhere")


def check_array(what: str, wanted: np.dtype[Any], value: np.ndarray[Any, Any]) -> None:
    """Raise TypeError unless a kernel can take the array."""
    if value.dtype != wanted or not value.flags.c_contiguous:
        raise TypeError(f"{what} must be contiguous {wanted}, not {value.dtype} with strides {value.strides}")
