"""What messages of CCSDS have in common: keywords with a value and a line, dates, numbers, and how they are refused."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple, NoReturn

from piazzi.earth import Epoch
from piazzi.earth.scales import SCALES
from piazzi.formats.columns import LARGEST
from piazzi.text import one_line, suggest

_SHOWN = 60


class Item(NamedTuple):
    """A keyword, its text, the line that it stands in, and the units written beside it."""

    keyword: str
    text: str
    line: int
    unit: str = ""


def shown(text: str) -> str:
    """A text of a file as messages repeat it."""
    return repr(one_line(text, _SHOWN))


class Source(NamedTuple):
    """The name of a file, for messages."""

    name: str

    def refuse(self, line: int, reason: str) -> NoReturn:
        """Raise ValueError with file, line and reason."""
        raise ValueError(f"{self.name}: line {line}: {reason}")

    def number(self, item: Item) -> float:
        """The finite number of an item."""
        if re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?", item.text, re.ASCII):
            value = float(item.text.replace("d", "e").replace("D", "e"))
            if abs(value) < LARGEST:
                return value
        self.refuse(item.line, f"{item.keyword} is {shown(item.text)}; it must be a number")

    def whole(self, item: Item) -> int:
        """The whole number of an item."""
        if not re.fullmatch(r"[+-]?\d{1,9}", item.text, re.ASCII):
            self.refuse(item.line, f"{item.keyword} is {shown(item.text)}; it must be a whole number")
        return int(item.text)

    def word(self, item: Item, words: Collection[str]) -> str:
        """One of some words, in capitals."""
        word = item.text.upper()
        if word not in words:
            self.refuse(item.line, f"{item.keyword} is {shown(item.text)}; it must be one of {', '.join(words)}")
        return word

    def date(self, item: Item, scale: str) -> Epoch:
        """The instant of an item, whose file has that time scale."""
        try:
            return Epoch(item.text, scale)
        except ValueError as error:
            self.refuse(item.line, f"{item.keyword}: {one_line(str(error), 200)}")

    def scale(self, item: Item) -> str:
        """The time scale of a ``TIME_SYSTEM``."""
        scale = item.text.upper()
        if scale not in SCALES:
            known = ", ".join(SCALES)
            self.refuse(item.line, f"TIME_SYSTEM is {shown(item.text)}, which has no fixed relation to TT; known: {known}")
        return scale


def known(source: Source, item: Item, keywords: Collection[str], where: str) -> None:
    """Refuse a keyword that does not belong there."""
    if item.keyword not in keywords:
        source.refuse(item.line, f"{shown(item.keyword)} is no keyword of {where}{suggest(item.keyword[:_SHOWN], keywords)}")


def lines_of(data: bytes) -> list[str]:
    """Lines of a small text, with ends of every kind."""
    return data.decode("utf-8", "replace").removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")


_KEY_VALUE = re.compile(r"([A-Za-z0-9_]+)\s*=\s*(.*)", re.DOTALL)
_WITH_UNIT = re.compile(r"([-+0-9.eEdD]+)\s*\[([^\[\]]*)\]")  # names may have brackets, too


def key_value(source: Source, text: str, line: int) -> Item | None:
    """The item of a line ``KEYWORD = value [unit]``, None for blank lines and comments."""
    stripped = text.strip()
    if not stripped or re.match(r"COMMENT(\s|$)", stripped):
        return None
    match = _KEY_VALUE.fullmatch(stripped)
    if match is None:
        source.refuse(line, f"{shown(stripped)} is no line of the form KEYWORD = value")
    with_unit = _WITH_UNIT.fullmatch(match[2])
    return Item(match[1].upper(), with_unit[1], line, with_unit[2]) if with_unit else Item(match[1].upper(), match[2], line)


def single(source: Source, items: Sequence[Item], what: str) -> dict[str, Item]:
    """Items by keyword; one given twice is refused."""
    found: dict[str, Item] = {}
    for item in items:
        if item.keyword in found:
            source.refuse(item.line, f"{item.keyword} is given twice in {what}, before in line {found[item.keyword].line}")
        found[item.keyword] = item
    return found


def needed(source: Source, found: dict[str, Item], keywords: Sequence[str], what: str, line: int) -> None:
    """Refuse what lacks a keyword, at the line where it should have come."""
    for keyword in keywords:
        if keyword not in found or not found[keyword].text:
            source.refuse(found[keyword].line if keyword in found else line, f"{what} has no {keyword}")


def numbered(found: dict[str, Item], prefix: str) -> Iterator[tuple[int, Item]]:
    """Items ``PREFIX_1``, ``PREFIX_2``, ... with their numbers."""
    for keyword, item in found.items():
        match = re.fullmatch(re.escape(prefix) + r"_(\d)", keyword)
        if match:
            yield int(match[1]), item
