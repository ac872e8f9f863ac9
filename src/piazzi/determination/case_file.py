"""A case as a file: the sections [determine], [object] and [product] of a scenario, with [earth] for its forces."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from piazzi.determination.case import ANSWERS, OPTIONS, Case
from piazzi.opening import told_path
from piazzi.text import nearest, one_line, suggest

SECTIONS = ("determine", "object", "product")
ENDING = ".toml"
LONGEST_PATH = 200
CASES = Path(__file__).parent / "cases"


def split(given: Sequence[Any]) -> tuple[list[Any], Case]:
    """What is tracking, and the case that is among the files, over that of the package whose tracking it is; else an empty one.

    Raises
    ------
    OSError
        Where the case cannot be read.
    ValueError
        For what is wrong with it, with its place, and for two of them.
    """
    given = [part for one in given for part in shipped(one)]
    cases = [one for one in given if isinstance(one, str | os.PathLike) and os.fspath(one).lower().endswith(ENDING)]
    ours = [one for one in cases if Path(one).parent == CASES]
    theirs = [one for one in cases if one not in ours]
    for several in (ours, theirs):
        if len(several) > 1:
            raise ValueError(f"{' and '.join(map(told_path, several[:2]))} are both cases: give one")
    told = Case()
    for one in (*ours, *theirs):
        told = read_case(one, told)
    return [one for one in given if not any(one is case for case in cases)], told


def shipped(given: Any) -> list[Any]:
    """The files of a case of the package, by its name where no file is called so; else what was given.

    Raises
    ------
    FileNotFoundError
        Where no file is called so, and the name is nearly that of a case.
    """
    if not isinstance(given, str) or os.path.exists(given):
        return [given]
    if given in names():
        return [str(CASES / f"{given}.toml"), str(CASES / f"{given}.txt")]
    if hint := suggest(given, names()):
        raise FileNotFoundError(errno.ENOENT, f"{os.strerror(errno.ENOENT)}{hint}", given)
    return [given]


def names() -> list[str]:
    """Names of the cases of the package, each with its tracking."""
    return sorted(path.stem for path in CASES.glob("*.txt"))


def refuse_case(given: str, ending: str = ".toml") -> None:
    """Raise ValueError for the name of a case of the package, where a file with this ending is wanted that is made of one."""
    if given in names() and not os.path.exists(given):
        what = "a problem" if ending == ".toml" else "an orbit"
        raise ValueError(f"{given} is tracking: piazzi determine {given} -o {given}{ending} makes {what} of it")


def read_case(path: str | os.PathLike[str], base: Case | None = None) -> Case:
    """The case in a file, over another; files that it names are looked for beside it first.  Raises OSError, ValueError."""
    from piazzi.scenarios.loader import tables_of
    from piazzi.scenarios.table import ScenarioError

    name = told_path(path)
    tables, faults = tables_of(path)
    if faults:
        raise ScenarioError(name, list(faults))
    if not any(section in tables for section in SECTIONS):
        raise ValueError(f"{name} is no case: it has no section [determine], [object] or [product] (stations: --stations)")
    try:
        return _told(tables, Path(path).parent, base or Case())
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _told(tables: Mapping[str, Any], folder: Path, case: Case) -> Case:
    """The case with what the sections say; raises ValueError."""
    if "earth" in tables:
        case = replace(case, forces=_forces(tables["earth"], folder, "[earth]"))
    for section in SECTIONS:
        given = tables.get(section, {})
        if not isinstance(given, Mapping):
            raise ValueError(f"{section}: must be a table")
        known = keys(section)
        for key, value in given.items():
            name = known.get(key.replace("-", "_"))
            if name is None:
                raise ValueError(f"{section}.{one_line(key, 60)}: unknown key{nearest(key[:60], list(known))}")
            try:
                case = case.told({name: _beside(name, value, folder)}, f"{section}.{key}")
            except TypeError:
                raise ValueError(f"{section}.{key} is {one_line(repr(value), 60)}, which it cannot be") from None
    printed = tables.get("published", [])
    if not printed:
        return case
    from piazzi.determination.published import published_of

    if not isinstance(printed, list):
        raise ValueError("published: must be a list of tables, [[published]]")
    return replace(case, published=tuple(published_of(one, f"published[{i}]") for i, one in enumerate(printed)))


def keys(section: str) -> dict[str, str]:
    """Names of options by the keys of a section."""
    if section == "determine":
        own = [name for name, option in OPTIONS.items() if option.key and option.flags is not None]
        return {name.rstrip("_"): name for name in [*own, *ANSWERS]}
    return {option.section[1]: name for name, option in OPTIONS.items() if option.section and option.section[0] == section}


def _beside(name: str, value: Any, folder: Path) -> Any:
    """A value with files that are beside the case by their paths, and tables of forces read."""
    if name == "forces" and isinstance(value, Mapping):
        return _forces(value, folder, "the case")
    if name not in OPTIONS or not OPTIONS[name].file:
        return value
    if isinstance(value, list):
        return [_beside(name, one, folder) for one in value]
    if name == "participant" and isinstance(value, str) and "=" in value:
        who, _, path = value.partition("=")
        return f"{who}={_beside(name, path, folder)}"
    there = isinstance(value, str) and "\0" not in value and len(value) < LONGEST_PATH and (folder / value).is_file()
    return str(folder / value) if there else value


def _forces(table: Any, folder: Path, source: str) -> Any:
    from piazzi.earth.defaults import forces_of

    if not isinstance(table, Mapping):
        raise ValueError(f"{source}: must be a table")
    try:
        return forces_of(table, folder, source)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{source}: {error}") from None
