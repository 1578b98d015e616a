"""Standard deviations of drives in u_input: linear problems, where dF/du is known, and markers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_measured_body import (
    BASE,
    FREE,
    PLACES,
    SIZE,
    E,
    T,
    experiment,
    log,
    recording,
    stretched,
)

from validate.compare.verdict import Accept
from validate.pipeline import run_in_memory
from validate.pipeline.bodies.choices import BodyRanges, SeenOf
from validate.pipeline.checks.checks import drive_inputs
from validate.recording.types import Markers, Signal
from validate.register.observation import Selection
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Prescribed, Scene, Support

SD = 2e-5
STIFFNESS = E * SIZE[0] * SIZE[1] / SIZE[2]
SURE = BodyRanges(E=1e-9, nu=1e-9, load=1e-9)


def noisy(sd: float) -> dict[str, Signal]:
    signals = log()
    return {**signals, "displacement": replace(signals["displacement"], sd=sd)}


def test_the_sd_of_a_displacement_is_sd_times_stiffness(tmp_path: Path) -> None:
    """u_input = sd dF/du, and the mean of the samples at rest, from which it is counted."""
    p = BASE.with_settings(ranges=SURE)
    result = run_in_memory(experiment(tmp_path, p, recording(signals=noisy(SD)), "force"))
    zeroed = SD * np.sqrt(1 + 1 / int((p.settings.seen.still >= T).sum()))
    assert [i.name for i in result.inputs][-1] == "sd of displacement"
    assert result.inputs[-1].source == "recorded"
    for check in result.checks:
        assert check.u_input == pytest.approx(STIFFNESS * zeroed, rel=1e-3)
    joint = {j.name: j for j in result.joint}
    assert joint["force@high"].first_order == pytest.approx(STIFFNESS * zeroed, rel=1e-3)
    assert joint["force@high"].sampled == pytest.approx(STIFFNESS * zeroed, rel=0.1)


def test_a_drive_without_one_has_no_input(tmp_path: Path) -> None:
    still = {n: replace(s, y=s.y.round(3)) for n, s in noisy(0.0).items()}
    result = run_in_memory(
        experiment(tmp_path, BASE, recording(signals=still), "force"), quick=True
    )
    names = [i.name for i in result.inputs]
    sd = result.methods[0].registered[0].drives[0].sd
    assert ("sd of displacement" in names) == (sd > 0)


def test_a_force_that_pulls(tmp_path: Path) -> None:
    """A marker's way is that of the force over the stiffness, so is its uncertainty."""
    signals = log()
    pull = replace(signals["force"], sd=0.05)
    x = np.array(list(PLACES.values()))
    share = np.clip((T - 0.5) / 3.0, 0, 1)[:, None, None]
    seen = Markers(T, tuple(PLACES), x + share * stretched(x), 1e-6, "body")
    p = FREE.with_scene(loads=(Load("force", "zmax", "-z"),))
    p = p.with_settings(seen=SeenOf(markers="m", states=9, still=0.4), ranges=SURE)
    result = run_in_memory(
        experiment(tmp_path, p, recording(signals={"force": pull}, markers={"m": seen}), "marker")
    )
    assert [i.name for i in result.inputs][-1] == "sd of force"
    drive = result.methods[0].registered[0].drives[0]
    top = next(c for c in result.checks if c.name == "marker.max@high")
    # Marker A, at the top corner, moves most: down by the force over the stiffness, and aside.
    aside = 0.3 * np.array([SIZE[0], SIZE[1]]) / SIZE[2]
    most = np.sqrt(1 + (aside**2).sum()) * drive.sd / STIFFNESS
    assert top.u_input == pytest.approx(most, rel=0.01)


# --- tracked points -------------------------------------------------------------------------------

POINTS = tuple(
    (n, (x, y, 0.01))
    for n, x, y in (("a", 0.0, 0.0), ("b", 0.01, 0.0), ("c", 0.01, 0.01), ("d", 0.0, 0.01))
)


def tracked() -> Scene:
    follower = Prescribed("lid", "z1", POINTS)
    return Scene(box((0.01,) * 3, (1, 1, 1)), Material(1e4, 0.0), (Support("z0", (0, 1, 2)),),
                 tracked=(follower,))  # fmt: skip


def seen(scene: Scene, sd: float) -> Registered:
    t = np.arange(4.0)
    y = np.zeros((4, len(scene.inputs)))
    return Registered((SignalObservation("markers", "drives", t, y, "m", sd),))


def test_a_rigid_set_has_one_input_a_motion_and_the_covariance_of_its_fit() -> None:
    """Of n points with noise sd the middle has sd / sqrt(n) in every direction."""
    scene = tracked()
    inputs = drive_inputs(scene, seen(scene, SD))
    assert [i.name for i in inputs] == [f"sd of markers, {k} of 6" for k in range(1, 7)]
    follower = scene.tracked[0]
    middle = follower.columns(np.array([[0.005, 0.005, 0.01]]))
    square = sum(np.square(middle @ np.array(i.off)) for i in inputs)
    assert np.sqrt(square) == pytest.approx(SD / np.sqrt(len(POINTS)), rel=1e-9)


def test_markers_that_move_a_body(tmp_path: Path) -> None:
    """A bar between rollers that four markers pull along z: the force is none, a marker in the
    middle moves half as far as the mean of the four."""
    corners = {f"c{i}": (x, y, 0.05) for i, (x, y) in enumerate(
        [(0.0, 0.0), (0.04, 0.0), (0.04, 0.03), (0.0, 0.03)]
    )}  # fmt: skip
    places = {**corners, "side": (0.04, 0.015, 0.025)}
    x = np.array(list(places.values()))
    share = np.clip((T - 0.5) / 3.0, 0, 1)[:, None, None]
    u = np.array([0.0, 0.0, 1.0]) * -0.001 / SIZE[2] * x
    rng = np.random.default_rng(3)
    markers = Markers(T, tuple(places), x + share * u + rng.normal(0, SD, (len(T), *x.shape)), SD,
                      "body")  # fmt: skip
    p = FREE.with_scene(
        material=Material(E, 0.0), supports=(Support("zmin"),),
        tracked=(Prescribed("moved", "zmax", labels=tuple(corners)),),
    ).with_settings(seen=SeenOf(markers="m", states=6, still=0.4), ranges=SURE)  # fmt: skip
    made = experiment(tmp_path, p, recording(markers={"m": markers}), "marker")
    result = run_in_memory(replace(made, accept=(Accept("marker", 1e-4, "of a test"),)))
    drive = result.methods[0].registered[0].drives[0]
    assert sum(i.name.startswith("sd of moved") for i in result.inputs) == 6
    least = 0.5 * drive.sd / np.sqrt(len(corners))
    for check in result.checks:
        assert 0.9 * least < check.u_input < 4 * least


def test_at_rest_nothing_is_off() -> None:
    scene = tracked()
    one = seen(scene, SD)
    rested = replace(one, rest=Selection("rest", one.t[:1]))
    off = tuple(np.arange(1.0, 13.0).tolist())
    assert rested.shifted(off).inputs[0].tolist() == [0.0] * 12
    assert rested.shifted(off).inputs[1].tolist() == list(off)
    assert one.shifted(off).inputs[0].tolist() == list(off)
