"""A determination for people: the verdict, the orbit, its elements, residuals and what was assumed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from piazzi.determination.document import document
from piazzi.determination.physical import believed, said_name
from piazzi.determination.setup import Setup
from piazzi.determination.verdict import apart_by
from piazzi.earth.force_options import TIDES
from piazzi.evaluate.grids import Grid
from piazzi.evaluate.quantities import display_of, displays, number, with_sigma
from piazzi.text import printable

MOST_REJECTED = 12


def heading(found: Any, facts: Mapping[str, Any]) -> Iterator[str]:
    """What was determined, and the six sentences, those that are false first."""
    state = "determined" if facts["determined"] else "not determined"
    span = facts["span"]
    yield f"{facts['object'] or 'the object'}: {state} by {found.name} from {span['first']} to {span['last']}"
    sentences = sorted(facts["verdict"].values(), key=lambda one: one["ok"] is not False)
    yield from (f"  {one['sentence']}" for one in sentences)


def grids(found: Any, facts: Mapping[str, Any]) -> list[Grid]:
    """State, elements, residuals, rejected rows."""
    tables = [
        _state(facts), *([_elements(facts)] if facts["elements"] else []), *([_beside(facts)] if facts["estimated"] else []),
        _residuals(facts),
    ]  # fmt: skip
    return [
        *tables,
        *([_rejected(facts)] if facts["rejected"] else []),
        *([_published(facts)] if facts["published"] else []),
        *([_estimators(found)] if len(found.estimates) > 1 else []),
    ]


def _state(facts: Mapping[str, Any]) -> Grid:
    rows = []
    shows = displays(facts["units"][:6], [[v] for v in facts["mean"][:6]], [range(3), range(3, 6)])
    for show, name, *numbers in zip(shows, *(facts[k][:6] for k in ("names", "mean", "sigma")), strict=True):
        value, sigma = (np.nan if v is None else v for v in numbers)
        rows.append((name, *with_sigma(value * show.factor, sigma * show.factor), show.unit))
    return Grid(f"State at {facts['epoch']}, {facts['frame']}", ("", "value", "sigma", "unit"), tuple(rows))


def _beside(facts: Mapping[str, Any]) -> Grid:
    rows, found = [], facts["estimated"]
    shows = displays([one["unit"] for one in found], [[one["value"], one["prior_sigma"]] for one in found], [])
    for show, one in zip(shows, found, strict=True):
        value, sigma, before, spread = (
            np.nan if one[k] is None else one[k] * show.factor for k in ("value", "sigma", "prior", "prior_sigma")
        )
        texts = (*with_sigma(value, sigma), *with_sigma(before, spread))
        rows.append((one["words"], *texts, show.unit, number(one["departure"], 2)))
    columns = ("", "value", "sigma", "before", "sigma\nbefore", "unit", "departure\n[sigma]")
    return Grid("Estimated beside it, and what was known before", columns, tuple(rows))


def _elements(facts: Mapping[str, Any]) -> Grid:
    elements, rows = facts["elements"], []
    for name, unit, value, sigma in zip(*(elements[k] for k in ("names", "units", "mean", "sigma")), strict=True):
        show = display_of(unit, [value])
        texts = with_sigma(value * show.factor, np.nan if sigma is None else sigma * show.factor)
        rows.append((name, texts[0], "-" if sigma is None else texts[1], show.unit))
    return Grid(f"Elements, {elements['frame']}", ("", "value", "sigma", "unit"), tuple(rows))


def _residuals(facts: Mapping[str, Any]) -> Grid:
    rows, found = [], facts["residuals"]
    kinds = {
        kind: [i for i, one in enumerate(found) if one["component"] == kind] for kind in {one["component"] for one in found}
    }
    shows = displays([one["unit"] for one in found], [[one["rms"]] for one in found], kinds.values())
    for one, show in zip(found, shows, strict=True):
        values = [None if one[k] is None else one[k] * show.factor for k in ("mean", "rms")]
        rows.append((
            one["station"], one["component"], f"{one['used']}/{one['count']}", *(number(v, 3) for v in values), show.unit,
            number(one["weighted_rms"], 3),
        ))  # fmt: skip
    return Grid(
        "Residuals, observed minus computed",
        ("station", "component", "used", "mean", "rms", "unit", "rms\n[sigma]"),
        tuple(rows),
        2,
    )


def _rejected(facts: Mapping[str, Any]) -> Grid:
    shown, many = facts["rejected"][:MOST_REJECTED], len(facts["rejected"])
    rows = []
    for one in shown:
        off = None if one["residual"] is None or not one["sigma"] else one["residual"] / one["sigma"]
        rows.append((one["time"], one["station"], one["component"], number(off, 3), one["reason"]))
    more = f", the first {MOST_REJECTED}" if many > MOST_REJECTED else ""
    return Grid(
        f"Not used: {many} measurements{more}", ("time", "station", "component", "residual\n[sigma]", "why"), tuple(rows), 3
    )


def _published(facts: Mapping[str, Any]) -> Grid:
    rows = []
    for one in facts["published"]:
        worst = max(abs(value) for value in one["in_sigma"])
        show = display_of("m", [one["distance"]])
        rows.append((
            one["name"], one["date"], number(one["distance"] * show.factor, 3), show.unit, number(worst, 3),
            number(one["chi_square"], 3), one["source"],
        ))  # fmt: skip
    columns = ("", "date", "distance", "unit", "worst\n[sigma]", "chi-square\nof 6", "source")
    return Grid("Published orbits, and how far the answer is from them", columns, tuple(rows), 2)


def _estimators(found: Any) -> Grid:
    rows = []
    for name, one in found.estimates.items():
        off = apart_by(found.estimate, one, found.setup.solution)
        rows.append((name, "yes" if one.success else "no", str(one.iterations), number(off, 3), one.message))
    return Grid("Estimators", ("", "success", "iterations", "apart\n[sigma]", "message"), tuple(rows))


def remarks(facts: Mapping[str, Any]) -> Iterator[str]:
    """Forces, constants, what was left out and what was assumed."""
    forces = facts["forces"]
    extra = [k for k in ("relativity", "radiation", "drag") if forces[k]]
    field = (
        f"{forces['gravity']} to degree {forces['degree']}"
        if forces["degree"]
        else f"the {facts.get('about', 'earth').title()} as a point"
    )
    names = [
        field,
        *forces["bodies"],
        *(TIDES[t] for t in forces["tides"]),
        *extra,
        *("departures of sunlight" if one == "sunlight" else one for one in forces["empirical"]),
    ]
    yield f"Forces ({forces['source']}): {', '.join(names)}."
    if "against" in facts:
        apart = facts["against"]
        rms = ", ".join(f"{axis} {number(value, 3)} m" for axis, value in apart["rms"].items())
        share = apart["in_sigma"]
        rms += "" if share is None else ", in sigma " + ", ".join(f"{a} {number(v, 3)}" for a, v in share["rms"].items())
        yield f"Against {apart['file']}: rms {rms} at {apart['count']:,} times from {apart['first']} to {apart['last']}."
    for what, count in facts["left_out"].items():
        yield f"Left out: {what}{f' ({count:,})' if isinstance(count, int) else f': {count}'}."
    for text in facts["assumed"]:
        yield f"Assumed: {text}."


def line(found: Any) -> str:
    """One line on an object."""
    facts = document(found)
    state = "determined" if facts["determined"] else "not determined"
    rms = found.weighted_rms
    wrong = [one["sentence"] for one in facts["verdict"].values() if one["ok"] is False]
    said = f": {wrong[0]}" if wrong else ""
    return printable(f"{facts['object'] or 'the object'}: {state}, residuals {number(rms, 3)} sigma{said}")


def shown(given: Setup) -> str:
    """Forces, unknowns, noise and assumptions of a problem that is not solved yet."""
    problem, chosen, measured = given.problem, given.chosen, given.measured
    facts = {
        "about": measured.about,
        "forces": chosen.facts,
        "left_out": {**chosen.left_out, **measured.left_out},
        "assumed": given.assumed,
    }
    lines = [f"{measured.object or 'the object'}: {len(given.tracking.times):,} epochs from {measured.first}"]
    lines += [
        f"Begins at {given.guess.epoch} from {given.guess.source}: {', '.join(f'{v:.6g}' for v in given.guess.state)} (m, m/s)."
    ]
    known = "which the guess leaves open" if given.earlier is None else f"known from {given.earlier.source}"
    lines += ["Unknowns:", f"  position and velocity, {known}"]
    for name in problem.model.constants:
        lines.append(f"  {_unknown(given, name)}")
    for one in chosen.extra.processes:
        lines.append(f"  {one.label.name}, {one.label.words}: 0 +- {one.sigma:.3g} {one.unit}".rstrip())
    lines += [f"Considered: {_unknown(given, name)}" for name in problem.considered]
    for push in chosen.extra.pushes:
        dv = ", ".join(f"{v:g}" for v in push.burn.dv)
        how = f"over {push.burn.duration:g} s" if push.burn.duration else "at once"
        lines.append(f"Manoeuvre at {push.burn.epoch}: {dv} m/s along {push.burn.axes}, {how}")
    noise: dict[str, None] = {}  # each but once: passes of one station are stations of the problem
    for station in problem.stations:
        sensor = problem.model.sensor(station.sensor)
        sigmas = ", ".join(
            f"{c} {number(s, 3)} {u}"
            for c, s, u in zip(sensor.components, np.sqrt(np.diag(station.noise)), dict(sensor.units).values(), strict=True)
        )
        noise[f"  {measured.labels[station.name]} ({station.sensor}): {sigmas}"] = None
    return "\n".join(printable(text) for text in [*lines, "Noise:", *noise, *remarks(facts)])


def _unknown(given: Setup, name: str) -> str:
    """A constant in words, with what is known of it before the measurements."""
    (mean, spread), label = believed(given.problem, name), given.labels.get(name)
    words = name if label is None else f"{label.name}, {label.words}"
    return f"{words}: {mean:.4g} +- {spread:.3g} {given.problem.model.unit(said_name(name))}".rstrip()
