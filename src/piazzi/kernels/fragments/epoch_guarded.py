"""All measurements of one epoch, without those that cannot be believed, linearised anew at every estimate from them."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def squared_innovation(row, innovations, L):
    """nu^T S^-1 nu of a row over the components that are there, by Cholesky's factor, and how many these are."""
    total = 0.0
    present = 0
    for i in range(M):
        e = innovations.nu[row * M + i]
        if isnan(e):
            for j in range(M):
                L[i * M + j] = 0.0
        else:
            for j in range(i + 1):
                s = 0.0 if isnan(innovations.nu[row * M + j]) else innovations.S[(row * M + i) * M + j]
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
def passes_gate(row, squared, present, gate, innovations):
    """Whether a row is taken: it lies within the gate, or the gate is open, as so many rows in a row were beyond it.

    Good rows are rejected one after the other only by a belief that is wrong.  An open gate closes with the first row within.
    A row without a prediction is taken, so that the failure shows.
    """
    beyond = squared > gate.limits[present]
    for i in range(M):
        if fabs(innovations.nu[row * M + i]) == inf:
            beyond = False
    gate.streak[0] = gate.streak[0] + 1 if beyond else 0
    gate.rejected[row] = 0
    if beyond:
        gate.rejected[row] = 2 if gate.streak[0] > REOPENS else 1
    return gate.rejected[row] != 1


@inline
def gate_rows(run, k, x, P, p, measured, gate, innovations):
    """Innovations of all rows at the prediction, and which rows lie beyond the gate of their number of components."""
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    for row in range(run.first_row[k], run.first_row[k + 1]):
        innovate_row(measured, row, run.t[k], x, p, own.nu, own.H, 0)
        record(row, P, measured, own, innovations)
        squared, present = squared_innovation(row, innovations, own.work)
        passes_gate(row, squared, present, gate, innovations)


@inline
def update_epoch_guarded(run, k, x, P, p, measured, gate, innovations):
    """Gauss-Newton steps on prediction and measurements together: each counts once, however often it is linearised.

    Linearised at x + d, a row says nu + H d about the deviation from the prediction x (Bell and Cathey, IEEE Trans. Automatic
    Control 38, 1993); the covariance is that of the last step.
    """
    gate_rows(run, k, x, P, p, measured, gate, innovations)
    own = Row(scratch(M), scratch(MN), scratch(WORK))
    d = unit(-1, N)
    P_new = P
    for _ in range(gate.iterations):
        offset = d
        d = unit(-1, N)
        P_new = P
        for row in range(run.first_row[k], run.first_row[k + 1]):
            if gate.rejected[row] != 1:
                innovate_row(measured, row, run.t[k], x + offset, p, own.nu, own.H, 0)
                for i in range(M):
                    told = own.nu[i] + load_vector(own.H, i * N, N) @ offset
                    own.nu[i] = unless_missing(measured.z[row * M + i], told)
                d, P_new = update_row(d, P_new, measured.station[row], measured, own)
    return x + d, P_new
