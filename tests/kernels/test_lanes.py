"""Every operation of the lanes' vectors and matrices against NumPy, for many sizes."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

SIZES = [1, 2, 3, 4, 5, 6, 7, 8, 9, 18]
LANES = [2, 4, 8]
GUARD = -7.25e300  # stands around every result: nothing may be written beside it


def call(function: Callable[..., None], *arrays: np.ndarray) -> None:
    """Compile `function` of pointers to doubles as the kernels' entries are, and call it."""
    from piazzi.kernels.compiled import Array, entry
    from piazzi.kernels.library import load_objects
    from piazzi.kernels.members import FLOATS

    function.__annotations__ = dict.fromkeys(function.__code__.co_varnames[: function.__code__.co_argcount], Array)
    compiled = entry(function)
    symbols = {"run": (compiled.native_name, (FLOATS,) * len(arrays))}
    load_objects({"run": compiled._library.object_code()}, symbols, {})["run"](*arrays)


class Results:
    """One flat array, cut into named results with a guard after each."""

    def __init__(self, shapes: dict[str, tuple[int, ...]]) -> None:
        self.shapes, self.at, end = shapes, {}, 1
        for name, shape in shapes.items():
            self.at[name], end = end, end + int(np.prod(shape)) + 1
        self.flat = np.full(end, GUARD)

    def __getitem__(self, name: str) -> np.ndarray:
        size = int(np.prod(self.shapes[name]))
        return self.flat[self.at[name] : self.at[name] + size].reshape(self.shapes[name])

    def guards(self) -> np.ndarray:
        ends = [self.at[name] + int(np.prod(shape)) for name, shape in self.shapes.items()]
        return self.flat[[0, *ends]]


def operands(n: int, w: int = 1) -> dict[str, np.ndarray]:
    """Random entries; A and C are (r, n), B is (n, c); the lanes come last where there are several."""
    rng = np.random.default_rng(100 * n + w)
    r, c, lanes = n // 2 + 1, n % 4 + 1, (w,) if w > 1 else ()
    shapes = {"A": (r, n), "C": (r, n), "B": (n, c), "S": (n, n), "u": (n,), "v": (n,), "y": (r,), "s": (), "q": ()}
    return {name: rng.standard_normal((*shape, *lanes)) for name, shape in shapes.items()}


MEANING: dict[str, Callable[..., np.ndarray]] = {
    "vector sum": lambda A, C, B, S, u, v, y, s, q: u + v,
    "vector difference": lambda A, C, B, S, u, v, y, s, q: u - v,
    "matrix sum": lambda A, C, B, S, u, v, y, s, q: A + C,
    "matrix difference": lambda A, C, B, S, u, v, y, s, q: A - C,
    "negative vector": lambda A, C, B, S, u, v, y, s, q: -u,
    "negative matrix": lambda A, C, B, S, u, v, y, s, q: -A,
    "number times vector": lambda A, C, B, S, u, v, y, s, q: s * u,
    "vector times number": lambda A, C, B, S, u, v, y, s, q: u * s,
    "number times matrix": lambda A, C, B, S, u, v, y, s, q: s * A,
    "matrix times number": lambda A, C, B, S, u, v, y, s, q: A * s,
    "literal times vector": lambda A, C, B, S, u, v, y, s, q: 2 * u,
    "vector times vector": lambda A, C, B, S, u, v, y, s, q: u @ v,
    "matrix times column": lambda A, C, B, S, u, v, y, s, q: A @ u,
    "row times matrix": lambda A, C, B, S, u, v, y, s, q: y @ A,
    "matrix product": lambda A, C, B, S, u, v, y, s, q: A @ B,
    "congruence": lambda A, C, B, S, u, v, y, s, q: A @ S @ A.T,
    "transpose": lambda A, C, B, S, u, v, y, s, q: A.T,
    "outer product": lambda A, C, B, S, u, v, y, s, q: np.outer(y, u),
    "row of a matrix": lambda A, C, B, S, u, v, y, s, q: A[-1],
    "entry of a vector": lambda A, C, B, S, u, v, y, s, q: u[-1] + 0 * s,
    "vector of entries": lambda A, C, B, S, u, v, y, s, q: np.array([s, 2.0, u[0]]),
    "matrix of rows": lambda A, C, B, S, u, v, y, s, q: np.array([u, v, A[0]]),
    "row of the identity": lambda A, C, B, S, u, v, y, s, q: np.eye(len(u))[-1],
    "no row of the identity": lambda A, C, B, S, u, v, y, s, q: np.zeros(len(u)),
    "identity": lambda A, C, B, S, u, v, y, s, q: np.eye(len(u)),
}
EXACT = set(MEANING) - {
    "number times vector", "vector times number", "number times matrix", "matrix times number", "vector times vector",
    "matrix times column", "row times matrix", "matrix product", "congruence", "outer product", "entry of a vector",
}  # fmt: skip


