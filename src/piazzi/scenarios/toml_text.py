"""Plain tables as TOML text, which `tomllib` reads back to the same values in all bits."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from math import isfinite, isnan
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+", re.ASCII)
_HIDDEN = re.compile(r"[\x7f-\x9f]")
WIDTH = 120  # of a line, beyond which a table gets a section of its own


def toml_text(tables: Mapping[str, Any], comments: tuple[str, ...] = ()) -> str:
    """TOML of tables, lists, text, numbers and flags, behind lines of comment; what is None is left out.

    Raises
    ------
    ValueError
        For a value that TOML has no form of.
    """
    said = [f"# {' '.join(_HIDDEN.sub('?', line).split())}" for line in comments]
    return "\n".join([*said, *([""] if said else []), *_lines(tables, "")]).rstrip("\n") + "\n"


def _lines(table: Mapping[str, Any], path: str) -> Iterator[str]:
    """The keys of a table, then its tables as sections, all of them where one is: what follows a section would belong to it."""
    lines, later = dict[str, str](), dict[str, Any]()
    for key, value in table.items():
        if value is not None and not _is_section(value, path):
            lines[key] = f"{_key(key)} = {_value(value)}"
    long = any(len(line) > WIDTH for key, line in lines.items() if isinstance(table[key], Mapping))
    for key, value in table.items():
        if key in lines and not (long and isinstance(value, Mapping)):
            yield lines[key]
        elif value is not None:
            later[key] = value
    for key, value in later.items():
        place = f"{path}.{_key(key)}" if path else _key(key)
        if isinstance(value, Mapping):
            yield from ("", f"[{place}]", *_lines(value, place))
        else:
            for one in value:
                yield from ("", f"[[{place}]]", *_lines(one, place))


def _is_section(value: Any, path: str) -> bool:
    tables = isinstance(value, list | tuple) and bool(value) and all(isinstance(one, Mapping) for one in value)
    return not path and (isinstance(value, Mapping) or tables)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _text(key)


def _text(value: str) -> str:
    return _HIDDEN.sub(lambda c: f"\\u{ord(c[0]):04x}", json.dumps(value, ensure_ascii=False))


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        return repr(value) if isfinite(value) else "nan" if isnan(value) else "inf" if value > 0 else "-inf"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items() if one is not None)
        return f"{{ {inner} }}" if inner else "{}"
    raise ValueError(f"TOML has no form of {type(value).__name__}")
