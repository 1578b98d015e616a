"""A measured body against exact solutions: uniaxial force, own weight, markers that move a face,
outlines of a section; and what is refused."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from machine_logs import machine_log, on_a_body

from validate.compare.result import Result
from validate.errors import (
    ComparisonError,
    RecordingError,
    RegistrationError,
    SceneError,
    UsageError,
)
from validate.parameters import with_given, with_values
from validate.pipeline import run_in_memory
from validate.pipeline.bodies import (
    body_registration as measured_seen,
)
from validate.pipeline.bodies import (
    drive as measured_drive,
)
from validate.pipeline.bodies import (
    markers as measured_markers,
)
from validate.pipeline.bodies import (
    markers as measured_outline,
)
from validate.pipeline.bodies.choices import BodyRanges, MeasuredBody, SeenOf
from validate.pipeline.bodies.measured import solid
from validate.pipeline.bodies.mesh import mesh_of
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.ladder import default as ladder_default
from validate.recording.types import Contours, Markers, Recording, Signal, Source
from validate.report.scenes.body_scene import body_scene, held
from validate.report.scenes.markers import markers as drawn_markers
from validate.report.sections.observations import shown_loads
from validate.report.sections.registration import registration
from validate.scene.geometries.box import box
from validate.scene.geometries.specification import Box, MeshFile
from validate.scene.material import Material
from validate.scene.mesh_files.mesh_file import write_mesh
from validate.scene.places import axis_of, facets_of, place_of, point_of
from validate.scene.scene import Drive, Load, Prescribed, Scene, Support, Weight

# private: _FEWEST: a limit or list of the code, which the test must meet exactly.
# private: _followed, _instants, _loading, _noted, _squeezable, _touched, _window:
#   called alone, case by case.
# private: _points_in, _untaken: replaced, to bring a case about.

SIZE, E, NU, RHO, G = (0.04, 0.03, 0.05), 20e3, 0.3, 1100.0, 9.80665
T = np.linspace(0.0, 4.0, 161)
ROLLERS = (Support("xmin", (0,)), Support("ymin", (1,)), Support("zmin", (2,)))
GRAVITY = Weight("gravity", "-z", G)
PLACES = {"A": (0.04, 0.03, 0.05), "B": (0.0, 0.03, 0.04), "C": (0.04, 0.0, 0.02),
          "D": (0.04, 0.03, 0.03)}  # fmt: skip
SD = 5e-6


def recording(**streams: Any) -> Recording:
    return Recording("body", Source("x", "", 0, "x"), 0, **streams)


def tracked(u: Any, frame: str = "body") -> Markers:
    """Markers displaced by u(x) times the share of the load, with noise."""
    x = np.array(list(PLACES.values()))
    share = np.clip((T - 0.5) / 3.0, 0, 1)[:, None, None]
    seen = x + share * u(x) + np.random.default_rng(3).normal(0, SD, (len(T), *x.shape))
    return Markers(T, tuple(PLACES), seen, SD, frame)


def stretched(x: Any) -> Any:
    """1 mm of compression, uniform."""
    return np.array([-NU, -NU, 1.0]) * -0.001 / SIZE[2] * x


def log() -> dict[str, Signal]:
    d = 1e-3 * np.clip((T - 0.5) / 3.0, 0, 1)
    force = E * SIZE[0] * SIZE[1] * d / SIZE[2] + np.random.default_rng(1).normal(0, 2e-3, len(T))
    return dict(machine_log(T, d, force, 2e-3).signals)


BASE = Tree(
    "body.mcap",
    Scene(Box(SIZE, (2, 2, 2), "hex8"), Material(E, NU, rho=RHO), ROLLERS,
          drives=(Drive("displacement", "zmax", "-z"),), dilatation="by_element"),
    MeasuredBody(SeenOf(force="force", states=8, still=0.4)),
)  # fmt: skip
FREE = BASE.with_scene(drives=())
TETS = BASE.with_scene(body=Box(SIZE, (4, 4, 4)))


def experiment(
    folder: Path, parameters: Tree, seen: Recording, *names: str
) -> Experiment:  # fmt: skip
    limits = {"force": 0.1, "marker": 1e-4, "contour": 4e-4}
    methods = {"linear": solid("linear", "linear")}
    return on_a_body(folder, parameters, seen, methods, {n: limits[n] for n in names})


def verdicts(result: Result) -> dict[str, str]:
    return {c.name: c.verdict for c in result.checks}


def test_the_force_of_a_uniform_body_is_predicted(tmp_path: Path) -> None:
    result = run_in_memory(experiment(tmp_path, BASE, recording(signals=log()), "force"))
    assert verdicts(result) == {"force.max@low": "good enough", "force.max@high": "good enough"}
    rms = {s.name: s.value for s in result.methods[0].scores}
    assert rms["force.rms@high"] < 4e-3  # noise alone


def test_a_force_that_differs_has_likely_causes(tmp_path: Path) -> None:
    """Under a displacement it is the modulus: the given one is half of the true one."""
    soft = with_given(BASE, {"material.E": E / 2})
    result = run_in_memory(experiment(tmp_path, soft, recording(signals=log()), "force"))
    assert "Likely causes, in order: load or modulus" in result.sentence
    assert (
        "measured is 2 times simulated, at all places and times: consistent with that multiple of"
        in (result.sentence)
    )


def test_a_test_may_be_longer_than_its_states_are_seconds(tmp_path: Path) -> None:
    """States more than a second apart: the force was looked for at rest, where it is zero."""
    slow = {n: replace(s, t=20 * s.t) for n, s in log().items()}
    p = with_given(BASE, {"seen.still": 8.0})
    result = run_in_memory(experiment(tmp_path, p, recording(signals=slow), "force"))
    assert set(verdicts(result).values()) == {"good enough"}


def test_an_open_modulus_is_found_below_and_predicted_above(tmp_path: Path) -> None:
    open_ = with_given(BASE, {"material.E": None})
    result = run_in_memory(experiment(tmp_path, open_, recording(signals=log()), "force"))
    found = {p.path: p.default for p in result.parameters}
    assert found["material.E"] == pytest.approx(E, rel=0.01)
    assert verdicts(result) == {"force.max@low": "fitted", "force.max@high": "good enough"}
    assert found["ranges.E"] < 0.01  # of the fit, in place of the assumed one
    assert any("identified" in note for note in result.notes)


def test_markers_of_a_pressed_body(tmp_path: Path) -> None:
    """A turned tracker's frame, the layout recorded: displacements are those of the body."""
    c, s = np.cos(0.4), np.sin(0.4)
    R, shift = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.array([1.0, -2.0, 0.5])
    seen = tracked(stretched, "tracker")
    layout = {name: " ".join(map(repr, at)) for name, at in PLACES.items()}
    both = recording(
        signals=log(), markers={"markers": replace(seen, x=seen.x @ R.T + shift)},
        metadata={"marker_layout": layout},
    )  # fmt: skip
    p = with_given(BASE, {"seen.markers": "markers", "seen.layout": "recorded"})
    result = run_in_memory(experiment(tmp_path, p, both, "force", "marker"))
    assert set(verdicts(result).values()) == {"good enough"}
    rms = {s.name: s.value for s in result.methods[0].scores}
    assert rms["marker.rms@high"] < 1.5 * np.sqrt(3) * SD  # of a length
    shown, run = result.methods[0], result.methods[0].run
    assert len(held(shown.registered[0], run)) == len(run.u)  # the replay stood still at rest
    at, frames = shown_loads(shown)
    assert [h.label for h in at] == ["rest", "1.50s", "2.50s", "4.00s"]
    assert frames == (0, 3, 5, 8)
    assert (scene := body_scene(result, 4)) is not None
    assert scene.methods[0].frames[scene.worst] >= 7  # all of the load
    assert (exhibit := drawn_markers(result)) is not None
    assert [p.name for p in exhibit.pictures] == ["markers", "markers_across"]


