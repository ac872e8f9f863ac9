// Speed floor for Earth orbits in 3-D: force model, variational equations and integrators by hand.
// Written before functions from outside, to know what a machine can do, and adopted; space.py builds and calls it.
//
// One orbit at a time; a row of the variational matrix (6 states + drag and radiation coefficients = 8 columns) is one
// 8-double vector, and 8 orders of the gravity field are summed at once.  `gravity_lanes` does 8 orbits at once instead.
// SI units.  Positions are inertial; tables give Earth's orientation, the Sun and the Moon as polynomials per piece of time.
// Everything is re-entrant: a model is a struct.  Build: gcc -O3 -march=native -ffp-contract=fast -shared -fPIC (see space.py).
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
typedef double v8 __attribute__((vector_size(64)));
typedef double v8u __attribute__((vector_size(64), aligned(8)));
typedef long long i8 __attribute__((vector_size(64)));
#define AT(p) (*(const v8u *)(p))
#define PUT(p, v) (*(v8u *)(p) = (v))
static inline v8 all(double x) { return (v8){x, x, x, x, x, x, x, x}; }
// the sums of the entries of 8 vectors, in one vector: three rounds of halves
#define MIX(x, y, ...) __builtin_shuffle(x, y, (i8){__VA_ARGS__})
static inline v8 pairs1(v8 x, v8 y) { return MIX(x, y, 0, 8, 2, 10, 4, 12, 6, 14) + MIX(x, y, 1, 9, 3, 11, 5, 13, 7, 15); }
static inline v8 pairs2(v8 x, v8 y) { return MIX(x, y, 0, 1, 8, 9, 4, 5, 12, 13) + MIX(x, y, 2, 3, 10, 11, 6, 7, 14, 15); }
static inline v8 pairs4(v8 x, v8 y) { return MIX(x, y, 0, 1, 2, 3, 8, 9, 10, 11) + MIX(x, y, 4, 5, 6, 7, 12, 13, 14, 15); }
static inline v8 sums(v8 a, v8 b, v8 c, v8 d, v8 e, v8 f, v8 g, v8 h) {
  return pairs4(pairs2(pairs1(a, b), pairs1(c, d)), pairs2(pairs1(e, f), pairs1(g, h)));
}
static double cpu(void) { struct timespec t; clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t); return t.tv_sec + 1e-9 * t.tv_nsec; }

// ------------------------------------------------------------------ gravity
// U = mu/r sum_nm q^n Anm(u) [C Re w^m + S Im w^m],  q = R/r, (s, t, u) = x/r, w = s + i t, Anm = d^m Pn/du^m normalised.
// For a fixed order m the sums over n are polynomials in u and q: blocks of 8 orders run down the degrees in registers, with
// A, dA/du, d2A/du2 by one recursion each.  q^m goes into w^m.  The first 8 rows of a block start its diagonal lanes.
typedef struct { int degree, blocks; int first[40]; double mu, radius; double *rows, *seed; } Gravity;
enum { ROW = 32 };  // a[8], b[8], C[8], S[8]

void *gravity_new(int N, double mu, double radius, const double *C, const double *S, int stride) {
  Gravity *g = calloc(1, sizeof *g);
  g->degree = N; g->blocks = N / 8 + 1; g->mu = mu; g->radius = radius;
  int rows = 0;
  for (int b = 0; b < g->blocks; b++) { g->first[b] = rows; rows += N - 8 * b + 1; }
  g->rows = aligned_alloc(64, (size_t)rows * ROW * 8);
  g->seed = aligned_alloc(64, (size_t)g->blocks * 64 * 8);
  memset(g->rows, 0, (size_t)rows * ROW * 8);
  memset(g->seed, 0, (size_t)g->blocks * 64 * 8);
  double diagonal = 1;
  for (int m = 0; m <= N; m++) {
    if (m) diagonal *= m == 1 ? sqrt(3.0) : sqrt((2.0 * m + 1) / (2.0 * m));
    int b = m / 8, l = m % 8;
    g->seed[b * 64 + l * 8 + l] = diagonal;
    for (int n = m; n <= N; n++) {
      double *row = g->rows + (size_t)(g->first[b] + n - 8 * b) * ROW;
      if (n > m) row[l] = sqrt((2.0 * n + 1) * (2.0 * n - 1) / ((double)(n - m) * (n + m)));
      if (n > m + 1) row[8 + l] = -sqrt((2.0 * n + 1) * (n - m - 1.0) * (n + m - 1.0) / ((2.0 * n - 3) * (n + m) * (n - m)));
      row[16 + l] = C[n * stride + m]; row[24 + l] = S[n * stride + m];
    }
  }
  return g;
}

// Re and Im of (q w)^m for m = 0 ..., behind two zeros: re[2 + m]
static inline void powers(double s, double t, int count, double *re, double *im) {
  re[0] = re[1] = im[0] = im[1] = 0;
  double s2 = s * s - t * t, t2 = 2 * s * t, s3 = s2 * s - t2 * t, t3 = s2 * t + t2 * s, s4 = s2 * s2 - t2 * t2, t4 = 2 * s2 * t2;
  v8 x = {1, s, s2, s3, s4, s4 * s - t4 * t, s4 * s2 - t4 * t2, s4 * s3 - t4 * t3};
  v8 y = {0, t, t2, t3, t4, s4 * t + t4 * s, s4 * t2 + t4 * s2, s4 * t3 + t4 * s3}, A = all(s4 * s4 - t4 * t4), B = all(2 * s4 * t4);
  PUT(re + 2, x); PUT(im + 2, y);
  for (int m = 8; m < count; m += 8) { v8 c = x * A - y * B; y = x * B + y * A; x = c; PUT(re + 2 + m, x); PUT(im + 2 + m, y); }
}

