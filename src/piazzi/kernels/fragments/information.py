"""One Gauss-Newton step in square-root information form, for priors too wide for a covariance.

Bierman (1977), ch. 6 and 10, by orthogonal transformations only: rows of R (unit noise) are rotated into the triangle; a step
of the dynamics substitutes delta_k = Phi^-1 (delta_{k+1} - c - G w), with Q = G G^T, and eliminates w.  Going back, means and
covariances are sums of congruences.  Unlike a covariance, R loses nothing when what is known differs by many orders of
magnitude between directions.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def rotate_in(R, y, row, value):
    """Rotate the equation ``row . delta = value`` into the triangle; what is left of `value` is returned, `row` is used up."""
    for j in range(N):
        if row[j] != 0.0:
            size = sqrt(R[j * N + j] * R[j * N + j] + row[j] * row[j])
            c = R[j * N + j] / size
            s = row[j] / size
            for i in range(j, N):
                above = R[j * N + i]
                R[j * N + i] = c * above + s * row[i]
                row[i] = c * row[i] - s * above
            above = y[j]
            y[j] = c * above + s * value
            value = c * value - s * above
    return value


@inline
def factor_lu(A, order):
    """PA = LU in place, with partial pivoting; `order` keeps the rows' places."""
    for i in range(N):
        order[i] = i
    for j in range(N):
        best = j
        for i in range(j + 1, N):
            if fabs(A[i * N + j]) > fabs(A[best * N + j]):
                best = i
        if best != j:
            for k in range(N):
                A[j * N + k], A[best * N + k] = A[best * N + k], A[j * N + k]
            order[j], order[best] = order[best], order[j]
        for i in range(j + 1, N):
            A[i * N + j] = A[i * N + j] / A[j * N + j]
            for k in range(j + 1, N):
                A[i * N + k] -= A[i * N + j] * A[j * N + k]


@inline
def solve_lu(A, order, B, work, columns):
    """X with A X = B for `columns` columns of B, stored by rows, in place."""
    for i in range(N):
        source = int(order[i])
        for c in range(columns):
            s = B[source * columns + c]
            for k in range(i):
                s -= A[i * N + k] * work[k * columns + c]
            work[i * columns + c] = s
    for b in range(N):
        i = N - 1 - b
        for c in range(columns):
            s = work[i * columns + c]
            for k in range(i + 1, N):
                s -= A[i * N + k] * B[k * columns + c]
            B[i * columns + c] = s / A[i * N + i]


@inline
def invert_triangle(R, out):
    """R^-1 of the upper triangle, into `out`."""
    for c in range(N):
        for b in range(N):
            i = N - 1 - b
            s = 1.0 if i == c else 0.0
            for k in range(i + 1, N):
                s -= R[i * N + k] * out[k * N + c]
            out[i * N + c] = s / R[i * N + i]


@inline
def triangularize(B, rows, columns, pivots):
    """Clear the rows x columns array `B` below the diagonal of its first `pivots` columns by Householder reflections."""
    for j in range(pivots):
        norm = 0.0
        for i in range(j, rows):
            norm += B[i * columns + j] * B[i * columns + j]
        norm = sqrt(norm)
        if norm > 0.0:
            alpha = -norm if B[j * columns + j] > 0.0 else norm
            first = B[j * columns + j] - alpha
            beta = -1.0 / (alpha * first)
            for k in range(j + 1, columns):
                s = first * B[j * columns + k]
                for i in range(j + 1, rows):
                    s += B[i * columns + j] * B[i * columns + k]
                s = s * beta
                B[j * columns + k] -= s * first
                for i in range(j + 1, rows):
                    B[i * columns + k] -= s * B[i * columns + j]
            B[j * columns + j] = alpha
            for i in range(j + 1, rows):
                B[i * columns + j] = 0.0


@inline
def noise_root(Q, L, D, G):
    """G with G G^T = Q."""
    factor_noise(Q, L, D)
    for i in range(N):
        for j in range(N):
            entry_ij = 1.0 if i == j else (L[i * N + j] if j < i else 0.0)
            G[i * N + j] = entry_ij * sqrt(D[j])


@inline
def belief(R, y, inverse, d_pred, P_pred, j):
    """Mean and covariance that the triangle stands for, stored at position j."""
    invert_triangle(R, inverse)
    U = load_matrix(inverse, 0, N, N)
    store(d_pred, j * N, U @ load_vector(y, 0, N))
    store(P_pred, j * N * N, U @ U.T)


@inline
def step_information(R, y, F, order, G, c, A, B, work, W, V, U, j):
    """R, y of the next state; what determines the noise of the step given that state is kept at position j of W, V, U."""
    columns = 2 * N + 1
    for i in range(N):
        for k in range(N):
            A[i * N + k] = R[k * N + i]
    solve_lu(F, order, A, work, N)
    for i in range(N):
        for k in range(2 * N + 1):
            B[i * columns + k] = 1.0 if i == k else 0.0
            B[(N + i) * columns + k] = 0.0
        rhs_i = y[i]
        for k in range(N):
            a = A[k * N + i]
            B[(N + i) * columns + N + k] = a
            rhs_i += a * c[k]
            for q in range(N):
                B[(N + i) * columns + q] -= a * G[k * N + q]
        B[(N + i) * columns + 2 * N] = rhs_i
    triangularize(B, 2 * N, columns, 2 * N)
    for i in range(N):
        y[i] = B[(N + i) * columns + 2 * N]
        for k in range(N):
            R[i * N + k] = B[(N + i) * columns + N + k]
            A[i * N + k] = B[i * columns + k]
    invert_triangle(A, work)
    for i in range(N):
        total = 0.0
        for q in range(N):
            total += work[i * N + q] * B[q * columns + 2 * N]
            s = 0.0
            for r in range(N):
                s += work[i * N + r] * B[r * columns + N + q]
            W[(j * N + i) * N + q] = s
            U[(j * N + i) * N + q] = work[i * N + q]
        V[j * N + i] = total


@inline
def transposed_lu(Phi, j, F, order, transpose):
    """LU factors of Phi_j, or of its transpose."""
    for i in range(N):
        for k in range(N):
            F[i * N + k] = Phi[(j * N + k) * N + i] if transpose else Phi[(j * N + i) * N + k]
    factor_lu(F, order)


@inline
def back_information(j, Phi, F, order, G, c, W, V, U, work, B, delta, P):
    """Deviation and covariance of state j from those of state j + 1."""
    noise = load_vector(V, j * N, N) - load_matrix(W, j * N * N, N, N) @ delta
    G_now = load_matrix(G, 0, N, N)
    spread = identity(N) + G_now @ load_matrix(W, j * N * N, N, N)
    root = G_now @ load_matrix(U, j * N * N, N, N)
    transposed_lu(Phi, j, F, order, 0)
    store(B, 0, delta - load_vector(c, 0, N) - G_now @ noise)
    solve_lu(F, order, B, work, 1)
    before = load_vector(B, 0, N)
    store(B, 0, spread)
    solve_lu(F, order, B, work, N)
    through = load_matrix(B, 0, N, N)
    store(B, 0, root)
    solve_lu(F, order, B, work, N)
    own = load_matrix(B, 0, N, N)
    return before, symmetric(through @ P @ through.T + own @ own.T), through @ P
