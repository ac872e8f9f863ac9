"""States of a determination over a span, with their covariances, as others take them."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.determination.words import date
from piazzi.earth import Epoch
from piazzi.earth.rotation import frame_named
from piazzi.formats import Arc, Ephemeris
from piazzi.units import positive_duration

STEP, DAILY = 60.0, 86400.0  # s, of an orbit about the Earth and about the Sun
MOST_STATES = 200_000


def dates_of(found: Any, span: Any) -> tuple[Epoch, Epoch]:
    """The two ends of ``"first .. last+3d"``; default the rows that were used, and the answer.

    Raises
    ------
    ValueError
        For what cannot be read.
    """
    times = found.setup.tracking.row_times[found.keep]
    zero = found.setup.measured.epoch
    first, last = zero + float(times.min()), zero + float(times.max())
    if span is None:
        return min(first, found.epoch), max(last, found.epoch)
    ends = span.split("..") if isinstance(span, str) else list(span)
    if len(ends) != 2:
        raise ValueError(f'--span {span!r}: write two ends with .. between them, as "first .. last+3d"')
    begin, end = (end_of(one, first, last, default) for one, default in zip(ends, (first, last), strict=True))
    if end < begin:
        raise ValueError(f"--span {span!r}: it ends before it begins")
    return begin, end


def end_of(text: Any, first: Epoch, last: Epoch, default: Epoch) -> Epoch:
    """One end of a span: first, last, either with a length of time added or taken off, or a date."""
    if isinstance(text, Epoch):
        return text
    plain = str(text or "").strip()
    if not plain:
        return default
    for word, base in (("first", first), ("last", last)):
        if plain.startswith(word):
            rest = plain.removeprefix(word).strip()
            if not rest:
                return base
            if rest[0] in "+-":
                length = positive_duration(rest[1:], f"--span: {word}")
                return base + (length if rest[0] == "+" else -length)
    return date(plain, "--span")


def check_span(span: Any) -> None:
    """Raise ValueError for a span that cannot be read, before there is a result."""
    if span is None:
        return
    zero, soon, late = Epoch.at(0.0), Epoch.at(1.0), Epoch.at(1e10)
    ends = span.split("..") if isinstance(span, str) else list(span)
    if len(ends) != 2:
        raise ValueError(f'--span {span!r}: write two ends with .. between them, as "first .. last+3d"')
    told = [[end_of(one, zero, last, usual) for one, usual in zip(ends, (zero, last), strict=True)] for last in (soon, late)]
    if all(end < begin for begin, end in told):
        raise ValueError(f"--span {span!r}: it ends before it begins")


def ephemeris(
    found: Any, span: Any = None, step: float | None = None, frame: str | None = None, *, formal: bool | None = None
) -> Ephemeris:
    """States and covariances over a span, every `step` seconds (default 60) from its beginning, its end too.

    What is not given is what the case says.
    """
    begin, end = dates_of(found, found.case.span if span is None else span)
    usual = STEP if found.setup.measured.about == "earth" else DAILY
    width = found.case.step or usual if step is None else float(step)
    if not width > 0:
        raise ValueError(f"--step is {width:g} s; it must be positive")
    length = end - begin
    if length / width > MOST_STATES:
        raise ValueError(
            f"--span with --step {width:g} s makes {length / width:,.0f} states; at most {MOST_STATES:,} are written"
        )
    t = width * np.arange(int(length / width + 1e-9) + 1)
    t = np.append(t, length) if length - t[-1] > 1e-6 else t
    return Ephemeris(arcs=(arc_of(found, begin, t, frame, formal),), format="OEM")


def one_state(found: Any, formal: bool | None = None) -> Arc:
    """The answer as an arc of one state."""
    return arc_of(found, found.epoch, np.zeros(1), None, formal)


def arc_of(found: Any, begin: Epoch, t: Any, frame: str | None, formal: bool | None) -> Arc:
    """States at times past a date, with their covariances, in the axes of products or others."""
    case = found.case
    axes = frame or case.axes
    orbit = found.orbit if axes is None else found.orbit.to(frame_named(axes))
    mean, roots = orbit.states([begin + float(x) for x in t])
    own = _covered(np.asarray(t), case.covariance_step)
    roots = roots[own] * (1.0 if is_formal(found, formal) else inflation(found))
    method, degree = case.interpolation or (None, None)
    spacecraft = {"mass": case.mass, "drag_area": case.area, "radiation_area": case.area}
    return Arc(
        epoch=begin, t=t, position=mean[:, :3], velocity=mean[:, 3:], name=found.object or "UNKNOWN",
        identifier=case.identifier or "", centre=found.setup.measured.about.upper(), frame=orbit.frame,
        scale=scale_of(found), covariance_t=t[own],
        covariance=roots @ np.swapaxes(roots, 1, 2), covariance_frames=(orbit.frame,) * int(own.sum()),
        interpolation=method, degree=degree,
        spacecraft=tuple((name, value) for name, value in spacecraft.items() if value is not None),
    )  # fmt: skip


def _covered(t: Any, step: float | None) -> Any:
    """Which of the times have a covariance: the first, the last, and between them one at least every `step` seconds."""
    if step is None or len(t) < 2:
        return np.ones(len(t), dtype=np.bool_)
    turn = np.floor((t - t[0]) / step + 1e-9)
    own = np.append(True, turn[1:] > turn[:-1])
    own[-1] = True
    return own


def is_formal(found: Any, formal: bool | None = None) -> bool:
    """Whether covariances are written as computed, where the verdict calls them too small."""
    return bool(found.case.covariance == "formal" if formal is None else formal)


def inflation(found: Any) -> float:
    """What sigmas are multiplied by where the verdict says that they are too small."""
    honest = found.verdict["honest"]
    return float(honest.figure) if honest.ok is False and honest.figure and honest.figure > 1.0 else 1.0


def scale_of(found: Any) -> str:
    """The time scale of dates in products."""
    return str(found.scale) if found.scale in ("UTC", "TAI", "TT", "TDB", "GPS", "UT1", "TCG") else "UTC"
