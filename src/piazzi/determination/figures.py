"""Pictures of a determination for papers: no titles, units in labels, colours that every eye tells apart."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.determination.orbit import TILT
from piazzi.determination.page.charts import RTN, passes_of, spans
from piazzi.determination.page.ecliptic import FARTHEST, ellipse
from piazzi.determination.page.places import station_rows
from piazzi.determination.page.sampled import Sampled, sampled
from piazzi.determination.residuals import table
from piazzi.earth.constants import ASTRONOMICAL_UNIT
from piazzi.evaluate.quantities import display_of, fine
from piazzi.io.atomic import atomic_path
from piazzi.present.colours import MEASURED, PLANET, station_colour
from piazzi.present.figures.space import UNIT_CIRCLE
from piazzi.present.figures.style import plain, plain_ticks, time_axis
from piazzi.present.land import land
from piazzi.present.report.blocks import Rows
from piazzi.problem.checks import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("pdf", "svg", "png", "pgf")
_RADIUS = 6378137.0
_BLUE = "#0072B2"
_ASIDE = (40.0, 25.0)  # azimuth and height from which an orbit is seen aslant
_LENGTHS = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72.27}
_RC: Any = {
    "font.size": 8.0, "axes.labelsize": 8.0, "xtick.labelsize": 7.0, "ytick.labelsize": 7.0, "legend.fontsize": 7.0,
    "legend.frameon": False, "axes.spines.top": False, "axes.spines.right": False, "lines.linewidth": 1.0,
    "axes.linewidth": 0.6, "pdf.fonttype": 42, "svg.hashsalt": "piazzi",
}  # fmt: skip
_ABOVE: Any = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0)}
_METADATA: dict[str, dict[str, Any]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}


def figures(found: Any, folder: Any, formats: Any = "pdf", width: Any = "88mm") -> list[Path]:
    """Write the pictures of a determination; returns their paths.

    Parameters
    ----------
    found : Determination
    folder : made where it is not there
    formats : of pdf, svg, png and pgf, as names or as text with commas; pgf needs LaTeX
    width : of every picture, text with mm, cm, in or pt, or a number of mm

    Raises
    ------
    ValueError
        For a format or width that is none, and for pgf without LaTeX.
    OSError
        Where it cannot be written.
    """
    from matplotlib import rc_context

    kinds, size = formats_of(formats), width_of(width)
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    out = []
    with rc_context(_RC):
        for name, figure in drawn(found, size / 25.4):
            for kind in kinds:
                path = target / f"{name}.{kind}"
                with atomic_path(path) as work:
                    figure.savefig(work, format=kind, dpi=300, metadata=_METADATA.get(kind))
                out.append(path)
    return out


def formats_of(given: Any) -> tuple[str, ...]:
    """Names of formats; raises ValueError for one that is none, or cannot be made here."""
    names = [name.strip().lower() for name in (given.split(",") if isinstance(given, str) else given)]
    for name in names:
        if name not in FORMATS:
            raise ValueError(f"--format {name[:40]!r}: pictures are written as {', '.join(FORMATS)}")
    if "pgf" in names:
        from matplotlib import rcParams

        if shutil.which(rcParams["pgf.texsystem"]) is None:
            raise ValueError(f"--format pgf needs {rcParams['pgf.texsystem']}, which measures the text; pdf and svg do not")
    if not names:
        raise ValueError("--format: name one of " + ", ".join(FORMATS))
    return tuple(dict.fromkeys(names))


def width_of(given: Any) -> float:
    """A width in millimetres; raises ValueError for what is none."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(mm|cm|in|pt)?\s*", str(given))
    size = float(match[1]) * _LENGTHS[match[2] or "mm"] if match else 0.0
    if not 20.0 <= size <= 1000.0:
        raise ValueError(f"--width {str(given)[:40]!r}: a width between 20 mm and 1 m, such as 88mm or 3.5in")
    return size


