"""All measurements of one epoch, without those that cannot be believed, linearised anew at every estimate from them."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def surprise(row, innovation, innovation_covariance, L):
    """nu^T S^-1 nu of a row over the components that are there, by Cholesky's factor, and how many these are."""
    total = 0.0
    present = 0
    for i in range(M):
        e = innovation[row * M + i]
        if isnan(e):
            for j in range(M):
                L[i * M + j] = 0.0
        else:
            for j in range(i + 1):
                s = 0.0 if isnan(innovation[row * M + j]) else innovation_covariance[(row * M + i) * M + j]
                for k in range(j):
                    s = s - L[i * M + k] * L[j * M + k]
                if i == j:
                    L[i * M + i] = sqrt(s)
                else:
                    L[i * M + j] = s / L[j * M + j] if L[j * M + j] > 0.0 else 0.0
            for j in range(i):
                e = e - L[i * M + j] * L[M * M + j]
            e = e / L[i * M + i]
            total += e * e
            present += 1
        L[M * M + i] = 0.0 if isnan(e) else e
    return total, present


@inline
def judge(
    first, last, t, x, P, p, z, station, sensor, numbers, R, nu, H, work, gate, rejected, innovation, innovation_covariance
):
    """Innovations of all rows at the prediction, and which rows lie beyond the gate of their number of components."""
    for row in range(first, last):
        s = station[row]
        innovate(sensor[s], t, x, p, numbers, s * NUMBERS, z, row * M, nu, H, 0)
        record(row, nu, H, P, R, s * M * M, innovation, innovation_covariance)
        squared, present = surprise(row, innovation, innovation_covariance, work)
        rejected[row] = 1 if squared > gate[present] else 0


@inline
def update_epoch_guarded(
    first,
    last,
    t,
    x,
    P,
    p,
    z,
    station,
    sensor,
    numbers,
    R,
    correlated,
    nu,
    H,
    work,
    iterations,
    gate,
    rejected,
    innovation,
    innovation_covariance,
):
    """Gauss-Newton steps on prediction and measurements together: each counts once, however often it is linearised.

    Linearised at x + d, a row says nu + H d about the deviation from the prediction x (Bell and Cathey, IEEE Trans. Automatic
    Control 38, 1993); the covariance is that of the last step.
    """
    judge(
        first, last, t, x, P, p, z, station, sensor, numbers, R, nu, H, work, gate, rejected, innovation, innovation_covariance
    )
    d = unit(-1, N)
    P_new = P
    for _ in range(iterations):
        offset = d
        d = unit(-1, N)
        P_new = P
        for row in range(first, last):
            if rejected[row] == 0:
                s = station[row]
                innovate(sensor[s], t, x + offset, p, numbers, s * NUMBERS, z, row * M, nu, H, 0)
                for i in range(M):
                    nu[i] = nu[i] + load_vector(H, i * N, N) @ offset
                d, P_new = absorb(d, P_new, nu, H, R, s * M * M, correlated[s], work)
    return x + d, P_new
