"""Twins: seeded, the same on every machine, noise as declared, files beside what must be read."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from beside import experiment

from experiments.fluid_phantom.sensors import StageProfile
from experiments.fluid_phantom.twin import IMAGE_POSE, PhantomTwin, record_phantom
from validate.arrays import Floats
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording
from validate.twin.sensors import streams

COARSE = PhantomTwin(nodes_x=7, nodes_y=8, nodes_z=11)
DECLARED = experiment("fluid_phantom").parameters.scene


def made(settings: PhantomTwin = COARSE) -> Recording:
    return record_phantom(settings, DECLARED, lambda _: None)


@pytest.fixture(scope="module")
def twin() -> Recording:
    return made()


def apart(one: Sequence[Floats], other: Sequence[Floats]) -> float:
    """Largest absolute difference between arrays, NaN in the same places."""
    pairs = list(zip(one, other, strict=True))
    assert all(a.shape == b.shape and (np.isnan(a) == np.isnan(b)).all() for a, b in pairs)
    return max(float(np.nanmax(np.abs(a - b))) for a, b in pairs)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes(tmp_path: Path, twin: Recording) -> None:
    write_recording(twin, tmp_path / "a.mcap")
    write_recording(made(), tmp_path / "b.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    other = made(replace(COARSE, seed=1))
    assert not np.array_equal(other.markers["markers"].x, twin.markers["markers"].x)


@pytest.mark.slow
def test_sensors_read_the_simulation_with_their_declared_noise(twin: Recording) -> None:
    quiet = made(replace(COARSE, sd_outline=0.0, sd_tip=0.0, sd_hand=0.0, sd_force=0.0,
                         sd_pressure=0.0, sd_stage=0.0))  # fmt: skip
    for topic, sd in (("load_cell", 0.02), ("pressure", 10.0), ("stage", 2e-6)):
        noise = twin.signals[topic].y - quiet.signals[topic].y
        assert twin.signals[topic].sd == sd
        assert noise.std() == pytest.approx(sd, rel=0.12)  # 371 samples
    hand = twin.markers["markers"].x - quiet.markers["markers"].x
    assert hand.std() == pytest.approx(np.hypot(0.2e-3, 0.577e-3), rel=0.1)  # 504 numbers
    radius = np.linalg.norm(quiet.contours["outline"].outlines[0] - [0.0206, 0.0284], axis=1)
    assert radius == pytest.approx(np.full(72, 0.0085), abs=2e-5)  # wall samples of a coarse mesh
    noisy = np.linalg.norm(twin.contours["outline"].outlines[0] - [0.0206, 0.0284], axis=1)
    assert (noisy - radius).std() == pytest.approx(0.15e-3, rel=0.3)


def test_the_sweep_shows_sections_of_the_inclusion_at_rest(twin: Recording) -> None:
    """Images at 2 mm steps from 17 mm below the outline's plane on; 14 of 18 meet the capsule."""
    sweep, position = twin.contours["sweep"], twin.signals["sweep_position"]
    at = np.interp(sweep.t, position.t, position.y[:, 0])
    assert at == pytest.approx(1e-3 * np.arange(-13, 14, 2), abs=1e-5)
    assert sweep.t[-1] < 7.0  # the stage rests for 7 s
    over = np.maximum(np.abs(at) - 5.5e-3, 0)
    radii = [np.linalg.norm(o - [0.0206, 0.0284], axis=1).mean() for o in sweep.outlines]
    assert radii == pytest.approx(np.sqrt(8.5e-3**2 - over**2), abs=0.25e-3)  # of a coarse wall


def test_signs_compression_and_closing_are_positive(twin: Recording) -> None:
    stage, force, pressure = (twin.signals[k].y[-1, 0] for k in ("stage", "load_cell", "pressure"))
    assert stage == pytest.approx(0.009, abs=1e-5)
    assert force > 5
    assert pressure > 800


def test_the_pen_has_a_frame_of_its_own_and_markers_rise(twin: Recording) -> None:
    up = np.array([float(v) for v in twin.record("pen")["up"].split()])
    assert np.linalg.norm(up) == pytest.approx(1.0)
    rise = (twin.markers["markers"].x[3] - twin.markers["markers"].x[0]) @ up
    assert rise.mean() == pytest.approx(3.3e-3, rel=0.1)  # nu x strain x height


def test_the_image_pose_is_a_proper_rotation() -> None:
    R = IMAGE_POSE[:3, :3]
    assert np.array_equal(R.T @ R, np.eye(3))
    assert np.linalg.det(R) == 1.0


def test_the_profile_holds_at_every_load() -> None:
    t, q, middles = StageProfile((0.0, 0.003, 0.009), speed=1e-3, hold=2.0, rate=10.0).positions()
    assert np.interp(middles, t, q) == pytest.approx([0.0, 0.003, 0.009])
    assert t[-1] == pytest.approx(2 + 3 + 2 + 6 + 2)
    assert np.abs(np.diff(q)).max() == pytest.approx(1e-4)


def test_every_sensor_has_a_stream_of_its_own() -> None:
    one, two = streams(3, ("a", "b")), streams(3, ("a", "c"))
    assert one["a"].standard_normal() == two["a"].standard_normal()
    assert one["b"].standard_normal() != one["a"].standard_normal()


@pytest.mark.slow
def test_the_shipped_recording_is_made_again_to_1e_9(project_root: Path) -> None:
    shipped = read_recording(project_root / "recordings" / "fluid_phantom.mcap")
    again = made(PhantomTwin())
    scale = {"stage": 1e-2, "sweep_position": 1e-2, "load_cell": 7.0, "pressure": 1e3}
    for topic, size in scale.items():
        one, other = again.signals[topic], shipped.signals[topic]
        assert apart((one.t, one.y), (other.t, other.y)) < 1e-9 * size
    one, other = again.markers["markers"], shipped.markers["markers"]
    assert one.names == other.names
    assert apart((one.t, one.x), (other.t, other.x)) < 1e-9
    for topic in ("outline", "sweep"):
        drawn, found = again.contours[topic], shipped.contours[topic]
        assert apart((drawn.t, *drawn.outlines), (found.t, *found.outlines)) < 1e-9
    assert again.record("marker_layout") == shipped.record("marker_layout")
