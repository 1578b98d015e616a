"""Shape functions are partitions of one with the slopes they claim; rules are exact to degree."""

from collections.abc import Callable
from math import factorial, prod

import numpy as np
import pytest

from validate.arrays import Floats
from validate.scene.shape_functions import (
    CORNERS,
    LATTICE,
    Quadrature,
    barycentric,
    brick_rule,
    brick_values,
    collapsed_points,
    facet_rule,
    gauss_points,
    simplex_rule,
    symmetric_points,
)


def at(order: int, brick: bool) -> Callable[[Floats], Quadrature]:
    """The rule of simplices or bricks of an order, at points without weights."""
    if brick:
        return lambda xi: brick_rule(xi, np.zeros(len(xi)), order)
    return lambda xi: simplex_rule(order, barycentric(xi), np.zeros(len(xi)))


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("brick", [False, True])
@pytest.mark.parametrize("order", [1, 2])
def test_shapes_sum_to_one_and_their_slopes_are_differences(
    order: int, brick: bool, d: int
) -> None:
    xi, made = np.random.default_rng(0).random((5, d)) / d, at(order, brick)
    assert made(xi).N.sum(axis=1) == pytest.approx(np.ones(5))
    for axis, step in enumerate(1e-6 * np.eye(d)):
        difference = (made(xi + step).N - made(xi - step).N) / 2e-6
        assert made(xi).dN[..., axis] == pytest.approx(difference, abs=1e-9)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_bricks_are_one_at_their_own_node(d: int) -> None:
    assert np.array_equal(brick_values(CORNERS[d]), np.eye(2**d))
    assert np.array_equal(brick_values(LATTICE[d], 2), np.eye(3**d))


def monomials(xi: Floats, weights: Floats, degree: int) -> None:
    """Integral of x^i y^j (z^k) over the unit simplex is i! j! k! / (i + j + k + d)!."""
    d = xi.shape[1]
    for power in np.ndindex(*[degree + 1] * d):
        if sum(power) <= degree:
            exact = prod(map(factorial, power)) / factorial(sum(power) + d)
            assert weights @ (xi**power).prod(axis=1) == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("points", [1, 2, 3, 4])
@pytest.mark.parametrize("d", [2, 3])
def test_collapsed_rules_are_exact_to_their_degree(d: int, points: int) -> None:
    monomials(*collapsed_points(d, points), 2 * points - 1)


@pytest.mark.parametrize(("d", "degree"), [(1, 3), (2, 2), (2, 4), (3, 2)])
def test_symmetric_rules_are_exact_to_their_degree(d: int, degree: int) -> None:
    L, weights = symmetric_points(d, degree)
    assert L.sum(axis=1) == pytest.approx(np.ones(len(L)))
    monomials(L[:, 1:], weights, degree)


def test_gauss_points_integrate_cubes_along_every_axis() -> None:
    xi, weights = gauss_points(2, 2)
    assert weights @ (xi[:, 0] ** 3 * xi[:, 1] ** 3) == pytest.approx(1 / 16)


@pytest.mark.parametrize(
    ("dimension", "nodes", "shares"),
    [
        (2, 2, [1 / 2, 1 / 2]),
        (2, 3, [1 / 6, 1 / 6, 4 / 6]),
        (3, 3, [1 / 6] * 3),
        (3, 4, [1 / 4] * 4),
        (3, 6, [0] * 3 + [1 / 6] * 3),
    ],
)
def test_integrals_of_facet_shapes(dimension: int, nodes: int, shares: list[float]) -> None:
    rule = facet_rule(dimension, nodes)
    assert rule.weights @ rule.N == pytest.approx(np.array(shares), abs=1e-15)


def test_a_rule_carries_nodal_values_and_jacobians() -> None:
    """A unit triangle stretched to 2 x 3: x at the centroid and its slopes."""
    rule = simplex_rule(1, np.full((1, 3), 1 / 3), np.array([0.5]))
    x = np.array([[[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]]])
    assert rule.at(x)[0, 0] == pytest.approx([2 / 3, 1.0])
    assert rule.jacobians(x)[0, 0] == pytest.approx(np.diag([2.0, 3.0]))
