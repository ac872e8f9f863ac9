"""The model's own functions on many states at once, for users."""

from piazzi.kernels.vocabulary import *  # noqa: F403


@entry
@sizes(K="K", t="K", x="K N", numbers="U", out="K M")
def evaluate_measurement(K: int, sensor: int, t: Array, x: Array, p: Given, numbers: Array, out: Array) -> None:
    for k in range(K):
        measure_into(sensor, t[k], load_vector(x, k * N, N), p, numbers, 0, out, k * M)


@entry
@sizes(K="K", t="K", x="K N", numbers="U", out="K M N")
def evaluate_measurement_jacobian(K: int, sensor: int, t: Array, x: Array, p: Given, numbers: Array, out: Array) -> None:
    z, nu, H = scratch(M), scratch(M), scratch(MN)
    for i in range(M):
        z[i] = 0.0
    for i in range(M * N):
        H[i] = 0.0
    for k in range(K):
        innovate(sensor, t[k], load_vector(x, k * N, N), p, numbers, 0, z, 0, nu, H, 0)
        for i in range(M):
            store(out, (k * M + i) * N, load_vector(H, i * N, N))


@entry
@sizes(K="K", t="K", x="K N", out="K N", Phi="K N N")
def evaluate_step(K: int, t: Array, dt: float, count: int, x: Array, p: Given, out: Array, Phi: Array) -> None:
    for k in range(K):
        x_next, derivative = transition(t[k], dt, count, load_vector(x, k * N, N), p)
        store(out, k * N, x_next)
        store(Phi, k * N * N, derivative)
