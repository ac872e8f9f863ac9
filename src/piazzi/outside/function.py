"""A function of the user's own: a fragment of Python that kernels compile, with its derivatives, and data if it has any."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.arrays import Array
from piazzi.model.functions import Signature
from piazzi.opening import opened
from piazzi.outside.evaluation import aligned, check_count, checksum, derivatives, numbers, plain_functions, value
from piazzi.outside.fragment import Fragment, read_fragment
from piazzi.text import brief

AGREED = 1e-5  # of a derivative
ROUNDING = 64 * 2.0**-52  # of a value: what rounding in a function may come to
LONG = 1e-3  # of an argument: shorter steps have too much rounding in them to tell what is zero


@dataclass(frozen=True, eq=False)
class Function:
    """A function of equations that is written as a fragment of Python: functions and literal constants, nothing else.

    The fragment has a function ``f(a, b, ...)`` and ``f_partials(a, b, ...)``, which returns the values of `f` and behind them
    the derivatives of the first output by each argument, then of the second, and so on.  Where there are data, both take
    ``data, at`` behind their arguments and read ``data[at]``, ``data[at + 1]`` and so on.  They may use arithmetic, ``if``,
    ``for`` over ``range``, the functions of the language (``sin``, ``exp``, ..., also as ``math.sin``) and one another, as
    long as each stands above its users.  A `Problem` checks them against differences when it is made.

    Parameters
    ----------
    fragment : text, or `Path` of a file
    arguments, outputs : how many numbers it takes and gives
    partials : pairs (output, argument), counted from 0, whose derivatives are returned; default all.  The others are zero.
    data : numbers that it reads; other data compile nothing
    span : the first and the last time that it has values for, if it takes the time; default any

    Raises
    ------
    ValueError
        With the line, for what has no place in a fragment, or another number of arguments or results.
    """

    fragment: Any
    arguments: int
    outputs: int = 1
    partials: Any = None
    data: Any = ()
    span: tuple[float, float] | None = None
    file: str = field(default="the fragment", init=False)

    if TYPE_CHECKING:  # what is taken; the fields above say what is kept of it

        def __init__(
            self,
            fragment: str | Path,
            arguments: int,
            outputs: int = 1,
            partials: Sequence[tuple[int, int]] | None = None,
            data: Any = (),
            span: tuple[float, float] | None = None,
        ) -> None: ...

    __repr__ = brief

    def __post_init__(self) -> None:
        put = object.__setattr__
        for what, least in (("arguments", 1), ("outputs", 1)):
            count = getattr(self, what)
            if isinstance(count, bool) or not isinstance(count, int) or not least <= count <= 100:
                raise ValueError(f"{what} of a function is {count!r}; it must be a whole number from {least} to 100")
        if isinstance(self.fragment, Path):
            with opened(self.fragment) as file:
                put(self, "file", self.fragment.name)
                put(self, "fragment", file.read().decode("utf-8", errors="replace"))
        elif not isinstance(self.fragment, str) or "\n" not in self.fragment:
            raise ValueError(f"fragment is {self.fragment!r}; it must be the text of functions, or Path(...) of a file")
        put(self, "partials", self._pairs())
        data = numbers(self.data, "data of a function").reshape(-1)
        if not np.isfinite(data).all():
            at = int(np.argmin(np.isfinite(data)))
            raise ValueError(f"data of a function must be finite; number {at} is {data[at]}")
        block = aligned(max(len(data), 1))
        block[: len(data)] = data
        block.flags.writeable = False
        put(self, "data", block)
        if self.span is not None:
            first, last = map(float, self.span)
            if not first <= last:
                raise ValueError(f"span of a function is {self.span}; it must be its first and last time")
            put(self, "span", (first, last))
        self.read  # noqa: B018  # refused now, where it cannot be read

    def _pairs(self) -> tuple[tuple[int, int], ...]:
        every = list(product(range(self.outputs), range(self.arguments)))
        if self.partials is None:
            return tuple(every)
        given = [tuple(pair) for pair in self.partials]
        for pair in given:
            if pair not in every:
                most = f"its outputs are 0 to {self.outputs - 1}, its arguments 0 to {self.arguments - 1}"
                raise ValueError(f"partials of a function have {pair}; {most}")
        return tuple(pair for pair in every if pair in given)

    def __getstate__(self) -> dict[str, Any]:
        """What it was made of."""
        names = ("fragment", "arguments", "outputs", "partials", "data", "span", "file")
        return {name: getattr(self, name) for name in names}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        state["data"].flags.writeable = False

    @cached_property
    def read(self) -> Fragment:
        """The fragment, checked."""
        return read_fragment(self.fragment, self.file, self.arguments, self.outputs, self.partials)

    @cached_property
    def signature(self) -> Signature:
        """The form of the function, with its source."""
        return Signature(self.read.kind, self.arguments, self.outputs, self.partials, code=self.read.source)

    @cached_property
    def checksum(self) -> str:
        """Hash of text and data."""
        return checksum("function", self.read.source, self.data)

    def block(self, first: float = 0.0, last: float = 0.0) -> Array:
        """The data as kernels read them, whatever the times."""
        return self.data  # type: ignore[no-any-return]

    def value(self, *arguments: float) -> tuple[float, ...]:
        """The outputs."""
        return value(self.signature, self.data, *arguments)

    def derivatives(self, *arguments: float) -> Array:
        """The derivatives of the outputs (rows) by the arguments."""
        return derivatives(self.signature, self.data, *arguments)

    def check(self, name: str, *arguments: float) -> None:
        """Raise ValueError where derivatives disagree with differences there, or values with those beside the derivatives."""
        check_count(self.signature, arguments)
        if arguments in self._agreed:
            return
        with np.errstate(all="ignore"):
            found = plain_functions(self.signature)[1](*map(np.float64, arguments), self.data, 0)[: self.outputs]
        place = ", ".join(f"{a} = {x:g}" for a, x in zip(self.read.arguments, arguments, strict=True))
        for i, (one, other) in enumerate(zip(self.value(*arguments), found, strict=True)):
            if not abs(one - other) <= 1e-9 * max(abs(one), abs(other)) and not (np.isnan(one) and np.isnan(other)):
                raise ValueError(
                    f"function {name!r} ({self.file}): output {i + 1} is {one:.9g} by {self.read.name} but {other:.9g} by "
                    f"{self.read.name}_partials at {place}"
                )
        for i, k, given, measured in self._disagreements(arguments):
            raise ValueError(
                f"function {name!r} ({self.file}): the derivative of output {i + 1} by {self.read.arguments[k]!r} is "
                f"{given:.9g}, but differences give {measured:.9g}, at {place}"
            )
        self._agreed.add(arguments)

    @cached_property
    def _agreed(self) -> set[tuple[float, ...]]:
        """Where its derivatives were checked."""
        return set()

    def _disagreements(self, arguments: tuple[float, ...]) -> Iterator[tuple[int, int, float, float]]:
        """Output, argument, derivative and differences, where the two disagree."""
        known = self.derivatives(*arguments)
        for k in range(self.arguments):
            for i, measured in disagreement(lambda *x: np.array(self.value(*x)), arguments, k, known[:, k]):
                yield i, k, float(known[i, k]), measured


def disagreement(
    function: Callable[..., Array], at: Sequence[float], argument: int, derivatives: Array
) -> list[tuple[int, float]]:
    """Outputs whose derivative by an argument agrees with central differences of no length, and what the nearest one gives.

    Lengths go from a tenth of the argument down to a millionth, or about zero over six powers of ten to either side of 1; each
    is extrapolated with its half.  Outputs that have no finite value, or no finite differences, agree.
    """
    x = at[argument]
    steps = np.abs(x) * 10.0 ** -np.arange(1.0, 6.5, 0.5) if x else 10.0 ** np.arange(6.0, -6.5, -0.5)
    value = function(*at)
    best = np.full(len(value), np.nan)
    least = np.full(len(value), np.inf)
    agreed = ~np.isfinite(value) | ~np.isfinite(derivatives)
    for h in steps:
        d = _difference(function, at, argument, float(h))
        miss = np.abs(d - derivatives)
        allowed = AGREED * np.maximum(np.abs(d), np.abs(derivatives))
        if h >= LONG * (abs(x) or 1.0):
            allowed += ROUNDING * np.abs(value) / h
        agreed |= miss <= allowed
        nearer = miss < least
        best[nearer], least[nearer] = d[nearer], miss[nearer]
    return [(int(i), float(best[i])) for i in np.flatnonzero(~agreed & np.isfinite(best))]


def _difference(function: Callable[..., Array], at: Sequence[float], argument: int, h: float) -> Array:
    """The central difference, extrapolated with that of half its length."""

    def slope(h: float) -> Array:
        ends = [[x + s * h if k == argument else x for k, x in enumerate(at)] for s in (1, -1)]
        return np.asarray((function(*ends[0]) - function(*ends[1])) / (ends[0][argument] - ends[1][argument]))

    return (4.0 * slope(0.5 * h) - slope(h)) / 3.0
