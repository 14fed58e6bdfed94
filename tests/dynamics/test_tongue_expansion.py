import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

from gearmon.dynamics.floquet import multipliers
from gearmon.dynamics.stability import expanded_tongue
from gearmon.errors import ArgumentError


def mathieu_edges(eps, number):
    """Edges w/w0 for 1 + eps cos: a = 4/nu^2, q = 2 eps/nu^2."""

    def edge(function):
        return brentq(
            lambda nu: 4 / nu**2 - function(number, 2 * eps / nu**2),
            1.4 / number,
            2.6 / number,
            xtol=1e-15,
        )

    return sorted((edge(mathieu_a), edge(mathieu_b)))


@pytest.mark.parametrize(
    ("eps", "low", "high"),
    [
        (0.05, 1.974923167, 2.024920721),
        (0.1, 1.949698438, 2.049678773),
        (0.2, 1.898848110, 2.098687561),
        (0.4, 1.795989323, 2.194599747),
    ],
)
def test_published_principal_tongue(eps, low, high):
    assert mathieu_edges(eps, 1) == pytest.approx([low, high], abs=0.6e-9)
    assert expanded_tongue([eps / 2], 1, order=12) == pytest.approx((low, high), abs=0.6e-9)


@pytest.mark.parametrize("eps", [0.01, 0.1, 0.3])
def test_second_order_in_closed_form(eps):
    found = expanded_tongue([eps / 2], 1)
    assert found == pytest.approx((2 - eps / 2 - eps**2 / 32, 2 + eps / 2 - eps**2 / 32), rel=1e-14)
    found = expanded_tongue([eps / 2], 2)
    assert found == pytest.approx((1 - 5 * eps**2 / 24, 1 + eps**2 / 24), rel=1e-14)
    # phase does not move the edges of a single harmonic
    turned = expanded_tongue([eps / 2 * np.exp(0.7j)], 1)
    assert turned == pytest.approx(expanded_tongue([eps / 2], 1), rel=1e-14)


@pytest.mark.parametrize(("zeta", "wide"), [(0.049, True), (0.051, False)])
def test_threshold_of_damping(zeta, wide):
    # eps > 4 zeta, with eps = 0.2
    found = expanded_tongue([0.1], 1, zeta, order=1)
    assert (found is not None) == wide
    if found:
        width = 2 * math.sqrt((0.2 / 4) ** 2 - zeta**2) * 2
        assert found[1] - found[0] == pytest.approx(width, rel=1e-12)


@pytest.mark.parametrize("number", [1, 2, 3])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_error_falls_with_the_next_power(number, order):
    sizes = np.array([0.04, 0.08, 0.16])
    errors = []
    for eps in sizes:
        found = expanded_tongue([eps / 2], number, order=order)
        errors.append(np.abs(np.subtract(found, mathieu_edges(eps, number))).max())
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    # the second tongue is even in eps
    assert slope > order + 1 - 0.1
    assert slope < order + 2.1 + (number == 2)


@pytest.mark.parametrize(("number", "zeta"), [(1, 0.02), (2, 0.02), (3, 0.005)])
def test_damped_edges_of_any_stiffness(number, zeta):
    c = np.array([0.1 + 0.02j, 0.05j, 0.02])

    def growth(nu, size):
        return math.log(abs(multipliers(1 / nu, zeta * size, size * c, 1e-13)[0]))

    errors = []
    for size in (0.25, 0.5):
        found = expanded_tongue(size * c, number, zeta * size, order=3)
        middle, reach = sum(found) / 2, 0.02 * size / number
        exact = [
            brentq(growth, middle, found[0] - reach, args=(size,), xtol=1e-13),
            brentq(growth, middle, found[1] + reach, args=(size,), xtol=1e-13),
        ]
        errors.append(np.abs(np.subtract(found, exact)).max())
    assert math.log2(errors[1] / errors[0]) == pytest.approx(4, abs=0.35)


def test_meissner_tongues():
    # a square wave of duty 0.5 and 0.13: published edges, to the error of fourth order
    n = np.arange(1, 121)
    c = 0.13 * np.sin(n * math.pi / 2) / (n * math.pi / 2) + 0j
    assert expanded_tongue(c, 1, order=4) == pytest.approx((1.916507, 2.081913), abs=2e-5)
    assert expanded_tongue(c, 2, order=4) == pytest.approx((0.993654, 1.002099), abs=1e-4)


def test_refusals():
    for arguments, name in (
        (([0.1], 0), "number"),
        (([0.1], 1, 1.5), "zeta"),
        (([0.1], 1, 0.0, 0), "order"),
        (([np.nan], 1), "harmonics"),
    ):
        with pytest.raises(ArgumentError, match=name):
            expanded_tongue(*arguments)