// acceleration a[3] and gradient G = xx xy xz yy yz zz (rows up to degree M only), in body axes
static inline __attribute__((always_inline)) void gravity(const Gravity *g, int M, const double *p, double *a, double *G, const int with) {
  double r2 = p[0] * p[0] + p[1] * p[1] + p[2] * p[2], ir = 1 / sqrt(r2), q = g->radius * ir;
  double s = p[0] * ir, t = p[1] * ir, u = p[2] * ir;
  double re[160], im[160];
  int blocks = M / 8 + 1;
  powers(q * s, q * t, blocks * 8, re, im);
  const v8 uq = all(u * q), q1 = all(q), q2 = all(q * q), zero = {0};
  const v8 lane = {0, 1, 2, 3, 4, 5, 6, 7};
  // sums over orders: gradient in s, t, u and r, then second derivatives
  v8 gs = zero, gt = zero, gu = zero, gr = zero, hss = zero, hst = zero, hsu = zero, htu = zero, huu = zero, hrs = zero, hrt = zero, hru = zero, hrr = zero;
  for (int b = 0; b < blocks; b++) {
    const double *row = g->rows + (size_t)g->first[b] * ROW, *seed = g->seed + b * 64;
    v8 A = zero, B = zero, dA = zero, dB = zero, eA = zero, eB = zero;  // A: degree n-1, B: n-2
    v8 L = zero, K = zero, Lu = zero, Ku = zero, Luu = zero, Kuu = zero, Ln = zero, Kn = zero, Lnu = zero, Knu = zero, Lnn = zero, Knn = zero;
    int n = 8 * b, split = n + 8 < M + 1 ? n + 8 : M + 1;
#define TERM(start)                                                                                                  \
  {                                                                                                                  \
    v8 al = AT(row), be = AT(row + 8) * q2, C = AT(row + 16), S = AT(row + 24), au = al * uq, aq = al * q1;          \
    v8 Z = au * A + (be * B + (start)), dZ = au * dA + (be * dB + aq * A), eZ = zero;                                  \
    if (with) eZ = au * eA + (be * eB + (aq + aq) * dA);                                                              \
    B = A; A = Z; dB = dA; dA = dZ; eB = eA; eA = eZ;                                                                 \
    v8 nn = all(n + 1.0), nZ = nn * Z;                                                                               \
    L += C * Z; K += S * Z; Lu += C * dZ; Ku += S * dZ; Ln += C * nZ; Kn += S * nZ;                                     \
    if (with) { v8 nd = nn * dZ, n2 = all(n + 2.0) * nZ; Luu += C * eZ; Kuu += S * eZ; Lnu += C * nd; Knu += S * nd; Lnn += C * n2; Knn += S * n2; } \
  }
    for (; n < split; n++, row += ROW, seed += 8) TERM(AT(seed))
    for (; n <= M; n++, row += ROW) TERM(zero)
    const double *x = re + 2 + 8 * b, *y = im + 2 + 8 * b;
    v8 m = lane + 8.0 * b, x0 = AT(x), y0 = AT(y), x1 = m * AT(x - 1), y1 = m * AT(y - 1);
    gs += L * x1 + K * y1; gt += K * x1 - L * y1; gu += Lu * x0 + Ku * y0; gr += Ln * x0 + Kn * y0;
    if (with) {
      v8 mm = m * (m - 1.0), x2 = mm * AT(x - 2), y2 = mm * AT(y - 2);
      hss += L * x2 + K * y2; hst += K * x2 - L * y2; hsu += Lu * x1 + Ku * y1; htu += Ku * x1 - Lu * y1; huu += Luu * x0 + Kuu * y0;
      hrs += Ln * x1 + Kn * y1; hrt += Kn * x1 - Ln * y1; hru += Lnu * x0 + Knu * y0; hrr += Lnn * x0 + Knn * y0;
    }
  }
  double f = g->mu * ir * ir;  // U/r has the factor mu/r^2
  v8 one = with ? sums(gs, gt, gu, gr, hss, hst, hsu, htu) : sums(gs, gt, gu, gr, zero, zero, zero, zero);
  double ds = f * q * one[0], dt = f * q * one[1], du = f * one[2], dr = -f * one[3];
  double c = s * ds + t * dt + u * du, a4 = dr - c;
  a[0] = ds + a4 * s; a[1] = dt + a4 * t; a[2] = du + a4 * u;
  if (with) {
    double e = f * ir;
    v8 two = sums(huu, hrs, hrt, hru, hrr, zero, zero, zero);
    double ss = e * q * q * one[4], st = e * q * q * one[5], su = e * q * one[6], tu = e * q * one[7], uu = e * two[0];
    double rs = -e * q * two[1], rt = -e * q * two[2], ru = -e * two[3], rr = e * two[4];
    double ks = ss * s + st * t + su * u, kt = st * s - ss * t + tu * u, ku = su * s + tu * t + uu * u;  // H sigma, H_tt = -H_ss
    double ws = rs - ks - ds * ir, wt = rt - kt - dt * ir, wu = ru - ku - du * ir, a4r = a4 * ir;
    double k = rr - 2 * (s * rs + t * rt + u * ru) + 2 * c * ir + (s * ks + t * kt + u * ku) - a4r;
    G[0] = ss + s * (k * s + 2 * ws) + a4r; G[1] = st + s * (k * t + wt) + t * ws; G[2] = su + s * (k * u + wu) + u * ws;
    G[3] = -ss + t * (k * t + 2 * wt) + a4r; G[4] = tu + t * (k * u + wu) + u * wt; G[5] = uu + u * (k * u + 2 * wu) + a4r;
  }
#undef TERM
}
__attribute__((noinline)) void gravity_acceleration(const void *g, int M, const double *p, double *a) { gravity(g, M, p, a, 0, 0); }
__attribute__((noinline)) void gravity_gradient(const void *g, int M, const double *p, double *a, double *G) { gravity(g, M, p, a, G, 1); }

