"""Unknowns of one orbit: its first state and the constants, from all rows by their derivatives by the first state.

The first state is what its prior says plus a sum of rows of a root of the prior's covariance, with factors of unit variance.
Every row is one equation for these factors, and they are rotated into a triangle (Bierman 1977, ch. 4): nothing is squared, and
the prior may be of any width.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def times_root(W, at, root, A, size):
    """What each row of the root makes of a state, into rows of `A`."""
    for j in range(size):
        for i in range(size):
            s = 0.0
            for q in range(size):
                s += W[at + i * size + q] * root[j * size + q]
            A[j * size + i] = s


@inline
def solved_factors(R, y, inverse, b, size):
    """The factors that the rows so far tell, and the inverse of their triangle."""
    invert_upper(R, inverse, size)
    for q in range(size):
        s = 0.0
        for j in range(q, size):
            s += inverse[q * size + j] * y[j]
        b[q] = s


@inline
def predicted_belief(k, A, offset, inverse, b, work, mean, covariance, size):
    """Deviation and covariance of state k, of what the rows so far tell."""
    for i in range(size):
        s = offset[i]
        for j in range(size):
            s += b[j] * A[j * size + i]
        mean[k * size + i] = s
    for q in range(size):
        for i in range(size):
            s = 0.0
            for j in range(q + 1):
                s += inverse[j * size + q] * A[j * size + i]
            work[q * size + i] = s
    for i in range(size):
        for j in range(i + 1):
            s = 0.0
            for q in range(size):
                s += work[q * size + i] * work[q * size + j]
            covariance[(k * size + i) * size + j] = s
            covariance[(k * size + j) * size + i] = s


@inline
def away(W, drift, start, k, offset, size):
    """What becomes of a deviation of the first state at epoch k."""
    for i in range(size):
        s = drift[k * size + i]
        for q in range(size):
            s += W[(k * size + i) * size + q] * start[q]
        offset[i] = s


@entry
@sizes(
    K="K", size="Z", width="V", first_row="K+1", W="K Z Z", drift="K Z", nu="J V", H="J V Z", root="Z Z", start="Z",
    scaling="Z", mean="K Z", covariance="K Z Z", dx="K Z", inverse="Z Z", R="Z Z", A="Z Z", U="Z Z", y="Z", b="Z", row="Z",
    offset="Z",
)  # fmt: skip
def shoot(
    K: int, size: int, width: int, first_row: Indices, W: Array, drift: Array, nu: Array, H: Array, root: Array, start: Array,
    scaling: Array, mean: Array, covariance: Array, dx: Array, inverse: Array, R: Array, A: Array, U: Array, y: Array, b: Array,
    row: Array, offset: Array, damping: float,
) -> None:  # fmt: skip
    """Deviations `dx` of all states, and of each what the prior and the rows before it say; `inverse` of the last triangle.

    `start` is the prior's mean less the first state, `drift` how far states are off the orbit of the first.
    """
    for i in range(size):
        y[i] = 0.0
        for j in range(size):
            R[i * size + j] = 1.0 if i == j else 0.0
    for k in range(K):
        times_root(W, k * size * size, root, A, size)
        away(W, drift, start, k, offset, size)
        solved_factors(R, y, inverse, b, size)
        predicted_belief(k, A, offset, inverse, b, U, mean, covariance, size)
        for c in range(first_row[k] * width, first_row[k + 1] * width):
            if not isnan(nu[c]):
                value = nu[c]
                for i in range(size):
                    value -= H[c * size + i] * offset[i]
                for j in range(size):
                    s = 0.0
                    for i in range(size):
                        s += H[c * size + i] * A[j * size + i]
                    row[j] = s
                rotate(R, y, row, value, size)
        if damping > 0.0:
            for i in range(size):
                weight = sqrt(damping) * scaling[i]
                for j in range(size):
                    row[j] = weight * A[j * size + i]
                rotate(R, y, row, -weight * offset[i], size)
    solved_factors(R, y, inverse, b, size)
    for i in range(size):
        s = start[i]
        for j in range(size):
            s += b[j] * root[j * size + i]
        row[i] = s
    for k in range(K):
        away(W, drift, row, k, offset, size)
        for i in range(size):
            dx[k * size + i] = offset[i]
