"""One Gauss-Newton step over a stretch of states, without a normal matrix or an inverse.

Forward, a linearised Kalman filter over the deviations from the current states; back, the recursion of Bryson and Frazier
(1963) for the multipliers.  Nothing is divided by Q, so singular and zero process noise are ordinary.  Deviation k is
d_k - P_k lambda_k, with d and P predicted and lambda the multiplier before the measurements of epoch k.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def update_scalar(d, P, h, nu):
    """Deviation and covariance after one measurement of unit noise, in Joseph form; its gain, and innovation over variance."""
    Ph = h @ P
    S = h @ Ph + 1.0
    K = (1.0 / S) * Ph
    e = nu - h @ d
    B = P - outer(Ph, K)
    return d + e * K, B + outer(K, K - h @ B), K, e / S, e * e / S


@inline
def update_deviation(first, last, d, P, chain):
    """Deviation and covariance after the measurements first ... last - 1, and the sum of their squared innovations."""
    fit = 0.0
    for c in range(first, last):
        if not isnan(chain.nu[c]):
            d, P, _, _, squared = update_scalar(d, P, load_vector(chain.H, c * N, N), chain.nu[c])
            fit += squared
    return d, P, fit


@inline
def damp(d, P, damping, chain, slot, keep):
    """Measurements "no deviation" of every state, as sharp as `damping` prior covariances (Levenberg-Marquardt)."""
    for i in range(N):
        h = sqrt(damping) * load_vector(chain.scaling, i * N, N)
        d, P, K, g, _ = update_scalar(d, P, h, 0.0)
        if keep:
            store(chain.gains, (slot + i) * (N + 1), K)
            chain.gains[(slot + i) * (N + 1) + N] = g
    return d, P


@inline
def update_fixed_point(first, last, d, P, P_old, C, chain):
    """As `update_deviation`, and the same for the oldest state: its covariance, and C = Cov(this state, the oldest)."""
    for c in range(first, last):
        if not isnan(chain.nu[c]):
            h = load_vector(chain.H, c * N, N)
            u = h @ C
            S = h @ (h @ P) + 1.0
            d, P, K, _, _ = update_scalar(d, P, h, chain.nu[c])
            P_old = P_old - outer((1.0 / S) * u, u)
            C = C - outer(K, u)
    return d, P, P_old, C


@inline
def cancelled(P_old, P_start):
    """Whether what later measurements took from a covariance leaves few of its digits: they were subtracted, one by one."""
    before, after = scratch(NN), scratch(NN)
    store(before, 0, P_start)
    store(after, 0, P_old)
    lost = 0
    for i in range(0, NN, N + 1):
        if before[i] > FEW_DIGITS * after[i]:
            lost = 1
    return lost


@inline
def predict_deviation(j, k, d, P, run, chain):
    """Deviation and covariance of state j of the stretch, which is state k, from those of the one before."""
    F = load_matrix(chain.Phi, (j - 1) * N * N, N, N)
    P = F @ P @ F.T + noise_at(j, run.scale[k], Q_matrix(run.Q), chain.Q_all)
    return F @ d + (load_vector(chain.f, (j - 1) * N, N) - load_vector(chain.x, k * N, N)), P


@inline
def forward_fixed_point(a, W, run, chain, m, P):
    """As `forward`, undamped; the covariance of the oldest state given all measurements of the stretch comes with it."""
    base = run.first_row[a]
    d = m - load_vector(chain.x, a * N, N)
    C = P
    P_old = P
    for j in range(W):
        k = a + j
        if j > 0:
            C = load_matrix(chain.Phi, (j - 1) * N * N, N, N) @ C
            d, P = predict_deviation(j, k, d, P, run, chain)
        P = symmetric(P)
        store(chain.d_pred, j * N, d)
        store(chain.P_pred, j * N * N, P)
        first = (run.first_row[k] - base) * M
        d, P, P_old, C = update_fixed_point(first, (run.first_row[k + 1] - base) * M, d, P, P_old, C, chain)
        if j == 0:  # its own measurements in Joseph form: a wide prior less what they say would leave no digits
            C = P
            P_old = P
    return d, P, P_old


@inline
def forward(a, W, run, chain, m, P, damping):
    """Predicted deviations and covariances of states a ... a + W - 1; those of the last after its measurements are returned."""
    base = run.first_row[a]
    d = m - load_vector(chain.x, a * N, N)
    fit = 0.0
    for j in range(W):
        k = a + j
        if j > 0:
            d, P = predict_deviation(j, k, d, P, run, chain)
        P = symmetric(P)
        store(chain.d_pred, j * N, d)
        store(chain.P_pred, j * N * N, P)
        d, P, squared = update_deviation((run.first_row[k] - base) * M, (run.first_row[k + 1] - base) * M, d, P, chain)
        fit += squared
        if damping > 0.0:
            d, P = damp(d, P, damping, chain, 0, 0)
    return d, P, fit


@inline
def back_through_epoch(first, last, lam, d, P, chain, damping):
    """Multiplier before an epoch's measurements from the one after them: gains are recomputed, in order, then undone."""
    nu, H, gains = chain.nu, chain.H, chain.gains
    used = 0
    for c in range(first, last):
        if not isnan(nu[c]):
            h = load_vector(H, c * N, N)
            d_next, P_next, K, g, _ = update_scalar(d, P, h, nu[c])
            store(gains, used * (N + 1), K)
            gains[used * (N + 1) + N] = g
            used += 1
            if c + 1 < last or damping > 0.0:
                d = d_next
                P = P_next
    if damping > 0.0:
        d, P = damp(d, P, damping, chain, used, 1)
        for b in range(N):
            slot = used + N - 1 - b
            h = sqrt(damping) * load_vector(chain.scaling, (N - 1 - b) * N, N)
            lam = lam - (gains[slot * (N + 1) + N] + load_vector(gains, slot * (N + 1), N) @ lam) * h
    for b in range(last - first):
        c = last - 1 - b
        if not isnan(nu[c]):
            used -= 1
            lam = lam - (gains[used * (N + 1) + N] + load_vector(gains, used * (N + 1), N) @ lam) * load_vector(H, c * N, N)
    return lam


@inline
def backward(a, W, run, chain, damping):
    """Deviations of all states of the stretch, and the multipliers of the dynamics."""
    base = run.first_row[a]
    lam = unit(-1, N)
    for b in range(W):
        j = W - 1 - b
        k = a + j
        if b > 0:
            lam = lam @ load_matrix(chain.Phi, j * N * N, N, N)
        d = load_vector(chain.d_pred, j * N, N)
        P = load_matrix(chain.P_pred, j * N * N, N, N)
        lam = back_through_epoch((run.first_row[k] - base) * M, (run.first_row[k + 1] - base) * M, lam, d, P, chain, damping)
        store(chain.multiplier, j * N, lam)
        store(chain.dx, j * N, d - lam @ P)