// The same for 8 positions at once, one to a lane: orders and degrees one after the other.
static inline v8 rsqrt8(v8 x) { v8 o; for (int i = 0; i < 8; i++) o[i] = 1 / sqrt(x[i]); return o; }
__attribute__((noinline)) void gravity_lanes(const void *g_, int M, const v8 *p, v8 *a, v8 *G) {
  const Gravity *g = g_;
  v8 r2 = p[0] * p[0] + p[1] * p[1] + p[2] * p[2], ir = rsqrt8(r2), q = g->radius * ir, s = p[0] * ir, t = p[1] * ir, u = p[2] * ir;
  v8 zero = {0}, uq = u * q, q2 = q * q, sq = s * q, tq = t * q;
  v8 gs = zero, gt = zero, gu = zero, gr = zero, hss = zero, hst = zero, hsu = zero, htu = zero, huu = zero, hrs = zero, hrt = zero, hru = zero, hrr = zero;
  v8 x0 = zero + 1, y0 = zero, x1 = zero, y1 = zero, x2 = zero, y2 = zero;
  for (int m = 0; m <= M; m++) {
    const double *row = g->rows + (size_t)(g->first[m / 8] + m % 8) * ROW + m % 8;
    v8 A = zero, B = zero, dA = zero, dB = zero, eA = zero, eB = zero, start = zero + g->seed[m / 8 * 64 + m % 8 * 9];
    v8 L = zero, K = zero, Lu = zero, Ku = zero, Luu = zero, Kuu = zero, Ln = zero, Kn = zero, Lnu = zero, Knu = zero, Lnn = zero, Knn = zero;
    for (int n = m; n <= M; n++, row += ROW) {
      v8 be = row[8] * q2, au = row[0] * uq, aq = row[0] * q, C = zero + row[16], S = zero + row[24];
      v8 Z = au * A + (be * B + start), dZ = au * dA + (be * dB + aq * A), eZ = au * eA + (be * eB + (aq + aq) * dA);
      start = zero; B = A; A = Z; dB = dA; dA = dZ; eB = eA; eA = eZ;
      v8 nZ = (n + 1.0) * Z, nd = (n + 1.0) * dZ, n2 = (n + 2.0) * nZ;
      L += C * Z; K += S * Z; Lu += C * dZ; Ku += S * dZ; Ln += C * nZ; Kn += S * nZ;
      Luu += C * eZ; Kuu += S * eZ; Lnu += C * nd; Knu += S * nd; Lnn += C * n2; Knn += S * n2;
    }
    v8 mx = (double)m * x1, my = (double)m * y1, mmx = (double)(m * (m - 1)) * x2, mmy = (double)(m * (m - 1)) * y2;
    gs += L * mx + K * my; gt += K * mx - L * my; gu += Lu * x0 + Ku * y0; gr += Ln * x0 + Kn * y0;
    hss += L * mmx + K * mmy; hst += K * mmx - L * mmy; hsu += Lu * mx + Ku * my; htu += Ku * mx - Lu * my; huu += Luu * x0 + Kuu * y0;
    hrs += Ln * mx + Kn * my; hrt += Kn * mx - Ln * my; hru += Lnu * x0 + Knu * y0; hrr += Lnn * x0 + Knn * y0;
    x2 = x1; y2 = y1; x1 = x0; y1 = y0; v8 c = x0 * sq - y0 * tq; y0 = x0 * tq + y0 * sq; x0 = c;
  }
  v8 f = g->mu * ir * ir, ds = f * q * gs, dt = f * q * gt, du = f * gu, dr = -f * gr, c = s * ds + t * dt + u * du, a4 = dr - c, e = f * ir;
  a[0] = ds + a4 * s; a[1] = dt + a4 * t; a[2] = du + a4 * u;
  v8 ss = e * q * q * hss, st = e * q * q * hst, su = e * q * hsu, tu = e * q * htu, uu = e * huu, rs = -e * q * hrs, rt = -e * q * hrt, ru = -e * hru, rr = e * hrr;
  v8 ks = ss * s + st * t + su * u, kt = st * s - ss * t + tu * u, ku = su * s + tu * t + uu * u;
  v8 ws = rs - ks - ds * ir, wt = rt - kt - dt * ir, wu = ru - ku - du * ir, a4r = a4 * ir;
  v8 k = rr - 2 * (s * rs + t * rt + u * ru) + 2 * c * ir + (s * ks + t * kt + u * ku) - a4r;
  G[0] = ss + s * (k * s + 2 * ws) + a4r; G[1] = st + s * (k * t + wt) + t * ws; G[2] = su + s * (k * u + wu) + u * ws;
  G[3] = -ss + t * (k * t + 2 * wt) + a4r; G[4] = tu + t * (k * u + wu) + u * wt; G[5] = uu + u * (k * u + 2 * wu) + a4r;
}

// ------------------------------------------------------------------ tables
// 16 columns of time as polynomials in tau in [-1, 1] over pieces of equal length: rotation inertial -> body (9), Sun (3), Moon (3).
typedef struct { double start, piece; int pieces, terms; const double *c; } Table;  // c[piece][term][16], highest power first
static inline __attribute__((always_inline)) void table_at(const Table *T, double t, double *out) {
  double z = (t - T->start) / T->piece; int i = (int)z; i = i < 0 ? 0 : i >= T->pieces ? T->pieces - 1 : i;
  v8 tau = all(2 * (z - i) - 1); const double *c = T->c + (size_t)i * T->terms * 16; v8 x = AT(c), y = AT(c + 8);
  for (int k = 1; k < T->terms; k++) { c += 16; x = x * tau + AT(c); y = y * tau + AT(c + 8); }
  PUT(out, x); PUT(out + 8, y);
}
__attribute__((noinline)) void table_value(const Table *T, double t, double *out) { table_at(T, t, out); }

// ------------------------------------------------------------------ forces
typedef struct {
  Table table; const Gravity *gravity; int degree, gradient_degree, bodies, drag, radiation;
  double mu_sun, mu_moon, earth_radius, flattening, spin;            // the last: rad/s
  double density, height, scale;                                    // exponential atmosphere
  double area_mass, drag_coefficient, reflectivity, pressure, au, sun_radius;
} Model;

static inline void third_body(const double *r, const double *b, double mu, double *a, double *G, int with) {
  double d[3] = {b[0] - r[0], b[1] - r[1], b[2] - r[2]}, d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2], b2 = b[0] * b[0] + b[1] * b[1] + b[2] * b[2];
  double i2 = 1 / d2, k = mu * i2 * sqrt(i2), kb = mu / (b2 * sqrt(b2));
  for (int i = 0; i < 3; i++) a[i] += k * d[i] - kb * b[i];
  if (with) { double e = 3 * k * i2; for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) G[3 * i + j] += e * d[i] * d[j] - (i == j) * k; }
}

// fraction of the solar disc that is seen: two overlapping discs (Montenbruck and Gill, 3.4.2)
static inline double sunlight(const double *r, const double *d, double dd, double Rs, double Re) {
  double rd = r[0] * d[0] + r[1] * d[1] + r[2] * d[2];  // d: from the satellite to the Sun
  if (rd >= 0) return 1;
  double rr = r[0] * r[0] + r[1] * r[1] + r[2] * r[2], across = rr - rd * rd / dd, wide = Re + 0.01 * sqrt(rr);
  if (across > wide * wide) return 1;  // half-angle of the Sun is 0.0047
  double rn = sqrt(rr), dn = sqrt(dd), a = asin(Rs / dn), b = asin(Re / rn), c = acos(-rd / (rn * dn));
  if (a + b <= c) return 1;
  if (c <= b - a) return 0;
  double x = (c * c + a * a - b * b) / (2 * c), y = sqrt(fmax(a * a - x * x, 0));
  return 1 - (a * a * acos(x / a) + b * b * acos((c - x) / b) - c * y) / (M_PI * a * a);
}