def drawn(found: Any, width: float) -> Iterator[tuple[str, Figure]]:
    """Names and figures of a width in inches, one at a time."""
    path, columns = sampled(found), table(found)
    rows = station_rows(found, path)
    if np.isfinite(columns["o_minus_c"]).any():
        for kind in dict.fromkeys(columns["component"].tolist()):
            yield f"residuals-{kind.replace('_', '-')}", _one(width, 0.62, partial(residuals, found=found, kind=kind))
    if path is None:
        return
    if (path.sigmas[path.measured] > 0).any():
        yield "sigma", _one(width, 0.62, partial(sigmas, found=found, path=path))
    yield "orbit", _sides(width, path, found.setup.measured.centre.mu)
    if path.about == "earth":
        yield "ground-track", _one(width, 0.55, partial(ground_track, path=path, rows=rows))
    for one in rows:
        if one.azimuth is not None:
            name = re.sub(r"[^\w.+-]+", "_", one.label).strip(".") or "station"
            yield f"sky-{name}", _one(width, 1.0, partial(sky, rows=one), projection="polar")


def _figure(width: float, share: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, share * width), layout="constrained")


def _one(width: float, share: float, draw: Callable[[Axes], Axes], **options: Any) -> Figure:
    figure = _figure(width, share)
    draw(figure.add_subplot(**options))
    return figure


def residuals(ax: Axes, found: Any, kind: str) -> Axes:
    """Observed minus computed of one kind against time, a colour for each station, crosses for what was not used."""
    columns = table(found)
    own = (columns["component"] == kind) & np.isfinite(columns["o_minus_c"])
    used, left = own & columns["used"], own & ~columns["used"]
    size = columns["o_minus_c"][used if used.any() else own]
    show = fine(str(columns["unit"][own][0]), float(np.sqrt(np.mean(size**2))))
    time = time_axis(ax, found.estimate.times, found.setup.measured.epoch, found.scale)
    names = list(dict.fromkeys(columns["station"].tolist()))
    for i, name in enumerate(names):
        here = used & (columns["station"] == name)
        if here.any():
            x, y = columns["t"][here] * time.factor, columns["o_minus_c"][here] * show.factor
            ax.plot(x, y, ".", ms=2.5, color=station_colour(i), label=plain(name))
    half = 1.2 * float(np.abs(size).max()) * show.factor or 1.0
    if left.any():
        y = np.clip(columns["o_minus_c"][left] * show.factor, -0.95 * half, 0.95 * half)
        ax.plot(columns["t"][left] * time.factor, y, "x", ms=3.5, mew=0.8, color=MEASURED, label="not used")
    ax.axhline(0, color=MEASURED, lw=0.5)
    ax.set_ylim(-half, half)
    ax.set_ylabel(show.label(f"O-C of {kind.replace('_', ' ')}"))
    if 1 < len(names) + int(left.any()) <= 8:
        ax.legend(
            ncols=min(len(names) + 1, 4), loc="lower center", bbox_to_anchor=(0.5, 1.0), handletextpad=0.1, columnspacing=0.8
        )
    return ax


def sigmas(ax: Axes, found: Any, path: Sampled) -> Axes:
    """Standard deviations of position along R, T and N against time; grey while a station measures."""
    time = time_axis(ax, found.estimate.times, found.setup.measured.epoch, found.scale)
    known = path.measured
    show = display_of("m", [float(np.median(path.sigmas[known, :3]))])
    for i, (label, colour) in enumerate(RTN):
        style = ("-", "--", ":")[i]
        ax.plot(path.times[known] * time.factor, path.sigmas[known, i] * show.factor, style, color=colour, label=label[0])
    columns = table(found)
    for start, stop in spans(passes_of(found, columns), columns).tolist():
        ax.axvspan(start * time.factor, stop * time.factor, color="#E4E4E4", lw=0, zorder=0)
    ax.set_yscale("log")
    plain_ticks(ax)
    ax.set_ylabel(show.label("sigma of position"))
    ax.legend(ncols=3, **_ABOVE)
    return ax


