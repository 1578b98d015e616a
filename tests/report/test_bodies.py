"""The picture of the body: it follows the displacement, the camera does not follow the body."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import report_samples
from report_samples import small_result

from validate.fem.assembly.locate import nearest_node_rows
from validate.register.markers.markers import MarkerObservation
from validate.report.scenes import gl
from validate.report.scenes.bodies import _without_gl
from validate.report.scenes.body import ShownBody, shown_body

# private: _KNOWN: a cache, emptied.
# private: _without_gl: called alone, case by case.


def cube_body() -> ShownBody:
    found = shown_body(small_result())
    assert found is not None
    return found


def test_body_of_the_accepted_method() -> None:
    found = cube_body()
    assert found.load == "2 mm"
    assert np.abs(found.u).max() == pytest.approx(2.0)  # mm
    assert found.pressure is None
    shifts = sorted(float(p.shift[0]) for p in found.plates)
    assert shifts == pytest.approx([-2.0, 0.0])
    assert [float(p.sizes[1]) for p in found.plates] == pytest.approx([22.4, 22.4])


def test_plates_lie_outside() -> None:
    centres = sorted(float(p.centre[0]) for p in cube_body().plates)
    assert centres[0] < 0
    assert centres[1] > 20


def test_markers_stand_where_they_were_measured_and_where_the_run_has_them() -> None:
    """At the load that is drawn; one that was not seen there is left out."""
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
    found = shown_body(replace(result, methods=(replace(method, registered=registered),)))
    assert found is not None
    assert found.markers is not None
    moved = 1e3 * mesh.nodes[[0, -1]] + found.u[[0, -1]]
    assert found.markers.simulated == pytest.approx(moved)
    assert found.markers.measured == pytest.approx(1e3 * rest[:2] + [0.0, 0.0, 3.0])
    off = np.linalg.norm(found.markers.measured - found.markers.simulated, axis=1)
    assert found.markers.largest == pytest.approx(off.max())


def test_drawn_body_follows_the_displacement() -> None:
    one = cube_body()
    two = _without_gl(replace(one, u=2 * one.u))
    assert two.pixels.shape == _without_gl(one).pixels.shape
    assert (two.pixels != _without_gl(one).pixels).any()


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
from validate.report.scenes import gl
if not gl.available():
    raise SystemExit(3)
from validate.report.scenes.body import ShownMarkers, shown_body
from validate.report.scenes.renders import renders
one = shown_body(small_result())
for factor in (1.0, 2.0):
    np.savez(f"{sys.argv[1]}/{factor:g}.npz",
             **{p.name: p.pixels for p in renders(replace(one, u=factor * one.u))})
at = 1e3 * one.mesh.nodes[[0, -1]] + one.u[[0, -1]]
marked = renders(replace(one, markers=ShownMarkers(at + [0.0, 0.0, 1.0], at)))
assert [p.name for p in marked] == ["render_markers", "render_rest", "render_flat", "render_mesh"]
assert "(largest distance 1.00 mm; arrows 2 times as long)" in marked[0].caption, marked[0].caption
np.savez(f"{sys.argv[1]}/marked.npz", marked=marked[0].pixels)
"""


@pytest.mark.slow
def test_renders(tmp_path: Path, project_root: Path) -> None:
    """In a process of its own: VTK keeps the window class of its first import."""
    paths = os.pathsep.join([str(project_root), str(Path(report_samples.__file__).parent)])
    environment = {k: v for k, v in os.environ.items() if k != "VALIDATE_NO_GL"}
    done = subprocess.run(
        [sys.executable, "-c", RENDER, str(tmp_path)],
        env={**environment, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    if done.returncode == 3:
        pytest.skip("no OpenGL library: renders not tested")
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "marked.npz") as found, np.load(tmp_path / "1.npz") as one:
        red, green, blue = found["marked"].astype(int).transpose(2, 0, 1)
        assert ((red > 150) & (green < 130) & (blue < 60)).sum() > 10  # the arrows
        assert not near(found["marked"], one["render_deformed"])
    with np.load(tmp_path / "1.npz") as one, np.load(tmp_path / "2.npz") as two:
        assert all(one[name].min() < 200 < one[name].max() for name in one.files)
        assert near(one["render_rest"], two["render_rest"])
        assert not near(one["render_deformed"], two["render_deformed"])
        assert height(two["render_flat"]) < height(one["render_flat"]) < height(one["render_rest"])


def near(a: np.ndarray, b: np.ndarray) -> bool:
    """Equal to 2 grey levels on 99.5 % of the pixels."""
    off = np.abs(a.astype(int) - b.astype(int)).max(axis=2)
    return bool((off <= 2).mean() >= 0.995)


def height(pixels: np.ndarray) -> int:
    """Rows in which the body or a plate is drawn, in the middle column."""
    return int((pixels[:, pixels.shape[1] // 2].min(axis=1) < 250).sum())
