"""Quantiles of chi-square by Wilson and Hilferty (1931), good to a per mille for many degrees of freedom."""

from statistics import NormalDist


def quantile(probability: float, degrees: int) -> float:
    """Value that chi-square with so many degrees of freedom stays below with that probability."""
    z, c = NormalDist().inv_cdf(probability), 2 / (9 * degrees)
    return degrees * (1 - c + z * c**0.5) ** 3


def mean_bounds(degrees: int, runs: int, outside: float) -> tuple[float, float]:
    """Two-sided bounds on the mean over `runs` independent chi-squares, violated with probability `outside`."""
    return tuple(quantile(p, degrees * runs) / runs for p in (outside / 2, 1 - outside / 2))
