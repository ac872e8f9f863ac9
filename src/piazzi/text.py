"""Words of messages: what a user wrote on one printable line, and the valid name that was probably meant."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from math import isfinite
from typing import Any

LONGEST = 500
BRIEF = 400  # characters of a result in a terminal
_FORMULA = re.compile(r"'*[=+\-@\t\r]")
_GUARDED = re.compile(r"'+[=+\-@\t\r]")


def printable(text: str) -> str:
    """The text with control characters written out, so that nothing in it steers a terminal."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def escape_formula(text: str) -> str:
    """The text as a cell that no spreadsheet takes for a formula: behind an apostrophe where it would; see `restored`."""
    return f"'{text}" if _FORMULA.match(text) else text


def unescape_formula(cell: str) -> str:
    """The text of which `unformulated` made this cell; any other cell as it is."""
    return cell[1:] if _GUARDED.match(cell) else cell


def one_line(text: str, longest: int = LONGEST) -> str:
    """The text on one line of sane length, with control characters written out."""
    return printable(text if len(text) <= longest else text[:longest] + " ...")


def shown(value: Any) -> str:
    """A value as a message shows it: short, and on one line."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        short = len(value) <= 4 and not any(isinstance(v, dict | list) for v in value)
        return one_line(repr(value)) if short else f"a list of {len(value)}"
    text = repr(value) if not isinstance(value, int) or abs(value) < 10**20 else "a number of more than 20 digits"
    return one_line(text if len(text) <= 60 else text[:57] + "...")


def counted(many: int, what: str) -> str:
    """So many of something: ``1 row``, ``2,000 rows``."""
    return f"{many:,} {what}{'' if many == 1 else 's'}"


def is_number(text: str | bytes) -> bool:
    """Whether Python reads a text as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def finite_number(text: str, place: str) -> float:
    """A number of a file, with E or, as Fortran writes it, D; ValueError with its place for any other text."""
    try:
        value = float(text.replace("D", "E").replace("d", "e"))
    except ValueError:
        raise ValueError(f"{place}: {text!r} is not a number") from None
    if not isfinite(value):
        raise ValueError(f"{place}: {text!r} is not finite")
    return value


def suggestion(name: str, valid: Iterable[object]) -> str:
    """The valid name nearest to `name`, upper and lower case aside, "" where none is near."""
    from difflib import get_close_matches

    options = [str(v) for v in valid]
    near = get_close_matches(str(name), options, n=1)
    if near:
        return near[0]
    folded = {option.casefold(): option for option in sorted(options)}
    near = get_close_matches(str(name).casefold(), folded, n=1)
    return folded[near[0]] if near else ""


def suggest(name: str, valid: Iterable[object]) -> str:
    """'; did you mean ...?' with the nearest valid name, nothing where none is near."""
    near = suggestion(name, valid)
    return f"; did you mean {near!r}?" if near else ""


def listed(names: Iterable[str], most: int = 6) -> str:
    """Names with commas, the first few of many."""
    found = list(names)
    return ", ".join(found) if len(found) <= most else f"{', '.join(found[:most])} and {len(found) - most} more"


def nearest(name: str, valid: Iterable[object]) -> str:
    """'; did you mean ...?' with the nearest valid name, or the list of them."""
    options = [str(v) for v in valid]
    return suggest(name, options) or (f"; known: {listed(options, 24)}" if options else "")


def brief(thing: Any) -> str:
    """A dataclass in a terminal: fields that differ from their defaults, arrays by their shape, long values by their size."""
    told = []
    for field in fields(thing):
        value = getattr(thing, field.name, None)
        if field.repr and not (value is None or value is field.default or _same(value, field)):
            told.append(f"{field.name}={_brief(value)}")
    text = f"{type(thing).__qualname__}({', '.join(told)})"
    return text if len(text) <= BRIEF else text[: BRIEF - 5] + " ...)"


def _same(value: Any, field: Any) -> bool:
    """Whether a plain value, or an empty one, is the default of its field."""
    if field.default is not MISSING:
        return isinstance(value, str | int | float | tuple) and type(value) is type(field.default) and value == field.default
    return field.default_factory is not MISSING and isinstance(value, Mapping | tuple | list) and not value


def _brief(value: Any) -> str:
    if isinstance(value, str | int | float | bool):
        return shown(value)
    shape = getattr(value, "shape", ())
    if shape:
        few = len(shape) == 1 and shape[0] <= 3
        return f"[{', '.join(f'{v:.6g}' for v in value)}]" if few else f"<{' x '.join(map(str, shape))} numbers>"
    if isinstance(value, Mapping):
        return f"{{{listed((one_line(str(key), 30) for key in value), 4)}}}"
    if isinstance(value, tuple | list | set | frozenset):
        text = ", ".join(map(_brief, value)) if len(value) <= 4 else ""
        return (
            f"({text})"
            if text and len(text) <= 100
            else f"<{len(value)} of {type(next(iter(value))).__name__}>"
            if value
            else "()"
        )
    text = repr(value)
    return text if len(text) <= 80 else f"<{type(value).__name__}>"


def spelled(value: Any) -> str:
    """A value in full, field by field: what keys and digests are made of, whatever `repr` shows."""
    if is_dataclass(value) and not isinstance(value, type):
        own = ", ".join(f"{field.name}={spelled(getattr(value, field.name))}" for field in fields(value) if field.repr)
        return f"{type(value).__qualname__}({own})"
    if type(value) in (tuple, list):
        inner = ", ".join(map(spelled, value)) + "," * (type(value) is tuple and len(value) == 1)
        return f"({inner})" if type(value) is tuple else f"[{inner}]"
    return repr(value)
