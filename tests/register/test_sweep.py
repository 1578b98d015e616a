"""From images at 2 mm steps to the inclusion's surface and mesh, against a known shape."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sweeps import LeaningCapsule, sweep_frames

from validate.errors import RecordingError, RegistrationError
from validate.fem.cavity import cavity_surface
from validate.recording.types import Contours
from validate.register.outlines import sweep
from validate.register.outlines.sweep import Stack, stacked, surface_of, sweep_outlines
from validate.scene.geometries.inclusion import Block
from validate.twin.ultrasound import Scanner

# private: _beside, _clearest, _tracked: called alone, case by case.
# private: _end: sections of an exact sphere.

# Image x is the block's z, image y its x, the sweep goes along its y.
POSE = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0.015], [0, 0, 0, 1]])
ROUND = LeaningCapsule((20e-3, 30e-3, 22.5e-3), (8.5e-3, 8.5e-3), 28e-3, (0.1, -0.05))
OVAL = LeaningCapsule((20e-3, 30e-3, 22.5e-3), (9.8e-3, 7.2e-3), 28e-3, (0.1, -0.05))
POSITIONS = np.arange(6e-3, 41e-3, 2e-3)
SCANNER = Scanner(width=200, height=260, m_per_px=2e-4, axial=0.15e-3, lateral=0.3e-3)


def exact(shape: LeaningCapsule) -> Stack:
    """The stack that a faultless segmentation would give."""
    sections = [(z, shape.section(float(z))) for z in POSITIONS]
    seen = [(z, o) for z, o in sections if o is not None]
    at = np.array([z for z, _ in seen])
    radii = shape.cap * shape.scale(at)
    ends = shape.centre[2] + np.array([-1, 1]) * shape.length / 2
    centres = np.array([o.mean(axis=0) for _, o in seen])
    outlines = tuple(o for _, o in seen)
    return Stack(POSE, at, centres, radii, outlines, ends, 0.0, 0.0)


def off_surface(shape: LeaningCapsule, stack: Stack, free: float) -> np.ndarray:
    points = shape.surface(30)
    surface = surface_of(stack, free)
    return surface.distance(points @ POSE[:3, :3].T + POSE[:3, 3])


@pytest.fixture(scope="module")
def stack() -> Stack:
    frames = sweep_frames(OVAL, POSITIONS, SCANNER, POSE, 5)
    return stacked(sweep_outlines(frames), frames.t, POSITIONS)


def drawn(**changes: Any) -> Contours:
    """The faultless outlines of the round one, one a second."""
    stack = exact(ROUND)
    t = np.searchsorted(POSITIONS, stack.positions).astype(float)
    return replace(Contours(t, stack.outlines, 0.0, POSE, "phantom"), **changes)


TIMES = np.arange(len(POSITIONS), dtype=float)


def test_exact_slices_give_the_shape_back() -> None:
    surface = surface_of(exact(ROUND))
    assert surface.volume == pytest.approx(ROUND.volume, rel=0.006)
    assert np.sqrt((off_surface(ROUND, exact(ROUND), 0) ** 2).mean()) < 0.04e-3
    assert surface.radius == pytest.approx(8.5e-3, rel=1e-6)


def test_circles_keep_an_ellipse_volume_but_not_its_surface() -> None:
    circle, free = (surface_of(exact(OVAL), k) for k in (0, 1))
    assert circle.volume == pytest.approx(OVAL.volume, rel=0.006)
    assert free.volume == pytest.approx(OVAL.volume, rel=0.006)
    # Half axes 9.8 and 7.2 mm against a radius of 8.4 mm: 1.4 mm at the vertices.
    assert np.abs(off_surface(OVAL, exact(OVAL), 0)).max() == pytest.approx(1.4e-3, abs=0.15e-3)
    assert np.sqrt((off_surface(OVAL, exact(OVAL), 1) ** 2).mean()) < 0.05e-3


@pytest.mark.slow
def test_a_sweep_of_images_gives_volume_and_surface(stack: Stack) -> None:
    assert stack.ends == pytest.approx([8.5e-3, 36.5e-3], abs=1.0e-3)
    assert stack.sd_ends == pytest.approx(2e-3 / np.sqrt(12))
    free = surface_of(stack, 1)
    assert free.volume == pytest.approx(OVAL.volume, rel=0.05)
    rms = {k: np.sqrt((off_surface(OVAL, stack, free) ** 2).mean())
           for k, free in (("free", 1), ("circle", 0))}  # fmt: skip
    assert rms["free"] < 0.25e-3
    assert rms["circle"] > 2.5 * rms["free"]  # what the circular assumption costs
    middle = np.abs(stack.positions - 22.5e-3) < 5e-3
    leaning = np.polyfit(stack.positions[middle], stack.centres[middle], 1)[0]
    assert leaning == pytest.approx(OVAL.lean, abs=0.03)


def test_the_surface_becomes_a_mesh(stack: Stack) -> None:
    surface = surface_of(stack, 1)
    block = Block(0.060, 0.045, 0.070)
    mesh = block.around((9, 9, 12), surface)
    wall = mesh.nodes[mesh.facet_nodes("cavity")]
    assert np.abs(surface.distance(wall)).max() < 1e-12
    assert mesh.cell_volumes().min() > 0
    hole = cavity_surface(mesh, "cyst", "cavity").volume(mesh.nodes)
    assert mesh.cell_volumes().sum() + hole == pytest.approx(np.prod(block.sizes), rel=1e-11)
    assert 0.8 * OVAL.volume < hole < 1.02 * OVAL.volume


def test_an_inclusion_that_goes_on_beyond_the_sweep_is_refused() -> None:
    seen = drawn()
    last = int(seen.t[-1])
    with pytest.raises(RegistrationError, match="reaches the first or last image"):
        stacked(seen, TIMES[: last + 1], POSITIONS[: last + 1])


@pytest.mark.slow
def test_a_sweep_without_an_inclusion_is_refused() -> None:
    empty = POSITIONS[-3:] + 10e-3
    with pytest.raises(RegistrationError, match="no slice shows an inclusion"):
        sweep_outlines(sweep_frames(ROUND, empty, SCANNER, POSE, 2))


def test_outlines_drawn_along_a_stage_are_stacked_in_their_order() -> None:
    """Downward as upward, with a stage read more often than images are taken."""
    up = stacked(drawn(), TIMES, POSITIONS)
    often = np.linspace(0, TIMES[-1], 171)
    down = stacked(drawn(t=TIMES[-1] - drawn().t[::-1], outlines=drawn().outlines[::-1]),
                   often, np.interp(often, TIMES, POSITIONS[::-1]))  # fmt: skip
    assert down.positions == pytest.approx(up.positions, abs=1e-15)
    assert down.radii == pytest.approx(up.radii, rel=1e-14)
    assert up.radii == pytest.approx(exact(ROUND).radii, rel=3e-4)  # 180 corners
    assert up.centres == pytest.approx(exact(ROUND).centres, abs=1e-12)
    assert up.ends == pytest.approx(exact(ROUND).ends, abs=0.02e-3)
    assert up.off_round == pytest.approx(0.0, abs=2e-6)


def test_what_the_circle_leaves_of_an_ellipse_is_told_by_slice() -> None:
    """Radii R + a cos 2 phi: a / sqrt 2 off the circle, a = (9.8 - 7.2) / 2 mm, at first order."""
    seen = stacked(drawn(outlines=exact(OVAL).outlines), TIMES, POSITIONS)
    middle = np.abs(seen.positions - 22.5e-3) < 5e-3
    assert seen.off_round[middle] == pytest.approx(1.3e-3 / np.sqrt(2), rel=0.03)


def skipped(seen: Contours) -> Contours:
    return replace(seen, t=np.delete(seen.t, 4), outlines=seen.outlines[:4] + seen.outlines[5:])


def moved_aside(seen: Contours) -> Contours:
    aside = (*seen.outlines[:4], seen.outlines[4] + [9e-3, 0.0], *seen.outlines[5:])
    return replace(seen, outlines=aside)


def flat(seen: Contours) -> Contours:
    middle = seen.outlines[4].mean(axis=0)
    thin = middle + (seen.outlines[4] - middle) * [1.6, 0.2]
    return replace(seen, outlines=(*seen.outlines[:4], thin, *seen.outlines[5:]))


def twice(seen: Contours) -> Contours:
    t = np.insert(seen.t, 4, seen.t[4] - 0.01)
    return replace(seen, t=t, outlines=(*seen.outlines[:5], *seen.outlines[4:]))


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (skipped, r"no slice between 16\.00 and 20\.00 mm, and steps of 2\.00 mm otherwise"),
        (moved_aside, r"slices at .* cross: their centres lie 9\.\d\d mm from each other"),
        (flat, r"the slice at 18\.00 mm is not a section of an inclusion"),
        (twice, r"two slices lie at 17\.98 and 18\.00 mm"),
        (lambda s: replace(s, t=s.t[:2], outlines=s.outlines[:2]), "2 slices show the inclusion"),
        (lambda s: replace(s, t=s.t + 40), r"known at 0\.00\.\.17\.00 s;"),
        (lambda s: replace(s, pose=np.diag([1.0, 1, -1, 1])), "mirrors the image"),
    ],
)
def test_slices_that_make_no_inclusion_are_refused_in_one_line(
    spoil: Callable[[Contours], Contours], says: str
) -> None:
    with pytest.raises(RegistrationError, match=says) as caught:
        stacked(spoil(drawn()), TIMES, POSITIONS)
    assert len(str(caught.value).splitlines()) == 1


def test_a_sphere_ends_where_its_sections_say() -> None:
    from validate.register.outlines.sweep import _end

    r = 5e-3
    at = np.array([2.0e-3, 4.0e-3])
    assert _end(at, np.sqrt(r**2 - at**2), 2e-3) == pytest.approx(r, rel=1e-9)
    assert _end(-at, np.sqrt(r**2 - at**2), 2e-3) == pytest.approx(-r, rel=1e-9)
    assert _end(at, np.array([5e-3, 5e-3]), 2e-3) == pytest.approx(7e-3)  # 1.5 steps at most


def test_some_six_images_of_a_sweep_are_looked_at_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every third of eighteen, from the second on; the clearest and largest one is taken."""
    looked: list[int] = []

    def outlined(image: int, *_: object, **__: object) -> SimpleNamespace:
        looked.append(image)
        return SimpleNamespace(contrast=2.0 if image == 7 else 1.0, radius=1.0)

    monkeypatch.setattr(sweep, "extract_outline", outlined)
    frames = SimpleNamespace(images=range(18), m_per_px=(1e-4, 1e-4))
    first, _ = sweep._clearest(frames, None, None, False)
    assert looked == [1, 4, 7, 10, 13, 16]
    assert first == 7


