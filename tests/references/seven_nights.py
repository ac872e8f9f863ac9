"""Seven nights in a row, each with the orbit of the last as its prior, beside one fit of all: sigma and NEES of both.

Run from the root: ``PYTHONPATH=. python tests/references/seven_nights.py [RUNS]``.
"""

import sys

import numpy as np

import piazzi as pz
from tests.determination.fixing import EPOCH, observations, truth

DAY, SIGMA = 86400.0, 5.0
NIGHT = np.arange(0.0, 8 * 3600.0, 1200.0)  # s: eight hours of fixes, every 20 minutes
T = np.concatenate([night * DAY + NIGHT for night in range(7)])
KNOWN = "gravity=EGM2008 degree=12 radiation=cannonball cr_a_m=0.023"
ESTIMATED = "gravity=EGM2008 degree=12 radiation=cannonball"


def nees(found, end, state):
    """Squared error of the state at a date in units of its covariance, and the sigma of the position."""
    P = found.orbit.covariance(end)
    scale = np.sqrt(np.diag(P))
    miss = (found.orbit.at(end) - state) / scale
    return float(miss @ np.linalg.solve(P / np.outer(scale, scale), miss)), float(np.sqrt(np.trace(P[:3, :3])))


def chain(path, forces):
    """The orbit after seven nights, each determined with all rows so far and the last night's orbit."""
    found = None
    for night in range(7):
        rows = (night + 1) * DAY > T
        found = pz.determine(observations(path[rows], T[rows], SIGMA), forces=forces, prior=found, guess=None)
        assert found.determined, found.message
    return found


def compared(runs, forces):
    """For each run the two NEES (6 degrees of freedom), and the ratio of sigmas, chain over one fit."""
    states = truth(T)
    end = EPOCH + float(T[-1])
    out = []
    for seed in range(runs):
        path = states[:, :3] + SIGMA * np.random.default_rng(seed).standard_normal((len(T), 3))
        whole = pz.determine(observations(path, T, SIGMA), forces=forces)
        one, sigma = nees(whole, end, states[-1])
        two, other = nees(chain(path, forces), end, states[-1])
        out.append((one, two, other / sigma))
    return np.array(out)


def main():
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    for name, forces in (("nothing but the orbit estimated", KNOWN), ("sunlight estimated too", ESTIMATED)):
        found = compared(runs, forces)
        mean = found.mean(axis=0)
        print(
            f"{name}, {runs} runs: NEES per degree of freedom, one fit {mean[0] / 6:.2f}, chain {mean[1] / 6:.2f}; "
            f"sigma of the chain over that of one fit {found[:, 2].min():.3f} to {found[:, 2].max():.3f}"
        )


if __name__ == "__main__":
    main()
