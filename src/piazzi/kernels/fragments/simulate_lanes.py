"""Draw truths and their measurements, `LANES` runs together: what `simulate` does, with process noise of one shape."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def simulate_lanes(
    runs: int,
    K: int,
    J: int,
    t: Array,
    t_prior: float,
    count: Indices,
    scale: Array,
    first_row: Indices,
    station: Indices,
    sensor: Indices,
    width: Indices,
    angle: Indices,
    numbers: Array,
    R_root: Array,
    p: Array,
    Q_root: Array,
    x0: Array,
    w: Array,
    v: Array,
    one: Array,
    h: Array,
    truth: Array,
    z: Array,
) -> None:
    L = load_lanes(one, 0, 1, 0, LANES)[0] * load_matrix(Q_root, 0, N, N)
    for group in range((runs + LANES - 1) // LANES):
        r = min(group * LANES, runs - LANES)
        x = load_lanes(x0, r * N, N, N, LANES)
        before = t_prior
        for k in range(K):
            if t[k] > before:
                moved = travel_lanes(before, t[k] - before, count[k], x, p)
                x = moved + sqrt(scale[k]) * (L @ load_lanes(w, (r * K + k) * N, N, K * N, LANES))
            before = t[k]
            store_lanes(truth, (r * K + k) * N, K * N, x)
            for row in range(first_row[k], first_row[k + 1]):
                s = station[row]
                at = (r * J + row) * M
                measure_lanes(sensor[s], t[k], x, p, numbers, s * NUMBERS, h)
                for i in range(width[s]):
                    value = load_packs(h, i * LANES, 1, LANES)[0]
                    for j in range(i + 1):
                        value = value + R_root[(s * M + i) * M + j] * load_lanes(v, at + j, 1, J * M, LANES)[0]
                    if angle[s * M + i]:
                        value = wrap_angle(value)
                    store_lanes(z, at + i, J * M, vector(value))