// acceleration; with `with`, G = da/dr and D = da/dv (3 x 3 by rows) and E[0], E[1] = da by drag coefficient and reflectivity
static inline __attribute__((always_inline)) void forces(const Model *M, double t, const double *r, const double *v, double *a, double *G, double *D, double *E, const int with) {
  double w[16], p[3], b[3], g[6]; table_at(&M->table, t, w);
  for (int i = 0; i < 3; i++) p[i] = w[3 * i] * r[0] + w[3 * i + 1] * r[1] + w[3 * i + 2] * r[2];
  if (!with) gravity(M->gravity, M->degree, p, b, 0, 0);
  else if (M->gradient_degree >= M->degree) gravity(M->gravity, M->degree, p, b, g, 1);
  else { double unused[3]; gravity(M->gravity, M->degree, p, b, 0, 0); gravity(M->gravity, M->gradient_degree, p, unused, g, 1); }
  for (int i = 0; i < 3; i++) a[i] = w[i] * b[0] + w[3 + i] * b[1] + w[6 + i] * b[2];
  if (with) {  // W^T g W
    double S[9] = {g[0], g[1], g[2], g[1], g[3], g[4], g[2], g[4], g[5]}, T[9];
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) T[3 * i + j] = S[3 * i] * w[j] + S[3 * i + 1] * w[3 + j] + S[3 * i + 2] * w[6 + j];
    for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) G[3 * i + j] = w[i] * T[j] + w[3 + i] * T[3 + j] + w[6 + i] * T[6 + j];
    memset(D, 0, 72); memset(E, 0, 48);
  }
  if (M->bodies) { third_body(r, w + 9, M->mu_sun, a, G, with); third_body(r, w + 12, M->mu_moon, a, G, with); }
  if (M->radiation) {
    double d[3] = {w[9] - r[0], w[10] - r[1], w[11] - r[2]}, dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2], i2 = 1 / dd;
    double nu = sunlight(r, d, dd, M->sun_radius, M->earth_radius);
    if (nu > 0) {
      double f = nu * M->pressure * M->au * M->au * M->area_mass * i2 * sqrt(i2), k = f * M->reflectivity;
      for (int i = 0; i < 3; i++) { a[i] -= k * d[i]; if (with) E[3 + i] -= f * d[i]; }
      if (with) { double e = 3 * k * i2; for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) G[3 * i + j] -= e * d[i] * d[j] - (i == j) * k; }
    }
  }
  if (M->drag) {
    const double *z = w + 6; double o[3] = {M->spin * z[0], M->spin * z[1], M->spin * z[2]};
    double u[3] = {v[0] - (o[1] * r[2] - o[2] * r[1]), v[1] - (o[2] * r[0] - o[0] * r[2]), v[2] - (o[0] * r[1] - o[1] * r[0])};
    double r2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2], rn = sqrt(r2), i2 = 1 / r2, zb = p[2], dip = M->earth_radius * M->flattening;
    double s2 = zb * zb * i2, h = rn - M->earth_radius + dip * s2 * (1 + 1.5 * M->flattening * (1 - s2)), rho = M->density * exp((M->height - h) / M->scale);
    double un = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]), f = -0.5 * rho * M->area_mass, k = f * M->drag_coefficient;
    for (int i = 0; i < 3; i++) { a[i] += k * un * u[i]; if (with) E[i] += f * un * u[i]; }
    if (with) {
      double iu = k / un, K[9], dh[3];
      for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) K[3 * i + j] = iu * u[i] * u[j] + (i == j) * k * un;
      for (int j = 0; j < 3; j++) dh[j] = -(r[j] / rn + dip * 2 * zb * i2 * (z[j] - zb * i2 * r[j])) / M->scale;
      for (int i = 0; i < 3; i++) {
        const double *Ki = K + 3 * i; D[3 * i] += Ki[0]; D[3 * i + 1] += Ki[1]; D[3 * i + 2] += Ki[2];
        double ai = k * un * u[i];  // -K [o x] + a dlnrho/dr
        G[3 * i] += ai * dh[0] - (Ki[1] * o[2] - Ki[2] * o[1]);
        G[3 * i + 1] += ai * dh[1] - (Ki[2] * o[0] - Ki[0] * o[2]);
        G[3 * i + 2] += ai * dh[2] - (Ki[0] * o[1] - Ki[1] * o[0]);
      }
    }
  }
}
__attribute__((noinline)) void model_forces(const Model *M, double t, const double *y, double *a, double *G, double *D, double *E, int with) {
  if (with) forces(M, t, y, y + 3, a, G, D, E, 1); else forces(M, t, y, y + 3, a, 0, 0, 0, 0);
}

// ------------------------------------------------------------------ integrators
// y: position and velocity in one vector; R: 6 rows of d(state)/d(first state, drag coefficient, reflectivity).
typedef struct { v8 y, R[6]; } State;
static long calls;  // of the forces, for the report
static inline __attribute__((always_inline)) void rate(const Model *M, double t, const State *x, State *f, const int with) {
  double a[3], G[9], D[9], E[6], y[8]; PUT(y, x->y); calls++;
  forces(M, t, y, y + 3, a, G, D, E, with);
  f->y = (v8){y[3], y[4], y[5], a[0], a[1], a[2], 0, 0};
  if (with) for (int i = 0; i < 3; i++) {
    f->R[i] = x->R[3 + i];
    f->R[3 + i] = G[3 * i] * x->R[0] + G[3 * i + 1] * x->R[1] + G[3 * i + 2] * x->R[2] + (D[3 * i] * x->R[3] + D[3 * i + 1] * x->R[4] + D[3 * i + 2] * x->R[5]) + (v8){0, 0, 0, 0, 0, 0, E[i], E[3 + i]};
  }
}
static inline void add(State *o, const State *x, double h, const State *k, int with) { o->y = x->y + h * k->y; if (with) for (int i = 0; i < 6; i++) o->R[i] = x->R[i] + h * k->R[i]; }

static inline __attribute__((always_inline)) void rk4_step(const Model *M, double t, double h, State *x, const int with) {
  State k1, k2, k3, k4, y;
  rate(M, t, x, &k1, with); add(&y, x, h / 2, &k1, with);
  rate(M, t + h / 2, &y, &k2, with); add(&y, x, h / 2, &k2, with);
  rate(M, t + h / 2, &y, &k3, with); add(&y, x, h, &k3, with);
  rate(M, t + h, &y, &k4, with);
  x->y += h / 6 * (k1.y + 2 * k2.y + 2 * k3.y + k4.y);
  if (with) for (int i = 0; i < 6; i++) x->R[i] += h / 6 * (k1.R[i] + 2 * k2.R[i] + 2 * k3.R[i] + k4.R[i]);
}
#include "dop853.h"
static inline __attribute__((always_inline)) void rk8_stages(const Model *M, double t, double h, const State *x, State *k, State *out, const int with) {
  int rows = with ? 7 : 1;
  for (int s = 0; s < 12; s++) {
    State y; v8 *o = &y.y; const v8 *b = &x->y;
    for (int i = 0; i < rows; i++) { v8 e = {0}; for (int j = 0; j < s; j++) e += DA[s][j] * (&k[j].y)[i]; o[i] = b[i] + h * e; }
    rate(M, t + DC[s] * h, &y, &k[s], with);
  }
  for (int i = 0; i < rows; i++) { v8 e = {0}; for (int j = 0; j < 12; j++) if (DB[j] != 0) e += DB[j] * (&k[j].y)[i]; (&out->y)[i] = (&x->y)[i] + h * e; }
}
static void start(State *x, const double *y) { memset(x, 0, sizeof *x); for (int i = 0; i < 6; i++) { x->y[i] = y[i]; x->R[i][i] = 1; } }
static void finish(const State *x, double *y, double *Phi) { for (int i = 0; i < 6; i++) { y[i] = x->y[i]; if (Phi) PUT(Phi + 8 * i, x->R[i]); } }

