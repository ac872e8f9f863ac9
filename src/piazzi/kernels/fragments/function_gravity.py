"""Gravity of any degree as spherical harmonics: acceleration and its gradient in axes fixed to the body, regular at the poles.

    U = GM/r sum_nm q^n A_nm(u) (C_nm Re w^m + S_nm Im w^m),   q = R/r,  (s, t, u) = (x, y, z)/r,  w = s + i t,

where A_nm is the m-th derivative of the normalised Legendre polynomial P_n by u (Pines, AIAA Journal 11, 1973).  With q^m taken
into w^m and q^(n-m) into A_nm,  A_nm = a_nm u q A_(n-1)m + b_nm q^2 A_(n-2)m  runs down the degrees of one order, and its
derivatives by u likewise.  The derivatives of U by s, t, u and r (as if independent) are sums over degrees, then orders; the
chain rule makes of them those by x, y, z.

Of one state, eight orders are summed at once, in a register; of several, the lanes are states, and orders follow each other.
The data begin with: 1 or 0 (off), the degree, the degree of the gradient, GM, R, and positions from here on of the rows
(a, b, C, S of eight orders, degree after degree, for each eight orders) and of the first A_mm of each order.
"""

from piazzi.kernels.vocabulary import *  # noqa: F403


@inline
def next_degree(a, b, uq, q, q2, first, before):
    """A_nm and its derivative, from those of the two degrees before."""
    A, B, dA, dB = before
    au, bq = a * uq, b * q2
    return fused(au, A, fused(bq, B, first)), fused(au, dA, fused(bq, dB, (a * q) * A))


@inline
def add_degree(C, S, n1, Z, dZ, sums):
    """Sums over degrees of C and S times A, dA/du and -r d/dr of them."""
    L, K, Lu, Ku, Lr, Kr = sums
    rZ = n1 * Z
    return fused(C, Z, L), fused(S, Z, K), fused(C, dZ, Lu), fused(S, dZ, Ku), fused(C, rZ, Lr), fused(S, rZ, Kr)


@inline
def add_orders(c, d, c1, d1, sums, slopes):
    """Sums over orders of the derivatives of U by s, t, u, r; c1 + i d1 is m w^(m-1)."""
    (L, K, Lu, Ku, Lr, Kr), (gs, gt, gu, gr) = sums, slopes
    gs = gs + fused(L, c1, K * d1)
    gt = gt + fused(K, c1, -(L * d1))
    return gs, gt, gu + fused(Lu, c, Ku * d), gr + fused(Lr, c, Kr * d)


@inline
def acceleration(s, t, u, f, q, slopes):
    """The acceleration: along (s, t, u) what is left of d/dr, and the derivatives by s, t, u."""
    gs, gt, gu, gr = slopes
    ds, dt, du = f * q * gs, f * q * gt, f * gu
    along = -(f * gr) - (s * ds + t * dt + u * du)
    return ds + along * s, dt + along * t, du + along * u, along


@inline
def acceleration_and_gradient(towards, q, ir, GM, slopes, curvatures, beyond):
    """The acceleration, with slopes of degrees beyond the gradient's; the gradient, whose last sum is Laplace's equation's."""
    (s, t, u), (gs, gt, gu, gr), (es, et, eu, er) = towards, slopes, beyond
    hss, hst, hsu, htu, huu, hrs, hrt, hru = curvatures
    f = GM * ir * ir
    ax, ay, az, _ = acceleration(s, t, u, f, q, (gs + es, gt + et, gu + eu, gr + er))
    _, _, _, along = acceleration(s, t, u, f, q, slopes)
    e, a = f * ir, along * ir
    e1, e2 = e * q, e * q * q
    ss, st, su, tu, uu = e2 * hss, e2 * hst, e1 * hsu, e1 * htu, e * huu
    ws = -(e1 * hrs) - (ss * s + st * t + su * u) - e1 * gs
    wt = -(e1 * hrt) - (st * s - ss * t + tu * u) - e1 * gt
    wu = -(e * hru) - (su * s + tu * t + uu * u) - e * gu
    k = -(uu + 2.0 * (s * ws + t * wt + u * wu) + 3.0 * a)
    xx, xy, xz = ss + s * (k * s + 2.0 * ws) + a, st + s * (k * t + wt) + t * ws, su + s * (k * u + wu) + u * ws
    yy, yz, zz = t * (k * t + 2.0 * wt) - ss + a, tu + t * (k * u + wu) + u * wt, uu + u * (k * u + 2.0 * wu) + a
    return ax, ay, az, xx, xy, xz, xy, yy, yz, xz, yz, zz


