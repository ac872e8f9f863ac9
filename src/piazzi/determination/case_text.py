"""A case as a file that gives the same determination again: what was said, and what was assumed where nothing was."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from piazzi.arrays import distinct
from piazzi.determination.case import OPTIONS, Case
from piazzi.determination.fit import DEFAULT
from piazzi.determination.setup import Setup
from piazzi.earth import Epoch, ForceChoice, Forces
from piazzi.earth.defaults import DATA, SPHERE
from piazzi.earth.force_options import SUNLIGHT
from piazzi.formats import KINDS, Observations
from piazzi.io.atomic import atomic_path
from piazzi.scenarios.earth_functions import written_orientation
from piazzi.scenarios.toml_text import toml_text


def write_case(path: str | os.PathLike[str], case: Case, given: Setup) -> None:
    """Write the case of a determination, whole or not at all.

    Raises
    ------
    ValueError
        For what files cannot hold, such as forces with a field that is known in Python only.
    OSError
        Where nothing can be written there.
    """
    folder = Path(os.path.realpath(path)).parent
    text = toml_text(case_tables(case, given, folder), tuple(f"assumed: {line}" for line in given.assumed))
    with atomic_path(path) as work:
        work.write_text(text, encoding="utf-8")


def case_tables(case: Case, given: Setup, folder: Path) -> dict[str, Any]:
    """Sections of the case; files by their paths from a folder."""
    filled = _filled(case, given)
    told: dict[str, Any] = {}
    sections: dict[str, dict[str, Any]] = {"object": {}, "product": {}}
    for name, option in OPTIONS.items():
        value = getattr(filled, name)
        if not option.key or value is None or value is False or (isinstance(value, tuple | list) and not value):
            continue
        plain = _forces(value, folder) if name == "forces" else _plain(name, value, folder if option.file else None)
        if option.section is not None:
            sections[option.section[0]][option.section[1]] = plain
        else:
            told[name.rstrip("_")] = plain
    told |= {name: _plain(name, value, None) for name, value in filled.answers.items()}
    printed = {"published": [one.table() for one in case.published]} if case.published else {}
    return {"determine": told, **{name: section for name, section in sections.items() if section}, **printed}


def _filled(case: Case, given: Setup) -> Case:
    """The case with what was taken where it says nothing."""
    measured = given.measured
    answers = dict(case.answers)
    sigmas = list(_sigmas(measured.observations)) if any("sigma" in text for text in measured.assumed) else []
    if sigmas:
        answers["sigma"] = [*_texts(answers.get("sigma")), *sigmas]
    return replace(
        case,
        guess="none" if case.guess is None else case.guess,
        with_=case.with_ or list(DEFAULT),
        forces=given.chosen.choice,
        object=case.object or measured.object or None,
        answers=answers,
    )


def _sigmas(rows: Observations) -> Iterable[str]:
    """Standard deviations by kind and station, where all rows of both have the same."""
    used = rows.measured & np.isfinite(rows.sigma)
    for k, kind in enumerate(rows.kinds):
        for s in distinct(rows.station[used & (rows.kind == k)]):
            values = np.unique(rows.sigma[used & (rows.kind == k) & (rows.station == s)])
            if len(values) == 1:
                station = f".{rows.participants[s]}" if s >= 0 else ""
                yield f"{kind}{station}={float(values[0])!r}{KINDS[kind].unit}"


def _texts(given: Any) -> list[str]:
    if isinstance(given, Mapping):
        return [f"{name}={value}" if name else str(value) for name, value in given.items()]
    return [given] if isinstance(given, str) else [str(text) for text in given or ()]


def _forces(choice: Any, folder: Path) -> Any:
    """A table that `earth.defaults.forces_of` reads back; text stays."""
    if not isinstance(choice, ForceChoice):
        return choice
    forces, usual = choice.forces, Forces()
    if not choice.sphere:  # shares of sunlight were added where they matter, and are again
        forces = replace(forces, empirical=tuple(name for name in forces.empirical if name not in SUNLIGHT))
    table: dict[str, Any] = {}
    for field in fields(Forces):
        value = getattr(forces, field.name)
        if value is None and getattr(usual, field.name) is None:
            continue
        if field.name == "gravity" and not isinstance(value, str | os.PathLike):
            raise ValueError("the case cannot be written to a file: the field of its forces is known in Python only")
        table[field.name] = _plain(field.name, value, folder if field.name == "gravity" else None)
    open_ = {text.partition(" = ")[0] for text in choice.assumed}
    known = set(forces.parameters) - open_
    own = {k: float(v) for k, v in choice.values.items() if k in known and forces.values.get(k) != v}
    return {**table, **own, **_data(choice), **({} if choice.sphere else {SPHERE: False})}


def _data(choice: ForceChoice) -> dict[str, Any]:
    """Files of data that were named, and constants of the orientation."""
    found: dict[str, Any] = {} if choice.forces.about == "sun" else {"eop": written_orientation(choice.eop)}
    for name in DATA:
        value = getattr(choice, name)
        if value is not None and name not in found:
            path = Path(getattr(value, "source", value))
            if not path.is_file():
                raise ValueError(f"the case cannot be written to a file: its {name} is from no file that is there")
            found[name] = str(path.absolute())
    return found


def _plain(name: str, value: Any, folder: Path | None) -> Any:
    """A value as TOML has it, a file by its path from the folder; raises ValueError for an object that files cannot hold."""
    if isinstance(value, Mapping):
        return {str(key): _plain(name, one, folder) for key, one in value.items()}
    if isinstance(value, tuple | list):
        return " ".join(map(str, value)) if name == "interpolation" else [_plain(name, one, folder) for one in value]
    if isinstance(value, Epoch):
        return value.exact()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, str | os.PathLike):
        text = os.fspath(value)
        there = folder is not None and len(text) < 4096 and "\0" not in text and os.path.isfile(text)
        return os.path.relpath(os.path.realpath(text), folder) if there and folder is not None else text
    if isinstance(value, bool | int | float):
        return value
    raise ValueError(f"the case cannot be written to a file: its {name.rstrip('_')} is known in Python only")
