"""The table of the guide: how large each force is on three orbits, and what leaving it out does to a day."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import piazzi as pz
from tests.earth.test_other_packages import forces

pytestmark = pytest.mark.slow  # one kernel with all forces
PAGE = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "forces.md"
EPOCH = pz.Epoch("2015-05-05T00:00:00 UTC")
# radius (m), inclination and node (deg) of circular orbits
ORBITS = {"LEO": (6878e3, 51.6, 40.0), "MEO": (26560e3, 55.0, 40.0), "GEO": (42164e3, 0.1, 40.0)}
ROWS = {
    "field beyond its central term": 0, "field beyond degree 2": 2, "field beyond degree 8": 8,
    "Sun": "sun_on", "Moon": "moon_on",
    "solid tide": "tides_on", "tide by order and frequency": "k1_on", "tide of the pole": "pole_on",
    "Schwarzschild": "relativity_on", "Lense-Thirring": "lense_thirring_on", "de Sitter": "de_sitter_on",
    "sunlight, 0.02 m²/kg": "radiation_on", "air, 0.02 m²/kg": "drag_on",
}  # fmt: skip


def state(orbit):
    radius, inclination, node = ORBITS[orbit]
    i, n = np.radians([inclination, node])
    speed = np.sqrt(3.986004415e14 / radius)
    along = np.array([-np.sin(n) * np.cos(i), np.cos(n) * np.cos(i), np.sin(i)])
    return np.concatenate([radius * np.array([np.cos(n), np.sin(n), 0.0]), speed * along])


@cache
def problem(orbit, without=None):
    f = forces(20 if without is None or isinstance(without, str) else without)
    return pz.Problem(
        forces(20).model(),
        pz.Gaussian(state(orbit), [1.0] * 6),
        parameters={**f.values, "cr_a_m": 0.02, "cd_a_m": 0.02} | ({without: 0.0} if isinstance(without, str) else {}),
        integrator=pz.RungeKutta8(720),
        functions=f.functions(EPOCH),
        epoch=EPOCH,
        prior_time=0.0,
    )


def measured(orbit, without):
    """The largest acceleration of four hours, and metres after a day, of one force."""
    full, bare, start = problem(orbit), problem(orbit, without), state(orbit)
    sizes = []
    x = start
    for k in range(12):
        sizes.append(np.linalg.norm(full.dynamics(x, 1200.0 * k)[3:] - bare.dynamics(x, 1200.0 * k)[3:]))
        x = full.step(x, 1200.0, 1200.0 * k)[0]
    ends = [p.step(start, 86400.0, 0.0)[0][:3] for p in (full, bare)]
    return max(sizes), np.linalg.norm(ends[0] - ends[1])


def table():
    lines = ["| force | " + " | ".join(f"{o}, m/s² | {o}, a day" for o in ORBITS) + " |", "|---" * 7 + "|"]
    for name, without in ROWS.items():
        cells = []
        for orbit in ORBITS:
            size, metres = measured(orbit, without)
            cells += [
                f"{size:.0e}" if size > 1e-15 else "none",
                f"{metres:.2g} m" if metres < 1e3 else f"{metres / 1e3:.2g} km",
            ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def test_the_guide_has_the_sizes_of_forces():
    assert table() in PAGE.read_text(encoding="utf-8")


if __name__ == "__main__":
    print(table())