@cache
def one_problem(n: int) -> tuple[Results, dict[str, np.ndarray]]:
    """All operations of size n in one compiled function."""
    from piazzi.kernels.compiled import identity, load_matrix, load_vector, matrix, outer, store, unit, vector

    given = operands(n)
    (r, _), (_, c), last, end = given["A"].shape, given["B"].shape, n // 2, n - 1
    results = Results({name: np.shape(meaning(**given)) for name, meaning in MEANING.items()})
    (i0, i1, i2, i3, i4, i5, i6, i7, i8, i9, i10, i11, i12, i13, i14, i15, i16, i17, i18, i19, i20, i21, i22, i23, i24) = (
        results.at.values()
    )

    def everything(pA, pC, pB, pS, pu, pv, py, ps, out):
        A, C, B, S = load_matrix(pA, 0, r, n), load_matrix(pC, 0, r, n), load_matrix(pB, 0, n, c), load_matrix(pS, 0, n, n)
        u, v, y, s = load_vector(pu, 0, n), load_vector(pv, 0, n), load_vector(py, 0, r), ps[0]
        store(out, i0, u + v)
        store(out, i1, u - v)
        store(out, i2, A + C)
        store(out, i3, A - C)
        store(out, i4, -u)
        store(out, i5, -A)
        store(out, i6, s * u)
        store(out, i7, u * s)
        store(out, i8, s * A)
        store(out, i9, A * s)
        store(out, i10, 2 * u)
        out[i11] = u @ v
        store(out, i12, A @ u)
        store(out, i13, y @ A)
        store(out, i14, A @ B)
        store(out, i15, A @ S @ A.T)
        store(out, i16, A.T)
        store(out, i17, outer(y, u))
        store(out, i18, A[last])
        out[i19] = u[end]
        store(out, i20, vector(s, 2, u[0]))
        store(out, i21, matrix(u, v, A[0]))
        store(out, i22, unit(end, n))
        store(out, i23, unit(-1, n))
        store(out, i24, identity(n))

    call(everything, *(given[k] for k in ("A", "C", "B", "S", "u", "v", "y", "s")), results.flat)
    return results, given


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("operation", MEANING)
def test_operation_equals_numpys(operation, n):
    results, given = one_problem(n)
    expected = MEANING[operation](**given)
    if operation in EXACT:
        assert_array_equal(results[operation], expected)
    else:
        assert_allclose(results[operation], expected, rtol=1e-13, atol=1e-13 * n)


@pytest.mark.parametrize("n", SIZES)
def test_nothing_is_written_beside_a_result(n):
    results, _ = one_problem(n)
    assert_array_equal(results.guards(), GUARD)


@pytest.mark.parametrize("n", SIZES)
def test_loads_and_stores_need_no_alignment(n):
    from piazzi.kernels.compiled import load_matrix, load_vector, store

    buffer = np.arange(2.0 * n * n + 8)
    source = np.frombuffer(buffer.tobytes() + b"\0" * 16)[1:]
    out = np.full(2 * n * n + 9, GUARD)

    def shifted(a, b):
        store(b, 1, load_matrix(a, 3, n, n))
        store(b, n * n + 1, load_vector(a, 2, n))

    call(shifted, source, out)
    assert_array_equal(out[1 : n * n + 1], source[3 : n * n + 3])
    assert_array_equal(out[n * n + 1 : n * n + n + 1], source[2 : n + 2])
    assert out[0] == GUARD
    assert_array_equal(out[n * n + n + 1 :], GUARD)


