"""Sliding window one measurement at a time: the same pieces as over a whole run, on buffers that stay between calls.

`span` says which epochs a call is about: the oldest and the newest, or, of those that leave, the first and the one behind them.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(span="2")
def live_append(span: Indices, run: Run, p: Given, chain: Chain) -> None:
    k = span[1]
    x = load_vector(chain.x, (k - 1) * N, N)
    store(chain.x, k * N, propagate(run.t[k - 1], run.t[k] - run.t[k - 1], run.count[k], x, p))


@entry
@sizes(span="2")
def live_marginalize(span: Indices, window: Window, run: Run, p: Given, chain: Chain) -> None:
    for a in range(span[0], span[1]):
        marginalize_oldest(a, span[0], window, run, p, chain)


@entry
@sizes(span="2", widest="1")
def live_solve(
    span: Indices,
    window: Window,
    run: Run,
    p: Given,
    measured: Measured,
    chain: Chain,
    innovations: Innovations,
    widest: Array,
) -> None:
    k = span[1]
    P = solve_window(span[0], k, window, run, p, measured, chain, innovations)
    for row in range(run.first_row[k], run.first_row[k + 1]):
        record_variance_ratio(row, measured, innovations, widest)
    store(window.newest, 0, P)
