"""The scene of a drawn body, and its still pictures: what stands where, and that it is shown."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import report_samples
from report_samples import small_result
from tracking_samples import tracking_result

from validate.compare.exhibit import NodeMap
from validate.compare.result import Result
from validate.fem.assembly.locate import Rows, nearest_node_rows
from validate.register.markers.displacements import DisplacementObservation
from validate.register.markers.markers import MarkerObservation
from validate.report.scenes import bodies, gl
from validate.report.scenes.body import camera
from validate.report.scenes.body_scene import BodyScene, _particles, body_scene, fields
from validate.report.scenes.maps import drawn

# private: _KNOWN: a cache, emptied.
# private: _particles: called alone, case by case.


def cube() -> BodyScene:
    found = body_scene(small_result(), 4)
    assert found is not None
    return found


def scaled(result: Result, by: float) -> Result:
    """The displacements of the first method so many times as large."""
    first, *others = result.methods
    runs = tuple(replace(run, u=by * run.u) for run in first.runs)
    return replace(result, methods=(replace(first, runs=runs), *others))


def test_the_body_at_its_loads() -> None:
    found = cube()
    assert found.labels == ("0 mm", "2 mm")
    assert found.worst == 1
    assert np.abs(found.methods[0].u()[1]).max() == pytest.approx(2.0)  # mm
    assert found.cut is None
    moves = sorted(float(tool.shifts[1, 0]) for tool in found.tools)
    assert moves == pytest.approx([-2.0, 0.0])
    assert [np.ptp(t.nodes[:, 1]) for t in found.tools] == pytest.approx([22.4, 22.4])


def test_plates_lie_outside() -> None:
    centres = sorted(float(t.nodes[:, 0].mean()) for t in cube().tools)
    assert centres[0] < 0
    assert centres[1] > 20


def test_the_largest_displacement_is_among_few_instants() -> None:
    result = tracking_result()
    u = np.abs(result.methods[0].run.u).max(axis=(1, 2))
    for most in (2, 4):
        found = body_scene(result, most)
        assert found is not None
        assert len(found.labels) == most
        assert found.methods[0].frames[found.worst] == u.argmax()
        assert found.methods[0].frames[0] == 0


def test_markers_stand_where_they_were_measured_and_where_the_run_has_them() -> None:
    """One that was not seen is none there."""
    result = small_result()
    method = result.methods[0]
    mesh, recording = method.scene.mesh, method.registered[0]
    t, rest = recording.t, mesh.nodes[[0, -1, 1]]
    x = np.repeat(rest[None] + [0.0, 0.0, 3e-3], len(t), axis=0)
    x[:, 2] = np.nan
    none: object = None
    seen = MarkerObservation(
        "seen", "validates", t, ("a", "b", "c"), x, rest, nearest_node_rows(mesh, rest), 1e-4,
        np.full(3, 1e-4), none,  # type: ignore[arg-type]
    )  # fmt: skip
    registered = (replace(recording, observations=(*recording.observations, seen)),)
    found = body_scene(replace(result, methods=(replace(method, registered=registered),)), 4)
    assert found is not None
    shown = found.methods[0]
    assert shown.markers is not None
    assert shown.markers.simulated == pytest.approx((shown.nodes + shown.u())[:, [0, -1, 1]])
    assert shown.markers.measured[1, :2] == pytest.approx(1e3 * rest[:2] + [0.0, 0.0, 3.0])
    off = np.linalg.norm(shown.markers.measured[1] - shown.markers.simulated[1], axis=1)
    assert shown.markers.errors[1] == pytest.approx(off, nan_ok=True)
    assert np.isnan(shown.markers.errors[:, 2]).all()


def test_particles_are_markers_inside_of_the_body() -> None:
    mesh = small_result().methods[0].scene.mesh
    inner = mesh.nodes.mean(axis=0) + 1e-4 * np.arange(900.0)[:, None] * [0.01, 0.02, 0.0]
    rows = Rows.barycentric(mesh, inner)
    measured = np.tile([0.0, 0.0, -1e-3], (900, 1))
    beads = DisplacementObservation("beads", "validates", np.ones(1), inner, measured, rows,
                                    np.full(3, 1e-5))  # fmt: skip
    u = np.tile([0.0, 0.0, -3e-3], (len(mesh.nodes), 1))
    found = _particles([beads], u)
    assert found is not None
    assert found.inside
    assert found.measured.shape == (1, 300, 3)  # every third of 900
    assert found.names[1] == "beads 3"
    np.testing.assert_allclose(found.rest[1], 1e3 * inner[3])
    np.testing.assert_allclose(found.errors, 2.0)
    assert _particles([], u) is None


def test_stresses_of_all_methods_have_one_unit() -> None:
    """Pa or kPa by the largest of them: colours of methods can be compared."""
    soft, stiff = small_result().methods
    material = replace(stiff.scene.material, E=1e9)
    hard = replace(stiff, scene=replace(stiff.scene, material=material))
    found = body_scene(replace(small_result(), methods=(soft, hard)), 4)
    assert found is not None
    names = [set(f) for f in fields(found.methods, [1])]
    assert names[0] == names[1] == {"largest principal strain / %", "von Mises stress / kPa"}


def test_a_camera_holds_its_points_and_looks_along_the_drive() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3)) * [1.0, 5.0, 2.0]
    seen = camera(points, np.array([0.0, 0.0, -1.0]), None, flat=False)
    right = np.cross(seen.up, seen.away)
    right /= np.linalg.norm(right)
    above = np.cross(seen.away, right)
    off = points - seen.middle
    assert np.abs(off @ right).max() == pytest.approx(seen.half[0])
    assert np.abs(off @ above).max() == pytest.approx(seen.half[1])
    assert above[2] > 0.5
    opened = camera(points, np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0]), flat=False)
    assert opened.away[1] > 0.7  # onto the cut
    flat = camera(points, np.array([0.0, 0.0, -1.0]), None, flat=True)
    assert flat.away.tolist() == [0, 0, 1]


def test_drawn_body_follows_the_displacement(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a window of graphics too: its nodes are moved, and coloured by how far."""
    monkeypatch.setattr(gl, "available", lambda: False)
    maps: list[NodeMap] = []
    monkeypatch.setattr(
        bodies, "drawn", lambda shown, span: maps.append(shown) or drawn(shown, span)
    )
    result = small_result()
    assert bodies.body(result) is not None
    run, mesh = result.methods[0].run, result.methods[0].scene.mesh
    assert maps[0].mesh.nodes == pytest.approx(mesh.nodes + run.u[-1])
    assert maps[0].values == pytest.approx(np.linalg.norm(run.u[-1], axis=1))


