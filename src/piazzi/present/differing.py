"""How far two orbits are apart, as a table and sentences for terminals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from piazzi.evaluate.grids import Grid
from piazzi.evaluate.quantities import display_of, number
from piazzi.evaluate.tabled import Tabled
from piazzi.text import printable


@dataclass(frozen=True)
class Differing(Tabled):
    """What `Difference.to_dict` says, with its table."""

    found: Mapping[str, Any]

    def to_dict(self) -> dict[str, Any]:
        return dict(self.found)

    def grids(self) -> list[Grid]:
        """One line for each axis, and for the distance."""
        found = self.found
        a, b = (orbit["name"] for orbit in found["orbits"])
        shown = display_of("m", found["maximum"].values())
        sigma = found["in_sigma"]
        rows = []
        for axis, rms in found["rms"].items():
            cells = [axis, *(number(value * shown.factor) for value in (rms, found["maximum"][axis]))]
            mean, own = found["mean"].get(axis), sigma and sigma["rms"].get(axis)
            cells.append("" if mean is None else number(mean * shown.factor))
            if sigma is not None:
                cells += ["", ""] if own is None else [number(own, 3), number(sigma["maximum"][axis], 3)]
            rows.append(tuple(cells))
        heads: tuple[str, ...] = ("", f"rms\n[{shown.unit}]", f"largest\n[{shown.unit}]", f"mean\n[{shown.unit}]")
        heads += ("rms\n[sigma]", "largest\n[sigma]") if sigma is not None else ()
        kind = "along the axes of the first" if found["axes"] in ("RTN", "TNW") else f"in {found['axes']}"
        title = f"{b} minus {a}, {kind}: {found['count']:,} times, {found['first']} to {found['last']}"
        return [Grid(title, heads, tuple(rows))]

    def sentences(self) -> Iterator[str]:
        """Covariances, and how states between rows were made."""
        sigma = self.found["in_sigma"]
        if sigma is not None:
            yield (
                f"With covariances at {sigma['count']:,} times: {100 * sigma['inside']:.3g} % are inside the ellipsoid "
                f"that should hold {100 * sigma['expected_inside']:.4g} %, if the two are independent."
            )
        for orbit in self.found["orbits"]:
            name = printable(orbit["name"])
            if orbit["method"] in ("Lagrange", "Hermite"):
                yield (
                    f"Between rows {name} is {orbit['method']}'s polynomial of degree {orbit['degree']}; those of "
                    f"the next degrees are up to {number(orbit['error'], 2)} m from it."
                )
