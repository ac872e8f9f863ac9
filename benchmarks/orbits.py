"""A low orbit as Piazzi has it and as the floor has it: the same field, places of Sun and Moon, and first state."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from floor.space import SpaceFloor

import piazzi as pz
from piazzi import earth, kernels
from piazzi.earth.constants import ASTRONOMICAL_UNIT, EARTH_SPIN, GM, SOLAR_PRESSURE, SUN_RADIUS
from piazzi.earth.force_air import air
from piazzi.earth.force_text import EARTH_RADIUS, FLATTENING
from piazzi.kernels.spec import KernelSpec
from piazzi.kernels.tables import table_source
from piazzi.model import Model
from piazzi.outside.pieces import Pieces, fitted

DAY = 86400.0
EPOCH = "2016-02-13T00:00:00 UTC"
HEIGHT, AREA_MASS, CD, CR = 500e3, 0.01, 2.2, 1.3
PIECE, TERMS = 900.0, 8  # of the floor's table
ORBIT = (6878137.0, 0.001, 97.4, 0.7, 0.4)  # semi-major axis, eccentricity, inclination in degrees, node and argument in rad

CALLS = """
@entry
def call_value(K: int, place: Array, data: Array, out: Array) -> None:
    x, y, z = place[0], place[1], place[2]
    for k in range(K):
        a = gravity(x, y, z, data, 0)
        x += 1e-3 * a[0]
        z += 1e-3 * a[2]
    out[0] = x


@entry
def call_partials(K: int, place: Array, data: Array, out: Array) -> None:
    x, y, z = place[0], place[1], place[2]
    for k in range(K):
        a = gravity_partials(x, y, z, data, 0)
        x += 1e-3 * a[0]
        z += 1e-3 * a[2] + 1e-9 * a[3]
    out[0] = x


@entry
def call_lanes(K: int, place: Array, data: Array, out: Array) -> None:
    v = load_packs(place, 0, 3, 8)
    x, y, z = v[0], v[1], v[2]
    for k in range(K):
        a = gravity_partials(x, y, z, data, 0)
        x = x + 1e-3 * a[0]
        z = z + 1e-3 * a[2] + 1e-9 * a[3]
    store_packs(out, 0, vector(x, y, z), 8)
"""
LOOK_UP = """
@entry
def look_up(K: int, data: Array, out: Array) -> None:
    s = 0.0
    for k in range(K):
        v = table_3x{terms}(100.0 + s, data, 0)
        s = 1e-9 * v[0]
    out[0] = s
"""


@cache
def field(degree: int) -> Any:
    """EGM2008 to this degree, as the floor takes it too."""
    return earth.Gravity("EGM2008", degree=degree)


@cache
def calls() -> Any:
    """Compiled loops of calls of the field and of a table of three columns, each waiting for the one before."""
    text = table_source(3, TERMS) + LOOK_UP.format(terms=TERMS)
    with kernels.fragment("calls_of_field", CALLS), kernels.fragment("calls_of_table", text):
        fragments = ("function_gravity", "calls_of_field", "calls_of_table")
        return kernels.load(KernelSpec(Model(["x"], ["0"], [], discrete=True), kernels.Discrete().scheme, fragments, 8))


@cache
def vector_table() -> Pieces:
    """Where the Sun is over a day, in as many pieces and terms as the floor's table."""
    return fitted(lambda t: surroundings(t)[:, 9:12], -7200.0, PIECE, 112, TERMS)


def surroundings(t: np.ndarray) -> np.ndarray:
    """Rotation by rows, Sun, Moon, and zero, (times, 16)."""
    epochs = [earth.Epoch(EPOCH) + s for s in t.tolist()]
    parts = [earth.rotation("GCRF", "ITRF", epochs).reshape(-1, 9), *(earth.body(b, epochs)[0] for b in ("sun", "moon"))]
    return np.concatenate([*parts, np.zeros((len(t), 1))], axis=1)


@cache
def first_state() -> np.ndarray:
    """Position and velocity at t = 0, at the pericentre."""
    a, e, degrees, node, argument = ORBIT
    i, mu = math.radians(degrees), field(2).field.gm
    r, v = a * (1 - e), math.sqrt(mu * (1 + e) / (a * (1 - e)))
    (co, so), (cn, sn), (ci, si) = ((math.cos(w), math.sin(w)) for w in (argument, node, i))
    P = np.array([cn * co - sn * so * ci, sn * co + cn * so * ci, so * si])
    Q = np.array([-cn * so - sn * co * ci, -sn * so + cn * co * ci, co * si])
    return np.concatenate([r * P, v * Q])


@cache
def floor(degree: int, every: bool, gradient_degree: int | None = None) -> SpaceFloor:
    """The orbit by hand; `every` force, or the field with Sun and Moon."""
    density, scale = air(HEIGHT)
    numbers = {"mu_sun": GM["sun"], "mu_moon": GM["moon"], "earth_radius": EARTH_RADIUS, "flattening": FLATTENING}
    numbers |= {"spin": EARTH_SPIN, "density": density, "height": HEIGHT, "scale": scale, "area_mass": AREA_MASS}
    numbers |= {"drag_coefficient": CD, "reflectivity": CR, "pressure": SOLAR_PRESSURE, "au": ASTRONOMICAL_UNIT}
    numbers |= {"sun_radius": SUN_RADIUS}
    start, count = -7200.0, int((DAY + 4 * 3600) / PIECE) + 1
    coefficients = np.ascontiguousarray(fitted(surroundings, start, PIECE, count, TERMS).coefficients)
    own, gradient = field(degree).field, degree if gradient_degree is None else gradient_degree
    return SpaceFloor(own, degree, gradient, start, PIECE, coefficients, first_state(), True, every, every, numbers)


@cache
def problem(degree: int, every: bool, gradient_degree: int | None = None) -> pz.Problem:
    """The orbit as a problem; with `every` force, the coefficients of drag and radiation are estimated."""
    chosen: dict[str, Any] = (
        {"radiation": "cannonball", "shadows": ("earth",), "drag": "exponential", "air_height": HEIGHT} if every else {}
    )
    forces = earth.Forces(
        degree=degree, gradient_degree=gradient_degree, bodies=("sun", "moon"), relativity=False, tides=(), **chosen
    )
    roles = dict.fromkeys(("cd_a_m", "cr_a_m"), "estimated") if every else {}
    values: dict[str, Any] = dict(forces.values)
    if every:
        values |= {"cd_a_m": pz.Gaussian(CD * AREA_MASS, 1e-6), "cr_a_m": pz.Gaussian(CR * AREA_MASS, 1e-6)}
    epoch = earth.Epoch(EPOCH)
    prior = pz.Gaussian.from_sigma(first_state(), [100.0] * 3 + [0.1] * 3)
    return pz.Problem(
        forces.model(parameters=roles),
        prior,
        parameters=values,
        integrator=pz.RungeKutta8(max_step=60.0),
        prior_time=0.0,
        epoch=epoch,
        functions=forces.functions(epoch),
    )


def propagation(case: pz.Problem, integrator: Any, seconds: float) -> Callable[[], Any]:
    """A run of an arc from the first state over so many seconds, with its transition matrix."""
    moving, times = replace(case, integrator=integrator), np.array([0.0, seconds])
    return lambda: moving.arc(times)
