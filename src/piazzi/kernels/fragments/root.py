"""Covariances as roots: N rows r_i with P = sum of r_i^T r_i, so that no rounding makes P indefinite.

A state is x = x_pred + sum of u_i r_i with independent u_i of unit variance.  What is measured at one epoch is linear in the
first N of `unknowns()` such numbers, the u_i, and in the others, which stand for what a measurement's curvature adds.  Their
joint root B starts as the identity and takes in one component after the other (Potter 1963; Kaminski, Bryson and Schmidt, IEEE
Trans. Automatic Control 16, 1971), all at the same predicted state: so rows of an epoch commute.
"""

from piazzi.kernels.fragments.root_linear import unknowns
from piazzi.kernels.fragments.triangle import keep_root, triangularize_rows
from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def begin_epoch(joint):
    """Nothing is measured yet: unit variances, and no correction."""
    for i in range(unknowns()):
        joint.d[i] = 0.0
        for j in range(unknowns()):
            joint.B[i * unknowns() + j] = 1.0 if i == j else 0.0


@inline
def record_root(row, measured, own, joint, innovations):
    """Write the innovation and S = G G^T + R of one row, NaN where a component is missing."""
    at = measured.station[row] * M * M
    nu, G = own.nu, joint.G
    for i in range(M):
        innovations.nu[row * M + i] = nu[i]
        for j in range(M):
            s = measured.R[at + i * M + j]
            for k in range(unknowns()):
                s += G[i * unknowns() + k] * G[j * unknowns() + k]
            innovations.S[(row * M + i) * M + j] = nan if isnan(nu[i]) or isnan(nu[j]) else s


@inline
def whiten_root(row, measured, own, joint):
    """Divide innovation and sensitivities of one row by the Cholesky factor of R, in place, without missing components."""
    at = measured.station[row] * M * M
    nu, L, G = own.nu, own.work, joint.G
    for i in range(M):
        if isnan(nu[i]):
            for j in range(M):
                L[i * M + j] = 0.0
        else:
            for j in range(i + 1):
                s = 0.0 if isnan(nu[j]) else measured.R[at + i * M + j]
                for k in range(j):
                    s = s - L[i * M + k] * L[j * M + k]
                if i == j:
                    L[i * M + i] = sqrt(s)
                else:
                    L[i * M + j] = 0.0 if isnan(nu[j]) else s / L[j * M + j]
            for j in range(i):
                if not isnan(nu[j]):
                    nu[i] = nu[i] - L[i * M + j] * nu[j]
                    for k in range(unknowns()):
                        G[i * unknowns() + k] -= L[i * M + j] * G[j * unknowns() + k]
            nu[i] = nu[i] / L[i * M + i]
            for k in range(unknowns()):
                G[i * unknowns() + k] = G[i * unknowns() + k] / L[i * M + i]


@inline
def update_root(c, nu, joint):
    """Correction and joint root after component c, of unit noise: B' = B - B phi phi^T / (S + sqrt(S)).

    Where the component is far more exact than what was known, the difference loses its digits: then one column of B after the
    other by rotations (Carlson, AIAA Journal 11, 1973).
    """
    d, B, phi, G = joint.d, joint.B, joint.phi, joint.G
    at = c * unknowns()
    S = 1.0
    e = nu[c]
    for j in range(unknowns()):
        e -= G[at + j] * d[j]
        s = 0.0
        for i in range(unknowns()):
            s += B[i * unknowns() + j] * G[at + i]
        phi[j] = s
        S += s * s
    for i in range(unknowns()):
        s = 0.0
        for j in range(unknowns()):
            s += B[i * unknowns() + j] * phi[j]
        d[i] += s * (e / S)
        s = s / (S + sqrt(S))
        if S < FEW_DIGITS:
            for j in range(unknowns()):
                B[i * unknowns() + j] -= s * phi[j]
        else:
            before = 1.0
            s = 0.0
            for j in range(unknowns()):
                after = before + phi[j] * phi[j]
                b = B[i * unknowns() + j]
                B[i * unknowns() + j] = sqrt(before / after) * b - s / sqrt(before) * (phi[j] / sqrt(after))
                s += b * phi[j]
                before = after


@inline
def update_root_row(row, measured, own, joint):
    """One row of measurements, as it was sensed, into the epoch's correction."""
    whiten_root(row, measured, own, joint)
    for c in range(M):
        if not isnan(own.nu[c]):
            update_root(c, own.nu, joint)


@inline
def finish_epoch(x, root, joint):
    """The state with its correction; its root, in place."""
    for c in range(unknowns()):
        row = unit(-1, N)
        for i in range(N):
            row = row + joint.B[i * unknowns() + c] * load_vector(root.U, i * N, N)
        store(root.rows, c * N, row)
    for i in range(N):
        x = x + joint.d[i] * load_vector(root.U, i * N, N)
    triangularize_rows(root.rows, unknowns())
    keep_root(root.rows, root.U)
    return x