@pytest.mark.parametrize("n", [1, 3, 4, 6])
def test_missing_numbers_stay_missing(n):
    """NaN and infinity keep their meaning: no fast-math beyond contraction."""
    from piazzi.kernels.compiled import inf, isnan, load_vector, store

    given, out = np.full(n, np.nan), np.full(n + 2, GUARD)

    def through(a, out):
        v = load_vector(a, 0, n)
        store(out, 0, 0.0 * v + v)
        out[n] = 1.0 if isnan(v[0]) else 0.0
        out[n + 1] = 1.0 if a[0] * inf < inf else 0.0

    call(through, given, out)
    assert np.isnan(out[:n]).all()
    assert_array_equal(out[n:], [1.0, 0.0])


@pytest.mark.parametrize("n", [1, 3, 4, 9])
def test_a_vector_may_keep_its_entries_apart(n):
    """And computes the same so, also together with one that is in one piece; what is made alike is kept alike."""
    from piazzi.kernels.compiled import alike, gathered, load_vector, scattered, store

    entries = ", ".join(f"2.0 * y[{i}]" for i in range(n))
    scope = {"alike": alike, "gathered": gathered, "load_vector": load_vector, "scattered": scattered, "store": store}
    lines = ["def through(u, v, out):", f"    x, y = load_vector(u, 0, {n}), scattered(load_vector(v, 0, {n}))"]
    lines += [f"    z = alike(y, {entries})", f"    w = alike(x, {entries})"]
    lines += ["    for i in range(3):", "        z = z + 0.5 * x - y", "        w = w + 0.5 * x - gathered(y)"]
    exec("\n".join([*lines, "    store(out, 0, gathered(z))", f"    store(out, {n}, w)"]), scope)
    u, v, out = np.random.default_rng(n).standard_normal(n), np.random.default_rng(n + 1).standard_normal(n), np.zeros(2 * n)
    call(scope["through"], u, v, out)
    assert_allclose(out[:n], 1.5 * u - v, rtol=1e-14, atol=1e-15)
    assert_allclose(out[n:], 1.5 * u - v, rtol=1e-14, atol=1e-15)


# ---- several problems at once ----------------------------------------------------------------------------------------

