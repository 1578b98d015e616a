"""The tracker: what it sees can be placed again; noise, gaps and refusals are as declared."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import RecordingError, RegistrationError, UsageError
from validate.fem.system import build
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Drive, Probe, Scene, Support
from validate.solve.fluid.cavities import NoFluid
from validate.solve.march import march
from validate.solve.types import Outcome
from validate.twin.tracker import Camera, Origin, Points, Reading, points_of, require_noise

MESH = box((0.1, 0.1, 0.1), (3, 3, 3))
SIDE = 0.1
FIXED = {
    f"base{i}": np.array([x, y, 0.0])
    for i, (x, y) in enumerate(((0.0, 0.0), (SIDE, 0.0), (SIDE, SIDE), (0.0, SIDE)))
}
REST = np.array([[0.0, 0.05, 0.05], [0.05, 0.05, 0.1]])
ORIGIN = Origin("cube", 7, True, {"element": "P1"})
FORCE = "force"


def points(nt: int = 400) -> Points:
    t = np.arange(1.0, nt + 1) * 0.001
    u = np.zeros((nt, 2, 3))
    u[:, 0, 0] = 4e-3 * t / t[-1]
    u[:, 1, 2] = -1e-3 * np.sin(9 * t)
    return Points(t, ("A", "B"), REST, u)


def made(camera: Camera, at: Points | None = None) -> Recording:
    at = at or points()
    return ORIGIN.record(at, FIXED, camera, {FORCE: Reading(at.t / 0.8, "N", 0.01)})


def displacement(recording: Recording, name: str) -> Floats:
    seen = MarkerObservation.placed(recording, MESH)
    j = seen.names.index(name)
    return np.asarray(seen.x[:, j] - seen.rest[j])


def test_an_exact_camera_gives_back_the_displacements() -> None:
    at, recording = points(), made(Camera(0.0, every=5))
    seen = MarkerObservation.placed(recording, MESH)
    assert seen.t == pytest.approx(np.arange(81) * 0.005)
    assert recording.markers["markers"].frame == "camera"
    assert np.abs(recording.markers["markers"].x[0] - seen.rest).max() > 0.1  # a frame of its own
    for j, name in enumerate(("A", "B")):
        told = np.vstack([np.zeros(3), at.u[4::5, j]])
        assert displacement(recording, name) == pytest.approx(told, abs=1e-15)
    assert np.abs(seen.positions.outside).max() < 1e-12


def test_fiducials_do_not_move_and_up_is_the_scenes_z() -> None:
    recording = made(Camera(0.0))
    x = recording.markers["markers"].x
    assert np.ptp(x[:, 2:], axis=0).max() == 0
    up = np.array([float(v) for v in recording.record("camera")["up"].split()])
    rise = x[:, 1] - x[0, 1]
    assert rise[200] @ up == pytest.approx(points().u[199, 1, 2], rel=1e-9)


def test_noise_is_as_declared_and_the_still_first_sample_ten_times_quieter() -> None:
    quiet, noisy = (made(Camera(sd)).markers["markers"] for sd in (0.0, 2e-5))
    noise = noisy.x - quiet.x
    assert noisy.sd == 2e-5
    assert noise[1:].std() == pytest.approx(2e-5, rel=0.03)  # 7200 numbers
    still = np.concatenate([_first_noise(seed) for seed in range(40)])
    assert still.std() == pytest.approx(2e-6, rel=0.1)  # 720 numbers
    force = made(Camera(0.0)).signals[FORCE]
    assert force.sd == 0.01
    assert (force.y[1:, 0] - points().t / 0.8).std() == pytest.approx(0.01, rel=0.1)


def _first_noise(seed: int) -> Floats:
    told = replace(ORIGIN, seed=seed).record(points(3), FIXED, Camera(2e-5), {})
    exact = replace(ORIGIN, seed=seed).record(points(3), FIXED, Camera(0.0), {})
    noise = told.markers["markers"].x[0] - exact.markers["markers"].x[0]
    return np.asarray(noise.ravel())


def test_missing_looks_are_counted_and_never_the_first() -> None:
    seen = np.isfinite(made(Camera(1e-5, missing=0.1)).markers["markers"].x)
    assert seen[0].all()
    assert (seen.all(axis=2) == seen.any(axis=2)).all()  # a point is unseen as a whole
    assert 1 - seen[1:].mean() == pytest.approx(0.1, abs=0.02)  # 2400 looks
    assert MarkerObservation.placed(made(Camera(1e-5, missing=0.1)), MESH).x.shape == (401, 6, 3)


def test_streams_are_apart_and_seeded() -> None:
    one, other = made(Camera(1e-5)), made(Camera(1e-5, missing=0.3))
    assert np.array_equal(one.signals[FORCE].y, other.signals[FORCE].y)
    seen = np.isfinite(other.markers["markers"].x)
    assert np.array_equal(one.markers["markers"].x[seen], other.markers["markers"].x[seen])
    again = replace(ORIGIN, seed=8).record(points(), FIXED, Camera(1e-5), {})
    assert not np.array_equal(again.markers["markers"].x, one.markers["markers"].x)


def test_a_registration_is_as_good_as_the_still_looks() -> None:
    """Fitted on 100 looks, A's error from registration is a tenth of a look's noise."""
    seen = MarkerObservation.placed(made(Camera(2e-5)), MESH)
    assert float(seen.tre.max()) < 1e-5
    truth = np.vstack([np.zeros(3), points().u[:, 0]])
    error = displacement(made(Camera(2e-5)), "A") - truth
    assert np.abs(error.mean(axis=0)).max() < 6e-6
    assert error[1:].std() == pytest.approx(2e-5, rel=0.1)


def test_rest_in_front_is_not_doubled_and_must_be_rest() -> None:
    at = points()
    begun = replace(at, t=np.concatenate([[0.0], at.t]), u=np.vstack([np.zeros((1, 2, 3)), at.u]))
    exact = Camera(0.0)
    same = made(exact, begun).markers["markers"].x
    assert np.array_equal(same, made(exact).markers["markers"].x)
    with pytest.raises(RecordingError, match=r"4 mm away from their.*0"):
        made(exact, replace(begun, u=begun.u[::-1]))


def test_it_survives_a_file(tmp_path: Path) -> None:
    recording = made(Camera(2e-5, every=10, missing=0.05))
    write_recording(recording, tmp_path / "x.mcap")
    read = read_recording(tmp_path / "x.mcap")
    mine, theirs = recording.markers["markers"], read.markers["markers"]
    assert np.array_equal(mine.x, theirs.x, equal_nan=True)
    assert mine.names == theirs.names
    assert read.record("provenance")["same_model"] == "true"
    assert read.record("provenance")["element"] == "P1"
    assert MarkerObservation.placed(read, MESH).x == pytest.approx(
        MarkerObservation.placed(recording, MESH).x, nan_ok=True
    )


def test_a_run_with_probes_becomes_points() -> None:
    scene = Scene(
        MESH,
        Material(3e4, 0.3),
        (Support("z0", (0, 1, 2)),),
        drives=(Drive("press", "z1", (0.0, 0.0, -1.0)),),
        probes=(Probe("top", (0.05, 0.05, 0.1)), Probe("low", (0.05, 0.05, 0.0))),
    )
    t = np.array([0.1, 0.2, 0.3])
    run = march("x", NoFluid().prepare(build(scene)), t, 1e-3 * t[:, None], np.array([2]), 0.0)
    at = points_of(run, scene)
    assert at.names == ("top", "low")
    assert at.u[:, 0, 2] == pytest.approx(-1e-3 * t)
    assert np.abs(at.u[:, 1]).max() == 0
    with pytest.raises(RecordingError, match="is diverged after 3 steps with 2 probes"):
        points_of(replace(run, outcome=Outcome("diverged", 1)), scene)


def test_a_planar_set_is_placed_by_its_up() -> None:
    flat = {
        f"base{i}": p for i, p in enumerate(np.array([[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.06]]))
    }
    flat = {k: np.array([*p, 0.1]) for k, p in flat.items()}
    at = replace(points(), names=("B",), rest=REST[1:], u=points().u[:, 1:])
    recording = ORIGIN.record(at, flat, Camera(0.0), {})
    seen = MarkerObservation.placed(recording, MESH)
    assert seen.x[200, 0] - seen.rest[0] == pytest.approx(at.u[199, 0], abs=1e-14)
    down = {"up": " ".join(str(-float(v)) for v in recording.record("camera")["up"].split())}
    with pytest.raises(RegistrationError, match="mirrored"):
        MarkerObservation.placed(
            replace(recording, metadata={**recording.metadata, "camera": down}), MESH
        )


@pytest.mark.parametrize(
    "settings", [{"sd": -1.0}, {"every": 0}, {"missing": 1.0}, {"still": 0}, {"sd": float("nan")}]
)
def test_settings_that_mean_nothing_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(RecordingError, match="camera with"):
        Camera(**{"sd": 1e-5, **settings})  # type: ignore[arg-type]


def test_clashes_and_wrong_lengths_are_refused() -> None:
    with pytest.raises(RecordingError, match=r"\['A'\] are both"):
        ORIGIN.record(points(), {"A": REST[0]}, Camera(0.0), {})
    with pytest.raises(RecordingError, match=r"'force': shape \(3,\), expected \(400\)"):
        ORIGIN.record(points(), FIXED, Camera(0.0), {FORCE: Reading(np.zeros(3), "N")})


def test_records_that_are_no_vectors_are_refused() -> None:
    recording = made(Camera(0.0))
    spoilt = {**recording.metadata, "camera": {"up": "0 1"}}
    with pytest.raises(RegistrationError, match="'up' is '0 1': expected"):
        MarkerObservation.placed(replace(recording, metadata=spoilt), MESH)


def test_mistaken_looks_are_as_many_and_as_far_off_as_declared() -> None:
    """In any direction, never at the first look; noise and gaps stay what they were."""
    right, odd = made(Camera(1e-5)), made(Camera(1e-5, outliers=0.1, astray=2e-3))
    off = np.linalg.norm(odd.markers["markers"].x - right.markers["markers"].x, axis=2)
    assert off[0].max() == 0.0
    assert off[off > 0] == pytest.approx(2e-3)
    assert (off[1:] > 0).mean() == pytest.approx(0.1, abs=0.02)


def test_a_late_look_sees_the_motion_of_its_own_time_and_says_how_sure_it_is() -> None:
    """A moves by 10 mm/s along x: looks 2 ms off (sd) show it 20 um off; its clock's record says
    so. What stands still shows nothing of it."""
    exact, late = made(Camera(0.0)), made(Camera(0.0, late=2e-3))
    off = displacement(late, "A") - displacement(exact, "A")
    assert off[20:-20, 0].std() == pytest.approx(2e-5, rel=0.15)
    assert np.abs(off[:, 1:]).max() < 1e-12
    assert np.abs(late.markers["markers"].x[:, 2:] - exact.markers["markers"].x[:, 2:]).max() == 0
    assert MarkerObservation.placed(late, MESH).sd_t == 2e-3
    assert MarkerObservation.placed(exact, MESH).sd_t == 0.0


@pytest.mark.parametrize("wrong", [{"outliers": 1.0}, {"astray": 0.0}, {"late": -1.0}])
def test_a_careless_camera_has_its_limits(wrong: dict[str, float]) -> None:
    with pytest.raises(RecordingError, match="0 <= outliers < 1, astray > 0, late >= 0"):
        Camera(1e-5, **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("variance", [0.0, -1e-9, float("nan")])
def test_a_tracker_without_noise_is_refused(variance: float) -> None:
    with pytest.raises(
        UsageError,
        match=rf"{variance:g} m2: .* without noise use 1e-16",
    ):
        require_noise(variance)
