"""Linearised dynamics of a stretch of states, `LANES` states at a time; process noise is a multiple of one matrix."""

from piazzi.kernels.fragments.step_lanes import transition_each
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def linearize_dynamics(a, W, run, chain, p):
    """f and Phi of states a ... a + W - 2 at their current values, stored from position 0."""
    t, count = run.t, run.count
    j = 0
    while j + 1 < W:
        k = a + j
        together = 1 if j + LANES < W else 0
        if together:
            for lane in range(1, LANES):
                if count[k + lane + 1] != count[k + 1]:
                    together = 0
        if together:
            start = load_lanes(t, k, 1, 1, LANES)[0]
            dt = load_lanes(t, k + 1, 1, 1, LANES)[0] - start
            y, Phi = transition_each(start, dt, count[k + 1], load_lanes(chain.x, k * N, N, N, LANES), p)
            one = 1.0 + 0.0 * dt  # in every lane: where nothing depends on the states, y and Phi have a single lane
            store_lanes(chain.f, j * N, N, one * y)
            store_lanes(chain.Phi, j * N * N, N * N, one * Phi)
            j += LANES
        else:
            y_one, Phi_one = transition(t[k], t[k + 1] - t[k], count[k + 1], load_vector(chain.x, k * N, N), p)
            store(chain.f, j * N, y_one)
            store(chain.Phi, j * N * N, Phi_one)
            j += 1