# Of one lane: A, B (n, n), u, v (n,), s, q numbers; C, c and k are of one problem, the same in every lane
PACKS: dict[str, tuple[str, Callable[..., np.ndarray]]] = {
    "pack sum": ("s + q", lambda A, B, u, v, s, q, C, c, k: s + q),
    "pack difference": ("s - q", lambda A, B, u, v, s, q, C, c, k: s - q),
    "pack product": ("s * q", lambda A, B, u, v, s, q, C, c, k: s * q),
    "pack quotient": ("s / q", lambda A, B, u, v, s, q, C, c, k: s / q),
    "pack with numbers": ("1.5 / (k * s + 3) - q", lambda A, B, u, v, s, q, C, c, k: 1.5 / (k * s + 3) - q),
    "negative pack": ("-s", lambda A, B, u, v, s, q, C, c, k: -s),
    "entry": ("u[0] + A[0][0]", lambda A, B, u, v, s, q, C, c, k: u[0] + A[0][0]),
    "vector sum": ("u + v - c", lambda A, B, u, v, s, q, C, c, k: u + v - c),
    "matrix sum": ("A + B - C", lambda A, B, u, v, s, q, C, c, k: A + B - C),
    "negative vector": ("-u", lambda A, B, u, v, s, q, C, c, k: -u),
    "negative matrix": ("-A", lambda A, B, u, v, s, q, C, c, k: -A),
    "pack times vector": ("s * u", lambda A, B, u, v, s, q, C, c, k: s * u),
    "pack times vector of one problem": ("s * c", lambda A, B, u, v, s, q, C, c, k: s * c),
    "matrix of one problem times pack": ("C * s", lambda A, B, u, v, s, q, C, c, k: C * s),
    "number times matrix": ("k * A", lambda A, B, u, v, s, q, C, c, k: k * A),
    "vector times vector": ("u @ v", lambda A, B, u, v, s, q, C, c, k: u @ v),
    "matrix times column": ("A @ u", lambda A, B, u, v, s, q, C, c, k: A @ u),
    "row times matrix": ("u @ A", lambda A, B, u, v, s, q, C, c, k: u @ A),
    "matrix product": ("A @ B", lambda A, B, u, v, s, q, C, c, k: A @ B),
    "matrix product with one problem's": ("A @ C", lambda A, B, u, v, s, q, C, c, k: A @ C),
    "one problem's matrix product": ("C @ A", lambda A, B, u, v, s, q, C, c, k: C @ A),
    "congruence": ("A @ B @ A.T", lambda A, B, u, v, s, q, C, c, k: A @ B @ A.T),
    "transpose": ("A.T", lambda A, B, u, v, s, q, C, c, k: A.T),
    "sum with an outer product": ("plus_outer(A, u, v)", lambda A, B, u, v, s, q, C, c, k: A + np.outer(u, v)),
    "outer product added to one problem's": ("plus_outer(C, -u, v)", lambda A, B, u, v, s, q, C, c, k: C - np.outer(u, v)),
    "mirrored": ("mirrored(A)", lambda A, B, u, v, s, q, C, c, k: np.triu(A) + np.triu(A, 1).T),
    "outer product": ("outer(u, v)", lambda A, B, u, v, s, q, C, c, k: np.outer(u, v)),
    "vector of packs and numbers": ("vector(s, 1.0, q)", lambda A, B, u, v, s, q, C, c, k: np.array([s, 1.0, q])),
    "matrix of both kinds of rows": ("matrix(u, c)", lambda A, B, u, v, s, q, C, c, k: np.array([u, c])),
    "whole number above": ("ceil(4 * s) + ceil(k)", lambda A, B, u, v, s, q, C, c, k: np.ceil(4 * s) + np.ceil(k)),
    "wrapped angle": ("wrap_angle(9 * s)", lambda A, B, u, v, s, q, C, c, k: np.angle(np.exp(9j * s))),
    "larger": ("maximum(s, 0.2)", lambda A, B, u, v, s, q, C, c, k: np.maximum(s, 0.2)),
    "smaller": ("minimum(s, q)", lambda A, B, u, v, s, q, C, c, k: np.minimum(s, q)),
    "sign": ("sign(s)", lambda A, B, u, v, s, q, C, c, k: np.sign(s)),
    "heaviside": ("heaviside(s)", lambda A, B, u, v, s, q, C, c, k: np.heaviside(s, 0.5)),
    "arc tangent": ("atan2(s, q)", lambda A, B, u, v, s, q, C, c, k: np.arctan2(s, q)),
    "arc tangent with a number": ("atan2(k, q)", lambda A, B, u, v, s, q, C, c, k: np.arctan2(k, q)),
    "power": ("pow(fabs(s), q)", lambda A, B, u, v, s, q, C, c, k: np.abs(s) ** q),
    "roots": ("sqrt(fabs(s)) + log(fabs(q))", lambda A, B, u, v, s, q, C, c, k: np.sqrt(abs(s)) + np.log(abs(q))),
    "exponential": ("exp(s)", lambda A, B, u, v, s, q, C, c, k: np.exp(s)),
    "circular": ("sin(s) + cos(q) + tan(s)", lambda A, B, u, v, s, q, C, c, k: np.sin(s) + np.cos(q) + np.tan(s)),
    "hyperbolic": ("sinh(s) + cosh(q) + tanh(s)", lambda A, B, u, v, s, q, C, c, k: np.sinh(s) + np.cosh(q) + np.tanh(s)),
    "arcs": ("atan(s) + asin(s / 9)", lambda A, B, u, v, s, q, C, c, k: np.arctan(s) + np.arcsin(s / 9)),
    "chosen": ("choose(s, 0.1 * k, q, 2.0)", lambda A, B, u, v, s, q, C, c, k: np.where(s > 0.1 * k, q, 2.0)),
    "fused vectors": ("fused(s, u, v)", lambda A, B, u, v, s, q, C, c, k: s * u + v),
    "fused with one problem's": ("fused(k, c, fused(s, c, u))", lambda A, B, u, v, s, q, C, c, k: k * c + s * c + u),
    "fused matrices": ("fused(q, A, fused(k, C, B))", lambda A, B, u, v, s, q, C, c, k: q * A + k * C + B),
    "arc cosine": ("acos(q / 9)", lambda A, B, u, v, s, q, C, c, k: np.arccos(q / 9)),
}  # fmt: skip


