"""Which forces an orbit about the Sun is determined with: the Sun, planets, relativity."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from piazzi.determination.centres import SUN
from piazzi.determination.orbit_forces import ACCELERATION, STEPS, Chosen
from piazzi.earth import ForceChoice, Forces
from piazzi.earth.bodies import SERIES_ERROR
from piazzi.earth.defaults import forces_of, named_values
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array

DRAWING = ("venus", "earth", "mars", "jupiter", "saturn")  # whose places by series are good enough to be worth it


def forces_about_the_sun(given: Any, state: Array) -> Chosen:
    """The forces for an orbit about the Sun, (6,) of the ICRF.

    Parameters
    ----------
    given : "default", "none" (two bodies), words, or `earth.Forces`.  By default all planets draw it where a kernel is named;
        without one those that move it most, by series.

    Raises
    ------
    ValueError
        For forces that there are not.
    """
    choice = _choice(given)
    forces = choice.forces
    if forces.about != "sun":
        raise ValueError("--forces: these are about the Earth, and the orbit goes about the Sun")
    facts = {
        "source": choice.source, "gravity": "the Sun", "degree": 0, "bodies": list(forces.bodies), "tides": [],
        "relativity": bool(forces.relativity), "radiation": None, "drag": None, "empirical": list(forces.nongravitational),
    }  # fmt: skip
    open_ = {text.partition(" = ")[0] for text in choice.assumed}
    free = [name for name in forces.nongravitational if name in open_]
    values = dict(choice.values) | {name: Gaussian(0.0, ACCELERATION**2) for name in free}
    told = [text for text in choice.assumed if text.partition(" = ")[0] not in free]
    told += [f"{name} is estimated, before the measurements 0 +- {ACCELERATION:g} m/s2" for name in free]
    if forces.bodies and choice.kernel is None:
        worst = max(forces.bodies, key=lambda name: SERIES_ERROR[name])
        told.append(
            f"places of planets are by series, off by up to {SERIES_ERROR[worst]:,} km ({worst}); kernel=FILE says better"
        )
    step = SUN.longest_step(state[:3], state[3:6], STEPS)
    return Chosen(choice, dict.fromkeys(free, "estimated"), values, facts, step, {}, tuple(told))


def _choice(given: Any) -> ForceChoice:
    if isinstance(given, (Forces, ForceChoice)):
        return given if isinstance(given, ForceChoice) else ForceChoice(given, "given")
    words = ("default" if given is None else str(given)).split()
    if words == ["none"]:
        return ForceChoice(Forces(about="sun", bodies=(), relativity=False), "two bodies")
    try:
        table = named_values(words[words[:1] == ["default"] :])
        base = {"about": "sun"} | ({} if "kernel" in table else {"bodies": DRAWING})
        return forces_of(table, Path(), "as given" if table else "default about the Sun", base)
    except ValueError as error:
        raise ValueError(f"--forces: {str(error).removeprefix('forces: ')}") from None
