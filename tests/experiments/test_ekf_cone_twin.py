"""The cone's twin: its statics against other elements, its machine, its sensors, its files."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from beside import beside, experiment

from validate.arrays import Floats
from validate.errors import RegistrationError, SceneError
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.system import Responses, build
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.reader import digest
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.scene.geometries.specification import Cone, quarter_cone
from validate.scene.mesh_files.mesh_file import read_mesh
from validate.solve.static.newton import StaticNewton

TWIN = beside("ekf_cone", "twin")
CONE: Cone = experiment("ekf_cone").parameters.scene.body

MESH = read_mesh(Path(__file__).resolve().parents[2] / "experiments" / "meshes" / "cone.npz")
COARSE = TWIN.ConeTwin(radial=2, axial=4, loads=4)
QUIET = replace(COARSE, sd_force=0.0, sd_stage=0.0, sd_marker=0.0, missing=0.0)


def made(settings: Any) -> Recording:
    recording: Recording = TWIN.record_cone(CONE, settings, lambda _: None)
    return recording


def table(settings: Any, cone: Cone = CONE) -> Any:
    places = np.array(list(TWIN.marker_places(cone).values()))
    return TWIN.load_table(TWIN.cone_scene(cone, settings), places, settings.force, settings.loads)


@pytest.fixture(scope="module")
def twin() -> Recording:
    return made(COARSE)


@pytest.fixture(scope="module")
def quiet() -> Recording:
    return made(QUIET)


def displacement(recording: Recording, name: str) -> Floats:
    seen = MarkerObservation.placed(recording, MESH)
    j = seen.names.index(name)
    return np.asarray(seen.x[:, j] - seen.rest[j])


def test_a_small_load_meets_another_element() -> None:
    """Linear cells with nodal mean dilatation, twice as fine, compress as far to 2 %.

    Pointwise linear ones, as locked as nu 0.4995 makes them, by a third of it.
    """
    small = replace(COARSE, force=0.15, radial=3)
    ours = float(table(small).at(np.array([0.15]))[0][0])
    scene = TWIN.cone_scene(CONE, small)
    mesh = quarter_cone(CONE.bottom, CONE.top, CONE.height, 6, 8, small.grading)
    linear = replace(scene, body=mesh, material=replace(scene.material, law="linear"))
    softer = replace(linear, dilatation="nodal_mean")
    mean, pointwise = (0.15 / Responses.of(build(s)).reactions[0, 0] for s in (softer, linear))
    assert ours == pytest.approx(mean, rel=0.025)
    assert pointwise < 0.6 * ours


def test_the_cylinder_is_bracketed_by_free_plates_and_gent() -> None:
    """Bonded plates stiffen; Gent's disc, 1 + 2 S^2, is low for a squat cylinder."""
    s, upright = replace(COARSE, force=0.1, radial=3), replace(CONE, top=0.068)
    compression = float(table(s, upright).at(np.array([0.1]))[0][0])
    apparent = 0.1 / (np.pi * 0.034**2) / (compression / CONE.height) / s.material.E
    gent = 1 + 2 * (0.068 / (4 * 0.028)) ** 2
    assert gent < apparent < 1.15 * gent


def test_both_plates_bear_the_force() -> None:
    scene = TWIN.cone_scene(CONE, COARSE)
    stepper = StaticNewton().prepare(build(scene))
    state = stepper.step(stepper.rest(), np.array([1e-3]))
    inner = Body(scene).force(stepper.field(state).ravel()).reshape(-1, 3)
    bottom, top = (4 * inner[scene.mesh.facet_nodes(f), 2].sum() for f in ("bottom", "top"))
    assert bottom == pytest.approx(state.numbers["stage.force"], rel=1e-8)
    assert top == pytest.approx(-bottom, rel=1e-8)
    assert bottom > 10


def test_the_ramps_interpolation_is_finer_than_every_sensor() -> None:
    few, many = table(COARSE), table(replace(COARSE, loads=12))
    at = np.linspace(0.1, 15, 50)
    for one, other in zip(few.at(at), many.at(at), strict=True):
        assert np.abs(one - other).max() < 2e-8
    assert np.array_equal(few.at(np.zeros(1))[1], np.zeros((1, 5, 3)))
    assert few.force[-2] < 15 <= few.force[-1]


def test_the_ramp_is_linear_and_signs_are_positive(quiet: Recording) -> None:
    force, stage = (quiet.signals[k] for k in ("load_cell", "stage"))
    assert force.t == pytest.approx(np.arange(151) / 10)
    assert force.y[:, 0] == pytest.approx(force.t)  # 15 N in 15 s
    assert (force.unit, stage.unit) == ("N", "m")
    assert (np.diff(stage.y[:, 0]) > 0).all()
    a, b, d = (displacement(quiet, f"node_{name}") for name in "ABD")
    assert a[-1] == pytest.approx([0, 0, -1.14e-3], abs=4e-5)  # the plate comes down by 4 %
    assert b[-1, 0] > 5e-4  # the side bulges
    assert d[-1] == pytest.approx(b[-1] * [-1, 1, 1], abs=1e-12)
    assert np.abs(displacement(quiet, "base2")).max() < 1e-12


