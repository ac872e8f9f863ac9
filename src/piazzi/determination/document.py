"""A determination as one JSON object, schema piazzi.determine/1: metres, seconds and radians."""

from __future__ import annotations

from typing import Any

import numpy as np

from piazzi.determination.guesses import SCHEMA
from piazzi.determination.orbit import definite_root, jacobian
from piazzi.determination.residuals import groups, rejected
from piazzi.evaluate.quantities import finite
from piazzi.orbit import transform_root
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
        "about": found.setup.measured.about,
        "names": list(model.names),
        "units": [model.unit(name) for name in model.names],
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
        "manoeuvres": [],
        "span": span(found),
        "residuals": groups(found),
        "rejected": rejected(found),
        "modes": list(found.modes) if known else [],
        "verdict": {key: sentence.to_dict() for key, sentence in found.verdict.items()},
        "forces": dict(found.setup.chosen.facts),
        "left_out": {**found.setup.chosen.left_out, **found.setup.measured.left_out},
        "assumed": list(found.setup.assumed),
        "data": data(found),
        **{key: value for key, value in found.notes.items() if key in ("estimators", "against", "command")},
    }


def solution(found: Any) -> tuple[Array, Array]:
    """Mean (n,) of states and constants where the answer stands, in its frame, and a root (n, n) of the covariance."""
    k, estimate = found.setup.solution, found.estimate
    mean, P = estimate.mean[k], estimate.covariance[k]
    if not (np.isfinite(mean).all() and np.isfinite(P).all()):
        return np.full(len(mean), np.nan), np.full(P.shape, np.nan)
    J = np.eye(len(mean))
    J[:6, :6] = jacobian(found.frame, found.epoch)
    return J @ mean, transform_root(definite_root(P), J)


def estimated(found: Any) -> list[dict[str, Any]]:
    """Constants that were estimated, with what was known of them before."""
    problem, k = found.problem, found.setup.solution
    mean, covariance = found.estimate.mean[k], found.estimate.covariance[k]
    out = []
    for i, name in enumerate(problem.model.constants, start=len(problem.model.moving)):
        given = problem.parameters[name]
        out.append({
            "name": name, "unit": problem.model.unit(name), "prior": float(given.mean[0]),
            "prior_sigma": float(np.sqrt(given.covariance[0, 0])), "value": finite(float(mean[i])),
            "sigma": finite(float(np.sqrt(covariance[i, i]))) if covariance[i, i] >= 0 else None,
        })  # fmt: skip
    return out


def considered(found: Any) -> list[dict[str, Any]]:
    """Constants whose uncertainty counts and that were not estimated."""
    units = {p.name: p.unit for p in found.problem.model.parameters}
    given: dict[str, Gaussian] = {name: found.problem.parameters[name] for name in found.problem.considered}
    return [
        {"name": name, "unit": units[name], "value": float(g.mean[0]), "sigma": float(np.sqrt(g.covariance[0, 0]))}
        for name, g in given.items()
    ]


def span(found: Any) -> dict[str, Any]:
    """First and last measurement that was used."""
    times = found.setup.tracking.row_times[found.keep & np.isfinite(found.setup.tracking.values).any(axis=1)]
    if not len(times):
        return {"first": None, "last": None, "seconds": None}
    epoch = found.setup.measured.epoch
    first, last = (epoch + float(t) for t in (times[0], times[-1]))
    return {"first": first.to(found.scale), "last": last.to(found.scale), "seconds": float(times[-1] - times[0])}


def data(found: Any) -> list[dict[str, Any]]:
    """Files and how many of their measurements are of this object."""
    rows = found.setup.measured.observations
    count: Array = np.bincount(rows.file[rows.measured], minlength=len(rows.files))
    return [{"file": file, "measurements": int(count[i])} for i, file in enumerate(rows.files)]


def _listed(values: Array) -> list[float | None]:
    return [finite(v) for v in values.tolist()]
