"""Outlines in images that another model made: found where there is one, none where there is none,
and as far off as they say."""

from functools import cache

import numpy as np
import pytest
import shapely
from scan_lines import scanned

from validate.errors import RecordingError
from validate.recording.outlines.outline import Outline, extract_outline
from validate.recording.outlines.polar import scanned as filled
from validate.register.outlines.outlines import normal_distances


@cache
def found(seed: int) -> tuple[Outline | None, np.ndarray | None, float | None]:
    image, truth, scan = scanned(seed)
    try:
        return extract_outline(image, (scan.m_per_px,) * 2), truth, scan.level
    except RecordingError:
        return None, truth, scan.level


def off(outline: Outline, truth: np.ndarray) -> float:
    """Distance (rms) over its standard deviation."""
    return float(np.sqrt(np.mean(normal_distances(outline.points, truth) ** 2)) / outline.sd)


def test_a_fan_in_black_hides_no_inclusion() -> None:
    image, truth, scan = scanned(307)
    assert scan.sector
    assert image[0, 0] == image[-1, -1] == 0
    assert filled(image.astype(float))[0, 0] > 20
    outline, _, _ = found(307)
    assert outline is not None
    assert truth is not None
    assert off(outline, truth) < 2.5


def test_a_corner_that_is_as_dark_as_tissue_is_not_filled() -> None:
    image = np.full((40, 40), 9.0)
    assert filled(image) is image


def test_a_wall_moved_inward_does_not_fold() -> None:
    """At this seed two normals of the path cross."""
    outline, _, _ = found(155)
    assert outline is not None
    assert shapely.Polygon(outline.points).is_valid


@pytest.mark.slow
def test_outlines_are_as_far_off_as_they_say_and_none_is_made_up() -> None:
    """40 seeds of those that no choice was made on: of 120, 91 of 108 were found, all of -20 dB and
    below, none beside its place, none in 12 images without; rms over sd .83 (median .70)."""
    seen = [found(seed) for seed in range(300, 340)]
    ratios = [off(o, truth) for o, truth, _ in seen if o is not None and truth is not None]
    assert not [o for o, truth, _ in seen if truth is None and o is not None]
    assert all(o is not None for o, _, level in seen if level is not None and level <= -20)
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.1
    for o, truth, _ in seen:
        if o is not None and truth is not None:
            assert np.linalg.norm(o.centre - truth.mean(axis=0)) < 0.3 * o.radius
