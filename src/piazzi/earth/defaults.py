"""Which forces to take: by the height of an orbit, as text, as a table such as [earth] of a scenario, or none."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from math import ceil, log, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from piazzi.earth.constants import GM
from piazzi.earth.eop import EOP, read_eop
from piazzi.earth.epoch import Epoch
from piazzi.earth.finding import check_kernel, found
from piazzi.earth.force_options import TIDES, grouped
from piazzi.earth.forces import Forces
from piazzi.earth.scales import Orientation
from piazzi.earth.subdaily import WITHIN_THE_DAY, SubdailyEOP
from piazzi.earth.tides import RADIUS
from piazzi.opening import opened
from piazzi.text import brief, nearest
from piazzi.units import Units, is_quantity

if TYPE_CHECKING:
    from piazzi.earth.space_weather import SpaceWeather
    from piazzi.earth.thermosphere import Thermosphere

DEGREES = (8, 12, 20, 40, 70)
USUAL_TIDES = ("solid", "k1")  # without the second LAGEOS-2 moves by 1.6 sigma in three days, Stella by 2.2
CUT = 1e-5  # of the central term at the lowest point, where the field is cut off
AIR_BELOW = 1000e3  # m of height
REFLECTED, DRAGGED = 0.013, 0.022  # m2/kg: coefficients 1.3 and 2.2 on 0.01 m2/kg, of a satellite that nobody knows
NO = ("no", "none", "off", "false")
YES = ("yes", "on", "true")
LARGEST = 2**18  # bytes of a file of forces
SUBDAILY, DAILY = "subdaily", "daily"  # of `eop`: tides of UT1 and of the pole and libration, and the tables without them
SPHERE = "sphere"  # whether the body is one to sunlight: else `determine` estimates how it departs from that
DATA = ("eop", "kernel", "asteroid_kernel", "weather")  # keys beside the fields of Forces


@dataclass(frozen=True, eq=False)
class ForceChoice:
    """Forces with numbers of their coefficients and the data that they are computed with.

    `values` has every parameter of the forces, those in `assumed` because nobody gave them; `source` says what was chosen by.
    `sphere` is whether the body is one to sunlight, as it is unless somebody leaves it open.
    `weather` is what `read_space_weather` gives; without it the file that is found where data are looked for.
    """

    forces: Forces
    source: str
    values: Mapping[str, float] = field(default_factory=dict)
    eop: Orientation | None = None
    kernel: str | Path | None = None
    asteroid_kernel: str | Path | None = None
    weather: SpaceWeather | None = None
    assumed: tuple[str, ...] = ()
    sphere: bool = True

    __repr__ = brief

    def __post_init__(self) -> None:
        usual = {"cr_a_m": REFLECTED, "cd_a_m": DRAGGED}
        known = self.forces.parameters
        for name in self.values:
            if name not in known:
                raise ValueError(f"{name} is no coefficient of these forces{nearest(name[:60], known)}")
        given = {**self.forces.values, **self.values}
        missing = [name for name in known if name not in given]
        units = {"cr_a_m": " m2/kg", "cd_a_m": " m2/kg"}
        said = tuple(f"{name} = {usual.get(name, 0.0):g}{units.get(name, '')}" for name in missing)
        values = {name: given[name] if name in given else usual.get(name, 0.0) for name in known}
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "assumed", (*self.assumed, *said))

    def functions(self, epoch: Epoch, air: Any = None) -> dict[str, Any]:
        """The data of a problem whose time zero is `epoch`, with the `air` of its orbit."""
        return self.forces.functions(epoch, self.eop, self.kernel, self.asteroid_kernel, air)

    def air(self, epoch: Epoch, orbit: Any, at: float = 0.0) -> Thermosphere | None:
        """The thermosphere about an orbit, (6,) in m and m/s, `at` s after the epoch; None where no force needs it.

        Raises
        ------
        ValueError
            Where there is no file of space weather.
        """
        if self.forces.drag != "msis":
            return None
        weather = self.weather or next(found("weather"), None)
        if weather is None:
            raise ValueError("drag 'msis' needs space weather: give weather=FILE, or get it by: piazzi data get weather")
        from piazzi.earth.thermosphere import Thermosphere

        return Thermosphere(epoch, orbit, weather, at)

    def __str__(self) -> str:
        f = self.forces
        words = [f"{f.field.name} to degree {f.degree}", *f.bodies, *(TIDES[tide] for tide in f.tides)]
        words += ["relativity"] if f.relativity else []
        words += [f"radiation ({f.radiation})"] if f.radiation else []
        words += [f"drag ({f.drag})"] if f.drag else []
        words += [f"empirical {', '.join(grouped(f.empirical))}"] if f.empirical else []
        return f"{', '.join(words)} ({self.source})"


def lowest_height(position: Any, velocity: Any) -> float:
    """Height in m of the pericentre of a state above the Earth's mean equator."""
    r, v = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
    mu, h = GM["earth"], np.cross(r, v)
    size = float(h @ h) / mu
    e = sqrt(max(1.0 + size * (float(v @ v) / mu - 2.0 / float(np.linalg.norm(r))), 0.0))
    return size / (1.0 + e) - RADIUS


