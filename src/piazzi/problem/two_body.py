"""Whether a model has an orbit, and whether it is two-body motion, so that Kepler's closed form may stand for its dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import hypot, isclose

from piazzi.expressions import evaluate
from piazzi.kernels import Kepler
from piazzi.model import Model
from piazzi.model.values import with_values
from piazzi.text import nearest

# where equations are compared, in units of the prior's distance: near and far, so that forces of any reach show
_SCALES = (1.0, 0.3, 30.0)
_DIRECTIONS = ((0.83, -0.41, 0.38), (-0.29, 0.71, 0.64), (0.57, 0.62, -0.54))


def check_orbit_axes(model: Model) -> None:
    """Raise ValueError unless the model has groups position and velocity of two or three states each."""
    sizes = {g: len(members) for g, members in model.groups}
    r, v = sizes.get("position"), sizes.get("velocity")
    if r != v or r not in (2, 3):
        found = ", ".join(f"{g} ({n})" for g, n in sizes.items()) or "none"
        raise ValueError(
            f"axes of the orbit need groups position and velocity of two or three states each; the groups of the model: {found}"
        )


def check_two_body(model: Model, kepler: Kepler, numbers: Mapping[str, float]) -> None:
    """Raise ValueError unless the dynamics are Kepler's motion; `numbers` has values of states and parameters."""
    position, _ = kepler.axes(dict(model.groups))
    distance = hypot(*(numbers.get(s, 1.0) for s in position))
    where = departure(model, kepler, tuple((name, float(value)) for name, value in numbers.items()), distance)
    if where:
        raise ValueError(f"integrator Kepler does not fit: {where}")


@lru_cache(maxsize=64)
def departure(model: Model, kepler: Kepler, values: tuple[tuple[str, float], ...], distance: float) -> str:
    """Why Kepler's motion is not that of the model with these parameters, "" where it is; at some points, to rounding.

    Raises
    ------
    ValueError
        Where the model has no such position, velocity or gravitational parameter.
    """
    position, velocity = kepler.axes(dict(model.groups))
    mu = _gravity(model, kepler, position, velocity)
    for scale, direction in zip(_SCALES, _DIRECTIONS, strict=True):
        point = dict(values) | {"t": 1.7 * scale}
        point |= {s: point.get(s, 0.0) + 0.37 for s in model.states if s != mu}
        point |= {s: scale * distance * (direction[i] if i < 3 else 0.2) for i, s in enumerate(position)}
        strength = point[mu] if isinstance(mu, str) else mu
        r = hypot(*(point[s] for s in position))
        speed = (abs(strength) / r) ** 0.5
        point |= {s: speed * direction[(i + 1) % 3] for i, s in enumerate(velocity)}
        expected = dict.fromkeys(model.states, 0.0)
        expected |= {s: point[v] for s, v in zip(position, velocity, strict=True)}
        expected |= {v: -strength * point[s] / r**3 for s, v in zip(position, velocity, strict=True)}
        point = with_values(point, model.definitions)
        for state, equation in zip(model.states, model.dynamics, strict=True):
            found = evaluate(equation, point)
            if not isclose(found, expected[state], rel_tol=1e-12, abs_tol=0.0):
                at = ", ".join(f"{s} = {point[s]:g}" for s in (*position, *velocity))
                return f"the rate of {state!r} is {found:g} at {at}, where two-body motion has {expected[state]:g}"
    return ""


def _gravity(model: Model, kepler: Kepler, position: tuple[str, ...], velocity: tuple[str, ...]) -> str | float:
    """Name or value of the gravitational parameter; raises ValueError where names do not fit."""
    states = (*position, *velocity)
    for state in states:
        if state not in model.states:
            raise ValueError(f"Kepler names {state!r}, which is not a state{nearest(state, model.states)}")
    if len(position) != len(velocity) or len(set(states)) != len(states):
        raise ValueError(f"Kepler needs as many velocities as positions: {', '.join(position)}; {', '.join(velocity)}")
    known = (*model.states, *model.parameter_names)
    if isinstance(kepler.mu, str) and kepler.mu not in known:
        raise ValueError(f"Kepler's mu is {kepler.mu!r}, which is not a parameter{nearest(kepler.mu, model.parameter_names)}")
    return kepler.mu