def _sides(width: float, path: Sampled, mu: float) -> Figure:
    """The orbit from three sides, with equal scales and shared axes, and from aslant."""
    figure = _figure(width, 1.0)
    axes = figure.subplots(2, 2)
    for ax, (i, j) in zip((axes[0, 0], axes[0, 1], axes[1, 0]), ((0, 1), (2, 1), (0, 2)), strict=True):
        view(ax, path, mu, i, j)
    aslant(axes[1, 1], path, mu)
    return figure


def _lines(path: Sampled, mu: float) -> tuple[list[tuple[Array, Any]], float, str]:
    """Lines (P, 3) with their looks, half of what must be seen, and the unit: 1000 km, or AU along the axes of the ecliptic."""
    if path.about == "earth":
        place = path.mean[:, :3] / 1e6
        return [(place, {"color": _BLUE, "lw": 0.8})], 1.08 * max(_RADIUS / 1e6, float(np.abs(place).max())), "1000 km"
    whole = ellipse(path.mean[len(path.mean) // 2], mu)
    place, own = (line @ TILT.T / ASTRONOMICAL_UNIT for line in (path.mean[:, :3], whole))
    earth = np.column_stack([UNIT_CIRCLE, np.zeros(len(UNIT_CIRCLE))])
    lines = [(earth, {"color": MEASURED, "lw": 0.5}), (place, {"color": _BLUE, "lw": 1.4})]
    if len(own) and np.abs(own).max() < FARTHEST * np.abs(place).max():
        lines.insert(0, (own, {"color": _BLUE, "lw": 0.5}))
    return lines, 1.08 * max(float(np.abs(line).max()) for line, _ in lines), "AU"


def view(ax: Axes, path: Sampled, mu: float, i: int, j: int) -> Axes:
    """The orbit in the plane of two axes, with the Earth to scale; about the Sun with its ellipse, and 1 AU for the Earth."""
    lines, half, unit = _lines(path, mu)
    axes = np.eye(3)[[i, j]]
    _seen(ax, path, lines, axes, np.cross(*axes))
    ax.set_xlim(-half, half)
    ax.set_ylim(-half, half)
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlabel(f"{'xyz'[i]} [{unit}]")
    ax.set_ylabel(f"{'xyz'[j]} [{unit}]")
    return ax


def aslant(ax: Axes, path: Sampled, mu: float) -> Axes:
    """The orbit from above and aside, in space, with the directions of the axes."""
    lines, half, _ = _lines(path, mu)
    a, e = np.radians(_ASIDE)
    axes = np.array([[-np.sin(a), np.cos(a), 0.0], [-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)]])
    _seen(ax, path, lines, axes, np.cross(*axes))
    for name, (x, y) in zip("xyz", axes.T * 0.95 * half, strict=True):
        ax.annotate(
            name, (0, 0), (float(x), float(y)), ha="center", va="center", fontsize=7,
            arrowprops={"arrowstyle": "<-", "lw": 0.5, "color": MEASURED}, zorder=1,
        )  # fmt: skip
    ax.set_xlim(-1.15 * half, 1.15 * half)
    ax.set_ylim(-1.15 * half, 1.15 * half)
    ax.set_aspect("equal", adjustable="box")
    ax.set_axis_off()
    return ax


def _seen(ax: Axes, path: Sampled, lines: Sequence[tuple[Array, Any]], axes: Array, towards: Array) -> None:
    """Lines seen along a direction, dotted where they are behind the Earth."""
    from matplotlib.patches import Circle

    radius = _RADIUS / 1e6 if path.about == "earth" else 0.0
    if radius:
        ax.add_patch(Circle((0, 0), radius, color=PLANET, lw=0, zorder=0.5))
    else:
        ax.plot(0, 0, "o", ms=3, color="#E69F00")
    for line, look in lines:
        flat, behind = line @ axes.T, (np.linalg.norm(line @ axes.T, axis=1) < radius) & (line @ towards < 0.0)
        for hidden, dash in ((False, "-"), (True, ":")):
            if (behind == hidden).any():
                ax.plot(*np.where((behind == hidden)[:, None], flat, np.nan).T, dash, **look)


def ground_track(ax: Axes, path: Sampled, rows: Sequence[Rows]) -> Axes:
    """Where the object was overhead, with stations and where it was when they measured."""
    from matplotlib.patheffects import withStroke

    for ring in np.split(land(), np.flatnonzero(np.isnan(land()[:, 0])) + 1):
        for by in (-360.0, 0.0, 360.0) if len(ring) else ():
            ax.fill(*_closed(ring[:-1], by).T, color=PLANET, lw=0)
    longitude, latitude = _degrees(path.place)
    jumps = np.flatnonzero(np.abs(np.diff(longitude)) > 180.0) + 1
    ax.plot(np.insert(longitude, jumps, np.nan), np.insert(latitude, jumps, np.nan), color=MEASURED, lw=0.5)
    name: Any = {"fontsize": 6, "path_effects": [withStroke(linewidth=1.5, foreground="white")], "zorder": 5}
    for one in rows:
        ax.plot(*_degrees(one.place), ".", ms=2.0, color=one.colour)
        if one.site is not None:
            x, y = _degrees(one.site[None, :])
            ax.plot(x, y, "^", ms=4, color=one.colour, mec="white", mew=0.4)
            ax.annotate(plain(one.label), (float(x[0]), float(y[0])), xytext=(3, 2), textcoords="offset points", **name)
    ax.set_xlim(-180, 180)
    ax.set_ylim(-90, 90)
    ax.set_xticks(range(-180, 181, 60))
    ax.set_yticks(range(-90, 91, 45))
    ax.set_xlabel("longitude [deg]")
    ax.set_ylabel("latitude [deg]")
    return ax


def sky(ax: Axes, rows: Rows) -> Axes:
    """What a station saw, on polar axes: the zenith in the middle, north up, east right."""
    polar: Any = ax
    assert rows.azimuth is not None and rows.elevation is not None
    polar.set_theta_zero_location("N")
    polar.set_theta_direction(-1)
    away = 90.0 - np.degrees(rows.elevation)
    used = rows.used == 1.0
    ax.plot(rows.azimuth, away, "-", lw=0.4, color=rows.colour)
    ax.plot(rows.azimuth[used], away[used], ".", ms=3, color=rows.colour)
    ax.plot(rows.azimuth[rows.used == 0.0], away[rows.used == 0.0], "x", ms=3.5, mew=0.8, color=MEASURED)
    polar.set_rlim(0, 90)
    polar.set_rticks([30, 60, 90], ["60°", "30°", ""])
    polar.set_thetagrids([0, 90, 180, 270], ["N", "E", "S", "W"])
    return ax


def _degrees(place: Array) -> tuple[Array, Array]:
    """Longitude and geocentric latitude."""
    return np.degrees(np.arctan2(place[:, 1], place[:, 0])), np.degrees(np.arctan2(place[:, 2], np.hypot(*place[:, :2].T)))


def _closed(ring: Array, by: float) -> Array:
    """A ring without jumps, moved in longitude; one about the pole is closed along the edge of the map."""
    longitude = np.degrees(np.unwrap(np.radians(ring[:, 0])))
    points = np.column_stack([longitude, ring[:, 1]])
    if abs(longitude[-1] - longitude[0]) > 180.0:
        points = np.vstack([points, [longitude[-1], -90.0], [longitude[0], -90.0]])
    out: Array = points + np.array([by, 0.0])
    return out