def default_forces(height: float) -> ForceChoice:
    """Forces for an orbit whose lowest point is so many metres above the Earth.

    The degree of the field is the first of `DEGREES` whose terms are there below `CUT` of the central one, as they fall with
    the power of the radius.  Air counts below 1000 km.
    """
    return ForceChoice(Forces(**_usual(height)), f"default at {height / 1e3:,.0f} km", eop=WITHIN_THE_DAY, sphere=False)


def _usual(height: float) -> dict[str, Any]:
    if not height > 0:
        raise ValueError(f"the orbit comes down to {height / 1e3:,.0f} km: it is below the surface of the Earth")
    wanted = ceil(log(CUT) / log(RADIUS / (RADIUS + height)))
    degree = next((n for n in DEGREES if n >= wanted), DEGREES[-1])
    out: dict[str, Any] = {"degree": degree, "radiation": "cannonball", "tides": USUAL_TIDES}
    if height < AIR_BELOW:
        out |= {"drag": "harris-priester", "air_height": max(round(height, -4), 100e3)}
    return out


def read_forces(text: str, height: float) -> ForceChoice:
    """What `text` says of the forces on an orbit whose lowest point is at that height (m).

    Parameters
    ----------
    text : "default", "none" (two bodies), the name of a TOML file with a table [earth], or words such as
        ``"gravity=EGM2008 degree=40 drag=exponential cd_a_m=0.02"``, which change what is usual for `earth.Forces`; with the
        word ``default`` before them, what is usual at that height
    height : m

    Raises
    ------
    ValueError
        For what is not known, with what is.
    OSError
        Where a file cannot be read.
    """
    words = text.split()
    if words == ["default"]:
        return default_forces(height)
    if words == ["none"]:
        return ForceChoice(Forces(degree=0, bodies=(), tides=(), relativity=False), "two bodies", eop=WITHIN_THE_DAY)
    if len(words) < 2 and "=" not in text:
        if not text.lower().endswith(".toml"):
            raise ValueError(
                f"forces {text[:60]!r}: write default, none, a file .toml with [earth], or words such as "
                "'gravity=EGM2008 degree=40 drag=exponential'"
            )
        return _of_file(Path(text))
    base = _usual(height) if words[0] == "default" else {}
    chosen = forces_of(table := named_values(words[words[0] == "default" :]), Path(), "as given", base)
    return chosen if "eop" in table else replace(chosen, eop=WITHIN_THE_DAY)


def named_values(words: Iterable[str]) -> dict[str, str]:
    """NAME=VALUE of each word; raises ValueError for another."""
    table: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not value:
            raise ValueError(f"forces: {word[:60]!r} is not NAME=VALUE")
        if name in table:
            raise ValueError(f"forces: {name} is given twice")
        table[name] = value
    return table


def forces_of(
    table: Mapping[str, Any], folder: Path, source: str, base: Mapping[str, Any] | None = None, numbers: str = ""
) -> ForceChoice:
    """The forces of a table: fields of `earth.Forces`, `eop`, `kernel` and coefficients by their names.

    Parameters
    ----------
    table : texts or values
    folder : where files are that it names
    source : what it is
    base : fields that are otherwise than usual where the table does not have them
    numbers : a place that coefficients are to be given at instead
    """
    known = {f.name: f for f in fields(Forces)}
    given, values = dict(base or {}), dict[str, float]()
    for name, value in table.items():
        if name in known:
            given[name] = force_field(name, value, folder)
        elif name not in (*DATA, SPHERE):
            values[name] = value
    forces = Forces(**given)
    for name, value in values.items():
        if numbers or name not in forces.parameters:
            there = [*known, *DATA, SPHERE, *([] if numbers else forces.parameters)]
            hint = f": it belongs to {numbers}" if name in forces.parameters else nearest(name[:60], there)
            raise ValueError(f"forces: {name[:60]} is not known{hint}")
        values[name] = _number(name, value)
    data = {name: read_data(name, table[name], folder) for name in DATA if name in table}
    return ForceChoice(forces, source, values, sphere=_is_sphere(table.get(SPHERE, base is None or not base)), **data)


