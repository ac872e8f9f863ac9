"""Unknowns of one orbit: its first state and the constants, from all rows by their derivatives by the first state.

The first state is what its prior says plus a sum of rows of a root of the prior's covariance, with factors of unit variance.
Every row is one equation for these factors, and they are rotated into a triangle (Bierman 1977, ch. 4): nothing is squared, and
the prior may be of any width.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def times_root(k, orbit, A):
    """What each row of the root makes of state k, into rows of `A`."""
    size = orbit.size
    for j in range(size):
        for i in range(size):
            s = 0.0
            for q in range(size):
                s += orbit.W[(k * size + i) * size + q] * orbit.root[j * size + q]
            A[j * size + i] = s


@inline
def predicted_belief(k, shot, size):
    """Deviation and covariance of state k, of what the rows so far tell."""
    A, U = shot.A, shot.U
    for i in range(size):
        s = shot.offset[i]
        for j in range(size):
            s += shot.b[j] * A[j * size + i]
        shot.mean[k * size + i] = s
    for q in range(size):
        for i in range(size):
            s = 0.0
            for j in range(q + 1):
                s += shot.inverse[j * size + q] * A[j * size + i]
            U[q * size + i] = s
    for i in range(size):
        for j in range(i + 1):
            s = 0.0
            for q in range(size):
                s += U[q * size + i] * U[q * size + j]
            shot.covariance[(k * size + i) * size + j] = s
            shot.covariance[(k * size + j) * size + i] = s


@inline
def away(k, orbit, start, offset):
    """What becomes of a deviation of the first state at epoch k."""
    size = orbit.size
    for i in range(size):
        s = orbit.drift[k * size + i]
        for q in range(size):
            s += orbit.W[(k * size + i) * size + q] * start[q]
        offset[i] = s


@entry
def shoot(orbit: Orbit, shot: Shot, damping: float) -> None:
    """Deviations `dx` of all states, and of each what the prior and the rows before it say; `inverse` of the last triangle."""
    size, width = orbit.size, orbit.width
    R, y, A, row, offset = shot.R, shot.y, shot.A, shot.row, shot.offset
    for i in range(size):
        y[i] = 0.0
        for j in range(size):
            R[i * size + j] = 1.0 if i == j else 0.0
    for k in range(orbit.epochs):
        times_root(k, orbit, A)
        away(k, orbit, orbit.start, offset)
        solve_triangle(R, y, shot.inverse, shot.b, size)
        predicted_belief(k, shot, size)
        for c in range(orbit.first_row[k] * width, orbit.first_row[k + 1] * width):
            if not isnan(orbit.nu[c]):
                value = orbit.nu[c]
                for i in range(size):
                    value -= orbit.H[c * size + i] * offset[i]
                for j in range(size):
                    s = 0.0
                    for i in range(size):
                        s += orbit.H[c * size + i] * A[j * size + i]
                    row[j] = s
                rotate(R, y, row, value, size)
        if damping > 0.0:
            for i in range(size):
                weight = sqrt(damping) * orbit.scaling[i]
                for j in range(size):
                    row[j] = weight * A[j * size + i]
                rotate(R, y, row, -weight * offset[i], size)
    solve_triangle(R, y, shot.inverse, shot.b, size)
    for i in range(size):
        s = orbit.start[i]
        for j in range(size):
            s += shot.b[j] * orbit.root[j * size + i]
        row[i] = s
    for k in range(orbit.epochs):
        away(k, orbit, row, offset)
        for i in range(size):
            shot.dx[k * size + i] = offset[i]