def test_no_gl_by_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")
    assert not gl.available()


def test_a_probe_that_dies_means_no_gl(monkeypatch: pytest.MonkeyPatch) -> None:
    died = subprocess.CompletedProcess([], -11)
    monkeypatch.delenv("VALIDATE_NO_GL", raising=False)
    monkeypatch.setattr(subprocess, "run", lambda *_a, **_k: died)
    gl._KNOWN.clear()
    assert not gl.available()
    gl._KNOWN.clear()


def test_gl_is_probed_once_by_who_asks_early_and_who_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    probes: list[int] = []
    alive = subprocess.CompletedProcess([], 0)
    monkeypatch.delenv("VALIDATE_NO_GL", raising=False)
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "")
    monkeypatch.setattr(subprocess, "run", lambda *_a, **_k: probes.append(1) or alive)
    gl._KNOWN.clear()
    gl.ask()
    assert gl.available()
    assert gl.available(), "the first answer has set the window class"
    gl._KNOWN.clear()
    assert len(probes) == 1


def test_a_probe_that_hangs_means_no_gl(monkeypatch: pytest.MonkeyPatch) -> None:
    def hangs(*_a: object, **_k: object) -> None:
        raise subprocess.TimeoutExpired("probe", 60)

    monkeypatch.delenv("VALIDATE_NO_GL", raising=False)
    monkeypatch.setattr(subprocess, "run", hangs)
    gl._KNOWN.clear()
    assert not gl.available()
    gl._KNOWN.clear()


