"""Unknowns that all states share, beside the chain: its first state and the constants.

A chain whose first state and constants are given is solved without their priors, however wide these are.  What is predicted
depends on the unknowns linearly: deviation k is d_k + S_k b, with b of unit prior (Friedland 1969, separate-bias estimation).
Every innovation of the chain, in units of its deviation, is then one equation for b, and these are rotated into a triangle
(Bierman 1977, ch. 4): nothing is squared, and columns of any scale keep their digits.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def rotate(R, y, row, value, size):
    """Rotate the equation ``row . b = value`` into the triangle ``R b = y``; `row` is used up."""
    for j in range(size):
        if row[j] != 0.0:
            length = sqrt(R[j * size + j] * R[j * size + j] + row[j] * row[j])
            c = R[j * size + j] / length
            s = row[j] / length
            for i in range(j, size):
                above = R[j * size + i]
                R[j * size + i] = c * above + s * row[i]
                row[i] = c * row[i] - s * above
            above = y[j]
            y[j] = c * above + s * value
            value = c * value - s * above


@inline
def invert_upper(R, out, size):
    """The inverse of the upper triangle, into `out`."""
    for c in range(size):
        for b in range(size):
            i = size - 1 - b
            s = 1.0 if i == c else 0.0
            for k in range(i + 1, size):
                s -= R[i * size + k] * out[k * size + c]
            out[i * size + c] = s / R[i * size + i]


@inline
def solve_triangle(R, y, inverse, b, size):
    """The unknowns b of ``R b = y``, and the inverse of the triangle."""
    invert_upper(R, inverse, size)
    for i in range(size):
        s = 0.0
        for j in range(i, size):
            s += inverse[i * size + j] * y[j]
        b[i] = s


@inline
def begin_border(border):
    """The unknowns' prior: no deviation, unit variance; the first state through the rows of `root`, the constants later."""
    size = N + border.constants
    for i in range(size):
        border.y[i] = 0.0
        for j in range(size):
            border.R[i * size + j] = 1.0 if i == j else 0.0
        store(border.S, i * N, load_vector(border.root, i * N, N) if i < N else unit(-1, N))


@inline
def advance_border(k, d, defect, border):
    """Deviation and sensitivities of state k from those of state k - 1."""
    C, S, F = border.constants, border.S, load_matrix(border.A, (k - 1) * N * N, N, N)
    d = F @ d + defect
    for i in range(C):
        by_constant = load_vector(border.B, ((k - 1) * C + i) * N, N)
        d = d + border.offset[i] * by_constant
        store(S, (N + i) * N, border.sigma[i] * by_constant + F @ load_vector(S, (N + i) * N, N))
    for j in range(N):
        store(S, j * N, F @ load_vector(S, j * N, N))
    return d


@inline
def update_bordered(h, nu, at, of_constants, d, P, border):
    """One measurement of unit noise: the chain's update for given unknowns; its innovation goes into the triangle.

    Its derivatives by the constants stand at `at`; one that only says something of the states has none.
    """
    size, C, S, row = N + border.constants, border.constants if of_constants else 0, border.S, border.row
    Ph = h @ P
    variance = h @ Ph + 1.0
    K = (1.0 / variance) * Ph
    e = nu - h @ d
    for i in range(C):
        e -= border.G[at + i] * border.offset[i]
    weight = 1.0 / sqrt(variance)
    for j in range(size):
        s = load_vector(S, j * N, N)
        effect = h @ s
        if j >= N and j - N < C:
            effect += border.G[at + j - N] * border.sigma[j - N]
        store(S, j * N, s - effect * K)
        row[j] = weight * effect
    rotate(border.R, border.y, row, weight * e, size)
    B = P - outer(Ph, K)
    return d + e * K, B + outer(K, K - h @ B)


@inline
def width_of_row(h, at, P, border):
    """Predicted variance of a measurement of unit noise, without the noise."""
    size, row = N + border.constants, border.row
    for j in range(size):
        row[j] = h @ load_vector(border.S, j * N, N)
        if j >= N:
            row[j] = row[j] + border.G[at + j - N] * border.sigma[j - N]
    total = h @ (h @ P)
    for q in range(size):
        s = 0.0
        for j in range(q + 1):
            s += row[j] * border.inverse[j * size + q]
        total += s * s
    return total


@inline
def record_belief(k, d, P, border, whole):
    """Predicted deviation and covariance of states and constants together, unknowns included, of state k."""
    C, S, row, inverse, W = border.constants, border.S, border.row, border.inverse, border.W
    size = N + C
    solve_triangle(border.R, border.y, inverse, row, size)
    mean = d
    for j in range(size):
        mean = mean + row[j] * load_vector(S, j * N, N)
    store(whole.mean, k * size, mean)
    for i in range(C):
        whole.mean[k * size + N + i] = border.offset[i] + border.sigma[i] * row[N + i]
    for q in range(size):
        w = unit(-1, N)
        for j in range(q + 1):
            w = w + inverse[j * size + q] * load_vector(S, j * N, N)
        store(W, q * size, w)
        for i in range(C):
            W[q * size + N + i] = border.sigma[i] * inverse[(N + i) * size + q]
    store(border.own, 0, P)
    for i in range(size):
        for j in range(size):
            s = border.own[i * N + j] if i < N and j < N else 0.0
            for q in range(size):
                s += W[q * size + i] * W[q * size + j]
            whole.covariance[(k * size + i) * size + j] = s
