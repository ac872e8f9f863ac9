"""Draw truths and their measurements, `LANES` runs together: what `simulate` does, with process noise of one shape."""

from piazzi.kernels.fragments.score_lanes import ones
from piazzi.kernels.fragments.step_lanes import propagate_lanes
from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def simulate_lanes(run: Run, p: Given, stations: Stations, drawn: Drawn, samples: Samples) -> None:
    h = scratch(M_LANES)
    K, J = run.epochs, samples.rows
    L = ones() * load_matrix(drawn.Q_root, 0, N, N)
    for group in range((samples.many + LANES - 1) // LANES):
        r = min(group * LANES, samples.many - LANES)
        x = load_lanes(drawn.first, r * N, N, N, LANES)
        before = run.t_prior
        for k in range(K):
            if run.t[k] > before:
                moved = propagate_lanes(before, run.t[k] - before, run.count[k], x, p)
                x = moved + sqrt(run.scale[k]) * (L @ load_lanes(drawn.w, (r * K + k) * N, N, K * N, LANES))
            before = run.t[k]
            store_lanes(samples.truth, (r * K + k) * N, K * N, x)
            for row in range(run.first_row[k], run.first_row[k + 1]):
                s = stations.station[row]
                at = (r * J + row) * M
                measure_lanes(stations.sensor[s], run.t[k], x, p, stations.numbers, s * NUMBERS, h)
                for i in range(stations.width[s]):
                    value = load_packs(h, i * LANES, 1, LANES)[0]
                    for j in range(i + 1):
                        value = value + drawn.R_root[(s * M + i) * M + j] * load_lanes(drawn.v, at + j, 1, J * M, LANES)[0]
                    if stations.angle[s * M + i]:
                        value = wrap_angle(value)
                    store_lanes(samples.z, at + i, J * M, vector(value))
