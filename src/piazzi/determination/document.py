"""A determination as one JSON object, schema piazzi.determine/1: metres, seconds and radians."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.determination import holding
from piazzi.determination.departures import departures
from piazzi.determination.guesses import CARTESIAN, SCHEMA
from piazzi.determination.initial_result import UndeterminedError
from piazzi.determination.motion import words_of
from piazzi.determination.orbit import definite_root
from piazzi.determination.physical import believed, nodes_of, result_name, said, said_name
from piazzi.determination.published import beside
from piazzi.determination.residuals import groups, rejected
from piazzi.determination.verdict import KEYS
from piazzi.evaluate.quantities import finite
from piazzi.orbit import transform_root
from piazzi.orbit.axes import in_axes
from piazzi.problem import Gaussian
from piazzi.problem.checks import Array


def document(found: Any) -> dict[str, Any]:
    """The object; what is not finite is None."""
    model = found.problem.model
    mean, root = solution(found)
    covariance = root @ root.T
    sigma = np.sqrt(np.diag(covariance))
    known = bool(np.isfinite(mean).all() and np.isfinite(covariance).all())
    return {
        "schema": SCHEMA,
        "object": found.object,
        "epoch": found.epoch.to(found.scale),
        "frame": found.frame,
        "names": [result_name(found.setup.labels, name) for name in model.names],
        "units": [model.unit(said_name(name)) for name in model.names],
        "mean": _listed(mean),
        "sigma": _listed(sigma),
        "covariance": [_listed(row) for row in covariance],
        "elements": found.orbit.elements() if known else None,
        "success": bool(found.success),
        "determined": bool(found.determined),
        "message": found.message,
        "iterations": int(found.estimate.iterations),
        "seconds": float(found.seconds),
        "estimated": estimated(found),
        "considered": considered(found),
        "manoeuvres": manoeuvres(found),
        "span": span(found),
        "residuals": groups(found),
        "rejected": rejected(found),
        "modes": list(found.modes) if known else [],
        "verdict": {key: sentence.to_dict() for key, sentence in found.verdict.items()},
        "forces": dict(found.setup.chosen.facts),
        "left_out": {**found.setup.chosen.left_out, **found.setup.measured.left_out},
        "assumed": list(found.setup.assumed),
        "data": data(found),
        # beside the schema
        "about": found.setup.measured.about,
        "density": [when.to(found.scale) for when in nodes_of(found.setup.problem)],
        "held": None if found.held is None else holding.to_dict(found.setup, found.held, found.scale),
        "published": [beside(found.orbit, one) for one in found.case.published] if known else [],
        **({} if found.setup.earlier is None else {"prior": prior(found)}),
        **{key: value for key, value in found.notes.items() if key in ("estimators", "against", "command")},
    }


def undetermined(error: UndeterminedError, name: str | None = None) -> dict[str, Any]:
    """The same object where the measurements determine no orbit: nothing is known but what `orbits` says of it."""
    orbits = error.orbits.to_dict()
    said, nothing = str(error), "There is no orbit to ask this of."
    seen = {
        "ok": False,
        "figure": None,
        "test": "orbits that fit are a ridge",
        "sentence": f"Not seen: {' '.join(said.split())}.",
    }
    other = {"ok": None, "figure": None, "test": "of an orbit that is determined"}
    return {
        "schema": SCHEMA, "object": name or "", "epoch": (orbits["ridge"] or {}).get("epoch"), "frame": orbits["frame"],
        "names": list(CARTESIAN), "units": list(CARTESIAN.values()), "mean": [None] * 6, "sigma": [None] * 6,
        "covariance": [[None] * 6] * 6, "elements": None, "success": False, "determined": False, "message": said,
        "iterations": 0, "seconds": 0.0, "estimated": [], "considered": [], "manoeuvres": [],
        "span": {"first": None, "last": None, "seconds": None}, "residuals": [], "rejected": [], "modes": [],
        "verdict": {"seen": seen, **{key: {**other, "sentence": f"{key.title()}: {nothing}"} for key in KEYS[1:]}},
        "forces": {}, "left_out": {}, "assumed": [], "data": [], "about": orbits["about"], "orbits": orbits,
    }  # fmt: skip


def solution(found: Any) -> tuple[Array, Array]:
    """Mean (n,) of states and constants where the answer stands, in its frame, and a root (n, n) of the covariance."""
    k, estimate = found.setup.solution, found.estimate
    mean, P = estimate.mean[k], estimate.covariance[k]
    if not (np.isfinite(mean).all() and np.isfinite(P).all()):
        return np.full(len(mean), np.nan), np.full(P.shape, np.nan)
    values, J = said(found.problem, mean)
    J[:6, :6] = in_axes("GCRF", found.frame, found.epoch, found.orbit.eop)
    values[:6] = J[:6, :6] @ mean[:6]
    return values, transform_root(definite_root(P), J)


def estimated(found: Any) -> list[dict[str, Any]]:
    """What was estimated beside position and velocity, with what was known of it before."""
    problem, k, labels = found.problem, found.setup.solution, found.setup.labels
    apart = departures(found.setup, found.estimate)
    far = {} if apart is None else dict(zip(apart.names, apart.sigmas.tolist(), strict=True))
    mean, J = said(problem, found.estimate.mean[k])
    variance = np.diag(J @ found.estimate.covariance[k] @ J.T)
    out = []
    for i, name in enumerate(problem.model.names[6:], start=6):
        before, spread = believed(problem, name)
        out.append({
            "name": result_name(labels, name), "unit": problem.model.unit(said_name(name)),
            "prior": before, "prior_sigma": spread, "value": finite(float(mean[i])),
            "sigma": finite(float(np.sqrt(variance[i]))) if variance[i] >= 0 else None,
            # beside the schema: what it is, and how far from the prior, in sigma of that difference
            "words": labels[name].words if name in labels else words_of(said_name(name)), "departure": finite(far.get(name)),
        })  # fmt: skip
    return out


def considered(found: Any) -> list[dict[str, Any]]:
    """Constants whose uncertainty counts and that were not estimated."""
    units, labels = {p.name: p.unit for p in found.problem.model.parameters}, found.setup.labels
    given = {name: believed(found.problem, name) for name in found.problem.considered}
    return [
        {"name": result_name(labels, name), "unit": units[said_name(name)], "value": value, "sigma": sigma}
        for name, (value, sigma) in given.items()
    ]


def manoeuvres(found: Any) -> list[dict[str, Any]]:
    """Manoeuvres: what was commanded and what came out, m/s along their axes."""
    problem, k = found.problem, found.setup.solution
    names, mean, P = problem.model.names, found.estimate.mean[k], found.estimate.covariance[k]

    def value(name: str) -> float:
        return float(mean[names.index(name)]) if name in names else _number(problem.parameters[name])

    out = []
    for push in found.setup.chosen.extra.pushes:
        burn, turned = push.burn, push.turned
        J = np.zeros((3, len(names)))
        size = value(push.scale) if push.scale else 1.0
        given = np.array([value(name) for name in push.dv])
        for i, name in enumerate(push.dv):
            if name in names:
                J[i, names.index(name)] = size
        if push.scale in names:
            J[:, names.index(push.scale)] = given
        sigma = np.sqrt(np.maximum(np.diag(turned.T @ J @ P @ J.T @ turned), 0.0))
        prior = np.sqrt(np.array(burn.sigma) ** 2 + (burn.scale * np.array(burn.dv)) ** 2)
        out.append({
            "time": burn.epoch.to(found.scale), "duration": burn.duration, "axes": burn.axes, "engine": burn.engine or None,
            "dv": list(burn.dv), "prior_sigma": prior.tolist(), "estimate": _listed(size * (turned.T @ given)),
            "sigma": _listed(sigma), "scale": finite(size) if push.scale else None,
        })  # fmt: skip
    return out


def _number(given: Any) -> float:
    return float(np.ravel(given.mean)[0]) if isinstance(given, Gaussian) else float(given)


def span(found: Any) -> dict[str, Any]:
    """First and last measurement that was used."""
    times = found.setup.tracking.row_times[found.keep & np.isfinite(found.setup.tracking.values).any(axis=1)]
    if not len(times):
        return {"first": None, "last": None, "seconds": None}
    epoch = found.setup.measured.epoch
    first, last = (epoch + float(t) for t in (times[0], times[-1]))
    return {"first": first.to(found.scale), "last": last.to(found.scale), "seconds": float(times[-1] - times[0])}


def prior(found: Any) -> dict[str, Any]:
    """The orbit that was known before, and what it was made of."""
    earlier = found.setup.earlier
    first, last = (when.to(found.scale) for when in earlier.used) if earlier.used else (None, None)
    return {"file": earlier.source, "epoch": earlier.epoch.to(found.scale), "first": first, "last": last}


def data(found: Any) -> list[dict[str, Any]]:
    """Files and how many of their measurements are of this object."""
    rows = found.setup.measured.observations
    count: Array = np.bincount(rows.file[rows.measured], minlength=len(rows.files))
    return [{"file": file, "measurements": int(count[i])} for i, file in enumerate(rows.files)]


def _listed(values: Array) -> list[float | None]:
    return [finite(v) for v in values.tolist()]