// fixed steps of RK4 (order 4) or Dormand-Prince 8 (order 8) from t0 for `steps` of `h`; Phi has 6 rows of 8
#define BODY(with)                                                                                         \
  for (int i = 0; i < steps; i++) {                                                                         \
    if (order == 4) rk4_step(M, t0 + i * h, h, &x, with);                                                   \
    else { State z; rk8_stages(M, t0 + i * h, h, &x, k, &z, with); x = z; }                                    \
  }
long fixed(const Model *M, int order, double t0, double h, int steps, double *y, double *Phi) {
  State x, k[12]; start(&x, y); calls = 0;
  if (Phi) BODY(1) else BODY(0)
  finish(&x, y, Phi); return calls;
}
#undef BODY

// Fixed steps of order 8 that end at the edges of the half-shadow: the radiation's rate has a corner there, which no order sees.
static void edges(const Model *M, double t, const double *r, double *e) {  // signs change at the outer and the inner edge
  double w[16]; table_at(&M->table, t, w);
  double d[3] = {w[9] - r[0], w[10] - r[1], w[11] - r[2]}, dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2], rr = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
  double a = asin(M->sun_radius / sqrt(dd)), b = asin(M->earth_radius / sqrt(rr)), c = acos(-(r[0] * d[0] + r[1] * d[1] + r[2] * d[2]) / sqrt(rr * dd));
  e[0] = c - (a + b); e[1] = c - (b - a);
}
static double crossing(const Model *M, double t, double h, const v8 *p, const v8 *f, const v8 *q, const v8 *g, int which) {
  double lo = 0, hi = 1, e[2], start[2], r[3]; for (int i = 0; i < 3; i++) r[i] = (*p)[i]; edges(M, t, r, start);
  for (int k = 0; k < 40; k++) {  // place along the step by the quintic of both ends
    double u = 0.5 * (lo + hi), u2 = u * u, u3 = u2 * u, u4 = u3 * u, u5 = u4 * u;
    for (int i = 0; i < 3; i++) r[i] = (1 - 10 * u3 + 15 * u4 - 6 * u5) * (*p)[i] + (10 * u3 - 15 * u4 + 6 * u5) * (*q)[i] + h * ((u - 6 * u3 + 8 * u4 - 3 * u5) * (*f)[i] + (-4 * u3 + 7 * u4 - 3 * u5) * (*g)[i])
      + h * h * ((0.5 * u2 - 1.5 * u3 + 1.5 * u4 - 0.5 * u5) * (*f)[3 + i] + (0.5 * u3 - u4 + 0.5 * u5) * (*g)[3 + i]);
    edges(M, t + u * h, r, e);
    if ((e[which] > 0) == (start[which] > 0)) lo = u; else hi = u;
  }
  return hi;
}
static inline __attribute__((always_inline)) long edged_(const Model *M, double t0, double h, int steps, double *y, double *Phi, const int with) {
  State x, z, k[12], g; start(&x, y); calls = 0; double e[2], n[2], r[3];
  for (int i = 0; i < steps; i++) {
    double t = t0 + i * h, end = t0 + (i + 1) * h, step = h; int ended = 0;
    for (int splits = 0; !ended && splits < 8; splits++) {
      for (int j = 0; j < 3; j++) r[j] = x.y[j]; edges(M, t, r, e);
      rk8_stages(M, t, step, &x, k, &z, with);
      for (int j = 0; j < 3; j++) r[j] = z.y[j]; edges(M, t + step, r, n);
      double first = 1;
      for (int c = 0; c < 2; c++) if ((e[c] > 0) != (n[c] > 0)) {
        rate(M, t + step, &z, &g, 0); double u = crossing(M, t, step, &x.y, &k[0].y, &z.y, &g.y, c); if (u > 1e-9 && u < first) first = u;
      }
      if (first < 1 && first * step > 1e-6) { step *= first; rk8_stages(M, t, step, &x, k, &z, with); x = z; t += step; step = end - t; ended = step < 1e-6; }
      else { x = z; ended = 1; }
    }
  }
  finish(&x, y, Phi); return calls;
}
long edged(const Model *M, double t0, double h, int steps, double *y, double *Phi) { return Phi ? edged_(M, t0, h, steps, y, Phi, 1) : edged_(M, t0, h, steps, y, 0, 0); }

// adaptive Dormand-Prince 8(5,3); the state alone decides; an estimate of position and velocity error below
// `metres` and `metres` times the mean motion of the orbit counts as 1.
static inline __attribute__((always_inline)) long adaptive_(const Model *M, double t0, double t1, double metres, double h, double *y, double *Phi, long *rejected, double *steps_out, int most, const int with) {
  State x, z, k[12]; start(&x, y); calls = 0; *rejected = 0; double t = t0, rate_ = 1.1e-3; long n = 0;
  if (steps_out) { steps_out[0] = t; n = 1; }
  while (t < t1) {
    if (t + 1.001 * h > t1) h = t1 - t;
    // try the state alone, and go on with the variational equations only when it is accepted: no, one pass is cheaper where few are rejected
    rk8_stages(M, t, h, &x, k, &z, with);
    v8 e5 = {0}, e3 = {0}; for (int j = 0; j < 12; j++) { e5 += DE5[j] * k[j].y; e3 += DE3[j] * k[j].y; }
    double s5 = 0, s3 = 0;
    for (int i = 0; i < 6; i++) { double w = 1 / (i < 3 ? metres : metres * rate_); s5 += e5[i] * e5[i] * w * w; s3 += e3[i] * e3[i] * w * w; }
    double error = fabs(h) * s5 / sqrt(6 * fmax(s5 + 0.01 * s3, 1e-300));
    double factor = 0.9 * pow(fmax(error, 1e-10), -1.0 / 8);
    if (error <= 1) { t += h; x = z; if (steps_out && n < most) steps_out[n++] = t; } else ++*rejected;
    h *= fmin(fmax(factor, 0.3), 4);
  }
  finish(&x, y, Phi); return calls;
}
long adaptive(const Model *M, double t0, double t1, double metres, double h, double *y, double *Phi, long *rejected, double *steps_out, int most) {
  return Phi ? adaptive_(M, t0, t1, metres, h, y, Phi, rejected, steps_out, most, 1) : adaptive_(M, t0, t1, metres, h, y, Phi, rejected, steps_out, most, 0);
}