def test_compliance_and_toe_are_what_the_crosshead_adds(quiet: Recording) -> None:
    """Crosshead less plate, by least squares: the machine's compliance and the seated toe."""
    force, stage = (quiet.signals[k].y[:, 0] for k in ("load_cell", "stage"))
    extra = stage + displacement(quiet, "node_A")[:, 2]
    slope, toe = np.polyfit(force[50:], extra[50:], 1)
    assert 1 / slope == pytest.approx(COARSE.machine, rel=1e-3)
    assert toe == pytest.approx(COARSE.toe, rel=1e-3)
    seated = 1 - (extra - force / COARSE.machine)[5] / COARSE.toe  # at the toe's own force
    assert seated == pytest.approx(np.exp(-1), rel=1e-6)
    assert TWIN.crosshead(COARSE, np.zeros(1), np.zeros(1)) == 0


def test_sensors_read_with_their_declared_noise(twin: Recording, quiet: Recording) -> None:
    for topic, sd in (("load_cell", 0.02), ("stage", 2e-6)):
        assert twin.signals[topic].sd == sd
        noise = twin.signals[topic].y - quiet.signals[topic].y
        assert noise.std() == pytest.approx(sd, rel=0.15)  # 151 samples
    x, exact = twin.markers["markers"].x, quiet.markers["markers"].x
    seen = np.isfinite(x)
    assert (x - exact)[1:][seen[1:]].std() == pytest.approx(2e-5, rel=0.05)  # some 3500 numbers
    unseen = int((~seen[..., 0]).sum())
    assert unseen == pytest.approx(0.03 * 150 * 8, abs=18)  # 36 expected, sd 5.9
    assert seen[0].all()


def test_the_same_seed_gives_the_same_recording_and_says_what_it_is(twin: Recording) -> None:
    assert digest(made(COARSE)) == digest(twin)
    assert digest(made(replace(COARSE, seed=1))) != digest(twin)
    told = twin.record("provenance")
    assert told["kind"] == "twin"
    assert told["same_model"] == "false"
    assert float(told["E_Pa"]) == pytest.approx(2 * 22_081 * 1.4995)
    assert twin.record("specimen")["bottom_diameter_m"] == "0.068"
    assert twin.record("machine")["control"] == "force, linear from 0 to 15 N in 15 s"


def test_it_survives_a_file_and_is_placed_on_the_shipped_mesh(
    tmp_path: Path, twin: Recording
) -> None:
    write_recording(twin, tmp_path / "x.mcap")
    read = read_recording(tmp_path / "x.mcap")
    assert digest(read) == digest(twin)
    seen = MarkerObservation.placed(read, MESH)
    assert seen.positions.outside.max() < 1e-9  # every marker is on a node
    assert seen.positions.weights.max(axis=1).toarray() == pytest.approx(np.ones(8))
    assert float(seen.tre.max()) < 2e-5


def test_markers_turned_by_a_quarter_are_found(twin: Recording) -> None:
    markers = twin.markers["markers"]
    turned = {
        "node_B": "node_C",
        "node_C": "node_D",
        "node_D": "node_E",
        "node_E": "node_B",
        "base1": "base2",
        "base2": "base3",
    }
    names = tuple({**turned, "base3": "base1"}.get(n, n) for n in markers.names)
    spoilt = replace(twin, markers={"markers": replace(markers, names=names)})
    with pytest.raises(RegistrationError, match="permuted"):
        MarkerObservation.placed(spoilt, MESH)


def test_what_cannot_be_reached_is_refused() -> None:
    with pytest.raises(SceneError, match=r"above 0 N, at least 3 loads"):
        table(replace(COARSE, force=0.0))
    with pytest.raises(SceneError, match=r"beyond 0 N of 10000 N.*last good load"):
        table(replace(COARSE, radial=1, axial=2, force=1e4))


@pytest.mark.parametrize(("name", "force"), [("ekf_cone", 15.0), ("ekf_cone_small", 0.15)])
def test_a_shipped_recording_is_small_and_ends_at_its_force(
    project_root: Path, name: str, force: float
) -> None:
    file = project_root / "recordings" / f"{name}.mcap"
    read = read_recording(file)
    assert file.stat().st_size < 500_000
    assert read.signal("load_cell", "N").y[-1, 0] == pytest.approx(force, abs=0.08)


def test_the_papers_load_is_within_the_noise(project_root: Path) -> None:
    """At 0.15 N the plate moves 12.5 um, less than a look's noise; at 15 N, 1.19 mm."""
    for name, plate in (("ekf_cone", 1.19e-3), ("ekf_cone_small", 12.5e-6)):
        recording = read_recording(project_root / "recordings" / f"{name}.mcap")
        moved = -displacement(recording, "node_A")[:, 2]
        ramp = recording.markers["markers"].t / 15
        seen = np.isfinite(moved)
        fit = np.polyfit(ramp[seen], moved[seen], 2)
        assert np.polyval(fit, 1) == pytest.approx(plate, abs=1.5e-5)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_shipped_recording_is_made_again(project_root: Path) -> None:
    read = read_recording(project_root / "recordings" / "ekf_cone.mcap")
    again = made(TWIN.ConeTwin())
    for topic in ("stage", "load_cell"):
        assert again.signals[topic].y == pytest.approx(read.signals[topic].y, abs=1e-9)
    there, here = read.markers["markers"].x, again.markers["markers"].x
    assert here == pytest.approx(there, abs=1e-9, nan_ok=True)