def given_packs(n: int, w: int) -> dict[str, np.ndarray]:
    """The lanes come first, one record after the other; what is of one problem has no lanes."""
    rng = np.random.default_rng(100 * n + w)
    shapes = {"A": (w, n, n), "B": (w, n, n), "u": (w, n), "v": (w, n), "s": (w,), "q": (w,), "C": (n, n), "c": (n,), "k": ()}
    return {name: rng.standard_normal(shape) for name, shape in shapes.items()}


def of_lane(given: dict[str, np.ndarray], lane: int) -> dict[str, np.ndarray]:
    return {name: value[lane] if name in "ABuvsq" else value for name, value in given.items()}


@cache
def several_problems(n: int, w: int) -> tuple[Results, dict[str, np.ndarray]]:
    """All operations on w problems of size n in one compiled function, written out for these sizes."""
    from piazzi.kernels import compiled

    given = given_packs(n, w)
    shapes = {name: np.shape(meaning(**of_lane(given, 0))) for name, (_, meaning) in PACKS.items()}
    results = Results({name: (w, *shape) for name, shape in shapes.items()})
    lines = ["def everything(A_, B_, u_, v_, s_, q_, C_, c_, k_, out):"]
    for name in "AB":
        lines.append(f"    {name} = matrix({', '.join(f'load_lanes({name}_, {i * n}, {n}, {n * n}, {w})' for i in range(n))})")
    lines += [f"    {name} = load_lanes({name}_, 0, {n}, {n}, {w})" for name in "uv"]
    lines += [f"    {name} = load_lanes({name}_, 0, 1, 1, {w})[0]" for name in "sq"]
    lines += [f"    C, c, k = load_matrix(C_, 0, {n}, {n}), load_vector(c_, 0, {n}), k_[0]"]
    for name, (text, _) in PACKS.items():
        value = text if shapes[name] else f"vector({text})"
        lines.append(f"    store_lanes(out, {results.at[name]}, {int(np.prod(shapes[name]))}, {value})")
    scope = dict(vars(compiled))
    exec("\n".join(lines), scope)
    call(scope["everything"], *given.values(), results.flat)
    return results, given


@pytest.mark.parametrize("w", LANES)
@pytest.mark.parametrize("n", [2, 3])
def test_lanes_are_independent_problems(n, w):
    results, given = several_problems(n, w)
    for name, (_, meaning) in PACKS.items():
        for lane in range(w):
            expected = meaning(**of_lane(given, lane))
            assert_allclose(results[name][lane], expected, rtol=1e-13, atol=1e-13, err_msg=f"{name}, lane {lane}")
    assert_array_equal(results.guards(), GUARD)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 8])
def test_lanes_give_the_same_bits(n):
    """Sums of products round alike in a register along the row and in a register across problems."""
    from piazzi.kernels import compiled

    w = 4
    given, size, each = given_packs(n, w), n * n, 2 * n * n + n + 1
    rest, last = 2 * size, 2 * size + n
    alone, together = np.zeros((w, each)), np.zeros((w, each))

    def one_by_one(A_, B_, u_, s_, out):
        for lane in range(w):
            A, B, u = (
                compiled.load_matrix(A_, lane * size, n, n),
                compiled.load_matrix(B_, lane * size, n, n),
                compiled.load_vector(u_, lane * n, n),
            )
            compiled.store(out, lane * each, A @ B @ A.T)
            compiled.store(out, lane * each + size, compiled.fused(s_[lane], A, compiled.plus_outer(B, -u, u @ B)))
            compiled.store(out, lane * each + rest, A @ u)
            out[lane * each + last] = u @ (u @ B)

    def at_once(A_, B_, u_, s_, out):
        A, B, u = (
            compiled.load_matrices(A_, 0, n, n, size, w),
            compiled.load_matrices(B_, 0, n, n, size, w),
            compiled.load_lanes(u_, 0, n, n, w),
        )
        compiled.store_lanes(out, 0, each, A @ B @ A.T)
        compiled.store_lanes(
            out, size, each, compiled.fused(compiled.load_lanes(s_, 0, 1, 1, w)[0], A, compiled.plus_outer(B, -u, u @ B))
        )
        compiled.store_lanes(out, rest, each, A @ u)
        compiled.store_lanes(out, last, each, compiled.vector(u @ (u @ B)))

    for function, out in ((one_by_one, alone), (at_once, together)):
        call(function, given["A"], given["B"], given["u"], given["s"], out)
    assert np.abs(alone[:, -1]).min() > 0
    assert_array_equal(together, alone)


