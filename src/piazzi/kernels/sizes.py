"""What every module has of a model: its sizes, and how a row of measurements finds its station."""

from __future__ import annotations

from piazzi.kernels.steps import inline_source
from piazzi.model import Model


def sizes_source(model: Model, lanes: int) -> str:
    """Source of the sizes; `lanes` problems are worked on at once where there are that many."""
    sizes = {
        "LANES": lanes,
        "ND": len(model.moving),
        "N": model.n,
        "M": model.width,
        "MN": model.width * model.n,
        "NN": model.n**2,
        "M_LANES": model.width * lanes,
        "N_LANES": model.n * lanes,
        "MN_LANES": model.width * model.n * lanes,
        "NN_LANES": model.n**2 * lanes,
        "WORK": model.width * (model.width + model.n),
        "NUMBERS": model.most_numbers,
        "FEW_DIGITS": 1e8,
        "REOPENS": 5,  # rows in a row beyond a gate, from which on it is open
        "LOST": 1e-15 * max(model.n, 4),  # of a diagonal: what is left below it is rounding
    }
    return "".join(f"{k} = {v}\n" for k, v in sizes.items()) + "\n\n"


def _of_row(function: str, rest: str) -> tuple[str, str]:
    """The same for a row, by its station."""
    numbers = "measured.numbers, s * NUMBERS"
    return "s = measured.station[row]", f"{function}(measured.sensor[s], t, x, p, {numbers}, {rest})"


ROWS = inline_source("measure_row(measured, row, t, x, p, out, at)", *_of_row("measure_into", "out, at")) + inline_source(
    "innovate_row(measured, row, t, x, p, nu, H, out)", *_of_row("innovate", "measured.z, row * M, nu, H, out")
)
