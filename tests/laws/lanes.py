"""What vector lanes change: a result made with them beside the one without, in units in which rounding means something.

Units: of a mean, the largest value of that state over the run, or its standard deviation where that is larger; of a covariance,
the two standard deviations at its epoch; of an innovation, the largest measured value of its component, or its own standard
deviation.  So a number that is small because large ones cancelled is judged by the large ones.

Bound: 1e-12.  It can be kept only because lanes round as one problem does, operation by operation: covariances whose
correlations have a condition number of 5e4, as bearings leave, turn one unit in the last place into 1e-11, and iterations that
gain one digit each, as those of the plain graph on outliers, into 1e-9.
"""

from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np
import pytest

import piazzi as pz
from piazzi import kernels
from piazzi.kernels.spec import lanes_with, machine_lanes

LIMIT = 1e-12
OF_FIELDS = 1e-8  # lanes sum fields in another order, 4e-15 sqrt(degree), which the estimate of an arc magnifies
LAST_PLACES = 4.0  # of a state, in its sigma: what states that lie sigmas apart can tell of a covariance


@contextmanager
def lanes(count):
    """So many lanes inside, as PIAZZI_LANES would say."""
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("PIAZZI_LANES", str(count))
            machine_lanes.cache_clear()
            yield
    finally:
        machine_lanes.cache_clear()


@cache
def wide():
    """This machine's lanes, whatever the environment says; two where it has no vector unit, for they are right anywhere."""
    return max(lanes_with(llvm.get_host_cpu_features()), 2)


@contextmanager
def kernels_used():
    """Specifications of the kernels that are loaded inside."""
    specs, load = [], kernels.load
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "load", lambda spec: specs.append(spec) or load(spec))
        yield specs


def work_in_lanes(specs):
    """Whether one of these kernels does."""
    return any(spec.lanes > 1 and any(speaks_of_lanes(name) for name in spec.fragments) for spec in specs)


@cache
def speaks_of_lanes(fragment):
    return "LANES" in (Path(kernels.__file__).parent / "fragments" / f"{fragment}.py").read_text()


# ---- differences -----------------------------------------------------------------------------------------------------


def worst(a, b, unit):
    """The largest |a - b| / unit; what is missing in both is the same, and infinitely far where it is in one."""
    with np.errstate(all="ignore"):
        apart = np.where((a == b) | (np.isnan(a) & np.isnan(b)), 0.0, np.abs(a - b) / unit)
    return float(np.where(np.isnan(apart), np.inf, apart).max(initial=0.0))


def sigmas(covariances):
    """Standard deviations (..., n) of covariances (..., n, n), NaN where there are none."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.diagonal(covariances, axis1=-2, axis2=-1))


def products(s):
    """Products of standard deviations, (..., n, n)."""
    return s[..., :, None] * s[..., None, :]


def differences(a, b):
    """How far each result of estimate `a` is from that of `b`."""
    assert a.success == b.success, f"with {a.message!r}, without {b.message!r}"
    found = one_view(a, b)
    if b.delayed is not None:
        found |= {f"delayed {what}": apart for what, apart in one_view(a.delayed, b.delayed).items()}
    return found


def one_view(a, b):
    s, spread = sigmas(b.covariance), sigmas(b.innovation_covariances)
    z = np.abs(b.tracking.padded(spread.shape[-1]))
    seen = z.max(axis=0, where=~np.isnan(z), initial=0.0)
    found = {
        "mean": worst(a.mean, b.mean, np.fmax(np.abs(b.mean).max(axis=0), s)),
        "covariance": worst(a.covariance, b.covariance, products(s)),
        "innovations": worst(a.innovations, b.innovations, np.fmax(seen, spread)),
        "innovation covariances": worst(a.innovation_covariances, b.innovation_covariances, products(spread)),
    }
    return found | details(a.details, b.details, s)


def details(a, b, s):
    units = {"cost": abs(b.get("cost", 1.0)), "weights": 1.0, "cross_covariances": s[:-1, :, None] * s[1:, None, :]}
    found = {what: worst(a[what], b[what], unit) for what, unit in units.items() if what in b}
    if "modes" in b:
        likely, other = ([mode["probability"] for mode in d["modes"]] for d in (b, a))
        assert len(likely) == len(other), f"{len(other)} modes with lanes, {len(likely)} without"
        found["probabilities"] = worst(np.array(other), np.array(likely), 1.0)
        found["mode states"] = worst(a["mode_states"], b["mode_states"], np.abs(b["mode_states"]).max(axis=(0, 1)))
    return found


def last_place(estimate):
    """The largest unit in the last place of an estimated state, in its sigma: 8e-9 where 7000 km are known to 0.2 m."""
    s = sigmas(estimate.covariance)
    apart = np.spacing(np.abs(estimate.mean))[s > 0] / s[s > 0]
    return float(apart.max(initial=0.0, where=np.isfinite(apart)))


# ---- comparing -------------------------------------------------------------------------------------------------------


def assert_rounding(found, limit=LIMIT):
    """Differences are within the bound."""
    beyond = {what: apart for what, apart in found.items() if not apart <= limit}
    assert not beyond, "lanes change " + ", ".join(f"{what} by {apart:.2g} of its unit" for what, apart in beyond.items())


@dataclass(frozen=True)
class Compared:
    """An estimate without lanes, how far the one with lanes is, and whether lanes worked on it."""

    one: pz.Estimate
    found: dict
    in_lanes: bool


def compared(run, problem, tracking):
    """The estimate without lanes after a check that lanes change nothing but rounding; `run` is an estimator's `estimate`."""
    with lanes(1):
        one = run(problem, tracking)
    with lanes(wide()), kernels_used() as specs:
        several = run(problem, tracking)
    found = differences(several, one)
    fields = any(signature.kind == "gravity" for signature in problem.model.signatures)
    assert_rounding(found, max(OF_FIELDS, LAST_PLACES * last_place(one)) if fields else LIMIT)
    return Compared(one, found, work_in_lanes(specs))
