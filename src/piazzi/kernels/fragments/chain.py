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
def absorb_epoch(first, last, d, P, nu, H):
    """Deviation and covariance after the measurements first ... last - 1, and the sum of their squared innovations."""
    fit = 0.0
    for c in range(first, last):
        if not isnan(nu[c]):
            d, P, _, _, squared = update_scalar(d, P, load_vector(H, c * N, N), nu[c])
            fit += squared
    return d, P, fit


@inline
def damp(d, P, damping, tether, nu, K_all, slot, keep):
    """Measurements "no deviation" of every state, as sharp as `damping` prior covariances (Levenberg-Marquardt)."""
    for i in range(N):
        h = sqrt(damping) * load_vector(tether, i * N, N)
        d, P, K, g, _ = update_scalar(d, P, h, 0.0)
        if keep:
            store(K_all, (slot + i) * (N + 1), K)
            K_all[(slot + i) * (N + 1) + N] = g
    return d, P


@inline
def follow_epoch(first, last, d, P, P_old, C, nu, H):
    """As `absorb_epoch`, and the same for the oldest state: its covariance, and C = Cov(this state, the oldest)."""
    for c in range(first, last):
        if not isnan(nu[c]):
            h = load_vector(H, c * N, N)
            u = h @ C
            S = h @ (h @ P) + 1.0
            d, P, K, _, _ = update_scalar(d, P, h, nu[c])
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
def forward_following(a, W, x, scale, first_row, Q, Q_all, f, Phi, nu, H, m, P, d_pred, P_pred):
    """As `forward`, undamped; the covariance of the oldest state given all measurements of the stretch comes with it."""
    base = first_row[a]
    d = m - load_vector(x, a * N, N)
    C = P
    P_old = P
    for j in range(W):
        k = a + j
        if j > 0:
            F = load_matrix(Phi, (j - 1) * N * N, N, N)
            C = F @ C
            P = F @ P @ F.T + noise_at(j, scale[k], Q, Q_all)
            d = F @ d + (load_vector(f, (j - 1) * N, N) - load_vector(x, k * N, N))
        P = symmetric(P)
        store(d_pred, j * N, d)
        store(P_pred, j * N * N, P)
        first = (first_row[k] - base) * M
        d, P, P_old, C = follow_epoch(first, (first_row[k + 1] - base) * M, d, P, P_old, C, nu, H)
        if j == 0:  # its own measurements in Joseph form: a wide prior less what they say would leave no digits
            C = P
            P_old = P
    return d, P, P_old


@inline
def forward(a, W, x, scale, first_row, Q, Q_all, f, Phi, nu, H, m, P, damping, tether, d_pred, P_pred):
    """Predicted deviations and covariances of states a ... a + W - 1; those of the last after its measurements are returned."""
    base = first_row[a]
    d = m - load_vector(x, a * N, N)
    fit = 0.0
    for j in range(W):
        k = a + j
        if j > 0:
            F = load_matrix(Phi, (j - 1) * N * N, N, N)
            P = F @ P @ F.T + noise_at(j, scale[k], Q, Q_all)
            d = F @ d + (load_vector(f, (j - 1) * N, N) - load_vector(x, k * N, N))
        P = symmetric(P)
        store(d_pred, j * N, d)
        store(P_pred, j * N * N, P)
        d, P, squared = absorb_epoch((first_row[k] - base) * M, (first_row[k + 1] - base) * M, d, P, nu, H)
        fit += squared
        if damping > 0.0:
            d, P = damp(d, P, damping, tether, nu, nu, 0, 0)
    return d, P, fit


@inline
def back_through_epoch(first, last, lam, d, P, nu, H, damping, tether, gains):
    """Multiplier before an epoch's measurements from the one after them: gains are recomputed, in order, then undone."""
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
        d, P = damp(d, P, damping, tether, nu, gains, used, 1)
        for b in range(N):
            slot = used + N - 1 - b
            h = sqrt(damping) * load_vector(tether, (N - 1 - b) * N, N)
            lam = lam - (gains[slot * (N + 1) + N] + load_vector(gains, slot * (N + 1), N) @ lam) * h
    for b in range(last - first):
        c = last - 1 - b
        if not isnan(nu[c]):
            used -= 1
            lam = lam - (gains[used * (N + 1) + N] + load_vector(gains, used * (N + 1), N) @ lam) * load_vector(H, c * N, N)
    return lam


@inline
def backward(a, W, first_row, Phi, nu, H, damping, tether, d_pred, P_pred, gains, multiplier, dx):
    """Deviations of all states of the stretch, into `dx`; the multipliers of the dynamics, into `multiplier`."""
    base = first_row[a]
    lam = unit(-1, N)
    for b in range(W):
        j = W - 1 - b
        k = a + j
        if b > 0:
            lam = lam @ load_matrix(Phi, j * N * N, N, N)
        d = load_vector(d_pred, j * N, N)
        P = load_matrix(P_pred, j * N * N, N, N)
        lam = back_through_epoch(
            (first_row[k] - base) * M, (first_row[k + 1] - base) * M, lam, d, P, nu, H, damping, tether, gains
        )
        store(multiplier, j * N, lam)
        store(dx, j * N, d - lam @ P)