@pytest.mark.slow
@pytest.mark.parametrize("places", [
    {"A": (0.04, 0.03, 0.05), "B": (0.0, 0.03, 0.04), "C": (0.04, 0.0, 0.02), "D": (0, 0, 0.01)},
    {"A": (0.04, 0.03, 0.05), "B": (0.04, 0.01, 0.04), "C": (0.04, 0.0, 0.02),
     "D": (0.04, 0.02, 0.01)},
], ids=["in space", "on a side"])  # fmt: skip
def test_markers_as_seen_may_stand_anywhere(
    places: dict[str, tuple[float, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{__name__}.PLACES", places)
    p = with_given(BASE, {"seen.markers": "markers"})
    found = recording(signals=log(), markers={"markers": tracked(stretched)})
    result = run_in_memory(experiment(tmp_path, p, found, "marker"))
    assert {c.verdict for c in result.checks if c.name.startswith("marker")} == {"good enough"}


@pytest.mark.parametrize("some", [("A",), ("A", "D")], ids=["one", "two"])
def test_a_single_marker_is_enough_in_the_body_s_own_frame(
    some: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is fitted there; a layout of its own needs four, and says what fewer may do."""
    monkeypatch.setattr(f"{__name__}.PLACES", {n: PLACES[n] for n in some})
    p = with_given(BASE, {"seen.markers": "markers"})
    layout = {name: " ".join(map(repr, at)) for name, at in PLACES.items()}
    found = recording(
        signals=log(), markers={"markers": tracked(stretched)}, metadata={"marker_layout": layout}
    )
    result = run_in_memory(experiment(tmp_path, p, found, "marker"))
    assert {c.verdict for c in result.checks if c.name.startswith("marker")} == {"good enough"}
    shown = registration(result)
    assert shown.words == (
        "Nothing was fitted: the markers were recorded in the body's frame, as declared.",
    )
    assert shown.pictures == ()
    laid = with_given(p, {"seen.layout": "recorded"})
    with pytest.raises(RegistrationError, match=rf"{len(some)} of its .* needs 4\. .*as seen"):
        run_in_memory(experiment(tmp_path, laid, found, "marker"))
    fitted = with_given(p, {"seen.registration.robust": True})
    with pytest.raises(UsageError, match="fits nothing"):
        run_in_memory(experiment(tmp_path, fitted, found, "marker"))


def test_markers_alone_under_its_own_weight(tmp_path: Path) -> None:
    """u_z = -rho g (h z - z^2/2) / E on rollers, without contraction."""

    def sunk(x: Any) -> Any:
        u = np.zeros_like(x)
        u[:, 2] = -RHO * G * (SIZE[2] * x[:, 2] - x[:, 2] ** 2 / 2) / E
        return u

    body = replace(BASE.scene.body, element="hex27")
    p = FREE.with_scene(body=body, loads=(GRAVITY,), material=Material(E, 0.0, rho=RHO))
    p = p.with_settings(seen=SeenOf(markers="m", still=0.4), ranges=BodyRanges(E=0.02))
    seen = recording(markers={"m": tracked(sunk)})
    result = run_in_memory(experiment(tmp_path, p, seen, "marker"))
    assert verdicts(result) == {"marker.max@loaded": "good enough"}
    assert {s.name: s.value for s in result.methods[0].scores}["marker.rms@loaded"] < 2e-5


def test_markers_on_a_face_move_it(tmp_path: Path) -> None:
    """Three of them drive the top as a rigid body; the fourth is predicted."""
    names = ("A", "T1", "T2", "D")
    x = np.array([(0.04, 0.03, 0.05), (0.0, 0.03, 0.05), (0.04, 0.0, 0.05), (0.02, 0.0, 0.025)])
    share = np.clip((T - 0.5) / 3.0, 0, 1)[:, None, None]
    u = np.zeros_like(x)
    u[:, 2] = -1e-3 * x[:, 2] / SIZE[2]
    noise = np.random.default_rng(3).normal(0, SD, (len(T), *x.shape))
    seen = recording(markers={"m": Markers(T, names, x + share * u + noise, SD, "body")})
    p = FREE.with_scene(
        material=Material(E, 0.0), supports=(Support("zmin"),),
        tracked=(Prescribed("moved", "zmax", labels=names[:3]),),
    ).with_settings(seen=SeenOf(markers="m", states=8, still=0.4))  # fmt: skip
    result = run_in_memory(experiment(tmp_path, p, seen, "marker"))
    assert verdicts(result) == {"marker.max@low": "good enough", "marker.max@high": "good enough"}
    short = p.with_scene(tracked=(Prescribed("moved", "zmax", labels=names[:2]),))
    with pytest.raises(UsageError, match="three or more are needed"):
        run_in_memory(experiment(tmp_path, short, seen, "marker"))


@pytest.mark.slow
def outline(share: float) -> Any:
    """The side of a block pressed by a share of 1 mm: its width grows, its height falls."""
    w, h = SIZE[0] * (1 + NU * 0.02 * share), SIZE[2] * (1 - 0.02 * share)
    s = np.linspace(0, 1, 30, endpoint=False)[:, None]
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h]])
    return np.vstack([a + s * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0),
                                                      strict=True)])  # fmt: skip


@pytest.mark.slow
def test_outlines_of_a_section(tmp_path: Path) -> None:
    t = T[::16]
    shapes = tuple(outline(float(v)) for v in np.clip((t - 0.5) / 3.0, 0, 1))
    contours = Contours(t, shapes, 2e-5, np.eye(4), "image")
    looks = SeenOf(outline="o", pose="fitted", image_x="+x", image_y="+z")
    known = replace(looks, pose="declared", origin=(0.0, 0.015, 0.0))
    p = TETS.with_settings(seen=known)
    seen = recording(signals=log(), contours={"o": contours})
    result = run_in_memory(experiment(tmp_path, p, seen, "contour"))
    assert verdicts(result) == {"contour.max@low": "good enough", "contour.max@high": "good enough"}
    aside = recording(signals=log(), contours={"o": replace(contours, outlines=tuple(
        s + np.array([0.3, -0.2]) for s in shapes))})  # fmt: skip
    fitted = run_in_memory(experiment(tmp_path, p.with_settings(seen=looks), aside, "contour"))
    assert set(verdicts(fitted).values()) == {"good enough"}
    assert any("was fitted" in note for note in fitted.notes)
    with pytest.raises(UsageError, match="two directions at right angles"):
        run_in_memory(experiment(tmp_path, with_given(p, {"seen.image_y": "+x"}), seen))


@pytest.mark.slow
def test_a_motion_that_was_only_noted_is_judged_by_outlines(tmp_path: Path) -> None:
    """Pressed by .4 mm in half of the time, by 1 mm at the end; as if by 2 mm it differs."""
    t = np.linspace(0.0, 2.0, 11)
    shapes = tuple(outline(float(v)) for v in np.interp(t, [0, 1, 2], [0, 0.4, 1.0]))
    looks = SeenOf(outline="o", pose="declared", image_y="+z", origin=(0.0, 0.015, 0.0))
    p = TETS.with_scene(drives=(Drive("moved", "zmax", "-z"),))
    p = p.with_settings(seen=looks, noted=(0.0, 0.4e-3, 1e-3))
    seen = recording(contours={"o": Contours(t, shapes, 2e-5, np.eye(4), "image")})
    names = {"contour.max@low": "good enough", "contour.max@high": "good enough"}
    assert verdicts(run_in_memory(experiment(tmp_path, p, seen, "contour"))) == names
    twice = p.with_settings(noted=(0.0, 2e-3))
    found = verdicts(run_in_memory(experiment(tmp_path, twice, seen, "contour")))
    assert found["contour.max@high"] == "not good enough"
    for noted in ((1e-3,), (1e-3, 1e-3)):
        with pytest.raises(UsageError, match="two different displacements"):
            run_in_memory(experiment(tmp_path, p.with_settings(noted=noted), seen))


def test_a_mesh_file_is_found_beside_the_experiment(tmp_path: Path) -> None:
    write_mesh(box(SIZE, (2, 2, 2)), tmp_path / "body.npz")
    p = BASE.with_scene(body=MeshFile("body.npz", element="linear"))
    result = run_in_memory(experiment(tmp_path, p, recording(signals=log()), "force"))
    assert set(verdicts(result).values()) == {"good enough"}


@cache
def _block() -> Any:
    return box(SIZE, (2, 2, 2))


def test_places_in_words() -> None:
    mesh = _block()
    top = place_of("z1", mesh)
    assert top == "z1"
    for words in ("zmax", "z=50mm", "z=0.0499~0.2mm", "box 0,0,49mm to 40mm,30mm,51mm"):
        assert len(place_of(words, mesh).entities(mesh)) == 8  # type: ignore[union-attr]
    assert len(place_of("near 0,0,50mm", mesh).entities(mesh)) == 1  # type: ignore[union-attr]
    assert len(place_of("zmin+zmax", mesh).entities(mesh)) == 16  # type: ignore[union-attr]
    assert axis_of("-z") == (0.0, 0.0, -1.0)
    assert axis_of("0,3,4") == (0.0, 0.6, 0.8)
    assert point_of("10mm,0,0.02m") == (0.01, 0.0, 0.02)
    for words, why in (("top", "none of a facet set"), ("z=1", "none of .* faces is chosen"),
                       ("z=5 apples", "expected a length"),
                       ("near 20,15,25", "in metres, write 10mm"),
                       ("box 0,0,49 to 40,30,51", "away from a body of 70.7 mm; .* write 10mm"),
                       ("near 1,2", "three lengths")):  # fmt: skip
        with pytest.raises(SceneError, match=why):
            place_of(words, mesh)
    with pytest.raises(SceneError, match="with their units"):
        point_of("10mm,20,0")
    with pytest.raises(SceneError, match="or three numbers"):
        axis_of("up")


def test_a_body_that_slides_widens_about_the_middle_of_its_plate(tmp_path: Path) -> None:
    """A node at its edge stayed where none is in the middle, and all markers were off by that."""
    write_mesh(box(SIZE, (1, 1, 2)), tmp_path / "b.npz")
    rests = (Support("zmin", (2,), rests=True),)
    file = MeshFile("b.npz", element="linear")
    p = BASE.with_scene(body=file, supports=rests)
    with pytest.raises(SceneError, match=r"middle .* 25 mm away.*halvings=1"):
        run_in_memory(experiment(tmp_path, p, recording(signals=log()), "force"))
    p = p.with_scene(body=replace(file, halvings=1))
    result = run_in_memory(experiment(tmp_path, p, recording(signals=log()), "force"))
    assert set(verdicts(result).values()) == {"good enough"}


@pytest.mark.parametrize("words", ["near 20mm,15mm,50mm", "box 5mm,5mm,49mm to 36mm,26mm,51mm"])
def test_a_place_in_words_is_as_large_on_every_mesh_of_a_file(words: str, tmp_path: Path) -> None:
    """A point's nearest facet was a quarter, a sixteenth of it on the halved ones, and a box took
    the smaller facets at its edge, too: no mesh could be the finer one of another."""
    write_mesh(box(SIZE, (4, 4, 4)), tmp_path / "b.npz")
    areas = []
    for halvings in (0, 1):
        file = MeshFile("b.npz", halvings=halvings, element="linear")
        p = BASE.with_scene(body=file, supports=(Support(words),))
        mesh = mesh_of(p, tmp_path)
        a, b, c = np.moveaxis(mesh.nodes[facets_of(mesh, place_of(words, mesh))], 1, 0)[:3]
        areas.append(float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()))
    assert areas[0] == pytest.approx(areas[1], rel=1e-9)


@pytest.mark.parametrize(("change", "error", "why"), [
    (BASE.with_settings(seen=SeenOf()), ComparisonError, "no stream of the recording is compared"),
    (BASE.with_scene(drives=(Drive("stage", "zmax", "-z"),)), UsageError,
     "'stage' moves the body: no signal of that name"),
    (BASE.with_scene(drives=(Drive("force", "zmax", "-z"),)), UsageError, "'force' .*: unit N; "),
    (FREE, UsageError, "0 parts that move or load the body"),
    (BASE.with_scene(loads=(Load("force", "zmax", "-z"),)), UsageError, "has 2 parts that move"),
    (BASE.with_scene(drives=(Drive("displacement", "lid", "-z"),)), SceneError,
     "place 'lid': none of"),
    (FREE.with_scene(loads=(GRAVITY,)), ComparisonError, "'gravity' is none"),
    (FREE.with_scene(loads=(GRAVITY,), material=Material(None, NU, rho=RHO)).with_settings(
        seen=SeenOf(markers="m")), UsageError, "an open modulus is identified on a force"),
])  # fmt: skip
def test_what_cannot_be_is_refused(
    tmp_path: Path, change: Tree, error: type[Exception], why: str
) -> None:
    seen = recording(signals=log(), markers={"m": tracked(stretched)})
    with pytest.raises(error, match=why):
        run_in_memory(experiment(tmp_path, change, seen, "force", "marker"))


def test_markers_that_rise_against_gravity_are_refused(tmp_path: Path) -> None:
    """A frame whose z points down, or another axis up: 1 mm of rise instead of sag."""
    p = FREE.with_scene(loads=(GRAVITY,)).with_settings(seen=SeenOf(markers="m", still=0.4))
    seen = recording(markers={"m": tracked(lambda x: np.array([0.0, 0.0, 0.02]) * x)})
    with pytest.raises(RegistrationError, match=r"against \(0, 0, -1\), although 'gravity'"):
        run_in_memory(experiment(tmp_path, p, seen, "marker"))


def test_a_body_that_slides_on_its_plate_neither_drifts_nor_turns(tmp_path: Path) -> None:
    p = BASE.with_scene(supports=(Support("zmin", (2,), rests=True),))
    result = run_in_memory(experiment(tmp_path, p, recording(signals=log()), "force"))
    assert set(verdicts(result).values()) == {"good enough"}
    method = result.methods[0]
    x, u = method.scene.mesh.nodes, method.run.u[-1]
    widened = 0.3 * 0.02 * (x[:, :2] - (0.02, 0.015))  # nu, strain, from the middle
    assert np.allclose(u[:, :2], widened, rtol=0, atol=1e-8)


def test_force_and_motion_of_different_signs_are_refused(tmp_path: Path) -> None:
    turned = log()
    turned["force"] = replace(turned["force"], y=-turned["force"].y)
    with pytest.raises(RegistrationError, match="must have the same sign"):
        run_in_memory(experiment(tmp_path, BASE, recording(signals=turned), "force"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"seen.states": "1"}, r"seen.states 1 \(2 to 500\)"),
        ({"seen.fit_to": "1"}, r"fit_to 1 \(between 0 and 1\)"),
        ({"seen.still": "-1s"}, r"still -1 s \(0 or above\)"),
    ],
)
def test_settings_of_a_body_that_cannot_be(change: dict[str, str], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        with_values(MeasuredBody(), change)


def test_a_plane_mesh_is_no_body(tmp_path: Path) -> None:
    write_mesh(box((1.0, 1.0), (2, 2)), tmp_path / "sheet.npz")
    with pytest.raises(SceneError, match=r"tri3.*needs 3-D cells"):
        mesh_of(FREE.with_scene(body=MeshFile("sheet.npz"), supports=()), tmp_path)


def test_layouts_and_markers_that_are_not_given_are_requested(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measured_markers, "_points_in", lambda path: {})
    with pytest.raises(RecordingError, match=r"a.fcsv: no points; a layout is a file"):
        measured_markers.layout_of(None, "a.fcsv", tmp_path)  # type: ignore[arg-type]
    monkeypatch.undo()
    (tmp_path / "a.csv").write_text("name,x,y,z\na,1,2,3\nb,4,5,6\n")
    with pytest.raises(UsageError, match=r"seen\.layout: .* must be complete"):
        measured_markers._points_in(tmp_path / "a.csv")
    none = BASE.with_settings(seen=SeenOf())
    for names in ((), ("left", "right")):
        recording = SimpleNamespace(markers=dict.fromkeys(names))
        with pytest.raises(UsageError, match=r"seen.markers.*not set"):
            measured_markers.markers_topic(recording, none)  # type: ignore[arg-type]
    one = SimpleNamespace(markers={"left": None})
    assert measured_markers.markers_topic(one, none) == "left"  # type: ignore[arg-type]


def use(**seen: str) -> Tree:
    """A body that is moved as noted."""
    return BASE.with_settings(seen=SeenOf(**seen, states=4), noted=(0.0, 1e-3))  # type: ignore[arg-type]


def test_streams_that_are_not_there_or_share_no_time_are_refused() -> None:
    def stream(*t: float) -> SimpleNamespace:
        return SimpleNamespace(t=np.array(t))

    recording = SimpleNamespace(name="r", streams={"cell": stream(0, 1), "tip": stream(2, 3)})
    for seen, error, says in (
        ({"force": "load"}, UsageError, r"no stream \['load'\] in r; it has \['cell', 'tip'\]"),
        ({}, ComparisonError, r"no stream of the recording is used: set seen\.\*"),
        (
            {"force": "cell", "markers": "tip"}, ComparisonError,
            r"share no time \(latest start 2.000 s, earliest end 1.000 s\)",
        ),
    ):  # fmt: skip
        with pytest.raises(error, match=says):
            measured_seen._instants(recording, use(**seen))  # type: ignore[arg-type]
    t, start = measured_seen._instants(recording, use(force="cell"))  # type: ignore[arg-type]
    assert (t.tolist(), start) == ([0, 0.25, 0.5, 0.75, 1], 0.0)


def test_a_window_of_too_few_samples_is_refused() -> None:
    few = np.arange(float(measured_seen._FEWEST - 1))
    with pytest.raises(ComparisonError, match=f"window 'low': {len(few)} samples; "):
        measured_seen._window("low", few, "samples")
    assert measured_seen._window("low", np.append(few, 9.0), "samples").label == "low"


def test_a_body_that_is_not_driven_or_cannot_be_squeezed_has_no_ladder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = SimpleNamespace(t=np.array([0.0, 1.0]), inputs=np.zeros((2, 1)))
    own = SimpleNamespace(
        seen=seen, experiment=SimpleNamespace(name="x"),
        scene=SimpleNamespace(material=SimpleNamespace(rho=None), mesh=None),
    )  # fmt: skip
    with pytest.raises(UsageError, match="'x' has only zero inputs"):
        ladder_default._loading(own)  # type: ignore[arg-type]
    monkeypatch.setattr(ladder_default, "touched_ladder", lambda *_: None)
    monkeypatch.setattr(ladder_default, "_untaken", lambda own: UsageError("no probe"))
    with pytest.raises(UsageError, match="no probe"):
        ladder_default._touched(own, quick=True)  # type: ignore[arg-type]

    def turned_over(mesh: object) -> None:
        raise SceneError("3 cells are turned over")

    monkeypatch.setattr(ladder_default, "squeezed", lambda *_: None)
    monkeypatch.setattr(ladder_default, "require_positive_cells", turned_over)
    assert not ladder_default._squeezable(own.scene)
    monkeypatch.setattr(ladder_default, "require_positive_cells", lambda mesh: None)
    assert ladder_default._squeezable(own.scene)


def moved_by(*names: str, noted: tuple[float, ...] = ()) -> Tree:
    seen = SeenOf(markers="m", still=0.5, layout="a.fcsv", outline="o")
    tracked = (Prescribed("moved", "x0", labels=names),) if names else ()
    drives = () if names else BASE.scene.drives
    p = BASE.with_scene(tracked=tracked, drives=drives)
    return p.with_settings(seen=seen, noted=noted)


def placed(recording: Any, *names: str) -> None:
    p = moved_by(*names)
    nothing: Any = None
    measured_drive.placed_points(recording, p, p.scene.tracked[0], nothing)


def test_a_place_that_markers_move_needs_three_that_are_tracked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recording = SimpleNamespace(marker=lambda topic: SimpleNamespace(names=("a", "b", "c", "d")))
    for names, says in (
        (("a",), "labels = a: three or more are needed; the recording has a, b, c, d"),
        (("a", "b"), "tracked.moved.labels = a,b: three or more are needed"),
        (("a", "b", "knee"), r"labels = a,b,knee: \['knee'\] are not recorded"),
    ):
        with pytest.raises(UsageError, match=says):
            placed(recording, *names)
    at_rest = SimpleNamespace(names=("a", "b"), x=np.zeros((1, 2, 3)))
    monkeypatch.setattr(measured_drive, "registered", lambda *_: at_rest)
    with pytest.raises(RegistrationError, match=r"markers \['c'\] on the moved place"):
        placed(recording, "a", "b", "c")


def test_amounts_that_were_noted_differ_and_markers_that_drive_have_no_gaps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    t = np.array([0.0, 1.0, 2.0])
    for noted in ((), (1e-3,), (1e-3, 1e-3)):
        with pytest.raises(UsageError, match=r"noted = .* two different displacements"):
            measured_drive._noted(moved_by(noted=noted), t)  # type: ignore[arg-type]
    found = measured_drive._noted(moved_by(noted=(1e-3, 3e-3)), t)  # type: ignore[arg-type]
    assert found.y[:, 0] == pytest.approx([0.0, 1e-3, 2e-3])
    x = np.zeros((3, 1, 3))
    x[1] = np.nan
    seen = SimpleNamespace(t=t, names=("a",), x=x)
    monkeypatch.setattr(measured_drive, "registered", lambda *_: seen)
    with pytest.raises(RegistrationError, match=r"visible at t = 1.000 s"):
        measured_drive._followed(None, moved_by("a"), t, None)  # type: ignore[arg-type]


def test_a_layout_without_the_recorded_names_and_markers_that_all_drive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recording = SimpleNamespace(marker=lambda topic: None)
    names = ("left", "right")
    rest = SimpleNamespace(names=names)
    monkeypatch.setattr(measured_markers, "rested", lambda *_: (rest, (), 3))
    monkeypatch.setattr(measured_markers, "layout_of", lambda *_: {"Left": None})
    with pytest.raises(RegistrationError, match=r"a.fcsv has 'Left'.*'left', 'right'"):
        measured_markers.registered(recording, moved_by(), (None, Path()))  # type: ignore[arg-type]
    monkeypatch.setattr(measured_markers, "registered", lambda *_: rest)
    with pytest.raises(ComparisonError, match="every marker moves the body: no marker"):
        measured_markers.compared_markers(recording, moved_by(*names), None)  # type: ignore[arg-type]


def test_outlines_need_triangles_and_an_open_modulus_a_force(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recording = SimpleNamespace(contour=lambda topic: None)
    bricks = SimpleNamespace(bricks=True, kind="hex8")
    with pytest.raises(RegistrationError, match=r"outlines need.*hex8"):
        measured_outline.observed_outline(recording, moved_by(), bricks, 0.0)  # type: ignore[arg-type]
