"""A filter that carries a root of its covariance, over a whole run or one epoch."""

from piazzi.kernels.fragments.root import begin_epoch, finish_epoch, take_row
from piazzi.kernels.fragments.root_linear import advance_root
from piazzi.kernels.fragments.semidefinite import root_of
from piazzi.kernels.fragments.triangle import covariance_of
from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
def make_root(covariance: Array, U: Array) -> None:
    root_of(load_matrix(covariance, 0, N, N), U, 0)


@entry
def run_root_filter(
    K: int,
    t: Array,
    t_prior: float,
    count: Indices,
    scale: Array,
    first_row: Indices,
    z: Array,
    station: Indices,
    sensor: Indices,
    numbers: Array,
    R: Array,
    correlated: Indices,
    p: Array,
    Q: Array,
    x0: Array,
    U: Array,
    settings: Array,
    gate: Array,
    points: Array,
    rows: Array,
    G: Array,
    B: Array,
    d: Array,
    phi: Array,
    seen: Array,
    rejected: Indices,
    mean: Array,
    covariance: Array,
    innovation: Array,
    innovation_covariance: Array,
) -> None:
    nu, H, work = scratch(M), scratch(MN), scratch(WORK)
    x = load_vector(x0, 0, N)
    Q_unit = load_matrix(Q, 0, N, N)
    before = t_prior
    for k in range(K):
        if t[k] > before:
            x = advance_root(before, t[k] - before, count[k], x, U, p, Q_unit, scale[k], points, rows, settings)
        before = t[k]
        begin_epoch(B, d)
        for row in range(first_row[k], first_row[k + 1]):
            take_row(
                row,
                station[row],
                t[k],
                x,
                U,
                p,
                z,
                sensor,
                numbers,
                R,
                nu,
                H,
                work,
                settings,
                gate,
                G,
                B,
                d,
                phi,
                seen,
                rejected,
                innovation,
                innovation_covariance,
            )
        x = finish_epoch(x, U, B, d, rows)
        store(mean, k * N, x)
        store(covariance, k * N * N, covariance_of(U))
