"""Weights of the multi-step method: exact for polynomials, and their first terms are those of the books."""

from fractions import Fraction
from math import factorial

import pytest

import piazzi as pz
from piazzi.kernels import multistep

ORDERS = [4, 7, 10, 14]


def polynomial(k, n):
    """Rate, velocity and position of t^k at n, with constants of integration that are not zero."""
    t = Fraction(n)
    return t**k, t ** (k + 1) / (k + 1) + 3, t ** (k + 2) / ((k + 1) * (k + 2)) + 3 * t - 2


def weighed(weights, rates):
    """Sum over rates, the newest of which comes last."""
    return sum(w * f for w, f in zip(weights, reversed(rates), strict=True))


@pytest.mark.parametrize("order", ORDERS)
def test_motion_under_a_polynomial_is_followed_exactly(order):
    """With m rates all polynomials below degree m are; the sums begin by what the corrector says of the newest state."""
    rule = multistep.rule(order)
    for k in range(order):
        rates = [polynomial(k, n)[0] for n in range(order)]
        _, v, x = polynomial(k, order - 1)
        first = v - weighed(rule.corrector[1], rates)
        second = x - weighed(rule.corrector[0], rates) + first
        for n in range(order, order + 3):
            f, v, x = polynomial(k, n)
            assert (second + weighed(rule.predictor[0], rates), first + weighed(rule.predictor[1], rates)) == (x, v)
            rates = [*rates[1:], f]
            assert (second + weighed(rule.corrector[0], rates), first + f + weighed(rule.corrector[1], rates)) == (x, v)
            first += f
            second += first


def test_first_terms():
    """In backward differences: -1/2, -1/12, -1/24, -19/720 of velocity, and 1/12, 0, -1/240, -1/240 of position."""
    corrector = multistep.rule(4).corrector
    differences = [[sum(w[j] * Fraction(factorial(j), factorial(k) * factorial(j - k)) for j in range(k, 4)) for k in range(4)]
                   for w in corrector]  # fmt: skip
    signed = [[(-1) ** k * d for k, d in enumerate(row)] for row in differences]
    assert signed == [
        [Fraction(1, 12), 0, Fraction(-1, 240), Fraction(-1, 240)],
        [Fraction(-1, 2), Fraction(-1, 12), Fraction(-1, 24), Fraction(-19, 720)],
    ]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("s", [Fraction(0), Fraction(1, 3), Fraction(1)])
def test_integrals_between_steps_are_exact_for_polynomials(order, s):
    """Backwards from the newest of the rates: v - integral of f, and x - s v + the double integral."""
    twice, once = multistep.within(order)
    a = [sum(row[j] * s ** (k + 2) for k, row in enumerate(twice)) for j in range(order)]
    b = [sum(row[j] * s ** (k + 1) for k, row in enumerate(once)) for j in range(order)]
    for k in range(order):
        rates = [polynomial(k, n)[0] for n in range(order)]
        _, v, x = polynomial(k, order - 1)
        _, v_s, x_s = polynomial(k, order - 1 - s)
        assert (v - weighed(b, rates), x - s * v + weighed(a, rates)) == (v_s, x_s)


@pytest.mark.parametrize(
    ("dynamics", "pairs"),
    [
        ({"x": "v", "v": "-x"}, ((0, 1),)),
        ({"x": "v", "y": "w", "v": "-x", "w": "-y*c", "c": "0"}, ((0, 2), (1, 3))),
        ({"x": "v", "y": "v", "v": "-x"}, ((0, 2), (1, 2))),  # one velocity may move two
        ({"x": "v", "v": "-x", "a": "-a"}, ()),  # a state of first order
        ({"x": "v", "v": "a", "a": "-v"}, ()),  # a velocity that is a position too
        ({"x": "x"}, ()),
        ({"x": "1"}, ()),
    ],
)
def test_pairs_of_position_and_velocity_are_found_in_the_equations(dynamics, pairs):
    assert multistep.second_order(pz.Model(list(dynamics), dynamics)) == pairs


def test_no_pairs_in_a_step_or_with_memories():
    assert multistep.second_order(pz.Model(["x", "v"], ["v", "-x"], discrete=True)) == ()
    assert multistep.second_order(pz.Model(["x", "v"], ["v", "-x"], memory={"x_before": "x"})) == ()
