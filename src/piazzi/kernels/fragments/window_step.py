"""Sliding window: at every epoch a Gauss-Newton step over the newest states; what left lives on in the prior of the oldest.

The measurements of a state that leaves keep the linearisation of its last step, its dynamics are linearised at its current
estimate: so a window of one state and one iteration is the extended Kalman filter, and a window of all states is the graph.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def settle(
    a,
    k,
    iterations,
    t,
    count,
    scale,
    first_row,
    z,
    station,
    sensor,
    numbers,
    R,
    correlated,
    p,
    Q,
    m,
    P,
    f,
    Phi,
    Q_all,
    nu,
    H,
    d_pred,
    P_pred,
    gains,
    multiplier,
    dx,
    nu_row,
    H_row,
    work,
    tether,
    x,
    oldest_covariance,
    innovation,
    innovation_covariance,
):
    """Gauss-Newton steps over the states a ... k; returns the newest state's covariance, stores the oldest's."""
    W = k - a + 1
    P_new = P
    for iteration in range(iterations):
        linearize_dynamics(a, W, t, count, scale, p, Q, x, f, Phi, Q_all)
        linearize_rows(a, W, t, x, first_row, z, station, sensor, numbers, R, correlated, p, nu, H, work)
        _, P_new, P_old = forward_following(a, W, x, scale, first_row, Q, Q_all, f, Phi, nu, H, m, P, d_pred, P_pred)
        if iteration == 0:
            d = load_vector(d_pred, (W - 1) * N, N)
            P_newest = load_matrix(P_pred, (W - 1) * N * N, N, N)
            record_epoch(
                k,
                t,
                first_row,
                z,
                station,
                sensor,
                numbers,
                R,
                p,
                load_vector(x, k * N, N),
                d,
                P_newest,
                nu_row,
                H_row,
                innovation,
                innovation_covariance,
            )
        backward(a, W, first_row, Phi, nu, H, 0.0, tether, d_pred, P_pred, gains, multiplier, dx)
        for j in range(W):
            store(x, (a + j) * N, load_vector(x, (a + j) * N, N) + load_vector(dx, j * N, N))
        if cancelled(P_old, load_matrix(P_pred, 0, N, N)) == 1:
            marginal_covariances(a, W, scale, first_row, Q, Q_all, Phi, nu, H, P_pred, P_new, 0, oldest_covariance, tether)
        else:
            store(oldest_covariance, a * N * N, symmetric(P_old))
    return symmetric(P_new)
