"""Axes, heat maps, globes, maps and skies as data of the page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from piazzi.evaluate.quantities import Display
from piazzi.present.report.blocks import Axis, Heat, Rows, Sky, Tab, World
from piazzi.present.report.html import Pool
from piazzi.problem.checks import Array
from piazzi.text import printable


def world_data(world: World, pool: Pool) -> dict[str, Any]:
    """What a globe or a map draws."""
    return {
        "kind": world.view,
        "at": pool.add_exactly(world.times),
        "place": _columns(world.place, pool),
        "covariance": _columns(world.covariance, pool),
        "turned": pool.add(_wrapped(world.turned)),
        "sun": _columns(world.sun, pool),
        "period": world.period,
        "factor": world.factor,
        "start": list(world.start),
        "land": pool.add(world.land),
        "rows": [rows_data(rows, pool) for rows in world.rows],
    }


def sky_data(sky: Sky, pool: Pool) -> dict[str, Any]:
    """What a sky draws."""
    return {"kind": "sky", "rows": rows_data(sky.rows, pool)}


def rows_data(rows: Rows, pool: Pool) -> dict[str, Any]:
    """Measurements of a station."""
    seen = rows.azimuth is not None and rows.elevation is not None
    return {
        "label": printable(rows.label),
        "colour": rows.colour,
        "at": pool.add_exactly(rows.times),
        "place": _columns(rows.place, pool),
        "turned": pool.add(_wrapped(rows.turned)),
        "used": pool.add(rows.used),
        "notes": noted(rows.notes),
        "site": None if rows.site is None else [float(v) for v in rows.site],
        "azimuth": pool.add(rows.azimuth) if seen and rows.azimuth is not None else None,
        "elevation": pool.add(rows.elevation) if seen and rows.elevation is not None else None,
    }


def noted(notes: Sequence[str]) -> dict[str, Any] | None:
    """Different words once each, and which of them each value has; None where there are none."""
    if not any(notes):
        return None
    words = list(dict.fromkeys(notes))
    index = {word: i for i, word in enumerate(words)}
    return {"words": [printable(word) for word in words], "of": [index[note] for note in notes]}


def _columns(values: Array, pool: Pool) -> list[int]:
    return [pool.add(np.ascontiguousarray(column)) for column in values.T]


def _wrapped(angle: Array) -> Array:
    """Within half a turn, so that few digits do."""
    return np.asarray(np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi)


def display_data(show: Display) -> list[Any]:
    """A unit and its factor."""
    return [printable(show.unit), show.factor]


def calendar_data(tab: Tab) -> dict[str, Any] | None:
    """The clock beside the times of a tab, None where they are past no instant."""
    if tab.epoch is None:
        return None
    from piazzi.present.dates import Calendar

    return Calendar(tab.epoch, tab.scale).to_dict(np.zeros(1) if tab.times is None else tab.times)


def axis_data(axis: Axis) -> Mapping[str, Any]:
    """An axis."""
    return {
        "label": printable(axis.label),
        "show": display_data(axis.show),
        "scale": axis.scale,
        "low": axis.low,
        "high": axis.high,
        "threshold": axis.threshold,
        "marks": [[value, printable(words)] for value, words in axis.marks],
    }


def heat_data(heat: Heat) -> dict[str, Any]:
    """What a heat map draws."""
    return {
        "kind": "heat",
        "labels": [printable(label) for label in heat.labels],
        "marks": [[printable(mark) for mark in marks] for marks in heat.marks],
        "measure": printable(heat.measure),
        "cells": [[[*cell[:2], printable(cell[2])] for cell in row] for row in heat.cells],
    }
