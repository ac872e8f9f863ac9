"""Problems, measurements and estimates of every shape that formats must keep, drawn by hypothesis."""

import numpy as np
from hypothesis import strategies as st

import piazzi as pz
from piazzi import kernels
from piazzi.problem import Manoeuvre

FLOATS = st.floats(-1e9, 1e9)
POSITIVE = st.floats(1e-6, 1e6)
STATES = ("x", "y", "vx", "vy")
TEXT = st.text(st.characters(exclude_categories=("Cs", "Cc", "Zl", "Zp")), min_size=1, max_size=12).map(str.strip).filter(bool)


def covariances(draw, n, *, definite=True):
    """A full, a diagonal or (where it may be) a singular matrix (n, n)."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    kind = draw(st.sampled_from(["full", "diagonal"] if definite else ["full", "diagonal", "singular", "zero"]))
    if kind == "zero":
        return np.zeros((n, n))
    factor = rng.normal(size=(n, n)) + 2 * np.eye(n)
    matrix = factor @ factor.T if kind == "full" else np.diag(rng.uniform(0.1, 2.0, n))
    if kind == "singular":
        matrix[0] = matrix[:, 0] = 0.0
    return draw(POSITIVE) * 0.5 * (matrix + matrix.T)


@st.composite
def integrators(draw, discrete=False):
    if discrete:
        return pz.Discrete()
    kind = draw(st.sampled_from([pz.Taylor, pz.RungeKutta4, kernels.Euler, kernels.RungeKutta8]))
    own = kernels.RungeKutta([[], [draw(st.floats(0.1, 1.0))]], [0.25, 0.75], substeps=draw(st.integers(1, 9)))
    return draw(
        st.one_of(
            st.builds(kind, st.integers(1, 100)),
            st.builds(kind, max_step=st.floats(0.5, 100.0)),
            st.builds(kernels.DormandPrince, rtol=st.floats(1e-14, 1e-3), max_steps=st.integers(1, 10**9)),
            st.just(own),
        )
    )


@st.composite
def problems(draw):
    """A problem with any of the roles, sensors, noises and truths that there are."""
    n, discrete = draw(st.integers(1, 4)), draw(st.booleans())
    states = STATES[:n]
    roles = draw(st.lists(st.sampled_from(["fixed", "estimated", "considered"]), max_size=3))
    parameters = [pz.Parameter(f"p{i}", role, draw(st.sampled_from(["", "m", "furlong/s"]))) for i, role in enumerate(roles)]
    extra = " + ".join(["0.1", *(f"1e-3*p{i}" for i in range(len(roles)))])
    sensors = [
        pz.Sensor(
            "near", {"range": "sqrt((x - mx)**2 + 1)", "angle": f"atan2({states[-1]}, 2.5 + mx)"}, ("angle",), {"range": "m"}
        ),
        pz.Sensor("far-one", {"range": f"{states[-1]} + {extra}"}),
    ]
    units = {s: "m" for s in states if draw(st.booleans())}
    memory = {"before": draw(st.sampled_from(states))} if draw(st.booleans()) else {}
    model = pz.Model(
        states, [f"{s}/7 + {extra}" for s in states], sensors, parameters, {"all": states}, units, discrete, memory
    )
    names = draw(st.lists(TEXT, min_size=1, max_size=3, unique=True))
    stations = [
        pz.Station(name, "near", covariances(draw, 2), {"mx": draw(FLOATS)})
        if draw(st.booleans())
        else pz.Station(name, "far-one", covariances(draw, 1))
        for name in names
    ]
    noise = st.sampled_from([("second", "integral"), ("second", "scaled"), ("step", "scaled")])
    size = draw(st.sampled_from([n, model.n]))
    return pz.Problem(
        model,
        pz.Gaussian(draw(st.lists(FLOATS, min_size=n, max_size=n)), covariances(draw, n)),
        pz.ProcessNoise(covariances(draw, size, definite=False), *draw(noise)),
        stations,
        {p.name: draw(FLOATS) if p.role == "fixed" else pz.Gaussian([draw(FLOATS)], [[draw(POSITIVE)]]) for p in parameters},
        draw(integrators(discrete)),
        draw(st.none() | st.floats(-1e6, 0.0)),
        draw(st.none() | truths(n, len(roles), discrete)),
        draw(st.just("") | TEXT),
        [] if discrete else draw(st.lists(manoeuvres(states), max_size=2)),
    )


@st.composite
def manoeuvres(draw, states):
    d = len(states)
    jump = draw(st.lists(FLOATS, min_size=d, max_size=d))
    return Manoeuvre(draw(st.floats(0.1, 1e6)), jump, covariances(draw, d, definite=False), states)


@st.composite
def truths(draw, n, parameters, discrete):
    return pz.Truth(
        draw(st.none() | st.lists(FLOATS, min_size=n, max_size=n)),
        draw(st.dictionaries(st.sampled_from([f"p{i}" for i in range(parameters)]), FLOATS)) if parameters else {},
        draw(st.none() | st.just(pz.ProcessNoise(np.zeros(n), "step")) | st.just(pz.ProcessNoise(np.eye(n)))),
        draw(st.none() | integrators(discrete)),
        draw(st.booleans()),
        None if discrete else draw(st.none() | st.lists(manoeuvres(STATES[:n]), max_size=2)),
    )


EPOCHS = [None, pz.Epoch("2025-01-01T00:00:00 UTC"), pz.Epoch("JD 2451545 TDB"), pz.Epoch.at(-1.5e9, 0.12345678901234567)]


@st.composite
def trackings(draw, problem, *, first=0.0):
    """Measurements of a problem at irregular times, several at one epoch, some missing, with any finite doubles."""
    J, width = draw(st.integers(1, 8)), problem.model.width
    steps = draw(st.lists(st.sampled_from([0.0, 0.1, 1e-9, 3.0, 1e5]), min_size=J, max_size=J))
    index = draw(st.lists(st.integers(0, len(problem.stations) - 1), min_size=J, max_size=J))
    values = np.array(draw(st.lists(st.floats(allow_nan=True, allow_infinity=False), min_size=J * width, max_size=J * width)))
    values = values.reshape(J, width)
    for row, s in enumerate(index):
        values[row, len(problem.stations[s].noise) :] = np.nan
    if np.isnan(values).all():
        values[0, 0] = -0.0
    times = first + np.cumsum(steps)
    named = len(problem.stations) > 1 or draw(st.booleans())
    epochs = len(np.unique(times))
    truth = np.array(draw(st.lists(FLOATS, min_size=epochs, max_size=epochs)))[:, None] * np.ones(problem.model.n)
    return pz.Tracking(
        times,
        values,
        [problem.stations[s].name for s in index] if named else None,
        truth if draw(st.booleans()) else None,
        draw(st.sampled_from(EPOCHS)),
    )


def same_bits(a, b):
    """Whether two arrays have the same shape and the same doubles, NaN and the sign of zero included (but not that of NaN)."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return a.shape == b.shape and bool((np.isnan(a) & np.isnan(b) | (a == b) & (np.signbit(a) == np.signbit(b))).all())


