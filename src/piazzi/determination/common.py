"""Errors that the rows of a pass have in common, found by their residuals before sigmas are believed.

A station's bias changes from pass to pass by more than its normal points scatter.  Rows that share it know less together than
as many that do not, and where nothing stands for it good passes look like outliers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from piazzi.determination.analysis import Analysis, analysed
from piazzi.determination.instruments import with_instruments
from piazzi.determination.passes import pass_of_rows
from piazzi.determination.setup import Setup, renewed
from piazzi.determination.unknowns import PASS, Asked, Estimated
from piazzi.estimate.chi_square import quantile
from piazzi.problem.checks import Array

SURE = 0.999
FEWEST = 3  # rows of a pass that say something together
MEDIAN = np.pi / 2  # times the variance of a mean of normal values is that of their median
# m: short-term stability of 2 cm and long-term of 1 cm, which the ILRS asks of its stations (Pearlman et al. 2002, Adv. Space
# Res. 30, 135, and its performance report cards)
LASER = 0.022
SOURCE = "the stability that the ILRS asks of its stations, 2 cm from pass to pass and 1 cm in the long term"


def with_common_errors(given: Setup) -> Setup:
    """The set-up with a bias for each pass of lasers, where residuals near the answer say that passes have some.

    Nothing is added where the user says what ranges are off by.
    """
    laser = _laser_rows(given)
    said = any(name.startswith("range_bias") for name in given.measured.parameters)
    if said or not laser.any() or not np.isfinite(given.states).all():
        return given
    score = together(given, analysed(given, given.states), laser)
    return given if score is None or score[0] <= quantile(SURE, score[1]) else with_pass_biases(given)


def with_pass_biases(given: Setup) -> Setup:
    """The set-up with a bias of ranges for each pass; its prior and states are otherwise as they were."""
    seen = with_instruments(given.measured, [Asked(Estimated("bias.range", PASS, LASER), "estimated", "--estimate")])
    text = f"a bias of each pass is estimated, before the measurements 0 +- {LASER:g} m ({SOURCE}), as residuals show some"
    return replace(renewed(given, seen, given.chosen), assumed=(*given.assumed, text))


def together(given: Setup, analysis: Analysis, rows: Array) -> tuple[float, int] | None:
    """Sum of squares of what residuals of passes have in common, in sigma, and how many; None for no pass long enough.

    It is their median, so that outliers count as one row each.
    """
    passes = pass_of_rows(given.measured, given.tracking, given.rows)
    squares = []
    for one in np.unique(passes[rows & (passes > 0)]):
        own = analysis.whitened[rows & (passes == one)]
        for column in own.T:
            known = column[np.isfinite(column)]
            if len(known) >= FEWEST:
                squares.append(float(np.median(known)) ** 2 * len(known) / MEDIAN)
    return (float(np.sum(squares)), len(squares)) if squares else None


def _laser_rows(given: Setup) -> Array:
    """Which rows (J,) are ranges of lasers."""
    observations = given.measured.observations
    laser = np.array([segment.wavelength is not None for segment in observations.segments], dtype=np.bool_)
    first = given.rows[:, 0]
    return (first >= 0) & laser[observations.segment[np.maximum(first, 0)]]
