"""What estimated coefficients say against the forces that they belong to."""

from __future__ import annotations

from collections.abc import Mapping

_POSITIVE = {
    "cd_a_m": "air cannot push a satellite on: a force along the track is not modelled, or the density is wrong",
    "cr_a_m": "sunlight cannot pull: a force is not modelled, or the orbit does not tell it from others",
}
SIGMAS = 3.0  # beyond which a sign is no matter of chance


def coefficient_faults(values: Mapping[str, float], sigmas: Mapping[str, float] | None = None) -> tuple[str, ...]:
    """A line for each coefficient that is negative, which is a fault of the model and not a property of the satellite.

    Parameters
    ----------
    values : of parameters by name; those that may be negative are passed over
    sigmas : of those that were estimated; a sign that is within `SIGMAS` of them is said to be uncertain
    """
    lines = []
    for name, why in _POSITIVE.items():
        value, sigma = values.get(name, 0.0), (sigmas or {}).get(name, 0.0)
        if value < 0.0:
            spread = f" +- {sigma:.2g}" if sigma else ""
            sure = "" if -value > SIGMAS * sigma else "; the measurements do not tell its sign"
            lines.append(f"{name} is {value:.3g}{spread} m^2/kg, negative: {why}{sure}")
    return tuple(lines)
