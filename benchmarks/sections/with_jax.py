"""A thousand EKF runs of the founding problem at once: ours in lanes, libraries that compile through JAX by vmap."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from cases import recording
from figures import Figure, rounds

import piazzi as pz

RUNS = 1000
ROUNDS = 3
LIBRARIES = {"dynamax": "in_dynamax", "cuthbert": "in_cuthbert"}
BOUND = 20.0


def figures() -> Iterator[Figure]:
    import jax_filters

    from piazzi.study.ensemble import Layout, filter_runs

    problem, tracking = pz.load(recording())
    z = tracking.values[None, :, :] + 1e-4 * np.random.default_rng(0).normal(size=(RUNS, *tracking.values.shape))
    truth = np.zeros((len(z), len(tracking.times), problem.model.n))  # scores are part of it
    layout = Layout(problem, tracking.times)
    filter_runs(layout, z[:8], truth[:8])  # load the compiled code
    runs = {"ours": lambda: filter_runs(layout, z, truth)[0]}
    runs |= {library: getattr(jax_filters, name)(problem, tracking, z) for library, name in LIBRARIES.items()}
    last = {library: run() for library, run in runs.items()}
    times = rounds(runs, ROUNDS)
    ours = times.pop("ours")
    yield Figure("EKF runs together, CPU time of one", ours / RUNS * 1e3, "ms", note=f"{RUNS} runs, {z.shape[1]} epochs each")
    for library, theirs in times.items():
        apart = float((np.abs(last[library] - last["ours"]).max(axis=0) / np.abs(last["ours"]).max(axis=0)).max())
        note = f"compiled beforehand; last means {apart:.0e} relative apart"
        yield Figure(f"  {library}", theirs / RUNS * 1e3, "ms", "higher", theirs / ours, "ours", BOUND, note=note)
