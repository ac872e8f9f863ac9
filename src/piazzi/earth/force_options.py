"""What the forces may be given, about the Earth and about the Sun."""

from __future__ import annotations

from collections.abc import Sequence

from piazzi.earth import force_harmonics, force_sun, force_text
from piazzi.text import nearest

USUAL = ("usual",)
CONSTANT = ("radial", "along", "cross")
ONCE_PER_REV = tuple(f"{name}_{wave}" for name in CONSTANT for wave in ("sin", "cos"))
SUNLIGHT = {  # shares of what sunlight does to a sphere, and words for them
    "light_y": "sunlight across Sun and Earth",
    "light_b": "sunlight across the Sun, in the plane of Sun and Earth",
    "light_b_cos": "sunlight in that plane: its cosine over a turn",
    "light_b_sin": "sunlight in that plane: its sine over a turn",
    "light_d_cos": "sunlight toward the Sun: its cosine over a turn",
    "light_d_sin": "sunlight toward the Sun: its sine over a turn",
    "light_d_cos2": "sunlight toward the Sun: its cosine over half a turn",
    "light_d_sin2": "sunlight toward the Sun: its sine over half a turn",
}
EMPIRICAL = (*CONSTANT, *ONCE_PER_REV, *SUNLIGHT)
GROUPS = {"constant": CONSTANT, "once-per-rev": ONCE_PER_REV, "sunlight": tuple(SUNLIGHT)}
UNITS = {
    "cr_a_m": "m^2/kg", "cd_a_m": "m^2/kg", "air_density": "kg/m^3", "air_height": "m", "air_scale": "m", "dv": "m/s",
    **dict.fromkeys((*CONSTANT, *ONCE_PER_REV, *force_sun.NONGRAVITATIONAL), "m/s^2"),
}  # fmt: skip
_RELATIVITY = ("schwarzschild", "lense-thirring", "de-sitter")
TIDES = {"solid": "solid tides", "k1": "tides by frequency", "pole": "the pole tide"}  # and words for them
_SHADOWS = ("earth", "moon")
_KNOWN: dict[str, dict[str, tuple[str, ...]]] = {
    "earth": {
        "bodies": force_text.BODIES,
        "tides": tuple(TIDES),
        "relativity": _RELATIVITY,
        "shadows": _SHADOWS,
        "empirical": (*GROUPS, *EMPIRICAL),
        "harmonics": force_harmonics.HARMONICS,
        "nongravitational": (),
        "asteroids": (),
    },
    "sun": {
        "bodies": force_sun.BODIES,
        "tides": (),
        "relativity": _RELATIVITY[:1],
        "shadows": (),
        "empirical": (),
        "harmonics": (),
        "nongravitational": force_sun.NONGRAVITATIONAL,
        "asteroids": tuple(force_sun.ASTEROIDS),
    },
}
_DEFAULT: dict[str, dict[str, tuple[str, ...]]] = {
    "earth": {"bodies": ("sun", "moon"), "tides": ("solid",), "shadows": ("earth",)},
    "sun": {"bodies": force_sun.BODIES, "tides": (), "shadows": ()},
}


def options(about: str) -> tuple[str, ...]:
    """The names of the options that are lists; raises ValueError for another centre."""
    if about not in _KNOWN:
        raise ValueError(f"about is {about!r}; it must be 'earth' or 'sun'")
    return tuple(_KNOWN[about])


def several(about: str, name: str, given: bool | Sequence[str]) -> tuple[str, ...]:
    """What was given of a list, each once and in full; raises ValueError for what there is not."""
    known = _KNOWN[about][name]
    given = _DEFAULT[about][name] if given == USUAL else known[:1] if given is True else given or ()
    if isinstance(given, str):
        raise ValueError(f"{name} is {given!r}; it must be a list, such as [{given!r}]")
    for one in given:
        if one not in known:
            there = f"there are {', '.join(known)}" if known else f"there are none about the {about.title()}"
            raise ValueError(f"{name} has {one!r}; {there}{nearest(one, known)}")
    full = [each for one in given for each in GROUPS.get(one, (one,))]
    ordered = sorted(full, key=EMPIRICAL.index) if name == "empirical" else full
    return tuple(dict.fromkeys(ordered))


def grouped(names: Sequence[str]) -> list[str]:
    """Empirical accelerations with the names of groups where a whole group is among them."""
    whole = [group for group, own in GROUPS.items() if set(own) <= set(names)]
    return [*whole, *(name for name in names if not any(name in GROUPS[group] for group in whole))]
