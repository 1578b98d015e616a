"""Outlines of a pressed body: exact ones agree, others are asked for or refused by name."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from machine_logs import pressed_cylinder

from validate.arrays import Floats
from validate.compare.result import MethodResult
from validate.errors import ComparisonError, RegistrationError, SceneError, UsageError
from validate.fem.system import build as build_system
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.experiment import Experiment, Uncertainty
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.compression import compression
from validate.pipeline.plates.outline import with_outline
from validate.pipeline.plates.scene import Compression, PressedOutline
from validate.recording.types import Contours, Recording, Signal, Source
from validate.register.observation import Selection
from validate.register.outlines.outlines import OutlineObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.inclusion import Block, Capsule
from validate.scene.geometries.specification import MeshFile, whole_cylinder
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.mesh_file import write_mesh
from validate.scene.scene import Cavity, Drive
from validate.solve.fluid.cavities import ExactPressure, NoFluid

T = np.linspace(0.0, 10.0, 51)
D, H = 0.02, 0.03
MOVED = 1.5e-3 * T / T[-1]
PLACE = PressedOutline("seen", origin=(-0.02, 0.0, 0.035), sd=0.1e-3)


def edge(closed: float, nu: float = 0.5) -> Floats:
    """The rectangle (k, 2) m in the images of a cylinder between slipping plates."""
    half = D / 2 * (1 + nu * closed / H)
    low, high = np.array([0.02 - half, 0.005 + closed]), np.array([0.02 + half, 0.035])
    s = np.linspace(0, 1, 20, endpoint=False)[:, None]
    corners = [low, (high[0], low[1]), high, (low[0], high[1]), low]
    sides = [np.array(a) + s * (np.array(b) - a) for a, b in pairwise(corners)]
    return np.vstack(sides)


def recorded(outline: Callable[[float], Floats] = edge, start: float = 0.0) -> Recording:
    t = start + np.arange(1.0, 10.0)
    outlines = tuple(outline(float(d)) for d in np.interp(t, T, MOVED))
    seen = Contours(t, outlines, 0.05e-3, np.eye(4), "image", "images")
    force = 5.0 * MOVED[:, None] + np.random.default_rng(1).normal(0, 1e-5, (len(T), 1))
    signals = {
        "displacement": Signal(T, MOVED[:, None], "m", 0.0, "machine"),
        "force": Signal(T, 1e3 * force, "N", 0.005, "machine"),
    }
    source = Source("x", "", 0, "x")
    return Recording("gel", source, 0, signals=signals, contours={"seen": seen})


def log() -> Registered:
    stage = SignalObservation("displacement", "drives", T, MOVED[:, None], "m", 0.0)
    force = SignalObservation("force", "validates", T, MOVED[:, None], "N", 0.1, "force", "x")
    return Registered((stage, force), (Selection("beyond", T[10:]),))


@pytest.fixture(scope="module")
def body() -> Mesh:
    return whole_cylinder(D, H, 2, 2)


def registered(body: Mesh, card: PressedOutline = PLACE, **made: object) -> Registered:
    return with_outline(log(), recorded(**made), card, body)  # type: ignore[arg-type]


def test_a_uniformly_pressed_cylinder_has_the_outline_it_should(body: Mesh) -> None:
    """Only the rim's polygon, 5 % outside of the circle at its corners, is left."""
    seen = registered(body)
    (outline,) = seen.of(OutlineObservation)
    assert [s.label for s in seen.selections] == ["beyond", "0.45mm", "0.75mm", "1.05mm", "1.35mm"]
    assert seen.selections[0].of == ("force",)
    assert all(s.of == ("seen",) for s in seen.selections[1:])
    last = seen.selections[-1]
    assert last.t is not None
    assert seen.rest is not None
    assert seen.rest.t is not None
    closed = {t: float(np.interp(t, T, MOVED)) for t in (last.t[0], seen.rest.t[0])}
    fields = [body.nodes * np.array([0.5, 0.5, -1.0]) * d / H for d in closed.values()]
    at = np.searchsorted(T, list(closed))
    run = SimpleNamespace(method="x", t=T, at=at, u=np.array(fields), traces={})
    off = {d.quantity: d for d in outline.deviations(run, last)}["contour"]
    wide = float(body.nodes[:, 0].max()) - D / 2
    assert np.abs(off.values).max() < 1.1 * wide
    assert np.abs(off.values[:20]).max() < 1e-9  # the moving plate's edge
    assert off.sd == outline.sd
    told = replace(outline, sds=np.linspace(1e-5, 9e-5, len(outline.t)))
    apart = {d.quantity: d for d in told.deviations(run, last)}  # type: ignore[arg-type]
    assert apart["contour"].sd == pytest.approx(9e-5)
    both = np.sqrt((1e-5**2 + 9e-5**2) / 2)  # what changed since the first image has both
    area = {d.quantity: d for d in outline.deviations(run, last)}["contour.area"].sd  # type: ignore[arg-type]
    assert apart["contour.area"].sd / area == pytest.approx(both / outline.sd)


