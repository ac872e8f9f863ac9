"""The JSON of a determination as somebody reads it who has the schema and nothing else: every key, type, length and unit."""

import numpy as np

import piazzi as pz

KEYS = [
    "schema", "object", "epoch", "frame", "names", "units", "mean", "sigma", "covariance", "elements", "success", "determined",
    "message", "iterations", "seconds", "estimated", "considered", "manoeuvres", "span", "residuals", "rejected", "modes",
    "verdict", "forces", "left_out", "assumed", "data",
]  # fmt: skip
SENTENCES = ["seen", "alone", "converged", "honest", "agreed", "complete"]
STATES = ["x", "y", "z", "vx", "vy", "vz"]
SI = {"m", "m/s", "rad", "rad/s", "s", "", "m/s^2", "m^2/kg", "m**2/kg", "Hz", "Hz/s", "kg/m^3", "1", "m/s**2"}
GROUP = {"station": str, "component": str, "unit": str, "count": int, "used": int, "mean": float, "rms": float,
         "weighted_rms": float}  # fmt: skip
ROW = {"time": str, "station": str, "component": str, "residual": float, "sigma": float, "reason": str}
UNKNOWN = {"name": str, "unit": str, "prior": float, "prior_sigma": float, "value": float, "sigma": float}


def is_of(value, kind, none=False):
    """Whether a value is of a kind; a truth value is no number."""
    if value is None:
        return none
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value)
    return isinstance(value, kind) and (kind is bool or not isinstance(value, bool))


def check(facts, rows=None):
    """Walk a determination; `rows` is how many measurements its file has of the object."""
    assert list(facts)[: len(KEYS)] == KEYS and facts["schema"] == "piazzi.determine/1"
    determined = facts["determined"]
    assert all(is_of(facts[k], str) for k in ("object", "frame", "message"))
    assert all(is_of(facts[k], bool) for k in ("success", "determined")) and is_of(facts["iterations"], int)
    assert is_of(facts["seconds"], float) and facts["seconds"] >= 0.0
    if facts["epoch"] is not None:
        date, scale = facts["epoch"].split(" ")
        assert "T" in date and scale in ("UTC", "TT", "TDB", "TAI", "GPS", "TCG", "UT1")
        assert abs(pz.Epoch(facts["epoch"]) - pz.Epoch(f"{date} {scale}")) == 0.0
    sentences(facts["verdict"], facts)
    state(facts)
    assert all(list(one)[:6] == list(UNKNOWN) for one in facts["estimated"])
    assert all(is_of(one[k], kind, k == "sigma") for one in facts["estimated"] for k, kind in UNKNOWN.items())
    assert [one["name"] for one in facts["estimated"]] == facts["names"][6:]
    assert len({one["name"] for one in facts["estimated"]}) == len(facts["estimated"])
    assert [one["unit"] for one in facts["estimated"]] == facts["units"][6:]
    assert all(is_of(one["words"], str) and one["words"] for one in facts["estimated"])
    counted(facts, rows)
    if determined:
        assert facts["success"] and all(facts["verdict"][key]["ok"] is not False for key in SENTENCES[:3])
        first, last = (pz.Epoch(facts["span"][key]) for key in ("first", "last"))
        assert abs(last - first - facts["span"]["seconds"]) < 1e-5
        assert facts["modes"] and all(len(mode["mean"]) == 6 for mode in facts["modes"])
        assert 0.99 < sum(mode["probability"] for mode in facts["modes"]) <= 1.0 + 1e-9
        assert facts["forces"] and all(list(one) == ["file", "measurements"] for one in facts["data"])
        if rows is not None and facts["data"]:
            assert sum(one["measurements"] for one in facts["data"]) == rows
    assert isinstance(facts["left_out"], dict) and all(is_of(text, str) for text in facts["assumed"])


def sentences(verdict, facts):
    assert list(verdict) == SENTENCES
    for one in verdict.values():
        assert list(one) == ["ok", "figure", "test", "sentence"] and one["ok"] in (True, False, None)
        assert is_of(one["figure"], float, True) and one["test"] and one["sentence"].endswith(".")
        assert one["ok"] is not False or one["sentence"].startswith("Not "), one["sentence"]


def state(facts):
    """Names, units, mean, sigma and covariance, which is symmetric, positive definite and has the sigmas on its diagonal."""
    n = len(facts["names"])
    assert facts["names"][:6] == STATES and facts["units"][:6] == ["m"] * 3 + ["m/s"] * 3 and set(facts["units"]) <= SI
    assert len(set(facts["names"])) == n
    assert [len(facts[k]) for k in ("units", "mean", "sigma", "covariance")] == [n] * 4
    assert all(len(row) == n for row in facts["covariance"])
    if not facts["determined"] and None in facts["mean"]:
        assert facts["elements"] is None
        return
    P, sigma = np.array(facts["covariance"]), np.array(facts["sigma"])
    assert np.array_equal(P, P.T) and np.allclose(np.sqrt(np.diag(P)), sigma, rtol=1e-12, atol=0.0) and (sigma > 0).all()
    np.linalg.cholesky(P / np.outer(sigma, sigma))
    elements = facts["elements"]
    assert list(elements) == ["names", "units", "mean", "sigma", "kind", "frame"]
    assert len({len(elements[k]) for k in ("names", "units", "mean", "sigma")}) == 1 and set(elements["units"]) <= SI


def counted(facts, rows):
    """Counts add up: of each station and component the rows that are not used are those with a reason."""
    assert all(list(one) == list(GROUP) for one in facts["residuals"])
    assert all(
        is_of(one[k], kind, k in ("mean", "rms", "weighted_rms")) for one in facts["residuals"] for k, kind in GROUP.items()
    )
    assert all(list(one) == list(ROW) for one in facts["rejected"])
    assert all(is_of(one[k], kind, k == "residual") for one in facts["rejected"] for k, kind in ROW.items())
    assert all(one["reason"] for one in facts["rejected"])
    assert all(pz.Epoch(one["time"]) for one in facts["rejected"])
    for one in facts["residuals"]:
        out = [r for r in facts["rejected"] if (r["station"], r["component"]) == (one["station"], one["component"])]
        assert one["count"] - one["used"] == len(out) and one["unit"] in SI
    if rows is not None and facts["determined"]:
        left = sum(count for count in facts["left_out"].values() if isinstance(count, int))
        assert sum(one["count"] for one in facts["residuals"]) + left == rows
