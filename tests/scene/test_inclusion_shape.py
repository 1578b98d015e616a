"""The surface between slices: exact for cylinders, near for spheres, at any pose."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from validate.errors import SceneError
from validate.scene.geometries.inclusion import SlicedShape


def sphere(pose: np.ndarray, r: float = 6e-3, step: float = 1e-3) -> SlicedShape:
    z = np.arange(-r + step / 2, r, step)
    radii = np.repeat(np.sqrt(r**2 - z**2)[:, None], 36, axis=1)
    return SlicedShape(pose, z, np.zeros((len(z), 2)), radii, np.array([-r, r]))


@settings(max_examples=15)
@given(st.integers(0, 10_000))
def test_a_sphere_of_slices_is_a_sphere_wherever_it_lies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=seed).as_matrix()
    pose[:3, 3] = rng.normal(0, 0.02, 3)
    shape = sphere(pose)
    points = pose[:3, 3] + rng.normal(0, 6e-3, (50, 3))
    away = np.linalg.norm(points - pose[:3, 3], axis=1)
    assert shape.distance(points) == pytest.approx(away - 6e-3, abs=0.06e-3)
    assert np.abs(shape.distance(shape.project(points))).max() < 1e-12
    assert shape.volume == pytest.approx(4 / 3 * np.pi * 6e-3**3, rel=0.01)
    assert shape.centre == pytest.approx(tuple(pose[:3, 3]), abs=0.05e-3)
    assert shape.reach == pytest.approx([6e-3] * 3, rel=0.02)
    assert shape.radius == pytest.approx(6e-3, rel=0.01)


def test_a_leaning_cylinder_is_exact_between_its_slices() -> None:
    z = np.array([0.0, 4e-3, 8e-3, 12e-3])
    centres = np.stack([0.1 * z, -0.2 * z], axis=1)
    shape = SlicedShape(np.eye(4), z, centres, np.full((4, 16), 3e-3), np.array([-1e-3, 13e-3]))
    on = np.array([[0.1 * 5e-3 + 3e-3, -0.2 * 5e-3, 5e-3], [0.1 * 7e-3, -0.2 * 7e-3 - 3e-3, 7e-3]])
    assert shape.distance(on) == pytest.approx([0, 0], abs=1e-12)
    assert shape.distance(on + [[1e-3, 0, 0], [0, 1e-3, 0]]) == pytest.approx([1e-3, -1e-3])


def test_an_axis_with_a_bend_follows_each_pair_of_slices() -> None:
    z = np.array([0.0, 4e-3, 8e-3])
    centres = np.array([[0.0, 0.0], [1e-3, 0.0], [0.0, 0.0]])
    shape = SlicedShape(np.eye(4), z, centres, np.full((3, 16), 3e-3), np.array([-4e-3, 12e-3]))
    middle = np.array([[0.5e-3 + 3e-3, 0.0, 2e-3], [0.5e-3 + 3e-3, 0.0, 6e-3]])
    assert shape.distance(middle) == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"positions": np.array([0.0, 0.0])}, "increasing positions between the ends"),
        ({"ends": np.array([0.0, 5e-3])}, "increasing positions between the ends"),
        ({"radii": np.zeros((2, 8))}, "expected positive radii at 8 or more angles"),
        ({"radii": np.ones((2, 7))}, "expected positive radii at 8 or more angles"),
        ({"radii": np.ones((3, 8))}, r"slices: radii: shape \(3, 8\)"),
        ({"centres": np.full((2, 2), np.nan)}, "not finite"),
    ],
)
def test_impossible_slices_are_refused(changes: dict, message: str) -> None:
    good = {
        "pose": np.eye(4),
        "positions": np.array([0.0, 1e-3]),
        "centres": np.zeros((2, 2)),
        "radii": np.full((2, 8), 2e-3),
        "ends": np.array([-1e-3, 2e-3]),
    }
    with pytest.raises(SceneError, match=message):
        SlicedShape(**(good | changes))
