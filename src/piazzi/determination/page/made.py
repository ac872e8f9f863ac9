"""Other orbits that fit, the tests behind the verdict, and how the answer was made."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

from piazzi.determination.showing import remarks
from piazzi.evaluate.quantities import number
from piazzi.present.report.blocks import Code, Section, Table, Text

_SAYS = {True: "yes", False: "no", None: "not tested"}


def modes(facts: dict[str, Any]) -> Section | None:
    """Orbits that fit, where there are several."""
    found = facts["modes"]
    if len(found) < 2:
        return None
    heads = [
        ("", ""),
        ("probability", ""),
        ("rms", "sigma"),
        *((name, "km") for name in "xyz"),
        *((f"v{n}", "km/s") for n in "xyz"),
    ]
    rows = []
    for i, one in enumerate(found, start=1):
        place, speed = (
            [f"{v / 1e3:{form}}" for v in part] for part, form in ((one["mean"][:3], ".3f"), (one["mean"][3:6], ".6f"))
        )
        rows.append([str(i), number(one["probability"], 3), number(one["weighted_rms"], 3), *place, *speed])
    words = "All of these give the measurements; the first is the answer. States stand at the epoch of the answer."
    return Section("Orbits that fit", [Table(heads, rows, caption=f"States in {facts['frame']}")], words)


def tests(facts: dict[str, Any]) -> Section:
    """What every sentence of the verdict was tested by."""
    rows = [[key, _SAYS[one["ok"]], number(one["figure"], 4), one["test"]] for key, one in facts["verdict"].items()]
    heads = [("", ""), ("holds", ""), ("figure", ""), ("tested by", "")]
    return Section("Tests behind the verdict", [Table(heads, rows, words=(3,))], folded=True)


def made(found: Any, facts: dict[str, Any]) -> list[Section]:
    """Forces and assumptions, files, and the command."""
    files = [[one["file"], f"{one['measurements']:,}"] for one in facts["data"]]
    out = [Section("Forces, and what was assumed", [Text([*remarks(facts), _orientation(found)])])]
    blocks: list[Any] = [Table([("file", ""), ("measurements", "")], files)] if files else []
    if facts.get("command"):
        blocks.append(Code(facts["command"]))
    blocks.append(
        Text([f"Piazzi {version('piazzi')}, {found.seconds:.3g} s of {found.name}, {facts['iterations']} iterations."])
    )
    return [*out, Section("How it was made", blocks)]


def _orientation(found: Any) -> str:
    """How old the tables of the Earth's orientation are beside the measurements."""
    from piazzi.earth.eop import mjd_text, tables

    table = tables()
    measured, last = mjd_text(table.measured), mjd_text(float(table.mjd[-1]))
    return f"Orientation of the Earth: IERS tables, measured up to {measured}, predicted to {last}."