def test_what_places_the_images_is_asked_for(body: Mesh) -> None:
    with pytest.raises(UsageError, match="images 'seen' is not recorded: give"):
        registered(body, replace(PLACE, origin=()))
    with pytest.raises(UsageError, match=r"outline\.sd \(standard uncertainty"):
        registered(body, replace(PLACE, sd=None))
    with pytest.raises(UsageError, match="two directions at right angles"):
        registered(body, replace(PLACE, image_y="+x"))
    shifted = registered(body, replace(PLACE, shift=(1e-3, 2e-3))).of(OutlineObservation)[0]
    assert shifted.pose[:3, 3] == pytest.approx([-0.019, 0.0, 0.033])


def test_outlines_of_what_the_model_does_not_have_are_refused(body: Mesh) -> None:
    def small(closed: float) -> Floats:
        return 0.3 * (edge(closed) - [0.02, 0.02]) + [0.02, 0.02]

    with pytest.raises(RegistrationError, match=r"enclose 0\.\d+ cm2, .* 6\.\d+ cm2"):
        registered(body, outline=small)
    with pytest.raises(SceneError, match="no facets 'cyst'; it has"):
        registered(body, replace(PLACE, surface="cyst"))
    with pytest.raises(ComparisonError, match=r"0 of 9 outlines.*0\.000\.\.10\.000"):
        registered(body, start=30.0)


def experiment(card: Tree, folder: Path = Path(), *, fluid: bool = False) -> Experiment:
    methods = {"slip": Method("linear", ExactPressure() if fluid else NoFluid())}
    return compression("gel", "gel", "gel.mcap", card, methods, ("slip",), (), folder=folder)


def test_outlines_named_after_the_declaration_are_refused(body: Mesh) -> None:
    card = pressed_cylinder(D, H, cells=(2, 2), element="tet4")
    late = replace(card, settings=Compression(outline=PLACE))
    one = experiment(card)
    with pytest.raises(UsageError, match="name the topic there"):
        one.place(recorded(), late, one.build(recorded(), late, one.methods["slip"].scene))


def test_outlines_show_all_of_the_body() -> None:
    card = pressed_cylinder(D, H, settings=Compression(outline=PLACE))
    with pytest.raises(UsageError, match=r"body\.part: .*part='whole'"):
        experiment(card)


def test_a_scene_that_no_plate_presses_is_refused() -> None:
    card = pressed_cylinder(D, H)
    for drives in ((), (Drive("stage", "upper_plate", (1.0, 0.0, 0.0)),)):
        with pytest.raises(UsageError, match=r'drives: .*"upper_plate"'):
            experiment(card.with_scene(drives=drives))


def test_fluid_in_a_body_wants_its_modulus_and_the_linear_law() -> None:
    card = pressed_cylinder(D, H).with_scene(cavities=(Cavity("inclusion", "wall"),))
    one = experiment(card, fluid=True)
    svk = pressed_cylinder(D, H, 1e4)
    svk = svk.with_scene(material=svk.scene.material.of_law("svk"))
    with pytest.raises(SceneError, match="ExactPressure cannot solve the law 'svk'"):
        one.methods["slip"].settings.prepare(build_system(one.build(recorded(), svk, None)))
    assert one.identify is not None
    with pytest.raises(UsageError, match=r"material\.E is not set: a body"):
        one.identify((recorded(),), card, one.methods)


def cyst(path: Path) -> None:
    """A block pressed along z with a capsule along y in it."""
    shape = Capsule((0.02, 0.025, 0.018), 0.008, 0.03)
    mesh = Block(0.04, 0.05, 0.036).around((9, 9, 9), shape)
    named = {"lower_plate": "z0", "upper_plate": "z1", "wall": "cavity"}
    facets = {name: mesh.facets[old] for name, old in named.items()}
    write_mesh(replace(mesh, nodes=mesh.nodes - [0.02, 0.025, 0], facets=facets), path)


def test_an_inclusions_wall_of_a_mesh_file_is_judged_with_its_fluid(tmp_path: Path) -> None:
    """Outlines of the fluid-filled model itself: it reads them again, an empty one does not."""
    cyst(tmp_path / "cyst.npz")
    place = replace(PLACE, surface="wall", holds=2)
    settings = Compression(outline=place, fit_to=0.02, limit=0.05)
    card = pressed_cylinder(None, None, 10e3, 0.48, element="tet4", whole=True, settings=settings)
    card = card.with_scene(
        body=MeshFile("cyst.npz", element="linear"), cavities=(Cavity("inclusion", "wall"),)
    )

    def judged(outline: Callable[[float], Floats], *, fluid: bool) -> MethodResult:
        made = recorded(outline)
        return run_in_memory(
            replace(
                experiment(card, tmp_path, fluid=fluid),
                uncertainty=Uncertainty(),
                load=lambda p, folder: (made,),
                path=tmp_path / "gel.py",
            )
        ).methods[0]

    circle = Capsule((0.0, 0.0, 0.0), 0.008, 0.03)
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = [0.02, 0.017] + circle.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    first = judged(lambda closed: ring, fluid=True)
    (seen,) = first.registered[0].of(OutlineObservation)
    at, fields = MOVED[first.run.at], first.run.u

    def simulated(closed: float) -> Floats:
        return seen.simulated(fields[int(np.abs(at - closed).argmin())])

    again, empty = (judged(simulated, fluid=fluid) for fluid in (True, False))
    off = [{s.name: s.value for s in m.scores}["contour.rms@1.35mm"] for m in (again, empty)]
    assert off[0] < 1e-6 < 2e-5 < off[1]