def same_problem(p, q):
    """Whether two problems agree in everything, bit for bit."""
    arrays = ("mean", "covariance", "given", "station_sensor", "station_noise", "station_numbers")
    return (
        (p.model, p.integrator, p.prior_time, p.name, p.epoch) == (q.model, q.integrator, q.prior_time, q.name, q.epoch)
        and [(s.name, s.sensor) for s in p.stations] == [(s.name, s.sensor) for s in q.stations]
        and all(same_bits(getattr(p, a), getattr(q, a)) for a in arrays)
        and same_noise(p.process_noise, q.process_noise)
        and same_truth(p.truth, q.truth)
        and same_manoeuvres(p.manoeuvres, q.manoeuvres)
    )


def same_noise(a, b):
    if a is None or b is None:
        return a is b
    full = [np.diag(n.covariance) if np.ndim(n.covariance) == 1 else n.covariance for n in (a, b)]
    return same_bits(*full) and (a.per, a.method, a.axes) == (b.per, b.method, b.axes)


def same_truth(a, b):
    if a is None or b is None:
        return a is b
    states = (a.state is None and b.state is None) or same_bits(a.state, b.state)
    plain = (dict(a.parameters), a.integrator, a.measurement_noise) == (dict(b.parameters), b.integrator, b.measurement_noise)
    return (
        states
        and plain
        and same_noise(a.process_noise, b.process_noise)
        and (a.manoeuvres is None) == (b.manoeuvres is None)
        and same_manoeuvres(a.manoeuvres or (), b.manoeuvres or ())
    )


def same_manoeuvres(a, b):
    return len(a) == len(b) and all(
        (m.time, tuple(m.states)) == (w.time, tuple(w.states))
        and same_bits(m.delta_v, w.delta_v)
        and same_bits(m.covariance, w.covariance)
        for m, w in zip(a, b, strict=True)
    )


def same_tracking(a, b):
    """Whether two trackings agree in everything, bit for bit."""
    named = (a.row_stations is None) == (b.row_stations is None)
    return (
        named
        and (a.row_stations is None or list(a.row_stations) == list(b.row_stations))
        and same_bits(a.row_times, b.row_times)
        and same_bits(a.values, b.values)
        and (a.truth is None) == (b.truth is None)
        and (a.truth is None or same_bits(a.truth, b.truth))
        and a.epoch == b.epoch
    )
