"""Random problems of six kinds, and what minimises the cost of each: dense, and written from the maths page alone."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import piazzi as pz

COUNT = 40  # problems of each family
EPOCHS = 30
SMALL = 1e-9  # sigma: where the reference ends


@dataclass(frozen=True)
class Family:
    """A model, and the same in NumPy: `flow` and `seen` take arrays whose first axis is the state, real or complex."""

    name: str
    states: tuple[str, ...]
    dynamics: tuple[str, ...]
    sensor: dict[str, str]
    flow: Callable
    seen: Callable
    draw: Callable  # of a generator: prior mean, prior sigma, noise PSD, measurement variance, longest interval
    constant: tuple[str, float, float] | None = None
    substeps: int = 5
    angles: tuple[str, ...] = ()

    def problem(self, seed: int) -> tuple[pz.Problem, pz.Tracking]:
        rng = np.random.default_rng([seed, sum(map(ord, self.name))])
        mean, sigma, noise, R, longest = self.draw(rng)
        parameters = {} if self.constant is None else {self.constant[0]: pz.Gaussian(*self.constant[1:])}
        model = pz.Model(
            list(self.states),
            list(self.dynamics),
            [pz.Sensor("s", self.sensor, self.angles)],
            parameters=dict.fromkeys(parameters, "estimated"),
        )
        prior = pz.Gaussian(mean, np.asarray(sigma) ** 2)
        stations = [pz.Station("a", "s", R)]
        problem = pz.Problem(model, prior, pz.ProcessNoise(noise), stations, parameters, pz.RungeKutta4(substeps=self.substeps))
        return problem, pz.simulate(problem, np.cumsum(rng.uniform(0.2 * longest, longest, EPOCHS)), rng)


def log_uniform(rng, low, high):
    return 10.0 ** rng.uniform(np.log10(low), np.log10(high))


def turn_flow(s):
    return np.array([s[2], s[3], -s[4] * s[3], s[4] * s[2], 0 * s[4]])


def polar(x, y):
    """Range and bearing; of complex numbers by their first derivative."""
    bearing = np.arctan2(y.real, x.real) + 1j * (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return np.array([np.sqrt(x**2 + y**2), bearing if np.iscomplexobj(x) else bearing.real])


PENDULUM = Family(
    "pendulum", ("a", "w"), ("w", "-9.8*sin(a)"), {"s": "sin(a)"},
    lambda s: np.array([s[1], -9.8 * np.sin(s[0])]), lambda s: np.array([np.sin(s[0])]),
    lambda r: (r.normal([1.0, 0.0], 0.5), [0.5, 0.5], [0, log_uniform(r, 1e-3, 1)], log_uniform(r, 1e-3, 0.1), 0.2),
)  # fmt: skip
DUFFING = Family(
    "Duffing", ("x", "v"), ("v", "x - x**3 - 0.2*v"), {"x": "x"},
    lambda s: np.array([s[1], s[0] - s[0] ** 3 - 0.2 * s[1]]), lambda s: s[:1],
    lambda r: (r.normal([0.5, 0.0], 0.5), [1.0, 1.0], [0, log_uniform(r, 1e-3, 0.3)], log_uniform(r, 1e-3, 0.3), 0.8),
)  # fmt: skip
LORENZ = Family(
    "Lorenz", ("x", "y", "z"), ("10*(y - x)", "x*(28 - z) - y", "x*y - 8*z/3"), {"x": "x"},
    lambda s: np.array([10 * (s[1] - s[0]), s[0] * (28 - s[2]) - s[1], s[0] * s[1] - 8 * s[2] / 3]), lambda s: s[:1],
    lambda r: (r.normal([1, 1, 20], 3), [3, 3, 3], [log_uniform(r, 1e-3, 3)] * 3, log_uniform(r, 0.1, 3), 0.2),
)  # fmt: skip
VAN_DER_POL = Family(
    "Van der Pol", ("x", "v"), ("v", "mu*(1 - x**2)*v - x"), {"x": "x"},
    lambda s: np.array([s[1], s[2] * (1 - s[0] ** 2) * s[1] - s[0], 0 * s[2]]), lambda s: s[:1],
    lambda r: ([1, 0], [0.3**0.5] * 2, [0, log_uniform(r, 0.01, 0.1)], log_uniform(r, 0.01, 0.1), 0.5),
    ("mu", 1.5, 0.5),
)  # fmt: skip
CUBIC = Family(
    "cubic sensor", ("x", "v"), ("v", "-x"), {"c": "x**3"},
    lambda s: np.array([s[1], -s[0]]), lambda s: s[:1] ** 3,
    lambda r: (r.normal([1, 0], 0.5), [1, 1], [0, log_uniform(r, 1e-3, 0.3)], log_uniform(r, 1e-2, 1), 0.5),
)  # fmt: skip
TURN = Family(
    "coordinated turn", ("x", "y", "u", "v", "w"), ("u", "v", "-w*v", "w*u", "0"),
    {"range": "hypot(x, y)", "bearing": "atan2(y, x)"},
    turn_flow, lambda s: polar(s[0], s[1]),
    lambda r: (
        [r.uniform(800, 2000), r.uniform(-300, 300), r.uniform(-30, 30), r.uniform(-30, 30), r.normal(0, 0.05)],
        [50, 50, 10, 10, 0.05], [0, 0, *[log_uniform(r, 0.1, 10)] * 2, log_uniform(r, 1e-6, 1e-4)],
        [log_uniform(r, 10, 1e3), log_uniform(r, 1e-6, 1e-3)], 2.0,
    ),
    angles=("bearing",),
)  # fmt: skip
FAMILIES = {f.name: f for f in (PENDULUM, DUFFING, LORENZ, VAN_DER_POL, CUBIC, TURN)}


# ---- the reference: all residuals in one vector, no recursion ------------------------------------------------------------


def derivative(function, s):
    """Values (m, K) and derivatives (K, m, n) of a function of states (n, K), by complex steps."""
    out = [function(s + 1e-30j * unit[:, None]) for unit in np.eye(len(s))]
    return out[0].real, np.array([o.imag for o in out]).transpose(2, 1, 0) / 1e-30


def rk4(flow, s, h):
    k1 = flow(s)
    k2 = flow(s + 0.5 * h * k1)
    k3 = flow(s + 0.5 * h * k2)
    return s + h / 6 * (k1 + 2 * k2 + 2 * k3 + flow(s + h * k3))


class Reference:
    """The cost of a path, with the process noise frozen where it was asked for."""

    def __init__(self, family, problem, tracking):
        self.family, self.model = family, problem.model
        self.t, self.z = tracking.times, tracking.values.T
        self.n, self.nd, self.K = problem.model.n, len(problem.model.moving), len(tracking.times)
        self.mean, self.P0 = problem.mean, problem.covariance
        self.psd = np.zeros((self.n, self.n))
        self.psd[: self.nd, : self.nd] = problem.process_noise.covariance[: self.nd, : self.nd]
        self.sigma_z = np.sqrt(np.diag(problem.stations[0].noise))[:, None]
        self.h = np.diff(self.t) / family.substeps

    def step(self, s):
        for _ in range(self.family.substeps):
            s = rk4(self.family.flow, s, self.h)
        return s

    def freeze(self, x):
        """Process noise integrated along the path by Simpson's rule; the states between are those of the integrator."""
        s, Q = x[:-1].T, np.zeros((self.K - 1, self.n, self.n))
        h = self.h[:, None, None]
        for _ in range(self.family.substeps):
            middle = rk4(self.family.flow, s, 0.5 * self.h)
            y, G = derivative(lambda v: rk4(self.family.flow, v, self.h), s)
            _, E = derivative(lambda v: rk4(self.family.flow, v, 0.5 * self.h), middle)
            Q = G @ (Q + h / 6 * self.psd) @ G.mT + h / 1.5 * E @ self.psd @ E.mT + h / 6 * self.psd
            s = y
        self.L = np.linalg.cholesky(Q[:, : self.nd, : self.nd])

    def path(self, v):
        """States (K, n) of all unknowns: the moving states of every epoch, then the constants."""
        moving = v[: self.K * self.nd].reshape(self.K, self.nd)
        return np.hstack([moving, np.tile(v[self.K * self.nd :], (self.K, 1))])

    def unknowns(self, x):
        return np.concatenate([x[:, : self.nd].ravel(), x[-1, self.nd :]])

    def linearize(self, v):
        """Whitened residuals and their dense Jacobian."""
        x, nd, K, n = self.path(v), self.nd, self.K, self.n
        f, Phi = derivative(self.step, x[:-1].T)
        y, H = derivative(self.family.seen, x.T)
        innovation = y - self.z
        for name in self.family.angles:
            i = list(self.family.sensor).index(name)
            innovation[i] = (innovation[i] + np.pi) % (2 * np.pi) - np.pi
        size = K * nd + n - nd
        C0 = np.linalg.cholesky(self.P0)
        rows = [np.linalg.solve(C0, np.hstack([np.eye(n, nd), np.zeros((n, (K - 1) * nd)), np.eye(n)[:, nd:]]))]
        r = [np.linalg.solve(C0, x[0] - self.mean)]
        for k in range(K - 1):
            row = np.zeros((nd, size))
            row[:, (k + 1) * nd : (k + 2) * nd] = np.eye(nd)
            row[:, k * nd : (k + 1) * nd] = -Phi[k, :nd, :nd]
            row[:, K * nd :] = -Phi[k, :nd, nd:]
            rows.append(np.linalg.solve(self.L[k], row))
            r.append(np.linalg.solve(self.L[k], x[k + 1, :nd] - f[:nd, k]))
        for k in range(K):
            row = np.zeros((len(y), size))
            row[:, k * nd : (k + 1) * nd] = H[k, :, :nd]
            row[:, K * nd :] = H[k, :, nd:]
            rows.append(row / self.sigma_z)
            r.append(innovation[:, k] / self.sigma_z[:, 0])
        return np.concatenate(r), np.vstack(rows)

    def hessian(self, v, sigma):
        """Second derivatives of the cost, by central differences of its gradient; states three epochs apart go together."""
        nd, K = self.nd, self.K
        out = np.zeros((len(v), len(v)))
        groups = [[(k, i) for k in range(a, K, 3)] for a in range(3) for i in range(nd)]
        columns = [[k * nd + i for k, i in group] for group in groups] + [[c] for c in range(K * nd, len(v))]
        for group in columns:
            step = np.zeros(len(v))
            step[group] = 1e-4 * sigma[group]
            sides = [self.linearize(v + side * step) for side in (1, -1)]
            change = (sides[0][1].T @ sides[0][0] - sides[1][1].T @ sides[1][0]) / 2
            for c in group:
                k = c // nd
                near = [j for j in range(len(v)) if c >= K * nd or (j < K * nd and abs(j // nd - k) <= 1)]
                out[near, c] = change[near] / step[c]
                if c >= K * nd:
                    out[c] = out[:, c]
        return 0.5 * (out + out.T)

    def minimise(self, x):
        """How far the nearest minimum is, in sigma, by Levenberg and Marquardt's method with second derivatives."""
        self.freeze(x)
        v = start = self.unknowns(x)
        r, J = self.linearize(v)
        sigma = np.sqrt(np.diag(np.linalg.pinv(J.T @ J, hermitian=True)))
        damping, first = 0.0, sigma
        for _ in range(60):
            H = self.hessian(v, sigma) * np.outer(sigma, sigma)
            g = sigma * (J.T @ r)
            while True:
                values, vectors = np.linalg.eigh(H + damping * np.eye(len(v)))
                step = -sigma * (vectors @ ((vectors.T @ g) / np.maximum(values, 1e-12)))
                r_new, J_new = self.linearize(v + step)
                if values[0] > 0 and r_new @ r_new <= r @ r * (1 + 1e-12) + 1e-12:
                    break
                damping = max(10 * damping, 1e-3)
                if damping > 1e12:
                    raise AssertionError("the reference does not descend")
            v, r, J, damping = v + step, r_new, J_new, damping / 10 if damping > 1e-3 else 0.0
            if np.abs(step / first).max() < SMALL:
                break
        return float(np.abs((v - start) / first).max())
