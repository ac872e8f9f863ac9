"""Observability as tables."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from piazzi.evaluate.grids import Grid, as_html, as_rich
from piazzi.evaluate.quantities import display_of, number

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult

    from piazzi.evaluate.observable import Observability


_LISTED = 8  # twins in the table


def grids(found: Observability) -> list[Grid]:
    """The first state with its bounds; the directions with their singular values; the twins."""
    return [_states(found), _directions(found), *([_twins(found)] if found.twins else [])]


def sentences(found: Observability) -> list[str]:
    """The verdict, and what further stations would change, one sentence a line."""
    out = _split(found.verdict)
    if found.added is not None:
        names = ", ".join(s.name for s in found.added.problem.stations[len(found.problem.stations) :])
        out.append(f"With {names} too:")
        out += [line for line in _split(found.added.verdict) if line.startswith(("Observability", "Twin"))]
    return out


def html(found: Observability) -> str:
    """Tables and verdict for a notebook; all text is escaped."""
    return as_html(grids(found), sentences(found))


def render(found: Observability, console: Console, options: ConsoleOptions) -> RenderResult:
    """Tables and verdict for rich."""
    from rich.text import Text

    for grid in grids(found):
        yield from as_rich(grid, console, options)
    for line in sentences(found):
        yield Text(line)


def _split(text: str) -> list[str]:
    return re.split(r"(?<=[.:]) (?=[A-Z])", text)


def _states(found: Observability) -> Grid:
    model, more = found.problem.model, found.added
    heads = ["state", f"first state\n({found.about})", "prior sigma", "Cramer-Rao\nsigma"]
    heads += [] if found.without_noise is None else ["without\nprocess noise"]
    heads += [] if more is None else ["with the\nfurther stations"]
    rows = []
    sigma = np.sqrt(np.diag(found.problem.covariance))
    for i, name in enumerate(model.names):
        show = display_of(model.unit(name), [found.state[i]])
        values = [found.state[i], sigma[i], found.crlb_sigma[i]]
        values += [] if found.without_noise is None else [found.without_noise.crlb_sigma[i]]
        values += [] if more is None else [more.crlb_sigma[i]]
        rows.append((name, *(number(float(v) * show.factor, 4) for v in values), show.unit))
    return Grid("First state, and how well the measurements alone determine it", (*heads, "unit"), tuple(rows))


def _directions(found: Observability) -> Grid:
    names, more = found.problem.model.names, found.added
    heads = ["", "singular\nvalue", *names]
    rows = [_direction(v, d) for v, d in zip(found.singular_values, found.information.directions, strict=True)]
    if more is not None:
        heads.insert(2, "with the\nfurther stations")
        rows = [(*row[:2], number(float(v), 4), *row[2:]) for row, v in zip(rows, more.singular_values, strict=True)]
    rows[0], rows[-1] = ("best seen", *rows[0][1:]), ("worst seen", *rows[-1][1:])
    return Grid("Directions of the first state, in prior sigmas, and their information", tuple(heads), tuple(rows))


def _direction(value: float, direction: np.ndarray[tuple[int], np.dtype[np.float64]]) -> tuple[str, ...]:
    return ("", number(float(value), 4), *(f"{c:+.3f}" for c in direction))


def _twins(found: Observability) -> Grid:
    names = found.problem.model.names
    rows = []
    for i, twin in enumerate(found.twins[:_LISTED]):
        distance = "-" if twin.prior_distance is None else number(twin.prior_distance, 3)
        rows.append((str(i + 1), number(twin.misfit, 2), distance, *(number(float(v), 5) for v in twin.state)))
    heads = ("twin", "misfit\n[sigma]", "from prior\n[sigma]", *names)
    return Grid("Other first states with (nearly) the same measurements", heads, tuple(rows))