def test_a_neighbour_is_looked_for_in_three_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    """An inclusion that narrows: the wall is found with a smaller rough radius, or not at all."""
    asked: list[float] = []

    def outlined(image: int, m_per_px: object, *, radius: float, **_: object) -> SimpleNamespace:
        asked.append(radius)
        if radius > finds * 1.01:
            raise RecordingError("nothing")
        return SimpleNamespace(centre=np.zeros(2), radius=radius)

    monkeypatch.setattr(sweep, "extract_outline", outlined)
    frames = SimpleNamespace(images=range(3), m_per_px=(1e-4, 1e-4))
    near = SimpleNamespace(centre=np.zeros(2), radius=1.0)
    finds = 0.45
    assert sweep._beside(frames, 1, near, False).radius == 0.45
    assert asked == [1.0, 0.7, 0.45]
    finds = 0.1
    assert sweep._beside(frames, 1, near, False) is None


def test_a_sweep_without_an_outline_says_why_of_the_last(monkeypatch: pytest.MonkeyPatch) -> None:
    def outlined(image: int, *_: object, **__: object) -> None:
        raise RecordingError(f"image {image} shows no wall")

    monkeypatch.setattr(sweep, "extract_outline", outlined)
    frames = SimpleNamespace(images=range(12), m_per_px=(1e-4, 1e-4))
    with pytest.raises(RegistrationError, match="the last one: image 11 shows no wall"):
        sweep._clearest(frames, None, None, False)


def test_outlines_are_followed_to_both_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Images 2 to 8 of ten show the wall; one that jumps aside ends the way like one without."""

    def outlined(image: int, m_per_px: object, *, centre: object, **_: object) -> SimpleNamespace:
        if image < 2:
            raise RecordingError("nothing")
        aside = 3.0 if image > 8 else 0.0
        return SimpleNamespace(centre=np.array([aside, 0.0]), radius=1.0, contrast=1.0, at=image)

    monkeypatch.setattr(sweep, "extract_outline", outlined)
    frames = SimpleNamespace(images=range(10), m_per_px=(1e-4, 1e-4))
    found = sweep._tracked(frames, None, None, False)
    assert {i: o.at for i, o in found.items()} == {i: i for i in range(2, 9)}
    every = SimpleNamespace(images=range(2, 9), m_per_px=(1e-4, 1e-4))
    assert sorted(sweep._tracked(every, None, None, False)) == list(range(7))
