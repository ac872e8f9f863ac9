"""Tableaus meet the order conditions of all rooted trees, and a user's wrong one is refused."""

from fractions import Fraction

import numpy as np
import pytest

from piazzi import kernels
from piazzi.kernels import tableaus
from tests.solvers import trees

METHODS = {
    kernels.Euler: 1,
    kernels.Midpoint: 2,
    kernels.Heun: 2,
    kernels.Ralston: 2,
    kernels.RungeKutta4: 4,
    kernels.DormandPrince5: 5,
    kernels.RungeKutta8: 8,
}


def test_there_are_as_many_trees_as_cayley_counted():
    assert [len(trees.trees(n)) for n in range(1, 10)] == [1, 1, 2, 4, 9, 20, 48, 115, 286]


@pytest.mark.parametrize(("method", "order"), METHODS.items(), ids=lambda v: getattr(v, "__name__", v))
def test_every_tableau_meets_its_order_conditions_and_no_more(method, order):
    a, b, c = method().tableau
    assert trees.order_of(a, b) == order
    np.testing.assert_allclose([sum(row) for row in a], c, rtol=0, atol=1e-15)


def test_error_estimates_are_the_solution_minus_those_of_order_5_and_3():
    a, b, _ = tableaus.DORMAND_PRINCE_8
    for error, order in ((tableaus.ERROR_5, 5), (tableaus.ERROR_3, 3)):
        embedded = np.array(b) - np.array(error)
        assert trees.order_of(a, embedded) == order


def test_ralston_has_the_smallest_error_bound_of_its_family():
    """Of all methods of two stages and order 2, with node c: 1/4 - 2/3 and its neighbours (Ralston 1962)."""

    def bound(c):
        a, b = [(), (c,)], [1 - 1 / (2 * c), 1 / (2 * c)]
        A = np.array([[0, 0], [c, 0]])
        return sum(abs(np.array(b) @ trees.stages(t, A) - 1 / trees.gamma(t)) for t in trees.trees(3)), a, b

    best = min(np.linspace(0.4, 1, 601), key=lambda c: bound(c)[0])
    assert abs(best - 2 / 3) < 1e-3
    np.testing.assert_allclose(kernels.Ralston().tableau[1], bound(2 / 3)[2])


# ---- a user's own ----------------------------------------------------------------------------------------------------


def test_ways_to_write_a_tableau_are_one():
    kutta3 = kernels.RungeKutta([[], [0.5], [-1, 2]], [1 / 6, 2 / 3, 1 / 6], [0, 0.5, 1], substeps=3)
    full = kernels.RungeKutta(np.array([[0, 0, 0], [0.5, 0, 0], [-1, 2, 0]]), np.array([1, 4, 1]) / 6, substeps=3)
    short = kernels.RungeKutta([[Fraction(1, 2)], [-1, 2]], [Fraction(1, 6), Fraction(2, 3), Fraction(1, 6)], substeps=3)
    assert kutta3 == full == short
    assert hash(kutta3) == hash(short)
    assert kutta3.scheme == full.scheme
    assert trees.order_of(*kutta3.tableau[:2]) == 3


@pytest.mark.parametrize(
    ("a", "b", "c", "message"),
    [
        ([[], [0.5]], [0.5, 0.4], None, "weights b add up to 0.9"),
        ([["1/2"]], [0.0, 1.0], None, r"\['1/2'\].*must be numbers"),
        ([[], [0.5]], [0.0, 1.0], [0.0, 0.4], r"row 1 of a adds up to 0.5, but its node c\[1\] is 0.4"),
        ([[0.5], [0.5]], [0.0, 1.0], None, r"a\[0\]\[0\] is 0.5: an explicit method"),
        ([[0, 0], [0.5, 0.5]], [0.0, 1.0], None, r"a\[1\]\[1\] is 0.5: an explicit method"),
        ([[], [0.5], [1.0]], [0.0, 1.0], None, "3 rows in a and 2 weights"),
        ([[], [0.5]], [0.0, 1.0], [0.5], "1 nodes in c for 2 stages"),
        ([[], [float("nan")]], [0.0, 1.0], None, r"coefficients a\[1\] of the tableau: number 0 is nan"),
        ([[], ["half"]], [0.0, 1.0], None, r"coefficients a\[1\] of the tableau are"),
        ([], [], None, "at least one weight"),
    ],
)
def test_a_wrong_tableau_is_refused_with_the_place(a, b, c, message):
    with pytest.raises(ValueError, match=message):
        kernels.RungeKutta(a, b, c)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"rtol": 0}, "rtol is 0"), ({"rtol": 1e-17}, "rtol"), ({"atol": -1}, "atol is -1"), ({"max_steps": 0}, "max_steps is 0")],
)
def test_a_wrong_tolerance_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        kernels.DormandPrince(**settings)