def _is_sphere(given: Any) -> bool:
    """Whether the body is a sphere, from text or from what a TOML file has."""
    word = given.strip().lower() if isinstance(given, str) else given
    if word not in (*YES, *NO) and not isinstance(word, bool):
        raise ValueError(f"{SPHERE} is {given!r}; it must be yes or no")
    return word in YES if isinstance(word, str) else bool(word)


def force_field(name: str, value: Any, folder: Path) -> Any:
    """The value of a field of `Forces`, from text or from what a TOML file has."""
    (known,) = (f for f in fields(Forces) if f.name == name)
    kind = set(re.findall(r"\w+", str(known.type)))
    several = "Sequence" in kind
    if isinstance(value, str):
        word = value.strip()
        if "bool" in kind and word.lower() in YES:
            return True
        if several:
            return () if word.lower() in NO else tuple(part.strip() for part in word.split(",") if part.strip())
        if word.lower() in (*NO, *YES) and name != "gravity":
            return word.lower() in YES
        if "Path" in kind and ("." in word or "/" in word):
            return folder / word
        if kind & {"int", "float"}:
            value = _number(name, word)
        else:
            return word
    if several and isinstance(value, list | tuple):
        return tuple(value)
    if "int" in kind and isinstance(value, float) and value.is_integer():
        return int(value)
    return _number(name, value) if "float" in kind else value


def read_data(name: str, value: Any, folder: Path) -> Any:
    """Orientation of the Earth, from files of the IERS or as a table of constants; space weather; or the path of a kernel."""
    if name.endswith("kernel"):
        path = folder / str(value)
        check_kernel(path)
        return path
    if name == "weather":
        from piazzi.earth.space_weather import read_space_weather

        return read_space_weather(folder / str(value))
    return _orientation(value, folder)


def _orientation(value: Any, folder: Path) -> Orientation | None:
    """A file, `daily`, `subdaily`, `subdaily:FILE`, or a table of constants with the switch `subdaily`."""
    if not isinstance(value, Mapping):
        word, both, file = str(value).strip().partition(":")
        if word == DAILY and not both:
            return None
        if word != SUBDAILY:
            return read_eop(folder / str(value))
        return SubdailyEOP(read_eop(folder / file) if both else None)
    known = [*(f.name for f in fields(EOP)), SUBDAILY]
    for key in value:
        if key not in known:
            raise ValueError(f"eop: {key[:60]!r} is not known{nearest(key[:60], known)}")
    within = value.get(SUBDAILY, False)
    if not isinstance(within, bool):
        raise ValueError(f"eop: {SUBDAILY} is {within!r}; it must be true or false")
    held = EOP(**{key: _number(key, number) for key, number in value.items() if key != SUBDAILY})
    return SubdailyEOP(held) if within else held


def _number(name: str, value: Any) -> float:
    """A number in SI, from text with or without a unit."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ValueError(f"{name} is {value!r}; it must be a number")
    if not isinstance(value, str):
        return float(value)
    if is_quantity(value):
        size, unit = Units().quantity(value)
        return size * unit.factor
    try:
        return float(value)
    except ValueError:
        raise ValueError(f"{name} is {value[:40]!r}; it must be a number") from None


def _of_file(path: Path) -> ForceChoice:
    with opened(path) as file:
        content = file.read(LARGEST + 1)
    try:
        if len(content) > LARGEST:
            raise ValueError(f"longer than {LARGEST} bytes")
        tables = tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: no TOML: {' '.join(str(error).split())}") from None
    earth, numbers = tables.get("earth"), tables.get("parameters", {})
    if not isinstance(earth, Mapping) or not isinstance(numbers, Mapping):
        raise ValueError(f"{path}: there is no table [earth] in it, or [parameters] is no table")
    flat = {key: value.get("value") if isinstance(value, Mapping) else value for key, value in numbers.items()}
    try:
        chosen = forces_of(earth, path.parent, path.name, numbers="[parameters]")
        chosen = chosen if "eop" in earth else replace(chosen, eop=WITHIN_THE_DAY)
        known = chosen.forces.parameters  # a scenario has others, of its own equations
        return replace(chosen, values={key: _number(key, value) for key, value in flat.items() if key in known}, assumed=())
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
