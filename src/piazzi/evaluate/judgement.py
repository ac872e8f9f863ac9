"""Whether covariances are consistent with errors: one judgement for terminal and page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from piazzi.evaluate.quantities import number, sigma_factor

if TYPE_CHECKING:
    from piazzi.evaluate.consistency import Check
    from piazzi.evaluate.rows import Row
    from piazzi.problem.checks import Array

CLEARLY = 1.5  # times as large: one run without a test cannot tell a smaller factor
SAME_ERROR = 1.01  # errors nearer than this are called the same
NEAR, APART = 1.0, 3.0  # sigma, by which estimators of all measurements, and those of real time, may differ
SLOW_CONVERGENCE = 5.0  # times the error of the last half that the whole run's must be to be called slow to settle
OPTIMISTIC, CONSISTENT, PESSIMISTIC = 1, 0, -1


@dataclass(frozen=True)
class Claim:
    """What is said of several rows at once.

    Attributes
    ----------
    sign : OPTIMISTIC where errors are larger than the covariance predicts, PESSIMISTIC where they are smaller, else CONSISTENT
    rows : those of which it is said
    factors : their RMS errors, or innovations, in units of what the covariance predicts
    """

    sign: int
    rows: tuple[Row, ...]
    factors: tuple[float, ...]

    @property
    def text(self) -> str:
        """The claim in words, to follow "errors of ... are"."""
        return (
            "consistent with the covariance"
            if self.sign == CONSISTENT
            else f"{times(self.factors)} what the covariance predicts"
        )


def not_diverged(rows: Sequence[Row]) -> list[Row]:
    """Rows whose covariance is worth a judgement: the others failed or diverged, and are reported as such."""
    return [r for r in rows if r.success and not r.diverged]


def divergences(rows: Sequence[Row]) -> list[str]:
    """A sentence for each estimator that diverged."""
    names = dict.fromkeys(r.estimator for r in rows if r.success and r.diverged)
    return [f"{name} diverged: its errors stay far beyond its own covariance and do not come down enough." for name in names]


def errors_known(rows: Sequence[Row]) -> bool:
    """Whether any error is known, so that errors are judged; else innovations are."""
    return any(v is not None for r in rows for v in r.rmse.values())


def claims(rows: Sequence[Row], values: Array) -> list[Claim]:
    """The judgement of each sound row, those that are judged alike together, the optimistic first.

    Parameters
    ----------
    rows : of a comparison
    values : (J, m) the measurements, NaN where missing
    """
    chosen = not_diverged(rows)
    known, expected = errors_known(chosen), expected_nis(values)
    found = [(r, judged) for r in chosen if (judged := _judged(r, known, expected)) is not None]
    out = []
    for sign in (OPTIMISTIC, CONSISTENT, PESSIMISTIC):
        alike = [(r, factor) for r, (factor, where) in found if where == sign]
        if alike:
            out.append(Claim(sign, tuple(r for r, _ in alike), tuple(f for _, f in alike)))
    return out


def _judged(row: Row, known: bool, expected: float | None) -> tuple[float, int] | None:
    """Errors, else innovations, in units of what the covariance predicts, and the sign of the claim.

    By the test of the mean NEES of the last half, which allows for correlation in time, or of the mean NIS, where there is one;
    else by a factor that one run can tell.
    """
    value, ideal = (row.mean_nees_last_half, row.nees_ideal_last_half) if known else (row.mean_nis, expected)
    if value is None or not isfinite(value) or not ideal:
        return None
    factor = sigma_factor(value, ideal)
    check = row.tests.nees_last_half if known else row.tests.nis
    if check is None or not isfinite(check.high):
        return factor, int(factor > CLEARLY) - int(factor < 1 / CLEARLY)
    return factor, int(check.statistic > check.high) - int(check.statistic < check.low)


def times(factors: Sequence[float]) -> str:
    """The factors as a multiple: "about 2 to 3 times", "about half of"."""
    low, high = min(factors), max(factors)
    if abs(low - 0.5) < 0.05 and abs(high - 0.5) < 0.05:
        return "about half of"
    return f"about {' to '.join(dict.fromkeys(number(v, 2) for v in (low, high)))} times"


def expected_nis(values: Array) -> float | None:
    """Mean number of components per row of measurements: what a mean NIS should be near."""
    present = (~np.isnan(values)).sum(axis=1)
    return float(present[present > 0].mean()) if present.any() else None


def far_apart(rows: Sequence[Row]) -> list[Row]:
    """Rows whose last states are further from those of the first estimator than either may be."""
    first = next((r.view for r in rows if r.success and r.apart is None), "")
    limits = [NEAR if row.view == first == "delayed" else APART for row in rows]
    return [r for r, limit in zip(rows, limits, strict=True) if r.success and r.apart is not None and not r.apart <= limit]


def tested(row: Row) -> bool:
    """Whether there is any test of this row."""
    return any(check is not None for check in _checks(row).values())


def failing(row: Row) -> list[str]:
    """Names of the tests that a row does not pass."""
    return [name for name, check in _checks(row).items() if check is not None and not check.passed]


def fails_at_first_only(row: Row) -> bool:
    """Whether NEES is out of its bounds over the whole run, but not over its last half."""
    whole, last = row.tests.nees, row.tests.nees_last_half
    return whole is not None and last is not None and last.passed and not whole.passed


def _checks(row: Row) -> dict[str, Check | None]:
    """The tests that are shown, by the name that they are shown under: NEES once the estimator has settled."""
    h = row.tests
    return {"NEES": h.nees_last_half, "NIS": h.nis, "whiteness": h.whiteness, "bias": h.bias}
