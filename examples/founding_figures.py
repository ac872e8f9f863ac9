"""The founding paper's figures, its published results beside Piazzi's on the same data.

    python examples/founding_figures.py FOLDER -o OUT --format pdf

FOLDER holds slide_example.npz, published_ekf.npz, published_full_graph.npz and published_timing.npz: the 2-D satellite that
accompanies Taylor and Gross, "Factor Graphs for Navigation Applications: A Tutorial", NAVIGATION 71(3), 2024.

The numbers are not like for like: the published filter takes one step of 15 s where Piazzi takes 15 substeps, the published
graph has no prior and another scale of process noise, and the times are of another machine.
"""

import argparse
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

import piazzi as pz
from piazzi.evaluate.window_lengths import head
from piazzi.present.figures import path_beside_truth, timing
from piazzi.present.figures.pages import save
from piazzi.present.figures.style import RC

PUBLISHED = {"ekf": ("published_ekf.npz", "ekf_ref"), "graph": ("published_full_graph.npz", "fg_res")}
ESTIMATORS = {"ekf": pz.ExtendedKalmanFilter(), "graph": pz.FactorGraph()}
TITLES = {
    "ekf": "Extended Kalman filter (the published one takes one step for our fifteen)",
    "graph": "Full factor graph (the published one has no prior)",
}
SIZES = (2, 5, 10, 20, 50, 100, 200, 300, 400, 500, 600, 700, 800, 900, 1000, 1100, 1200, 1300, 1441)


def norm_rmse(path: np.ndarray, truth: np.ndarray) -> float:
    """Root of the mean squared length of the position error, m."""
    return float(np.sqrt(((path[:, :2] - truth[:, :2]) ** 2).sum(axis=1).mean()))


def accuracy(name: str, published: np.ndarray, ours: np.ndarray, truth: np.ndarray) -> Figure:
    """Both paths over the truth, side by side."""
    figure = Figure(figsize=(10.5, 5.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    for ax, path, who in ((left, published, "as published"), (right, ours, "Piazzi")):
        path_beside_truth(ax, path[:, :2], truth[:, :2], name=name)
        ax.set_title(f"{who}: RMS {norm_rmse(path, truth) / 1e3:.4g} km")
    figure.suptitle(TITLES[name], fontsize=11, x=0.01, ha="left")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def costs(problem: pz.Problem, tracking: pz.Tracking, published: dict[str, np.ndarray]) -> Figure:
    """Seconds of a full optimisation against the number of steps: published, and Piazzi on this machine (best of three)."""
    sizes = [k for k in SIZES if k <= len(tracking.times)]
    graph = pz.FactorGraph()
    ours = [min(graph.estimate(problem, head(tracking, k)).seconds for _ in range(3)) for k in sizes]
    figure = Figure(figsize=(10.5, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    part = slice(1, None)  # the first call loads what the others have, and is left out of the paper's figure too
    timing(left, published["call_sizes"][part], published["full_opt"][part])
    timing(right, np.array(sizes), np.array(ours))
    last = np.searchsorted(published["call_sizes"], sizes[-1])
    for ax, who, value in ((left, "as published", published["full_opt"][last]), (right, "Piazzi, this machine", ours[-1])):
        ax.set_title(f"{who}: {1e3 * value:.3g} ms at {sizes[-1]} epochs")
    figure.suptitle("Time of a full optimisation (two machines)", fontsize=11, x=0.01, ha="left")
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="of the founding paper's data")
    parser.add_argument("-o", "--output", type=Path, default=Path("founding"), help="folder of the figures")
    parser.add_argument("--format", choices=("pdf", "svg", "png"), default="pdf")
    chosen = parser.parse_args()
    chosen.output.mkdir(parents=True, exist_ok=True)
    problem, tracking = pz.load(chosen.folder / "slide_example.npz")
    with rc_context(RC):
        figures = {}
        for name, (file, key) in PUBLISHED.items():
            with np.load(chosen.folder / file) as data:
                published = data[key]
            ours = ESTIMATORS[name].estimate(problem, tracking).mean
            figures[f"accuracy_{name}"] = accuracy(name, published, ours, tracking.truth)
        with np.load(chosen.folder / "published_timing.npz") as data:
            figures["timing"] = costs(problem, tracking, dict(data))
    for name, figure in figures.items():
        print("Wrote", save(figure, chosen.output / f"{name}.{chosen.format}"))


if __name__ == "__main__":
    main()
