"""The phantom meshed from its recorded sweep: where it lies, how large, and what is refused."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from beside import experiment
from sweeps import LeaningCapsule, sweep_frames

from experiments.fluid_phantom.effects import INPUTS
from experiments.fluid_phantom.phantom import place, read
from validate.errors import UsageError, ValidateError
from validate.fem.cavity import cavity_surface
from validate.parameters import with_given
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.plates.inclusion import (
    POSITION,
    SWEEP,
    MeshedInclusion,
    inclusion,
    swept,
)
from validate.recording.mcap.read import read_recording
from validate.recording.types import Contours, Recording
from validate.register.outlines.sweep import stacked
from validate.scene.geometries.inclusion import Capsule
from validate.twin.ultrasound import Scanner

DECLARED: Tree = experiment("fluid_phantom").parameters
SWEPT = with_given(DECLARED, {"body.inclusion.shape": "sweep"})
build = Built()
TRUE = Capsule((0.0284, 0.0225, 0.0356), 0.0085, 0.028)
ROUNDER = next(i for i in INPUTS if i.name == "circular sections")


@pytest.fixture(scope="module")
def recorded(project_root: Path) -> Recording:
    return read_recording(project_root / "recordings" / "fluid_phantom.mcap")


def with_sweep(recording: Recording, change: Callable[[Contours], Contours]) -> Recording:
    sweep = change(recording.contour(SWEEP))
    return replace(recording, contours={**recording.contours, SWEEP: sweep})


def test_the_swept_inclusion_is_the_true_one_within_the_outlines_noise(recorded: Recording) -> None:
    found = inclusion(recorded, SWEPT)
    assert found.volume == pytest.approx(TRUE.volume, rel=0.01)
    assert found.radius == pytest.approx(TRUE.radius, abs=0.05e-3)
    assert found.centre == pytest.approx(TRUE.centre, abs=0.2e-3)
    assert found.reach[1] == pytest.approx(0.014, abs=0.2e-3)


def test_its_mesh_holds_the_cavity_and_the_wall_is_the_sweeps(recorded: Recording) -> None:
    mesh = build(recorded, SWEPT).mesh
    wall = mesh.nodes[mesh.facet_nodes("cavity")]
    assert np.abs(inclusion(recorded, SWEPT).distance(wall)).max() < 1e-12
    hole = cavity_surface(mesh, "cyst", "cavity").volume(mesh.nodes)
    assert hole == pytest.approx(TRUE.volume, rel=0.2)  # facets of the nominal mesh cut corners


def test_the_circular_assumption_is_an_input_of_the_sweep_alone(recorded: Recording) -> None:
    """Of an oval inclusion one standard uncertainty is all of its difference from circles."""
    assert ROUNDER.source.startswith("measured")
    assert ROUNDER.by(1.0)(DECLARED) == DECLARED
    oval = with_sweep(recorded, lambda s: replace(s, outlines=tuple(
        o.mean(axis=0) + (o - o.mean(axis=0)) * [1.1, 1 / 1.1] for o in s.outlines
    )))  # fmt: skip
    circle, free = (inclusion(oval, p) for p in (SWEPT, ROUNDER.by(1.0)(SWEPT)))
    assert circle.reach[[2, 0]] == pytest.approx([0.0085, 0.0085], abs=0.1e-3)
    assert free.reach[[2, 0]] == pytest.approx([1.1 * 0.0085, 0.0085 / 1.1], abs=0.15e-3)
    assert free.volume == pytest.approx(circle.volume, rel=1e-3)


def test_the_report_says_what_the_circles_leave(recorded: Recording) -> None:
    said = place(recorded, SWEPT, build(recorded, SWEPT)).findings
    assert len(said) == 1
    assert "14 slices of a sweep: their outlines lie 0.147 mm rms off circles" in said[0]
    moved = with_given(SWEPT, {"body.inclusion.wider": 0.001})
    said = place(recorded, moved, build(recorded, moved)).findings
    assert "radius +1.00 mm off" in said[1]


def test_wider_and_longer_never_pass_the_outermost_slices(recorded: Recording) -> None:
    position = recorded.signal(POSITION, "m")
    stack = stacked(recorded.contour(SWEEP), position.t, position.y[:, 0])
    assert np.diff(swept(stack, longer=1e-3).ends) == pytest.approx(np.diff(stack.ends) + 1e-3)
    short = swept(stack, longer=-5e-3).ends
    assert short[0] < stack.positions[0] < stack.positions[-1] < short[1]


def beside(s: Contours) -> Contours:
    return replace(s, outlines=tuple(o + [0.030, 0.0] for o in s.outlines))


def lost(s: Contours) -> Contours:
    keep = [i for i in range(len(s.t)) if i != 6]
    return replace(s, t=s.t[keep], outlines=tuple(s.outlines[i] for i in keep))


SPOILED = (
    (lambda r: replace(r, contours={"outline": r.contour("outline")}), "no outlines 'sweep'"),
    (lambda r: replace(r, signals={k: s for k, s in r.signals.items() if k != POSITION}),
     "no signal 'sweep_position'"),
    (lambda r: with_sweep(r, beside), "beyond or touches the face z = max of the block"),
    (lambda r: with_sweep(r, lost), r"no slice between -3\.00 and 1\.00 mm"),
    (lambda r: replace(r, signals={**r.signals, "stage": replace(
        r.signals["stage"], t=r.signals["stage"].t - 6.0)}), "away from rest during the sweep"),
)  # fmt: skip


@pytest.mark.parametrize(("spoil", "says"), SPOILED)
def test_sweeps_that_mean_nothing_are_refused_in_one_line(
    recorded: Recording, spoil: Callable[[Recording], Recording], says: str
) -> None:
    with pytest.raises(ValidateError, match=says) as caught:
        build(spoil(recorded), SWEPT)
    assert len(str(caught.value).splitlines()) == 1


def test_what_is_set_of_a_capsule_is_no_setting_of_a_sweep() -> None:
    with pytest.raises(UsageError, match=r"inclusion\.radius applies to a capsule"):
        MeshedInclusion(shape="sweep", radius=0.008)


@pytest.mark.slow
def test_images_of_a_sweep_are_outlined_when_they_are_read(recorded: Recording) -> None:
    at = recorded.signal(POSITION, "m")
    shape = LeaningCapsule((0.0206, 0.0284, 0.0), (0.0085, 0.0085), 0.028)
    scanner = Scanner(width=200, height=260, m_per_px=2e-4, axial=0.15e-3, lateral=0.3e-3)
    images = sweep_frames(shape, at.y[:, 0], scanner, recorded.contour(SWEEP).pose, 3)
    contours = {"outline": recorded.contour("outline")}
    seen = read(
        replace(recorded, contours=contours, frames={SWEEP: replace(images, t=at.t)}), SWEPT
    )
    assert not seen.frames
    found = inclusion(seen, SWEPT)
    assert found.centre == pytest.approx(TRUE.centre, abs=0.6e-3)
    assert found.volume == pytest.approx(TRUE.volume, rel=0.06)


def test_a_recording_of_outlines_is_read_as_it_is(recorded: Recording) -> None:
    assert read(recorded, SWEPT) is recorded
