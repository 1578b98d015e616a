"""Circle fits: exact recovery, honest uncertainty, outlines that are no circles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from validate.errors import RegistrationError
from validate.recording.types import Contours
from validate.register.outlines.sections import Circle, outlined_capsule


def circle(centre, radius, k, first=0.0):
    angle = first + 2 * np.pi * np.arange(k) / k
    return np.array(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


@settings(max_examples=40)
@given(
    st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(1e-3, 0.05), st.integers(6, 80),
    st.floats(0, 6),
)  # fmt: skip
def test_exact_circle_is_recovered(x, y, radius, k, first):
    found = Circle.fit(circle((x, y), radius, k, first), 0.0)
    assert found.centre == pytest.approx([x, y], abs=1e-10)
    assert found.radius == pytest.approx(radius, abs=1e-10)
    assert found.rms < 1e-10


def test_half_a_circle_is_recovered():
    found = Circle.fit(circle((0.01, 0.02), 0.008, 60)[:30], 0.0)
    assert found.centre == pytest.approx([0.01, 0.02], abs=1e-9)
    assert found.radius == pytest.approx(0.008, abs=1e-9)


@pytest.mark.slow
def test_stated_sd_is_the_scatter_of_repeated_fits():
    """400 repetitions, 48 points, 0.15 mm along the normal; sd of an sd is 1/sqrt(800) = 3.5 %."""
    rng = np.random.default_rng(7)
    fits = []
    for _ in range(400):
        points = circle((0.0, 0.0), 0.0085, 48)
        fits.append(Circle.fit(points * (1 + rng.normal(0, 0.15e-3, (48, 1)) / 0.0085), 0.15e-3))
    centres, radii = np.array([f.centre for f in fits]), np.array([f.radius for f in fits])
    assert centres.std(axis=0) == pytest.approx(0.15e-3 * np.sqrt(2 / 48), rel=0.12)
    assert radii.std() == pytest.approx(0.15e-3 / np.sqrt(48), rel=0.12)
    stated = [np.mean([f.sd_centre for f in fits]), np.mean([f.sd_radius for f in fits])]
    assert stated == pytest.approx([centres.std(), radii.std()], rel=0.12)
    assert radii.mean() == pytest.approx(0.0085, abs=5e-6)
    assert np.mean([f.rms for f in fits]) == pytest.approx(0.15e-3, rel=0.05)


def test_larger_of_stated_noise_and_misfit_counts():
    points = circle((0, 0), 1.0, 8) * np.tile([1.1, 0.9], 4)[:, None]
    found = Circle.fit(points, 0.01)
    assert found.radius == pytest.approx(1.0)
    assert found.rms == pytest.approx(0.1)
    assert found.sd_radius == pytest.approx(0.1 / np.sqrt(8))
    assert found.sd_centre == pytest.approx(0.1 / 2)
    assert Circle.fit(points, 0.5).sd_radius == pytest.approx(0.5 / np.sqrt(8))


def test_too_few_points_are_refused():
    with pytest.raises(RegistrationError, match=r"5 points.*needs 6"):
        Circle.fit(circle((0, 0), 1.0, 5), 0.0)


def test_outline_far_from_a_circle_is_refused():
    stretched = circle((0, 0), 0.01, 40) * [1.0, 0.2]
    with pytest.raises(RegistrationError, match=r"not a circle: \d\.\d\d mm rms"):
        Circle.fit(stretched, 0.0)


POSE = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0.0225], [0, 1, 0, 0], [0, 0, 0, 1]])
SWEEP = {"centre_x_m": "0.030", "centre_y_m": "0.021", "centre_z_m": "0.035",
         "sd_centre_m": "0.0003", "length_m": "0.028"}  # fmt: skip


def outlined(off, allowance=0.0, sweep=SWEEP):
    """The inclusion of an outline whose centre is `off` m from the sweep's, along a diagonal."""
    centre = np.array([0.030, 0.035]) + off * np.array([0.6, -0.8])
    seen = Contours(np.zeros(1), (circle(centre, 0.0085, 50),), 0.15e-3, POSE, "scene")
    return outlined_capsule(seen, 0, sweep, allowance)


def test_an_outline_places_the_inclusion_in_its_plane_and_the_sweep_along_it():
    found = outlined(0.5e-3)
    assert found.centre == pytest.approx((0.0303, 0.021, 0.0346), abs=1e-9)
    assert (found.radius, found.length) == (pytest.approx(0.0085), 0.028)


def test_an_outline_further_off_than_four_standard_deviations_is_refused():
    """The sweep's .3 mm and the circle's .15 mm sqrt(2/50) together, and what is allowed beyond."""
    allowed = 4 * np.hypot(0.3e-3, 0.03e-3)
    outlined(0.999 * allowed)
    outlined(0.999 * allowed + 1e-3, 1e-3)
    for off, allowance in ((1.001 * allowed, 0.0), (1.001 * allowed + 1e-3, 1e-3)):
        with pytest.raises(RegistrationError, match="mirrored image or wrong pose"):
            outlined(off, allowance)
    with pytest.raises(RegistrationError, match="lacks a number 'length_m'"):
        outlined(0.0, sweep={k: v for k, v in SWEEP.items() if k != "length_m"})
