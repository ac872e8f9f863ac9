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
    from piazzi.kernels.library import POINTER, Entry

    function.__annotations__ = dict.fromkeys(function.__code__.co_varnames[: function.__code__.co_argcount], Array)
    compiled = entry(function)
    Entry(compiled.address, (POINTER,) * len(arrays), compiled)(*arrays)


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
EXACT = {
    "negative vector", "negative matrix", "transpose", "row of a matrix", "row of the identity", "no row of the identity", "identity",
    "matrix of rows", "vector of entries", "vector sum", "vector difference", "matrix sum", "matrix difference", "literal times vector",
}  # fmt: skip


@cache
def one_problem(n: int) -> tuple[Results, dict[str, np.ndarray]]:
    """All operations of size n in one compiled function."""
    from piazzi.kernels.compiled import identity, load_matrix, load_vector, matrix, outer, store, unit, vector

    given = operands(n)
    (r, _), (_, c), last, end = given["A"].shape, given["B"].shape, n // 2, n - 1
    results = Results({name: np.shape(meaning(**given)) for name, meaning in MEANING.items()})
    (i0, i1, i2, i3, i4, i5, i6, i7, i8, i9, i10, i11, i12, i13, i14, i15, i16, i17, i18, i19, i20, i21, i22, i23, i24) = results.at.values()

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


# ---- several problems at once ----------------------------------------------------------------------------------------


def pack_intrinsics():
    """Load and store of a pack, with the lanes next to each other in memory."""
    from numba.core import types
    from numba.extending import intrinsic

    from piazzi.kernels.lanes import Pack, llvm_type

    @intrinsic(prefer_literal=True)
    def load_pack(typing, a, at, w):
        pack = Pack(w.literal_value)

        def lower(context, b, sig, args):
            value = b.load(b.bitcast(b.gep(args[0], [args[1]]), llvm_type(pack).as_pointer()))
            value.align = 8
            return value

        return pack(a, types.intp, w), lower

    @intrinsic
    def store_pack(typing, a, at, value):
        def lower(context, b, sig, args):
            b.store(args[2], b.bitcast(b.gep(args[0], [args[1]]), args[2].type.as_pointer())).align = 8
            return context.get_dummy_value()

        return types.void(a, types.intp, value), lower

    return load_pack, store_pack


PACK_MEANING: dict[str, Callable[..., np.ndarray]] = {
    "pack sum": lambda A, B, u, v, s, q: s + q,
    "pack difference": lambda A, B, u, v, s, q: s - q,
    "pack product": lambda A, B, u, v, s, q: s * q,
    "pack quotient": lambda A, B, u, v, s, q: s / q,
    "number with pack": lambda A, B, u, v, s, q: 1.5 / (2.0 * s + 3.0) - q,
    "negative pack": lambda A, B, u, v, s, q: -s,
    "vector sum": lambda A, B, u, v, s, q: u + v,
    "negative vector": lambda A, B, u, v, s, q: -u,
    "pack times vector": lambda A, B, u, v, s, q: s * u,
    "number times matrix": lambda A, B, u, v, s, q: 2.5 * A,
    "vector times vector": lambda A, B, u, v, s, q: u @ v,
    "matrix times column": lambda A, B, u, v, s, q: A @ u,
    "row times matrix": lambda A, B, u, v, s, q: u @ A,
    "matrix product": lambda A, B, u, v, s, q: A @ B - A,
    "transpose": lambda A, B, u, v, s, q: A.T,
    "outer product": lambda A, B, u, v, s, q: np.outer(u, v),
    "vector of packs and numbers": lambda A, B, u, v, s, q: np.array([s, 1.0]),
}


def pack_helpers(n: int, w: int):
    """Loads and stores of vectors and matrices of n packs of w, entry by entry."""
    from piazzi.kernels.compiled import inline, matrix, vector

    load_pack, store_pack = pack_intrinsics()
    if n == 2:
        load_v = inline(lambda a, at: vector(load_pack(a, at, w), load_pack(a, at + w, w)))
        load_m = inline(lambda a: matrix(load_v(a, 0), load_v(a, 2 * w)))

        def store_v(a, at, v):
            store_pack(a, at, v[0])
            store_pack(a, at + w, v[1])

        def store_m(a, at, m):
            put(a, at, m[0])
            put(a, at + 2 * w, m[1])

    else:
        load_v = inline(lambda a, at: vector(load_pack(a, at, w), load_pack(a, at + w, w), load_pack(a, at + 2 * w, w)))
        load_m = inline(lambda a: matrix(load_v(a, 0), load_v(a, 3 * w), load_v(a, 6 * w)))

        def store_v(a, at, v):
            store_pack(a, at, v[0])
            store_pack(a, at + w, v[1])
            store_pack(a, at + 2 * w, v[2])

        def store_m(a, at, m):
            put(a, at, m[0])
            put(a, at + 3 * w, m[1])
            put(a, at + 6 * w, m[2])

    put = inline(store_v)
    return load_v, load_m, put, inline(store_m)


