"""Pictures that are no charts: registration, errors over noise, images with what was found."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from chart_contract import faults
from matplotlib.figure import Figure
from report_samples import small_result

from experiments.fluid_phantom.phantom import outlines_in
from validate.recording.types import Contours, Frames, Recording, Source
from validate.register.markers.quality import Registration
from validate.report.charts.style import WIDTH, painted
from validate.report.scenes import outline_images as module
from validate.report.scenes.body import flattest
from validate.report.scenes.outline_images import outline_images
from validate.report.scenes.residual_arrows import arrow_axes, magnified, residual_arrows
from validate.report.sections.discrimination import noise_rows, over_noise
from validate.report.sections.observations import Held

# private: _circle: called alone, case by case.
# private: _outline: replaced, to bring a case about.

SD = 1e-4  # m


def registered(points: np.ndarray, sd: float = SD) -> Registration:
    """Markers seen with noise against their own layout."""
    names = tuple(f"marker_{i}" for i in range(len(points)))
    seen = points + np.random.default_rng(0).normal(0, sd, points.shape)
    return Registration.of(names, seen, points, expected_sd=sd)


def arrows(found: Registration) -> Figure:
    return painted(lambda f: arrow_axes(f, found, flattest(found.markers)[0]), WIDTH, 4.0)


FLAT = np.array([[0, 0], [0.1, 0.001], [0.05, 0.002], [0.02, 0.0], [0.08, 0.001]])
SOLID = np.array([[0, 0, 0], [0, 0.05, 0], [0.5, 0, 0.1], [0.5, 0.05, 0.1], [0.2, 0, 0.25],
                  [0.2, 0.05, 0.25]])  # fmt: skip


@pytest.mark.parametrize("points", [FLAT, FLAT[:, ::-1], SOLID], ids=["line", "upright", "solid"])
def test_markers_on_a_line_have_room_across_it(points: np.ndarray) -> None:
    (ax,) = arrows(registered(points)).axes
    sides = np.array([np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())])
    assert sides.min() > 0.3 * sides.max()
    box = ax.get_window_extent()
    assert box.height > 0.3 * box.width > 0.05 * box.height


@pytest.mark.parametrize("points", [FLAT, SOLID], ids=["line", "solid"])
def test_names_do_not_hide_each_other(points: np.ndarray) -> None:
    figure = arrows(registered(points))
    assert faults(figure) == []
    names = ", ".join(t.get_text() for t in figure.axes[0].texts)
    assert sorted(names.split(", ")) == [f"marker_{i}" for i in range(len(points))]


@pytest.mark.parametrize("sd", [1e-7, 1e-4, 1e-2])
def test_arrows_are_magnified_as_far_as_there_is_room(sd: float) -> None:
    found = registered(SOLID, sd)
    plane, _ = flattest(found.markers)
    longest = np.linalg.norm(found.residuals[:, plane], axis=1).max()
    shown = magnified(found, plane) * longest / np.ptp(SOLID, axis=0).max()
    assert 0.04 < shown <= 0.12


def test_rounding_is_no_arrow() -> None:
    found = replace(registered(SOLID), residuals=1e-16 * np.ones_like(SOLID))
    assert magnified(found, [0, 2]) == 0
    assert "none beyond rounding" in residual_arrows(found).caption


# --- errors over noise ---------------------------------------------------------------------------


def test_every_model_has_a_row_of_its_own() -> None:
    result = small_result()
    one = result.methods[1]
    more = tuple(replace(one, name=f"m{i}", label=f"a rival with a long name, number {i}")
                 for i in range(15))  # fmt: skip
    wide = replace(result, methods=(result.methods[0], *more))
    (row,) = noise_rows(wide)
    assert len(row.ratios) == 16
    (picture,) = over_noise(wide)
    (few,) = over_noise(result)
    assert picture.pixels.shape[1] == few.pixels.shape[1] == round(130 * WIDTH)
    assert picture.pixels.shape[0] > 2 * few.pixels.shape[0]


# --- images --------------------------------------------------------------------------------------


def image(radius: float) -> np.ndarray:
    """Speckle with an anechoic disc of `radius` px in the middle of 96 x 96."""
    rows, columns = np.mgrid[:96, :96] - 48
    grey = np.random.default_rng(0).integers(90, 160, (96, 96))
    return np.where(np.hypot(rows, columns) < radius, 5, grey).astype(np.uint8)


@pytest.fixture(scope="module")
def recording() -> Recording:
    frames = Frames(np.array([0.0, 1.0]), (image(24), image(20)), (2e-4, 2e-4), np.eye(4), "body")
    return Recording(
        "r", Source("r.mcap", "", 0, "verified"), 0, frames={"b_mode": frames},
        contours={"outline": outlines_in(frames, "b_mode")},
    )  # fmt: skip


HOLDS = (Held("0mm", 0.0, "m", 0.0), Held("3mm", 0.003, "m", 1.0))
RING = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 6, 20)])
SECTIONS = (0.01 + 0.004 * RING, 0.01 + 0.003 * RING, 0.01 + 0.002 * RING)


def test_images_are_shown_with_the_outline_found_and_the_circle(recording: Recording) -> None:
    ((series, picture),) = outline_images(recording, "outline", HOLDS, SECTIONS[:2], "a model")
    assert [label.partition(",")[0] for label in series.labels] == ["0 mm", "3 mm"]
    assert {image.shape for image in series.images} == {series.images[0].shape}
    assert series.images[0].shape[1] <= 640
    assert (series.images[0] != series.images[1]).any()
    yellow = [((i[..., 0].astype(int) - i[..., 2]) > 60).sum() for i in series.images]
    assert min(yellow) > 200  # outlines stand in each
    assert "The images 'b_mode'" in picture.caption
    radii = [part.split(" mm")[0] for part in picture.caption.split("mm: ")[1:]]
    assert [float(r) for r in radii] == pytest.approx([4.8, 4.0], abs=0.15)
    above = picture.pixels[: int(0.85 * len(picture.pixels))]  # the legend lies below
    there = above.reshape(-1, 3).astype(int)
    assert (there[:, 0] - there[:, 2] > 60).sum() > 200  # yellow
    assert (there[:, 2] - there[:, 0] > 60).sum() > 200  # blue
    speckle = (there >= 85).all(axis=1) & (there <= 165).all(axis=1)
    assert speckle.mean() > 0.3


@pytest.mark.parametrize("count", [1, 2, 3])
def test_images_leave_room_for_their_labels(
    recording: Recording, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Tall images, in one row and in two."""
    tall = Frames(np.array([0.0, 1.0, 2.0]), 3 * (np.zeros((310, 200), np.uint8),), (2e-4, 2e-4),
                  np.eye(4), "body")  # fmt: skip
    ring = 0.02 + 0.01 * RING
    found = Contours(tall.t, 3 * (ring,), 1e-4, np.eye(4), "body", "b_mode")
    made = replace(recording, frames={"b_mode": tall}, contours={"outline": found})
    seen: list[Figure] = []

    def kept(*drawing: Any) -> Any:
        seen.append(painted(*drawing))
        return np.zeros((1, 1, 3), np.uint8)

    monkeypatch.setattr("validate.report.scenes.outline_images.draw", kept)
    holds = tuple(Held(f"{i}mm", 1e-3 * i, "m", float(i)) for i in range(count))
    assert len(outline_images(made, "outline", holds, SECTIONS[:count], "a model")) == 1
    assert all(faults(figure) == [] for figure in seen)


def test_outlines_recorded_as_such_show_no_images(recording: Recording) -> None:
    found = recording.contours["outline"]
    made = Contours(found.t, found.outlines, found.sd, found.pose, found.frame)
    bare = replace(recording, contours={"outline": made})
    assert outline_images(bare, "outline", HOLDS, SECTIONS[:2], "a model") == ()
    assert outline_images(recording, "another", HOLDS, SECTIONS[:2], "a model") == ()


def test_an_outline_that_was_pressed_flat_has_no_circle(monkeypatch: pytest.MonkeyPatch) -> None:
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = 5e-3 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    monkeypatch.setattr(module, "_outline", lambda *_: ring * [1.0, 0.2])
    assert module._circle(SimpleNamespace(sd=0.0), None) is None  # type: ignore[arg-type]
    monkeypatch.setattr(module, "_outline", lambda *_: ring)
    found = module._circle(SimpleNamespace(sd=1e-5), None)  # type: ignore[arg-type]
    assert found is not None
    assert found.radius == pytest.approx(5e-3)