@inline
def first_powers(a, b):
    """The powers 0 to 7 of a + i b, each in its place, and the eighth."""
    a2, b2 = a * a - b * b, 2.0 * a * b
    a3, b3 = a2 * a - b2 * b, a2 * b + b2 * a
    a4, b4 = a2 * a2 - b2 * b2, 2.0 * a2 * b2
    c = eight(vector(1.0, a, a2, a3, a4, a4 * a - b4 * b, a4 * a2 - b4 * b2, a4 * a3 - b4 * b3))
    d = eight(vector(0.0, b, b2, b3, b4, a4 * b + b4 * a, a4 * b2 + b4 * a2, a4 * b3 + b4 * a3))
    return c, d, a4 * a4 - b4 * b4, 2.0 * a4 * b4


@outlined
def gravity_of_one(x, y, z, data, at):
    """The acceleration at one place."""
    if data[at] == 0.0:
        return 0.0, 0.0, 0.0
    N = int(data[at + 1])
    ir = 1.0 / sqrt(x * x + y * y + z * z)
    q = data[at + 4] * ir
    s, t, u = x * ir, y * ir, z * ir
    uq, q2 = u * q, q * q
    zero = eight(vector(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    m = eight(vector(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0))
    c, d, a8, b8 = first_powers(q * s, q * t)
    re, im = scratch(16), scratch(16)
    store_eight(re, 0, zero)
    store_eight(im, 0, zero)
    row, seed = at + int(data[at + 5]), at + int(data[at + 6])
    gs, gt, gu, gr = zero, zero, zero, zero
    for block in range(N // 8 + 1):
        store_eight(re, 8, c)
        store_eight(im, 8, d)
        A, B, dA, dB = zero, zero, zero, zero
        L, K, Lu, Ku, Lr, Kr = zero, zero, zero, zero, zero, zero
        for n in range(8 * block, N + 1):
            given = load_eights(data, row, 4)
            row += 32
            first = zero
            if n < 8 * block + 8:
                first = load_eights(data, seed, 1)[0]
                seed += 8
            Z, dZ = next_degree(given[0], given[1], uq, q, q2, first, (A, B, dA, dB))
            A, B, dA, dB = Z, A, dZ, dA
            L, K, Lu, Ku, Lr, Kr = add_degree(given[2], given[3], n + 1.0, Z, dZ, (L, K, Lu, Ku, Lr, Kr))
        c1, d1 = m * load_eights(re, 7, 1)[0], m * load_eights(im, 7, 1)[0]
        gs, gt, gu, gr = add_orders(c, d, c1, d1, (L, K, Lu, Ku, Lr, Kr), (gs, gt, gu, gr))
        store_eight(re, 0, c)
        store_eight(im, 0, d)
        c, d = c * a8 - d * b8, c * b8 + d * a8
        m = m + 8.0
    g = sums_of_eight(vector(gs, gt, gu, gr, zero, zero, zero, zero))
    ax, ay, az, _ = acceleration(s, t, u, data[at + 3] * ir * ir, q, (g[0], g[1], g[2], g[3]))
    return ax, ay, az


@outlined
def gravity_partials_of_one(x, y, z, data, at):
    """The acceleration at one place and its gradient by rows."""
    if data[at] == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    N, G = int(data[at + 1]), int(data[at + 2])
    ir = 1.0 / sqrt(x * x + y * y + z * z)
    q = data[at + 4] * ir
    s, t, u = x * ir, y * ir, z * ir
    uq, q2 = u * q, q * q
    zero = eight(vector(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    m = eight(vector(0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0))
    c, d, a8, b8 = first_powers(q * s, q * t)
    re, im = scratch(16), scratch(16)
    store_eight(re, 0, zero)
    store_eight(im, 0, zero)
    row, seed = at + int(data[at + 5]), at + int(data[at + 6])
    gs, gt, gu, gr, hss, hst, hsu, htu = zero, zero, zero, zero, zero, zero, zero, zero
    huu, hrs, hrt, hru, es, et, eu, er = zero, zero, zero, zero, zero, zero, zero, zero
    for block in range(N // 8 + 1):
        store_eight(re, 8, c)
        store_eight(im, 8, d)
        A, B, dA, dB, eA, eB = zero, zero, zero, zero, zero, zero
        L, K, Lu, Ku, Lr, Kr = zero, zero, zero, zero, zero, zero
        Luu, Kuu, Lru, Kru = zero, zero, zero, zero
        for n in range(8 * block, G + 1):
            given = load_eights(data, row, 4)
            row += 32
            first = zero
            if n < 8 * block + 8:
                first = load_eights(data, seed, 1)[0]
                seed += 8
            a, C, S, n1 = given[0], given[2], given[3], n + 1.0
            Z, dZ = next_degree(a, given[1], uq, q, q2, first, (A, B, dA, dB))
            eZ = fused(a * uq, eA, fused(given[1] * q2, eB, (a * q + a * q) * dA))
            A, B, dA, dB, eA, eB = Z, A, dZ, dA, eZ, eA
            rdZ = n1 * dZ
            L, K, Lu, Ku, Lr, Kr = add_degree(C, S, n1, Z, dZ, (L, K, Lu, Ku, Lr, Kr))
            Luu, Kuu, Lru, Kru = fused(C, eZ, Luu), fused(S, eZ, Kuu), fused(C, rdZ, Lru), fused(S, rdZ, Kru)
        c1, d1 = m * load_eights(re, 7, 1)[0], m * load_eights(im, 7, 1)[0]
        mm = m * (m - 1.0)
        c2, d2 = mm * load_eights(re, 6, 1)[0], mm * load_eights(im, 6, 1)[0]
        gs, gt, gu, gr = add_orders(c, d, c1, d1, (L, K, Lu, Ku, Lr, Kr), (gs, gt, gu, gr))
        hss, hst = hss + fused(L, c2, K * d2), hst + fused(K, c2, -(L * d2))
        hsu, htu, huu = hsu + fused(Lu, c1, Ku * d1), htu + fused(Ku, c1, -(Lu * d1)), huu + fused(Luu, c, Kuu * d)
        hrs, hrt, hru = hrs + fused(Lr, c1, Kr * d1), hrt + fused(Kr, c1, -(Lr * d1)), hru + fused(Lru, c, Kru * d)
        if G < N:
            L, K, Lu, Ku, Lr, Kr = zero, zero, zero, zero, zero, zero
            for n in range(max(8 * block, G + 1), N + 1):
                given = load_eights(data, row, 4)
                row += 32
                first = zero
                if n < 8 * block + 8:
                    first = load_eights(data, seed, 1)[0]
                    seed += 8
                Z, dZ = next_degree(given[0], given[1], uq, q, q2, first, (A, B, dA, dB))
                A, B, dA, dB = Z, A, dZ, dA
                L, K, Lu, Ku, Lr, Kr = add_degree(given[2], given[3], n + 1.0, Z, dZ, (L, K, Lu, Ku, Lr, Kr))
            es, et, eu, er = add_orders(c, d, c1, d1, (L, K, Lu, Ku, Lr, Kr), (es, et, eu, er))
        store_eight(re, 0, c)
        store_eight(im, 0, d)
        c, d = c * a8 - d * b8, c * b8 + d * a8
        m = m + 8.0
    g = sums_of_eight(vector(gs, gt, gu, gr, hss, hst, hsu, htu))
    h = sums_of_eight(vector(huu, hrs, hrt, hru, es, et, eu, er))
    first_sums, second_sums = (g[0], g[1], g[2], g[3]), (g[4], g[5], g[6], g[7], h[0], h[1], h[2], h[3])
    return acceleration_and_gradient((s, t, u), q, ir, data[at + 3], first_sums, second_sums, (h[4], h[5], h[6], h[7]))


@outlined
def gravity_of_several(x, y, z, data, at):
    """The acceleration at several places, one to a lane."""
    ir = 1.0 / sqrt(x * x + y * y + z * z)
    zero = 0.0 * ir
    if data[at] == 0.0:
        return zero, zero, zero
    N = int(data[at + 1])
    q = data[at + 4] * ir
    s, t, u = x * ir, y * ir, z * ir
    uq, q2, sq, tq = u * q, q * q, s * q, t * q
    rows, seeds = at + int(data[at + 5]), at + int(data[at + 6])
    gs, gt, gu, gr = zero, zero, zero, zero
    c, d, c1, d1 = zero + 1.0, zero, zero, zero
    for m in range(N + 1):
        block, lane = m // 8, m % 8
        row = rows + 32 * (block * (N + 1) - 4 * block * (block - 1) + lane) + lane
        first = zero + data[seeds + 64 * block + 9 * lane]
        A, B, dA, dB = zero, zero, zero, zero
        L, K, Lu, Ku, Lr, Kr = zero, zero, zero, zero, zero, zero
        for n in range(m, N + 1):
            Z, dZ = next_degree(data[row], data[row + 8], uq, q, q2, first, (A, B, dA, dB))
            A, B, dA, dB, first = Z, A, dZ, dA, zero
            L, K, Lu, Ku, Lr, Kr = add_degree(data[row + 16], data[row + 24], n + 1.0, Z, dZ, (L, K, Lu, Ku, Lr, Kr))
            row += 32
        gs, gt, gu, gr = add_orders(c, d, float(m) * c1, float(m) * d1, (L, K, Lu, Ku, Lr, Kr), (gs, gt, gu, gr))
        c1, d1 = c, d
        c, d = c * sq - d * tq, c * tq + d * sq
    ax, ay, az, _ = acceleration(s, t, u, data[at + 3] * ir * ir, q, (gs, gt, gu, gr))
    return ax, ay, az


@outlined
def gravity_partials_of_several(x, y, z, data, at):
    """The acceleration at several places, one to a lane, and its gradient by rows."""
    ir = 1.0 / sqrt(x * x + y * y + z * z)
    zero = 0.0 * ir
    if data[at] == 0.0:
        return zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero
    N, G = int(data[at + 1]), int(data[at + 2])
    q = data[at + 4] * ir
    s, t, u = x * ir, y * ir, z * ir
    uq, q2, sq, tq = u * q, q * q, s * q, t * q
    rows, seeds = at + int(data[at + 5]), at + int(data[at + 6])
    gs, gt, gu, gr, hss, hst, hsu, htu = zero, zero, zero, zero, zero, zero, zero, zero
    huu, hrs, hrt, hru, es, et, eu, er = zero, zero, zero, zero, zero, zero, zero, zero
    c, d, c1, d1, c2, d2 = zero + 1.0, zero, zero, zero, zero, zero
    for m in range(N + 1):
        block, lane, m1 = m // 8, m % 8, float(m)
        row = rows + 32 * (block * (N + 1) - 4 * block * (block - 1) + lane) + lane
        first = zero + data[seeds + 64 * block + 9 * lane]
        A, B, dA, dB, eA, eB = zero, zero, zero, zero, zero, zero
        L, K, Lu, Ku, Lr, Kr = zero, zero, zero, zero, zero, zero
        Luu, Kuu, Lru, Kru = zero, zero, zero, zero
        for n in range(m, G + 1):
            a, b, C, S, n1 = data[row], data[row + 8], data[row + 16], data[row + 24], n + 1.0
            Z, dZ = next_degree(a, b, uq, q, q2, first, (A, B, dA, dB))
            eZ = fused(a * uq, eA, fused(b * q2, eB, ((a + a) * q) * dA))
            A, B, dA, dB, eA, eB, first = Z, A, dZ, dA, eZ, eA, zero
            rdZ = n1 * dZ
            L, K, Lu, Ku, Lr, Kr = add_degree(C, S, n1, Z, dZ, (L, K, Lu, Ku, Lr, Kr))
            Luu, Kuu, Lru, Kru = fused(C, eZ, Luu), fused(S, eZ, Kuu), fused(C, rdZ, Lru), fused(S, rdZ, Kru)
            row += 32
        mc, md, mc2, md2 = m1 * c1, m1 * d1, (m1 * (m1 - 1.0)) * c2, (m1 * (m1 - 1.0)) * d2
        gs, gt, gu, gr = add_orders(c, d, mc, md, (L, K, Lu, Ku, Lr, Kr), (gs, gt, gu, gr))
        hss, hst = hss + fused(L, mc2, K * md2), hst + fused(K, mc2, -(L * md2))
        hsu, htu, huu = hsu + fused(Lu, mc, Ku * md), htu + fused(Ku, mc, -(Lu * md)), huu + fused(Luu, c, Kuu * d)
        hrs, hrt, hru = hrs + fused(Lr, mc, Kr * md), hrt + fused(Kr, mc, -(Lr * md)), hru + fused(Lru, c, Kru * d)
        if G < N:
            L, K, Lu, Ku, Lr, Kr = zero, zero, zero, zero, zero, zero
            for n in range(max(m, G + 1), N + 1):
                Z, dZ = next_degree(data[row], data[row + 8], uq, q, q2, first, (A, B, dA, dB))
                A, B, dA, dB, first = Z, A, dZ, dA, zero
                L, K, Lu, Ku, Lr, Kr = add_degree(data[row + 16], data[row + 24], n + 1.0, Z, dZ, (L, K, Lu, Ku, Lr, Kr))
                row += 32
            es, et, eu, er = add_orders(c, d, mc, md, (L, K, Lu, Ku, Lr, Kr), (es, et, eu, er))
        c2, d2, c1, d1 = c1, d1, c, d
        c, d = c * sq - d * tq, c * tq + d * sq
    first_sums, second_sums = (gs, gt, gu, gr), (hss, hst, hsu, htu, huu, hrs, hrt, hru)
    return acceleration_and_gradient((s, t, u), q, ir, data[at + 3], first_sums, second_sums, (es, et, eu, er))


@inline
def gravity(x, y, z, data, at):
    """The acceleration, in m/s^2."""
    return by_lanes(gravity_of_one, gravity_of_several, x, y, z, data, at)


@inline
def gravity_partials(x, y, z, data, at):
    """The acceleration and its gradient by rows."""
    return by_lanes(gravity_partials_of_one, gravity_partials_of_several, x, y, z, data, at)