// Gauss-Jackson: summed multistep of order K for x'' = f(t, x, x').  The sums of the past are carried; predictor and corrector
// take weights of the newest K + 1 rates (newest first).  mode 0: predict, evaluate (PE); 1: PEC, one corrector from that rate;
// 2: PECE.  The variational rows are a second-order equation too, in the same weights.
typedef struct { v8 a, R[3]; } Rate;                      // accelerations
typedef struct { int K; const double *xp, *vp, *xc, *vc; } Weights;  // predictor and corrector, position and velocity
#define MOST 20
static inline __attribute__((always_inline)) void gj_rate(const Model *M, double t, const v8 *x, const v8 *v, Rate *f, const int with) {
  double r[8], u[8], a[3], G[9], D[9], E[6]; PUT(r, x[0]); PUT(u, v[0]); calls++;
  forces(M, t, r, u, a, G, D, E, with);
  f->a = (v8){a[0], a[1], a[2], 0, 0, 0, 0, 0};
  if (with) for (int i = 0; i < 3; i++) f->R[i] = G[3 * i] * x[1] + G[3 * i + 1] * x[2] + G[3 * i + 2] * x[3] + (D[3 * i] * v[1] + D[3 * i + 1] * v[2] + D[3 * i + 2] * v[3]) + (v8){0, 0, 0, 0, 0, 0, E[i], E[3 + i]};
}
// weighted sums of the newest K + 1 rates, for position and velocity, of all rows at once
static inline __attribute__((always_inline)) void weigh(int K, const double *wx, const double *wv, const Rate *F, v8 *sx, v8 *sv, const int rows) {
  v8 a[4] = {{0}}, b[4] = {{0}};
  for (int j = 0; j <= K; j++) {
    const v8 *f = &F[j].a, x = all(wx[j]), v = all(wv[j]);
    for (int i = 0; i < rows; i++) { a[i] += x * f[i]; b[i] += v * f[i]; }
  }
  for (int i = 0; i < rows; i++) { sx[i] = a[i]; sv[i] = b[i]; }
}
static inline __attribute__((always_inline)) long gauss_jackson_(const Model *M, const Weights *W, int mode, double t0, double h, int steps, double *y, double *Phi, double *dense, const int with) {
  const int K = W->K, rows = with ? 4 : 1; State s, k[12]; Rate F[64 + MOST + 1]; v8 x[4] = {{0}}, v[4] = {{0}}; calls = 0;
  // history: K steps back from the start, in substeps of order 8
  start(&s, y); int sub = h > 40 ? 2 : 1;
  Rate past[MOST + 1];
  for (int i = 0; i <= K; i++) {
    for (int j = 0; j < 3; j++) { x[0] = s.y; v[0] = (v8){s.y[3], s.y[4], s.y[5], 0, 0, 0, 0, 0}; x[1 + j] = s.R[j]; v[1 + j] = s.R[3 + j]; }
    gj_rate(M, t0 - i * h, x, v, &past[i], with);
    if (i < K) for (int j = 0; j < sub; j++) { State z; rk8_stages(M, t0 - i * h - j * h / sub, -h / sub, &s, k, &z, with); s = z; }
  }
  int at = 64;  // F[at] is the newest, older ones behind it
  for (int i = 0; i <= K; i++) F[at - 1 + i] = past[i];
  at -= 1;
  start(&s, y);
  v8 S1[4], S2[4], sx[4], sv[4];
  weigh(K, W->xc, W->vc, F + at, sx, sv, rows);
  for (int i = 0; i < rows; i++) {
    v8 pos = i ? s.R[i - 1] : s.y, vel = i ? s.R[2 + i] : (v8){s.y[3], s.y[4], s.y[5], 0, 0, 0, 0, 0};
    S1[i] = vel / h - sv[i]; S2[i] = pos / (h * h) - sx[i] + S1[i];
  }
  for (int n = 1; n <= steps; n++) {
    if (at == 0) { memmove(&F[63], &F[0], sizeof(Rate) * (K + 1)); at = 63; }  // the newest stay
    double t = t0 + n * h;
    weigh(K, W->xp, W->vp, F + at, sx, sv, rows);
    for (int i = 0; i < rows; i++) { x[i] = h * h * (S2[i] + sx[i]); v[i] = h * (S1[i] + sv[i]); }
    // sums move on with the new rate: S1_n = S1_(n-1) + f_n, S2_n = S2_(n-1) + S1_n
    at--; Rate *f = &F[at];
    gj_rate(M, t, x, v, f, with);
    if (mode) {
      weigh(K, W->xc, W->vc, F + at, sx, sv, rows);
      for (int i = 0; i < rows; i++) { x[i] = h * h * (S2[i] + sx[i]); v[i] = h * (S1[i] + (&f->a)[i] + sv[i]); }
      if (mode == 2) gj_rate(M, t, x, v, f, with);
    }
    for (int i = 0; i < rows; i++) { S1[i] += (&f->a)[i]; S2[i] += S1[i]; }
    if (dense) { PUT(dense, (v8){0}); for (int i = 0; i < 3; i++) { dense[i] = x[0][i]; dense[3 + i] = v[0][i]; dense[6 + i] = f->a[i]; } dense += 9; }
  }
  for (int i = 0; i < 3; i++) { y[i] = x[0][i]; y[3 + i] = v[0][i]; if (Phi) { PUT(Phi + 8 * i, x[1 + i]); PUT(Phi + 8 * (3 + i), v[1 + i]); } }
  return calls;
}
long gauss_jackson(const Model *M, const Weights *W, int mode, double t0, double h, int steps, double *y, double *Phi) {
  return Phi ? gauss_jackson_(M, W, mode, t0, h, steps, y, Phi, 0, 1) : gauss_jackson_(M, W, mode, t0, h, steps, y, 0, 0, 0);
}

// ------------------------------------------------------------------ orbit determination
// One-way range and range-rate of stations in body axes, light time by one correction.  A row of H has 8 columns like R.
typedef struct { int count; const double *t, *z; const int *station; const double *place, *sigma; } Tracking;  // z[count][2], sigma[2]

