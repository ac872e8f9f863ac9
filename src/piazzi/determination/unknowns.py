"""What is estimated or considered beside the orbit, as users say it."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

from piazzi.determination.orbit_forces import ACCELERATION, COEFFICIENTS, Chosen
from piazzi.determination.sensing import Measured
from piazzi.problem import Gaussian
from piazzi.text import nearest, one_line


@dataclass(frozen=True)
class Estimated:
    """An unknown by name, with a prior sigma (SI) where one is given.

    Parameters
    ----------
    name : ``cr``, ``cd``, ``radial``, ``along``, ``cross``, or a parameter of the model
    per : not taken yet
    sigma : of the prior
    """

    name: str
    per: str | None = None
    sigma: float | None = None


def estimated(chosen: Chosen, given: Any, seen: Measured) -> Chosen:
    """Forces with these parameters estimated.

    Raises
    ------
    ValueError
        For a name that is no parameter, or a form that is not taken yet.
    """
    roles, values = dict(chosen.roles), dict(chosen.values)
    for one in _listed(given):
        name = _known(one.name, chosen, "--estimate")
        if one.per is not None:
            raise ValueError(
                f"--estimate {one.name}/{one.per}: values for parts of the time are not taken yet: write {one.name}"
            )
        before = values.get(name)
        mean = float(before.mean[0]) if isinstance(before, Gaussian) else float(before or 0.0)
        usual = float(before.covariance[0, 0]) ** 0.5 if isinstance(before, Gaussian) else 0.5 * abs(mean) or ACCELERATION
        sigma = one.sigma * (abs(mean) if one.name in COEFFICIENTS else 1.0) if one.sigma is not None else usual
        roles[name], values[name] = "estimated", Gaussian(mean, sigma**2)
    return replace(chosen, roles=roles, values=values)


def considered(chosen: Chosen, given: Any, seen: Measured) -> Chosen:
    """Forces with these parameters considered; sigmas of ``cr`` and ``cd`` are shares of them."""
    roles, values = dict(chosen.roles), dict(chosen.values)
    items = given.items() if isinstance(given, Mapping) else [_pair(text) for text in _texts(given)]
    for short, sigma in items:
        name = _known(str(short), chosen, "--consider")
        if not (isfinite(float(sigma)) and float(sigma) > 0):
            raise ValueError(f"--consider {short}: its sigma is {sigma}; it must be positive")
        before = values.get(name)
        mean = float(before.mean[0]) if isinstance(before, Gaussian) else float(before or 0.0)
        size = float(sigma) * (abs(mean) if short in COEFFICIENTS else 1.0)
        roles[name], values[name] = "considered", Gaussian(mean, size**2)
    return replace(chosen, roles=roles, values=values)


def _known(name: str, chosen: Chosen, option: str) -> str:
    long = COEFFICIENTS.get(name, name)
    parameters = [p for p in chosen.forces.parameters if not p.endswith("_on")]
    if long not in parameters:
        short = {v: k for k, v in COEFFICIENTS.items()}
        known = [short.get(p, p) for p in parameters]
        hint = nearest(name, known) if known else "; the forces have no parameter"
        raise ValueError(f"{option}: {one_line(name, 60)!r} is no unknown of these forces{hint}")
    return long


def _texts(given: Any) -> list[str]:
    words = [given] if isinstance(given, str) else list(given or ())
    return [part for word in words for part in (word.split() if isinstance(word, str) else [word])]


def _listed(given: Any) -> Iterable[Estimated]:
    for word in [given] if isinstance(given, (str, Estimated)) else given or ():
        if isinstance(word, Estimated):
            yield word
            continue
        for text in str(word).split():
            yield _one(text)


def _one(text: str) -> Estimated:
    match = re.fullmatch(r"([A-Za-z]\w*)(?:([/~])([\w.]+))?(?:=(.+))?", text)
    if match is None:
        raise ValueError(f"--estimate: {one_line(text, 60)!r} cannot be read: write such as cr, cd or along=1e-7")
    return Estimated(
        match[1], match[3] and f"{match[2]}{match[3]}".lstrip("/"), None if match[4] is None else _number(match[4], text)
    )


def _pair(text: str) -> tuple[str, float]:
    name, equals, value = str(text).partition("=")
    if not equals:
        raise ValueError(f"--consider: {one_line(str(text), 60)!r} has no sigma: write NAME=SIGMA, such as cr=0.1")
    return name, _number(value, text)


def _number(text: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise ValueError(f"{one_line(whole, 60)!r}: {one_line(text, 40)!r} is no number") from None
    if not (isfinite(value) and value > 0):
        raise ValueError(f"{one_line(whole, 60)!r}: a sigma is positive, not {text}")
    return value