@pytest.mark.parametrize("w", [1, *LANES])
def test_a_stride_of_zero_gives_all_lanes_one_matrix(w):
    """That is how what is left over from the lanes is worked on; work space keeps what is written to it."""
    from piazzi.kernels.compiled import load_matrices, load_packs, scratch, store_lanes, store_packs

    size = 3 * w

    def through(a, out):
        room = scratch(size)
        store_packs(room, 0, load_matrices(a, 1, 2, 3, 0, w)[1], w)
        store_lanes(out, 1, 0, load_packs(room, 0, 3, w))

    a, out = np.arange(8.0), np.full(5, GUARD)
    call(through, a, out)
    assert_array_equal(out, [GUARD, 4.0, 5.0, 6.0, GUARD])


@pytest.mark.parametrize("w", LANES)
def test_packs_are_stored_lane_beside_lane(w):
    """Entry i of lane l at i w + l, whatever is of one problem in all lanes; and back the same."""
    from piazzi.kernels.compiled import load_lanes, load_packs, load_vector, store_packs

    def through(a, c, out, back):
        store_packs(out, 1, load_lanes(a, 0, 3, 3, w), w)
        store_packs(out, 3 * w + 1, load_vector(c, 0, 2), w)
        store_packs(back, 0, load_packs(out, 1, 3, w), w)

    a, c, out, back = np.arange(3.0 * w), np.array([-1.0, -2.0]), np.full(5 * w + 2, GUARD), np.zeros(3 * w)
    call(through, a, c, out, back)
    assert_array_equal(out[1 : 3 * w + 1].reshape(3, w), a.reshape(w, 3).T)
    assert_array_equal(out[3 * w + 1 : -1].reshape(2, w), np.repeat(c[:, None], w, axis=1))
    assert_array_equal(back, out[1 : 3 * w + 1])
    assert_array_equal(out[[0, -1]], GUARD)


def test_what_has_no_meaning_is_refused():
    """Rather a refusal at compile time than numbers from the wrong lanes."""
    from piazzi.kernels.compiled import load_lanes, load_matrix, load_vector, store, store_lanes

    def lengths_differ(a):
        store(a, 0, load_vector(a, 0, 2) + load_vector(a, 0, 3))

    def shapes_differ(a):
        store(a, 0, load_matrix(a, 0, 2, 3) @ load_matrix(a, 0, 2, 3))

    def elementwise_product(a):
        store(a, 0, load_vector(a, 0, 4) * load_vector(a, 0, 4))

    def different_lanes(a):
        store_lanes(a, 0, 2, load_lanes(a, 0, 1, 1, 4)[0] * load_lanes(a, 0, 2, 2, 2))

    def sum_of_different_lanes(a):
        store_lanes(a, 0, 2, load_lanes(a, 0, 2, 1, 4) + load_lanes(a, 0, 2, 2, 2))

    def lanes_where_one_problem_is_stored(a):
        store(a, 0, load_lanes(a, 0, 2, 2, 4))

    shapes = (lengths_differ, shapes_differ, elementwise_product)
    for function in (*shapes, different_lanes, sum_of_different_lanes, lanes_where_one_problem_is_stored):
        with pytest.raises(Exception, match=r"."):  # typing or lowering: Numba says which
            call(function, np.zeros(64))