@cache
def several_problems(n: int, w: int) -> tuple[Results, dict[str, np.ndarray]]:
    """All operations on w problems of size n (2 or 3) in one compiled function."""
    from piazzi.kernels.compiled import outer, vector

    load_pack, store_pack = pack_intrinsics()
    given = operands(n, w)
    given = {"A": given["S"], "B": given["S"][::-1].copy(), "u": given["u"], "v": given["v"], "s": given["s"], "q": given["q"]}
    lanes = [PACK_MEANING[name](**{k: g[..., 0] for k, g in given.items()}) for name in PACK_MEANING]
    results = Results({name: (*np.shape(lane), w) for name, lane in zip(PACK_MEANING, lanes, strict=True)})
    (i0, i1, i2, i3, i4, i5, i6, i7, i8, i9, i10, i11, i12, i13, i14, i15, i16) = results.at.values()
    load_v, load_m, store_v, store_m = pack_helpers(n, w)

    def everything(pA, pB, pu, pv, ps, pq, out):
        A, B, u, v, s, q = load_m(pA), load_m(pB), load_v(pu, 0), load_v(pv, 0), load_pack(ps, 0, w), load_pack(pq, 0, w)
        store_pack(out, i0, s + q)
        store_pack(out, i1, s - q)
        store_pack(out, i2, s * q)
        store_pack(out, i3, s / q)
        store_pack(out, i4, 1.5 / (2.0 * s + 3.0) - q)
        store_pack(out, i5, -s)
        store_v(out, i6, u + v)
        store_v(out, i7, -u)
        store_v(out, i8, s * u)
        store_m(out, i9, 2.5 * A)
        store_pack(out, i10, u @ v)
        store_v(out, i11, A @ u)
        store_v(out, i12, u @ A)
        store_m(out, i13, A @ B - A)
        store_m(out, i14, A.T)
        store_m(out, i15, outer(u, v))
        pair = vector(s, 1.0)
        store_pack(out, i16, pair[0])
        store_pack(out, i16 + w, pair[1])

    call(everything, *given.values(), results.flat)
    return results, given


@pytest.mark.parametrize("w", LANES)
@pytest.mark.parametrize("n", [2, 3])
def test_lanes_are_independent_problems(n, w):
    results, given = several_problems(n, w)
    for name, meaning in PACK_MEANING.items():
        for lane in range(w):
            expected = meaning(**{k: g[..., lane] for k, g in given.items()})
            assert_allclose(results[name][..., lane], expected, rtol=1e-13, atol=1e-13, err_msg=f"{name}, lane {lane}")
    assert_array_equal(results.guards(), GUARD)


def refused(function, *arrays):
    from numba.core.errors import TypingError

    with pytest.raises(TypingError):
        call(function, *arrays)


def test_what_has_no_meaning_is_refused():
    """Rather a refusal at compile time than numbers from the wrong lanes."""
    from piazzi.kernels.compiled import load_matrix, load_vector, store, vector

    load_pack, _ = pack_intrinsics()
    a = np.zeros(64)

    def lengths_differ(a):
        store(a, 0, load_vector(a, 0, 2) + load_vector(a, 0, 3))

    def shapes_differ(a):
        store(a, 0, load_matrix(a, 0, 2, 3) @ load_matrix(a, 0, 2, 3))

    def elementwise_product(a):
        store(a, 0, load_vector(a, 0, 4) * load_vector(a, 0, 4))

    def pack_times_vector_of_one_problem(a):
        store(a, 0, load_pack(a, 0, 4) * load_vector(a, 0, 4))

    def different_lanes(a):
        store(a, 0, load_pack(a, 0, 4) * vector(load_pack(a, 0, 2), load_pack(a, 0, 2)))

    for function in (lengths_differ, shapes_differ, elementwise_product, pack_times_vector_of_one_problem, different_lanes):
        refused(function, a)