static inline __attribute__((always_inline)) void observe(const Model *M, double t, const double *place, v8 x, v8 v, v8 *seen, v8 *H, const v8 *R, const v8 *V) {
  double w[16]; table_at(&M->table, t, w);
  v8 zero = {0}, s = zero, o = zero;
  for (int i = 0; i < 3; i++) { s[i] = w[i] * place[0] + w[3 + i] * place[1] + w[6 + i] * place[2]; o[i] = M->spin * w[6 + i]; }
  v8 sv = {o[1] * s[2] - o[2] * s[1], o[2] * s[0] - o[0] * s[2], o[0] * s[1] - o[1] * s[0], 0, 0, 0, 0, 0};
  v8 d = x - s, e = v - sv; double late = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / 299792458.0;
  d -= late * v; e += late * M->gravity->mu / pow(x[0] * x[0] + x[1] * x[1] + x[2] * x[2], 1.5) * x;  // the signal left that much earlier
  double r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]), ir = 1 / r, rate = (d[0] * e[0] + d[1] * e[1] + d[2] * e[2]) * ir;
  *seen = (v8){r, rate, 0, 0, 0, 0, 0, 0};
  v8 u = d * ir, q = (e - rate * u) * ir;
  H[0] = u[0] * R[0] + u[1] * R[1] + u[2] * R[2];
  H[1] = (q[0] * R[0] + q[1] * R[1] + q[2] * R[2]) + (u[0] * V[0] + u[1] * V[1] + u[2] * V[2]);
}
// quintic through place, velocity and acceleration at both ends of a step: value and rate at tau in [0, 1]
static inline void quintic(double tau, double h, double *w, double *d) {
  double t = tau, t2 = t * t, t3 = t2 * t, t4 = t3 * t, t5 = t4 * t;
  w[0] = 1 - 10 * t3 + 15 * t4 - 6 * t5; w[3] = 10 * t3 - 15 * t4 + 6 * t5;
  w[1] = h * (t - 6 * t3 + 8 * t4 - 3 * t5); w[4] = h * (-4 * t3 + 7 * t4 - 3 * t5);
  w[2] = h * h * (0.5 * t2 - 1.5 * t3 + 1.5 * t4 - 0.5 * t5); w[5] = h * h * (0.5 * t3 - t4 + 0.5 * t5);
  d[0] = (-30 * t2 + 60 * t3 - 30 * t4) / h; d[3] = -d[0];
  d[1] = 1 - 18 * t2 + 32 * t3 - 15 * t4; d[4] = -12 * t2 + 28 * t3 - 15 * t4;
  d[2] = h * (t - 4.5 * t2 + 6 * t3 - 2.5 * t4); d[5] = h * (1.5 * t2 - 4 * t3 + 2.5 * t4);
}
typedef struct { double t; v8 x[4], v[4], a[4]; } Node;  // place, velocity, acceleration of the state and of its three rows
// one iteration of batch least squares: normal matrix (8 x 8, constants included), right side, and the sum of squares
static void collect(const Model *M, const Tracking *Z, int *at, const Node *p, const Node *q, v8 *N, v8 *b, double *cost) {
  double h = q->t - p->t;
  for (; *at < Z->count && Z->t[*at] <= q->t; ++*at) {
    double w[6], d[6]; quintic((Z->t[*at] - p->t) / h, h, w, d);
    v8 x[4], v[4], seen, H[2];
    for (int i = 0; i < 4; i++) {
      x[i] = (w[0] * p->x[i] + w[1] * p->v[i]) + (w[2] * p->a[i] + w[3] * q->x[i]) + (w[4] * q->v[i] + w[5] * q->a[i]);
      v[i] = (d[0] * p->x[i] + d[1] * p->v[i]) + (d[2] * p->a[i] + d[3] * q->x[i]) + (d[4] * q->v[i] + d[5] * q->a[i]);
    }
    observe(M, Z->t[*at], Z->place + 3 * Z->station[*at], x[0], v[0], &seen, H, x + 1, v + 1);
    for (int c = 0; c < 2; c++) {
      double nu = (Z->z[2 * *at + c] - seen[c]) / Z->sigma[c]; v8 row = H[c] / Z->sigma[c];
      *cost += nu * nu; *b += nu * row;
      for (int i = 0; i < 8; i++) N[i] += row[i] * row;
    }
  }
}
long batch(const Model *M, const Weights *W, const Tracking *Z, double h, int steps, const double *y0, double *N_, double *b_, double *cost_) {
  double y[6]; memcpy(y, y0, 48); v8 N[8] = {{0}}, b = {0}; double cost = 0; int at = 0;
  // Gauss-Jackson with one correction, as above, keeping the two newest nodes
  const int K = W->K; State s, k[12]; Rate F[64 + MOST + 1], past[MOST + 1]; v8 x[4], v[4], S1[4], S2[4], sx[4], sv[4]; calls = 0; Node A, B;
  start(&s, y);
  for (int i = 0; i <= K; i++) {
    for (int j = 0; j < 3; j++) { x[0] = s.y; v[0] = (v8){s.y[3], s.y[4], s.y[5], 0, 0, 0, 0, 0}; x[1 + j] = s.R[j]; v[1 + j] = s.R[3 + j]; }
    gj_rate(M, -i * h, x, v, &past[i], 1);
    if (i == 0) { A.t = 0; memcpy(A.x, x, sizeof x); memcpy(A.v, v, sizeof v); memcpy(A.a, &past[0], sizeof x); A.x[0] = (v8){y[0], y[1], y[2], 0, 0, 0, 0, 0}; }
    if (i < K) { State z; rk8_stages(M, -i * h, -h, &s, k, &z, 1); s = z; }
  }
  int now = 63; for (int i = 0; i <= K; i++) F[now + i] = past[i];
  start(&s, y); weigh(K, W->xc, W->vc, F + now, sx, sv, 4);
  for (int i = 0; i < 4; i++) { S1[i] = A.v[i] / h - sv[i]; S2[i] = A.x[i] / (h * h) - sx[i] + S1[i]; }
  for (int n = 1; n <= steps; n++) {
    if (now == 0) { memmove(&F[63], &F[0], sizeof(Rate) * (K + 1)); now = 63; }
    weigh(K, W->xp, W->vp, F + now, sx, sv, 4);
    for (int i = 0; i < 4; i++) { x[i] = h * h * (S2[i] + sx[i]); v[i] = h * (S1[i] + sv[i]); }
    now--; Rate *f = &F[now]; gj_rate(M, n * h, x, v, f, 1);
    weigh(K, W->xc, W->vc, F + now, sx, sv, 4);
    B.t = n * h;
    for (int i = 0; i < 4; i++) { B.x[i] = h * h * (S2[i] + sx[i]); B.v[i] = h * (S1[i] + (&f->a)[i] + sv[i]); B.a[i] = (&f->a)[i]; S1[i] += B.a[i]; S2[i] += S1[i]; }
    if (at < Z->count && Z->t[at] <= B.t) collect(M, Z, &at, &A, &B, N, &b, &cost);
    A = B;
  }
  for (int i = 0; i < 8; i++) PUT(N_ + 8 * i, N[i]);
  PUT(b_, b); *cost_ = cost; return calls;
}
// extended Kalman filter: RK4 over intervals up to `near`, else order 8 in steps of at most `far`; process noise q per second
static inline void transpose6(const v8 *A, v8 *B) { for (int i = 0; i < 6; i++) for (int j = 0; j < 6; j++) B[j][i] = A[i][j]; }
long ekf(const Model *M, const Tracking *Z, double near, double far, const double *y0, const double *P0, const double *q, double *mean, double *sigma) {
  State s, k[12]; v8 P[6], zero = {0}; double t = 0; calls = 0; long steps = 0; start(&s, y0);
  for (int i = 0; i < 6; i++) { P[i] = zero; P[i][i] = P0[i]; }
  for (int m = 0; m < Z->count; m++) {
    double dt = Z->t[m] - t;
    if (dt > 0) {
      for (int i = 0; i < 6; i++) { s.R[i] = zero; s.R[i][i] = 1; }
      if (dt <= near) { rk4_step(M, t, dt, &s, 1); steps++; }
      else { int n = (int)ceil(dt / far); for (int i = 0; i < n; i++, steps++) { State z; rk8_stages(M, t + i * dt / n, dt / n, &s, k, &z, 1); s = z; } }
      v8 T[6], U[6], keep = {1, 1, 1, 1, 1, 1, 0, 0}; for (int i = 0; i < 6; i++) s.R[i] *= keep;
      for (int i = 0; i < 6; i++) { T[i] = zero; for (int j = 0; j < 6; j++) T[i] += s.R[i][j] * P[j]; }
      transpose6(s.R, U);
      for (int i = 0; i < 6; i++) { P[i] = zero; for (int j = 0; j < 6; j++) P[i] += T[i][j] * U[j]; P[i][i] += q[i] * dt; }
      t = Z->t[m];
    }
    v8 R[3], V[3], H[2], seen, x = {s.y[0], s.y[1], s.y[2], 0, 0, 0, 0, 0}, v = {s.y[3], s.y[4], s.y[5], 0, 0, 0, 0, 0}, d = zero;
    for (int i = 0; i < 3; i++) { R[i] = zero; R[i][i] = 1; V[i] = zero; V[i][3 + i] = 1; }
    observe(M, t, Z->place + 3 * Z->station[m], x, v, &seen, H, R, V);
    for (int c = 0; c < 2; c++) {  // Joseph form
      v8 h = H[c], Ph = zero, B[6], g; double r = Z->sigma[c] * Z->sigma[c];
      for (int j = 0; j < 6; j++) Ph += h[j] * P[j];
      double S = r, e = Z->z[2 * m + c] - seen[c]; for (int j = 0; j < 6; j++) { S += h[j] * Ph[j]; e -= h[j] * d[j]; }
      v8 K = Ph / S, hB = zero; d += e * K;
      for (int i = 0; i < 6; i++) { B[i] = P[i] - Ph[i] * K; }
      for (int j = 0; j < 6; j++) hB += h[j] * B[j];
      g = r * K - hB; for (int i = 0; i < 6; i++) P[i] = B[i] + K[i] * g;
    }
    s.y += d;
    if (mean) for (int i = 0; i < 6; i++) { mean[6 * m + i] = s.y[i]; sigma[6 * m + i] = sqrt(P[i][i]); }
  }
  return steps;
}

