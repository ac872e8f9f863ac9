"""Made-up fixes of an orbit at 20,000 km: every test that solves one uses the same model, so that one kernel serves all."""

import numpy as np

import piazzi as pz
from piazzi import earth
from piazzi.determination.setup import follow
from piazzi.formats import Observations, Segment

EPOCH = pz.Epoch("2015-05-05T00:00:00 UTC")
STATE = np.array([-17980470.3, -67945.7, 19435871.3, 1547.42562, -3263.10326, 1434.69777])  # m, m/s, GCRF
CR_A_M = 0.023


def observations(position, t, sigma, frame="GCRF", name="SAT", epoch=EPOCH, **told):
    """Rows x, y, z of positions (K, 3) m at times (K,) s."""
    return Observations(
        epoch=epoch,
        t=np.repeat(np.asarray(t, dtype=float), 3),
        value=np.asarray(position).reshape(-1),
        kinds=("x", "y", "z"),
        kind=np.tile(np.arange(3), len(t)),
        participants=(name,),
        object=0,
        segments=(Segment("UTC", participants=(name,), frame=frame),),
        sigma=sigma,
        **told,
    )


def truth(t):
    """States (K, 6) at times (K,) s past `EPOCH` of the orbit that starts at `STATE`, by steps of order 8 of 30 s."""
    forces = earth.Forces(degree=12, tides=("solid", "k1"), radiation="cannonball")
    model = forces.model([pz.Sensor("position", {"px": "x", "py": "y", "pz": "z"})], {"cr_a_m": "estimated"})
    problem = pz.Problem(
        model,
        pz.Gaussian(STATE, np.diag([1e10] * 3 + [1e2] * 3)),
        stations=[pz.Station("fixes", "position", [1.0] * 3)],
        parameters={**forces.values, "cr_a_m": pz.Gaussian(CR_A_M, 1e-4)},
        integrator=pz.RungeKutta8(max_step=100.0),
        functions=forces.functions(EPOCH),
        epoch=EPOCH,
        prior_time=0.0,
    )
    return follow(problem, np.asarray(t, dtype=float), np.append(STATE, CR_A_M), 100.0)[0][:, :6]
