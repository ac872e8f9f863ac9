"""Forces with the unknowns that a user asks for, and his manoeuvres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from piazzi.determination import motion
from piazzi.determination.burns import UNPLANNED, Burn
from piazzi.determination.motion import Extra, Numbers
from piazzi.determination.orbit_forces import COEFFICIENTS, Chosen, usual_sigma
from piazzi.determination.physical import by_shares
from piazzi.determination.sensing import Measured
from piazzi.determination.unknowns import DV, Asked, of_parameters
from piazzi.earth.force_options import EMPIRICAL, grouped
from piazzi.earth.forces import unit_of
from piazzi.problem import Gaussian

SHARES = {"cd_a_m": 0.3, "cr_a_m": 0.1}  # steady sigma of processes, where none is given


def with_unknowns(chosen: Chosen, given: Sequence[Asked], burns: Sequence[Burn], seen: Measured) -> Chosen:
    """The forces with these.

    Raises
    ------
    ValueError
        For a name that is no parameter, with the nearest.
    """
    chosen = _with_accelerations(chosen, given)
    numbers = Numbers(dict(chosen.roles), dict(chosen.values))
    extra = chosen.extra
    for name, one in of_parameters(given, chosen.forces.parameters, COEFFICIENTS):
        extra = extra.and_(_one(name, one, chosen, seen, numbers, extra))
    sudden = [_sudden(one) for one in given if one.what.kind == DV]
    every = sorted((*burns, *sudden), key=lambda b: (b.epoch.whole, b.epoch.fraction))
    extra = extra.and_(motion.manoeuvres(every, seen.epoch, numbers))
    extra = extra.and_(by_shares(numbers, extra, {**chosen.forces.definitions, **extra.definitions}))
    usual = [b for b in every if b.assumed]
    said = tuple(f"sigma of the manoeuvre at {b.epoch}: {_off(b)}" for b in usual)
    return replace(chosen, roles=numbers.roles, values=numbers.values, extra=extra, assumed=(*chosen.assumed, *said))


def _one(name: str, one: Asked, chosen: Chosen, seen: Measured, numbers: Numbers, extra: Extra) -> Extra:
    """What one unknown adds; its numbers are put among the others."""
    before = _before(name, one, numbers)
    definitions = {**chosen.forces.definitions, **extra.definitions}
    if one.what.per is None:
        numbers.roles[name], numbers.values[name] = one.role, before
        return Extra()
    if one.what.is_process:
        relative = name in COEFFICIENTS.values()
        usual = SHARES.get(name, usual_sigma(name))
        steady = usual if one.what.sigma is None else one.what.size("", 0.0) if relative else _in_si(one, name)
        if name not in numbers.roles:
            numbers.roles[name] = "fixed"
        return motion.process(name, one, steady, relative, unit_of(name), definitions, numbers)
    times = seen.tracking.times
    span = float(times[0]), float(times[-1])
    return motion.by_parts(name, one, before, *span, seen.epoch, definitions, numbers)


def _before(name: str, one: Asked, numbers: Numbers) -> Gaussian:
    """The belief about a parameter before the measurements; a sigma of coefficients is a share of them."""
    old = numbers.values.get(name)
    mean = float(np.ravel(old.mean)[0]) if isinstance(old, Gaussian) else float(old or 0.0)
    usual = float(np.ravel(old.covariance)[0]) ** 0.5 if isinstance(old, Gaussian) else 0.5 * abs(mean) or usual_sigma(name)
    if one.what.sigma is None or one.what.is_process:
        return Gaussian(mean, usual**2)
    if name in COEFFICIENTS.values():
        return Gaussian(mean, (one.what.size("", 0.0) * abs(mean)) ** 2)
    return Gaussian(mean, _in_si(one, name) ** 2)


def _in_si(one: Asked, name: str) -> float:
    """A sigma of an acceleration or another parameter: a plain number is in SI."""
    try:
        return one.what.size("", 0.0)
    except ValueError:
        return one.what.size(unit_of(name), 0.0)


def _with_accelerations(chosen: Chosen, given: Sequence[Asked]) -> Chosen:
    """The forces with those empirical accelerations that are asked for and that they have not."""
    new = [one.what.name for one in given if one.what.name in EMPIRICAL and one.what.name not in chosen.forces.empirical]
    return with_empirical(chosen, new) if new else chosen


def with_empirical(chosen: Chosen, new: Sequence[str]) -> Chosen:
    """The forces with further empirical accelerations, which are zero."""
    forces = replace(chosen.forces, empirical=(*chosen.forces.empirical, *new))
    zero = dict.fromkeys(new, 0.0) | {name: value for name, value in forces.values.items() if name == "empirical_on"}
    facts: dict[str, Any] = {**chosen.facts, "empirical": grouped(forces.empirical)}
    choice = replace(chosen.choice, forces=forces, values={**chosen.choice.values, **zero})
    return replace(chosen, choice=choice, values={**zero, **chosen.values}, facts=facts)


def _sudden(one: Asked) -> Burn:
    sigma = one.what.size("m/s", UNPLANNED)
    return Burn(one.what.epoch, sigma=(sigma, sigma, sigma), assumed=one.what.sigma is None)


def _off(burn: Burn) -> str:
    return f"{burn.scale:.0%} of its thrust" if burn.scale else f"{max(burn.sigma):g} m/s along each axis"
