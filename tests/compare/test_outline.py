"""Outline distances on squares worked out by hand, whatever the order of their points."""

import numpy as np
import pytest

from validate.errors import ComparisonError
from validate.register.outlines.outlines import angular_points, enclosed, normal_distances

SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
orders = pytest.mark.parametrize("order", [[0, 1, 2, 3], [2, 3, 0, 1], [3, 2, 1, 0], [0, 3, 2, 1]])


def circle(k: int, radius: float = 1.0, first: float = 0.0) -> np.ndarray:
    angle = first + 2 * np.pi * np.arange(k) / k
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@orders
def test_distances_from_a_square(order: list[int]) -> None:
    """Positive where the outline lies outside the point."""
    points = np.array([[0.5, 0.5], [0.5, 0.9], [0.5, 1.0], [0.5, 1.25], [2.0, 2.0], [-1.0, 0.3]])
    expected = [0.5, 0.1, 0.0, -0.25, -np.sqrt(2), -1.0]
    assert normal_distances(SQUARE[order], points) == pytest.approx(expected, abs=1e-15)


def test_distances_between_shifted_squares() -> None:
    """The square moved by (0.1, 0): its left side moved into, its right side out of the first."""
    sides = np.array([[0.0, 0.5], [0.5, 0.0], [1.0, 0.5], [0.5, 1.0]])
    moved = normal_distances(SQUARE + [0.1, 0.0], sides)
    assert moved == pytest.approx([-0.1, 0.0, 0.1, 0.0], abs=1e-15)


def test_larger_outline_lies_outside() -> None:
    points = circle(7, 0.9)
    distances = normal_distances(circle(720), points)
    assert distances == pytest.approx(0.1, abs=1e-5)
    assert normal_distances(circle(720, 0.8), points) == pytest.approx(-0.1, abs=1e-5)


def test_an_outline_against_itself_is_zero() -> None:
    outline = circle(31, 0.0085)
    assert np.abs(normal_distances(outline, outline)).max() == 0


@orders
def test_area_and_centroid_of_a_square(order: list[int]) -> None:
    area, centroid = enclosed(2 * SQUARE[order] + [1.0, -3.0])
    assert area == pytest.approx(4.0, rel=1e-15)
    assert centroid == pytest.approx([2.0, -2.0], abs=1e-15)


def test_area_and_centroid_of_a_triangle() -> None:
    area, centroid = enclosed(np.array([[0.0, 0], [3, 0], [0, 6]]))
    assert area == pytest.approx(9.0)
    assert centroid == pytest.approx([1.0, 2.0])


def test_polar_points_of_a_circle() -> None:
    outline = circle(360) * 0.0085 + [0.03, -0.01]
    angles = np.deg2rad([0.0, 10.0, 90.0, 225.0, 359.0, -45.0, 405.0])
    expected = np.array([0.03, -0.01]) + 0.0085 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    for turned in (outline, outline[::-1], np.roll(outline, 77, axis=0)):
        assert angular_points(turned, angles) == pytest.approx(expected, abs=1e-12)


@orders
def test_polar_points_of_a_square(order: list[int]) -> None:
    """Its corners are met; between them the radius is interpolated, so a side bulges."""
    angles = np.deg2rad([45.0, 135.0, 225.0, 315.0, 0.0])
    half = np.sqrt(0.5)
    expected = [[1, 1], [0, 1], [0, 0], [1, 0], [0.5 + half, 0.5]]
    assert angular_points(SQUARE[order], angles) == pytest.approx(np.array(expected), abs=1e-12)


def test_polar_points_of_a_triangle() -> None:
    outline = circle(3, 2.0)
    assert angular_points(outline, np.deg2rad([0.0, 120.0])) == pytest.approx(
        outline[:2], abs=1e-12
    )


def test_small_overhang_is_no_fold() -> None:
    """A point that noise has put 0.2 deg behind its neighbour, 1 % further in."""
    angle, radius = np.deg2rad(np.arange(0.0, 360.0, 0.5)), np.ones(720)
    angle[101], radius[101] = np.deg2rad(49.8), 0.99
    outline = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert angular_points(outline, np.zeros(1))[0] == pytest.approx([1.0, 0.0], abs=1e-3)


def test_outline_that_folds_back_is_refused() -> None:
    """A C: seen from its centroid the ring is passed twice."""
    outer, inner = circle(60)[:50], 0.8 * circle(60)[:50]
    with pytest.raises(ComparisonError, match="folds back on itself"):
        angular_points(np.vstack([outer, inner[::-1]]), np.zeros(1))


def test_outline_with_a_pocket_is_refused() -> None:
    """Once around, but 40 deg of it three times over."""
    arcs = [(1.0, 0, 60), (0.8, 60, 20), (0.6, 20, 340)]
    legs = [
        r * np.exp(1j * np.deg2rad(np.linspace(start, end, abs(end - start) // 2 + 1)))
        for r, start, end in arcs
    ]
    z = np.concatenate(legs)
    with pytest.raises(ComparisonError, match="folds back on itself"):
        angular_points(np.stack([z.real, z.imag], axis=1), np.zeros(1))


@pytest.mark.parametrize("measure", [enclosed, lambda o: normal_distances(o, SQUARE)])
def test_outline_that_crosses_itself_is_refused(measure) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ComparisonError, match=r"outline of 4 points .*Self-intersection"):
        measure(SQUARE[[0, 1, 3, 2]])
    with pytest.raises(ComparisonError, match="outline of 3 points is not a simple"):
        measure(np.array([[0.0, 0], [1, 0], [2, 0]]))


def test_points_at_one_angle_have_finite_radii() -> None:
    """A notch along a ray, and a polygon that ends where it began: no division by their angle."""
    notched = np.array([(1.0, -1), (1, 0), (0.9, 0), (1, 1), (-1, 1), (-1, -1.0)])
    closed = np.vstack([SQUARE, SQUARE[:1]])
    for outline in (notched, closed):
        about = angular_points(outline, np.deg2rad(np.arange(0, 360, 5)))
        assert np.isfinite(about).all()
    assert angular_points(closed, np.deg2rad([45.0])) == pytest.approx(np.array([[1, 1]]))
