"""Functions of one or two variables between nodes: cubic and bicubic polynomials by values and slopes (Hermite).

Of one variable, the data begin with: how many nodes, 1 where the ends are held outside (else there is no value), and from 8 on
the nodes, then value and slope of each.  Of two, with: how many nodes along each, for each 1 where the edges are held outside,
and from 8 on the nodes of the first variable, those of the second, then value, both slopes and the mixed one of each node, the
second variable running first.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def interval(x, data, first, n):
    """The number of the last node, but for the very last, that is not above x."""
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if data[first + middle] <= x:
            low = middle
        else:
            high = middle
    return low


@inline
def hermite_weights(s, h):
    """Hermite's weights of value and slope at both ends, and those of the derivative."""
    a, b = s * s, s - 1.0
    w0, w1 = (1.0 + 2.0 * s) * b * b, a * (3.0 - 2.0 * s)
    v0, v1 = h * s * b * b, h * a * b
    return (w0, v0, w1, v1), (6.0 * s * b / h, b * (3.0 * s - 1.0), -6.0 * s * b / h, s * (3.0 * s - 2.0))


@inline
def weighed(w, data, row, step):
    """The sum of four numbers of the data, so far apart, by weights."""
    return w[0] * data[row] + w[1] * data[row + step] + w[2] * data[row + 2 * step] + w[3] * data[row + 3 * step]


@inline
def of_one_variable(x, data, at):
    """Value and slope."""
    n, xs = int(data[at]), at + 8
    u = minimum(maximum(x, data[xs]), data[xs + n - 1])
    if isnan(x) or (u != x and data[at + 1] == 0.0):
        return nan, nan
    i = interval(u, data, xs, n)
    h = data[xs + i + 1] - data[xs + i]
    w, d = hermite_weights((u - data[xs + i]) / h, h)
    row = xs + n + 2 * i
    return weighed(w, data, row, 1), weighed(d, data, row, 1) if u == x else 0.0


@inline
def of_two_variables(x, y, data, at):
    """Value and both slopes."""
    n, m = int(data[at]), int(data[at + 1])
    xs, ys = at + 8, at + 8 + n
    u = minimum(maximum(x, data[xs]), data[xs + n - 1])
    v = minimum(maximum(y, data[ys]), data[ys + m - 1])
    if isnan(x) or isnan(y) or (u != x and data[at + 2] == 0.0) or (v != y and data[at + 3] == 0.0):
        return nan, nan, nan
    i, j = interval(u, data, xs, n), interval(v, data, ys, m)
    hx, hy = data[xs + i + 1] - data[xs + i], data[ys + j + 1] - data[ys + j]
    a, da = hermite_weights((u - data[xs + i]) / hx, hx)
    b, db = hermite_weights((v - data[ys + j]) / hy, hy)
    near = ys + m + 4 * (i * m + j)
    far = near + 4 * m
    f0, d0 = weighed(b, data, near, 2), weighed(b, data, near + 1, 2)
    f1, d1 = weighed(b, data, far, 2), weighed(b, data, far + 1, 2)
    value = a[0] * f0 + a[1] * d0 + a[2] * f1 + a[3] * d1
    by_x = da[0] * f0 + da[1] * d0 + da[2] * f1 + da[3] * d1 if u == x else 0.0
    g0, e0 = weighed(db, data, near, 2), weighed(db, data, near + 1, 2)
    g1, e1 = weighed(db, data, far, 2), weighed(db, data, far + 1, 2)
    return value, by_x, a[0] * g0 + a[1] * e0 + a[2] * g1 + a[3] * e1 if v == y else 0.0


@outlined
def interpolation_1_of_one(x, data, at):
    """The value."""
    return (of_one_variable(x, data, at)[0],)


@outlined
def interpolation_1_partials_of_one(x, data, at):
    """The value and its derivative."""
    return of_one_variable(x, data, at)


@outlined
def interpolation_2_of_one(x, y, data, at):
    """The value."""
    return (of_two_variables(x, y, data, at)[0],)


@outlined
def interpolation_2_partials_of_one(x, y, data, at):
    """The value and its derivatives."""
    return of_two_variables(x, y, data, at)


@inline
def interpolation_1(x, data, at):
    """The value, in every lane."""
    return each_lane(interpolation_1_of_one, x, data, at)


@inline
def interpolation_1_partials(x, data, at):
    """The value and its derivative, in every lane."""
    return each_lane(interpolation_1_partials_of_one, x, data, at)


@inline
def interpolation_2(x, y, data, at):
    """The value, in every lane."""
    return each_lane(interpolation_2_of_one, x, y, data, at)


@inline
def interpolation_2_partials(x, y, data, at):
    """The value and its derivatives, in every lane."""
    return each_lane(interpolation_2_partials_of_one, x, y, data, at)
