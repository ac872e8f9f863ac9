"""What is estimated or considered beside the orbit, as users say it: a list of words, or objects."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, NamedTuple

from piazzi.determination.words import date, quantity
from piazzi.earth import Epoch
from piazzi.text import nearest, one_line
from piazzi.units import positive_duration

PASS = "pass"
BIAS, SCALE, CLOCK, DV = "bias", "scale", "clock", "dv"
EXAMPLE = "cd/12h cr bias.range.7090/pass=1m clock.BER=1ms dv@2026-11-03T04:12:00Z"
_WORD = re.compile(r"([A-Za-z][\w.()+-]*)(?:([/~])([\w.+-]+))?", re.ASCII)


@dataclass(frozen=True)
class Estimated:
    """An unknown by name, with the sigma that it has before the measurements.

    Parameters
    ----------
    name : ``cr``, ``cd``, an acceleration such as ``along``, another parameter of the forces; ``bias.KIND.STATION``,
        ``scale.range.STATION``, ``clock.STATION`` (what its times are late by), of each station where none is named;
        ``dv@DATE``, a velocity that is gained at that date
    per : "12h", a value for each 12 hours; "~12h", a Gauss-Markov process with that time; "pass", a value for each pass
    sigma : SI, or text with a unit, such as "1ms"; of ``cr`` and ``cd`` a share of them.  Of a process it is the steady one.

    Raises
    ------
    ValueError
        For what cannot be read.
    """

    name: str
    per: str | None = None
    sigma: float | str | None = None

    def __post_init__(self) -> None:
        if isinstance(self.sigma, int | float) and not (isfinite(self.sigma) and self.sigma > 0):
            raise ValueError(f"{self}: a sigma is positive, not {self.sigma:g}")
        if isinstance(self.sigma, str) and re.match(r"\s*(-|\+?0*\.?0*([a-zA-Z%]|$))", self.sigma):
            raise ValueError(f"{self}: a sigma is positive, not {self.sigma}")
        if self.per is not None and self.per != PASS:
            self.period  # noqa: B018
        if self.kind == DV:
            self.epoch  # noqa: B018
            if self.per is not None:
                raise ValueError(f"{self}: a velocity is gained once; it has no {self.per!r}")

    def __str__(self) -> str:
        return f"{self.label}{'' if self.sigma is None else f'={self.sigma}'}"

    @property
    def label(self) -> str:
        """It without its sigma, as messages and results name it."""
        return f"{self.name}{'' if self.per is None else self.per if self.is_process else f'/{self.per}'}"

    @property
    def kind(self) -> str:
        """``bias``, ``scale``, ``clock`` or ``dv``; "" for a parameter of the forces."""
        head = re.split(r"[.@]", self.name, maxsplit=1)[0]
        return head if head in (BIAS, SCALE, CLOCK, DV) else ""

    @property
    def is_process(self) -> bool:
        """Whether it is a Gauss-Markov process."""
        return self.per is not None and self.per.startswith("~")

    @property
    def period(self) -> float:
        """Seconds of a value, or of the process."""
        return positive_duration(str(self.per).removeprefix("~"), self.label, plain=False)

    @property
    def epoch(self) -> Epoch:
        """The date of ``dv@DATE``."""
        return date(self.name.partition("@")[2], self.name)

    def size(self, unit: str, usual: float) -> float:
        """Its sigma in SI, `usual` where none is given; of a share without a unit."""
        if self.sigma is None:
            return usual
        if not isinstance(self.sigma, str):
            return float(self.sigma)
        text = self.sigma.strip()
        share = text.endswith("%") and not unit
        value = quantity(text.removesuffix("%") if share else text, unit, self.label) * (0.01 if share else 1.0)
        if not value > 0:
            raise ValueError(f"{self}: a sigma is positive, not {text}")
        return value


class Asked(NamedTuple):
    """An unknown, and whether it is estimated or considered."""

    what: Estimated
    role: str
    option: str


class Label(NamedTuple):
    """How people know a constant: its name in lists, and words."""

    name: str
    words: str


def asked(estimate: Any, consider: Any) -> tuple[Asked, ...]:
    """All that is to be estimated or considered; raises ValueError for words that cannot be read, or that come twice."""
    found = [Asked(one, "estimated", "--estimate") for one in listed(estimate)]
    found += [Asked(one, "considered", "--consider") for one in considered(consider)]
    names = [one.what.label for one in found]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ValueError(f"{found[i].option}: {name} is given twice")
    return tuple(found)


def listed(given: Any) -> list[Estimated]:
    """The unknowns of words and objects."""
    out: list[Estimated] = []
    for one in [given] if isinstance(given, str | Estimated) else given or ():
        out += [one] if isinstance(one, Estimated) else [_read(word) for word in str(one).split()]
    return out


def considered(given: Any) -> list[Estimated]:
    """The same of ``NAME=SIGMA``, or of a mapping of names to sigmas."""
    if isinstance(given, Mapping):
        return [Estimated(str(name), None, sigma) for name, sigma in given.items()]
    words = [given] if isinstance(given, str) else list(given or ())
    found = []
    for word in [part for text in words for part in (str(text).split() if not isinstance(text, Estimated) else [text])]:
        one = word if isinstance(word, Estimated) else _read(word, "--consider")
        if one.sigma is None:
            raise ValueError(f"--consider: {one_line(str(word), 60)!r} has no sigma: write NAME=SIGMA, such as cr=0.1")
        if one.per is not None and one.per != PASS:
            raise ValueError(f"--consider: {one_line(str(word), 60)!r}: what is considered has one value, or one per pass")
        found.append(one)
    return found


def of_parameters(given: Sequence[Asked], parameters: Iterable[str], short: Mapping[str, str]) -> list[tuple[str, Asked]]:
    """Those that are parameters of the forces, by the names these have; raises ValueError for any other that is neither."""
    names = {long: brief for brief, long in short.items()}
    known = [p for p in parameters if not p.endswith("_on")]
    out = []
    for one in given:
        if one.what.kind:
            continue
        long = short.get(one.what.name, one.what.name)
        if long not in known:
            every = [*(names.get(p, p) for p in known), "bias.range", "scale.range", CLOCK, "dv@DATE"]
            name = one_line(one.what.name, 60)
            raise ValueError(f"{one.option}: {name!r} is no unknown of these forces{nearest(name, every)}")
        if one.what.per == PASS:
            raise ValueError(f"{one.option} {one.what}: a force has no passes; write such as {one.what.name}/12h")
        out.append((long, one))
    return out


def _read(text: str, option: str = "--estimate") -> Estimated:
    left, equals, sigma = text.partition("=")
    match = None if left.startswith(f"{DV}@") else _WORD.fullmatch(left)
    if (equals and not sigma) or (match is None and not left.startswith(f"{DV}@")):
        raise ValueError(f"{option}: {one_line(text, 60)!r} cannot be read: write such as {EXAMPLE}")
    try:
        if match is None:
            return Estimated(left, None, sigma or None)
        per = f"{match[2]}{match[3]}".lstrip("/") if match[3] else None
        return Estimated(match[1], per, sigma or None)
    except ValueError as error:
        raise ValueError(f"{option}: {error}") from None