// ------------------------------------------------------------------ timing: CPU seconds per call, `reps` calls
double time_gravity(const void *g, int M, int with, int reps, const double *p0) {
  double p[3] = {p0[0], p0[1], p0[2]}, a[3], G[6] = {0}, t = cpu();
  for (int i = 0; i < reps; i++) { if (with) gravity_gradient(g, M, p, a, G); else gravity_acceleration(g, M, p, a); p[0] += 1e-3 * a[0]; p[2] += 1e-3 * a[2] + 1e-9 * G[0]; }
  return (cpu() - t) / reps;
}
double time_gravity_lanes(const void *g, int M, int reps, const double *p0) {
  v8 p[3] = {all(p0[0]), all(p0[1]), all(p0[2])}, a[3], G[6]; double t = cpu();
  for (int i = 0; i < reps; i++) { gravity_lanes(g, M, p, a, G); p[0] += 1e-3 * a[0]; p[2] += 1e-3 * a[2]; }
  return (cpu() - t) / reps / 8;
}
double time_table(const Table *T, int reps) { double o[16], s = 0, t = cpu(); for (int i = 0; i < reps; i++) { table_value(T, 100.0 + s, o); s = 1e-6 * o[0]; } return (cpu() - t) / reps; }
// the same of one vector alone: 3 columns in 4, at an instant that the last look-up decides
static inline __attribute__((always_inline)) void table3_at(const Table *T, double t, double *out) {
  typedef double v4 __attribute__((vector_size(32))); typedef double v4u __attribute__((vector_size(32), aligned(8)));
  double z = (t - T->start) / T->piece; int i = (int)z; i = i < 0 ? 0 : i >= T->pieces ? T->pieces - 1 : i;
  double x = 2 * (z - i) - 1; v4 tau = {x, x, x, x}; const double *c = T->c + (size_t)i * T->terms * 4; v4 y = *(const v4u *)c;
  for (int k = 1; k < T->terms; k++) { c += 4; y = y * tau + *(const v4u *)c; }
  *(v4u *)out = y;
}
__attribute__((noinline)) void table3_value(const Table *T, double t, double *out) { table3_at(T, t, out); }
double time_table3(const Table *T, int reps) { double o[4], s = 0, t = cpu(); for (int i = 0; i < reps; i++) { table3_value(T, 100.0 + s, o); s = 1e-9 * o[0]; } return (cpu() - t) / reps; }
double time_forces(const Model *M, int with, int reps, const double *y0) {
  double y[6], a[3], G[9], D[9], E[6], t; memcpy(y, y0, 48); t = cpu();
  for (int i = 0; i < reps; i++) { model_forces(M, 100, y, a, G, D, E, with); y[0] += 1e-3 * a[0]; y[2] += 1e-3 * a[2]; }
  return (cpu() - t) / reps;
}
double cpu_seconds(void) { return cpu(); }