RENDER = """
import sys
from dataclasses import replace
import numpy as np
from report_samples import small_result
from tracking_samples import tracking_result
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene
from validate.report.scenes import gl
if not gl.available():
    raise SystemExit(3)
from validate.report.scenes.body_scene import body_scene
from validate.report.scenes import stills

def scaled(result, by):
    return replace(result, methods=tuple(
        replace(m, runs=tuple(replace(r, u=by * r.u) for r in m.runs)) for m in result.methods))

cube = small_result()
seen = body_scene(cube, 4)
for name, result in (("one", cube), ("two", scaled(cube, 3.0)), ("still", scaled(cube, 0.0))):
    scene = replace(body_scene(result, 4), camera=seen.camera)
    drawn = stills.sheet(scene)
    np.savez(f"{sys.argv[1]}/{name}.npz",
             **{f"{c.frame} {c.method} {c.by[:4]} {c.less}": p for c, p in drawn.panels.items()})
tracking = stills.sheet(body_scene(tracking_result(), 4))
for width in (stills.ONE_COLUMN, stills.TWO_COLUMNS):
    picture = stills.picture(tracking, width)
    np.savez(f"{sys.argv[1]}/{width:.0f}.npz", sheet=picture.pixels, caption=picture.caption)
scene = phantom_scene(phantom_mesh(COARSE_GRID))
method = cube.methods[0]
u = np.zeros((2, len(scene.mesh.nodes), 3))
u[1, :, 2] = 0.05 * scene.mesh.nodes[:, 0]
run = replace(method.run, u=u)
hollow = replace(cube, methods=(replace(method, scene=scene, runs=(run, run)),))
opened = body_scene(hollow, 4)
panels = [stills.sheet(s).panels for s in (opened, replace(opened, cut=None))]
whole, cut = ({c.by[:4] + str(c.frame): p for c, p in found.items()} for found in panels[::-1])
np.savez(f"{sys.argv[1]}/cut.npz", cut=cut["disp1"], whole=whole["disp1"])
"""


@pytest.fixture(scope="module")
def stills(tmp_path_factory: pytest.TempPathFactory, project_root: Path) -> Path:
    """Panels of small bodies, by a process of its own: VTK keeps the window class of its first
    import."""
    folder = tmp_path_factory.mktemp("stills")
    tests = Path(report_samples.__file__).parent
    paths = os.pathsep.join(map(str, (project_root, tests, tests / "report")))
    environment = {k: v for k, v in os.environ.items() if k != "VALIDATE_NO_GL"}
    done = subprocess.run(
        [sys.executable, "-c", RENDER, str(folder)],
        env={**environment, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    if done.returncode == 3:
        report_samples.no_gl()
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
def test_a_panel_follows_the_displacement_and_rest_is_shown_where_nothing_moves(
    stills: Path,
) -> None:
    one, two, still = (dict(np.load(stills / f"{n}.npz")) for n in ("one", "two", "still"))
    assert set(one) == set(two)
    assert "0 0 disp None" not in one
    assert body(two["1 0 disp None"]) < 0.95 * body(one["1 0 disp None"])
    assert body(one["1 0 disp None"]) < 0.99 * body(still["0 0 disp None"])


@pytest.mark.slow
def test_a_body_that_does_not_move_has_no_stress_and_no_difference(stills: Path) -> None:
    with np.load(stills / "still.npz") as still, np.load(stills / "one.npz") as one:
        assert {name.split()[2] for name in still.files} == {"disp"}
        assert {name.split()[3] for name in still.files} == {"None"}
        assert "1 0 von  None" in one.files


@pytest.mark.slow
def test_sheets_are_as_wide_as_a_column_at_300_dots_an_inch(stills: Path) -> None:
    for width in (85, 175):
        with np.load(stills / f"{width}.npz") as found:
            assert found["sheet"].shape[1] == pytest.approx(300 * width / 25.4, abs=2)
            assert found["sheet"].shape[0] <= 300 * 9.0
            assert "10 times as long" in str(found["caption"])
            red, green, blue = found["sheet"].astype(int).transpose(2, 0, 1)
            assert ((red - green > 90) & (green - blue > 40)).sum() > 100  # errors of markers
            assert ((green > 190) & (red > 230) & (blue < 60)).sum() > 1000  # upper end of colours


@pytest.mark.slow
def test_an_opened_body_shows_its_cavity(stills: Path) -> None:
    with np.load(stills / "cut.npz") as found:
        assert not near(found["cut"], found["whole"])
        filled = [(found[name].min(axis=2) < 250).mean() for name in ("cut", "whole")]
        assert 0.3 * filled[1] < filled[0] < 0.97 * filled[1]


def near(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal to 2 grey levels on 99 % of the pixels."""
    off = np.abs(a.astype(int) - b.astype(int)).max(axis=2)
    return bool((off <= 2).mean() >= 0.99)


def body(pixels: np.ndarray) -> int:
    """Pixels of the body: it has a colour, tools are grey."""
    return int((np.ptp(pixels.astype(int), axis=2) > 25).sum())
