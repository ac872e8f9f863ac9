"""The picture that `plot` of a determination draws."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from piazzi.determination import figures
from piazzi.determination.page.places import station_rows
from piazzi.determination.page.sampled import sampled
from piazzi.determination.residuals import table
from piazzi.text import nearest

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PICTURES = ("residuals", "sigma", "orbit", "ground-track", "sky")


def plot(found: Any, ax: Axes | None, what: str, which: str | None) -> Axes:
    """Draw one picture of a determination; raises ValueError for what there is not."""
    from matplotlib import pyplot

    if what not in PICTURES:
        raise ValueError(f"unknown picture {what!r}{nearest(what, PICTURES)}")
    if ax is None:
        polar = {"projection": "polar"} if what == "sky" else {}
        ax = pyplot.subplots(layout="constrained", subplot_kw=polar)[1]
    if what == "residuals":
        kinds = list(dict.fromkeys(table(found)["component"].tolist()))
        return figures.residuals(ax, found, _one_of(which, kinds, "kind"))
    path = sampled(found)
    if path is None:
        raise ValueError(f"there is no orbit to draw: {found.message}")
    if what == "sigma":
        return figures.sigmas(ax, found, path)
    if what == "orbit":
        plane, mu = _one_of(which, ["xy", "yz", "xz", "space"], "plane"), found.setup.measured.centre.mu
        return figures.aslant(ax, path, mu) if plane == "space" else figures.view(ax, path, mu, *map("xyz".index, plane))
    rows = station_rows(found, path)
    if what == "ground-track":
        return figures.ground_track(ax, path, rows)
    seen = {one.label: one for one in rows if one.azimuth is not None}
    if not seen:
        raise ValueError("no station of it stands on the ground")
    return figures.sky(ax, seen[_one_of(which, list(seen), "station")])


def _one_of(given: str | None, known: list[str], what: str) -> str:
    """The given one, or the first; raises ValueError for one that is not known."""
    if given is not None and given not in known:
        raise ValueError(f"unknown {what} {given!r}{nearest(given, known)}")
    return known[0] if given is None else given
