"""A fluid-filled gelatin phantom compressed between an ultrasound probe and a stage (paper 000).

Gosline, Salcudean, Yan (2004), section 4: outlines of the inclusion by ultrasound and markers on
the top face by a digitising pen at 0, 3, 6 and 9 mm, against FEM of 1328 nodes with the fluid's
pressure. The recording is a twin: quadratic elements on a finer mesh, exact constant volume, and a
pressure transducer in the cavity, which the paper names as future work.

Frame "phantom": x from the probe plate (0) to the stage plate, y up, z lateral; metres.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from validate.compare.effects import Sensor
from validate.compare.score import Score
from validate.compare.verdict import Accept
from validate.identify.interval import profile_interval
from validate.papers.phantom_ladder import phantom_trial
from validate.parameters import quantity, require_ranges
from validate.recording.images.outline import outlines_of
from validate.recording.mcap.read import read_recording
from validate.recording.types import Contours, Recording
from validate.register.inclusion import outlined_capsule
from validate.register.markers import Sampling, Together, placed_markers
from validate.register.observation import Selection, nearest_sample
from validate.register.outlines import Corner, observe_outlines
from validate.register.plane import cavity_sampler
from validate.register.registered import Registered
from validate.register.signals import driving, holds_at, require_rising, validating
from validate.replay.experiment import (
    EffectSpec,
    Experiment,
    Identified,
    Input,
    Progress,
    Twin,
    Uncertainty,
    Variant,
)
from validate.replay.ladder import Ladder, Trial
from validate.replay.method import Method
from validate.replay.paper_000 import figures
from validate.replay.solved import solve
from validate.scene.inclusion import Block, Capsule, block_with_inclusion
from validate.scene.mesh import quadratic
from validate.scene.plates import Contact, between_plates
from validate.scene.scene import Cavity, Dilatation, LawName, Material, Membrane, Scene
from validate.solve.fluid import ExactPressure, NoFluid, PressureLoop
from validate.twin.phantom import PLATES, TwinSettings, record_phantom


@dataclass(frozen=True)
class MaterialCard:
    E: float = quantity(15_200.0, "Pa", "Young's modulus, plate compression (paper 000, 4.1)")
    nu: float = quantity(0.485, "1", "Poisson ratio of gelatin (paper 000, 4.4)")


@dataclass(frozen=True)
class BlockSize:
    x: float = quantity(0.060, "m", "size from the probe plate to the stage plate")
    y: float = quantity(0.045, "m", "height")
    z: float = quantity(0.070, "m", "lateral size")


@dataclass(frozen=True)
class Inclusion:
    """None: centre x, z and radius from the rest outline, the rest from the declared sweep."""

    centre_x: float | None = quantity(None, "m", "centre along the stage; none: from the outline")
    centre_y: float | None = quantity(None, "m", "height of the centre; none: from the sweep")
    centre_z: float | None = quantity(None, "m", "lateral centre; none: from the outline")
    radius: float | None = quantity(None, "m", "radius; none: from the outline")
    length: float | None = quantity(None, "m", "length along y; none: from the sweep")
    wider: float = quantity(0.0, "m", "added to the radius that is meshed")
    longer: float = quantity(0.0, "m", "added to the length that is meshed")


@dataclass(frozen=True)
class Wall:
    thickness: float = quantity(0.0, "m", "latex membrane on the wall of the cavity; 0: none")
    E: float = quantity(1.2e6, "Pa", "modulus of latex, small strain")
    nu: float = quantity(0.49, "1", "Poisson ratio of latex")


@dataclass(frozen=True)
class Grid:
    nodes_x: int = quantity(9, "1", "nodes along x (9 x 10 x 15 gives the 1328-node mesh)")
    nodes_y: int = quantity(10, "1", "nodes along y")
    nodes_z: int = quantity(15, "1", "nodes along z")
    finer_x: int = quantity(11, "1", "nodes along x of the second mesh, for u_num")
    finer_y: int = quantity(13, "1", "nodes along y of the second mesh")
    finer_z: int = quantity(19, "1", "nodes along z of the second mesh")
    order: Literal[1, 2] | None = quantity(
        None, "1", "1 or 2 for every method; none: each method's own"
    )

    @property
    def nodes(self) -> tuple[int, int, int]:
        return (self.nodes_x, self.nodes_y, self.nodes_z)

    @property
    def ratio(self) -> float:
        """Ratio of cell sizes of the two meshes."""
        fine = (self.finer_x - 1) * (self.finer_y - 1) * (self.finer_z - 1)
        coarse = (self.nodes_x - 1) * (self.nodes_y - 1) * (self.nodes_z - 1)
        return float((fine / coarse) ** (1 / 3))


@dataclass(frozen=True)
class Placing:
    method: Literal["rigid", "similarity", "two_step"] = quantity(
        "rigid", "1", "marker registration, on the rest state only"
    )
    sampling: Sampling = quantity("barycentric", "1", "markers to nodes")
    wall: Literal["measured", "facets", "nearest_node"] = quantity(
        "measured", "1", "wall on the measured circle, on the mesh's facets, or by nearest node"
    )
    image_shift_x: float = quantity(0.0, "m", "correction of the image pose along x")
    image_shift_z: float = quantity(0.0, "m", "correction of the image pose along z")


@dataclass(frozen=True)
class Ranges:
    """Standard uncertainties of the inputs, declared before the comparison."""

    E: float = quantity(0.05, "1", "relative, of the modulus")
    nu: float = quantity(0.005, "1", "of the Poisson ratio")
    friction: float = quantity(0.03, "1", "share of the way from slipping to bonded plates")
    pose: float = quantity(0.1e-3, "m", "of the image pose, per axis")
    radius: float = quantity(0.05e-3, "m", "of the inclusion's radius")
    length: float = quantity(0.5e-3, "m", "of the inclusion's length")

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True)
class Parameters:
    material: MaterialCard = MaterialCard()
    block: BlockSize = BlockSize()
    inclusion: Inclusion = Inclusion()
    membrane: Wall = Wall()
    mesh: Grid = Grid()
    registration: Placing = Placing()
    ranges: Ranges = Ranges()
    twin: TwinSettings = TwinSettings()
    plates: Literal["as_method", "slip", "partial", "bonded"] = quantity(
        "as_method", "1", "contact of both plates, for every method"
    )
    friction: float = quantity(1e5, "N/m3", "tangential stiffness of the plates, if partial")
    loads: tuple[float, ...] = quantity((0.003, 0.006, 0.009), "m", "stage positions compared")
    outlines: Literal["recorded", "images"] = quantity(
        "recorded", "1", "outlines as recorded, or extracted from the B-mode images"
    )
    recording: str | None = quantity(None, "1", "MCAP file; none: recordings/fluid_phantom.mcap")


@dataclass(frozen=True)
class Model:
    """What a method's scene is built with."""

    order: Literal[1, 2] = quantity(1, "1", "element order")
    dilatation: Dilatation = quantity("pointwise", "1", "volume strain per cell or nodal mean")
    law: LawName = quantity("linear", "1", "linear, or at large strain svk or neo_hooke")
    plates: Contact = quantity("slip", "1", "contact of both plates")


MEAN_DILATATION = Model(dilatation="nodal_mean")
METHODS: Mapping[str, Method] = {
    "p1_fluid": Method("P1 with fluid", ExactPressure(), Model()),
    "p1_loop": Method("P1 with fluid, the paper's loop", PressureLoop(), Model()),
    "p1_dry": Method("P1 without fluid", NoFluid(), Model()),
    "p1_bonded": Method("P1 with fluid, bonded plates", ExactPressure(), Model(plates="bonded")),
    "md_fluid": Method("P1 mean dilatation with fluid", ExactPressure(), MEAN_DILATATION),
    "p2_fluid": Method("P2 with fluid", ExactPressure(), Model(order=2)),
}


def _block(p: Parameters) -> Block:
    return Block(p.block.x, p.block.y, p.block.z)


def record(parameters: Parameters, progress: Progress) -> Recording:
    p = parameters
    material = Material(p.material.E, p.material.nu, p.twin.law)
    return record_phantom(p.twin, _block(p), material, progress)


def load(parameters: Parameters, folder: Path) -> tuple[Recording, ...]:
    named = parameters.recording
    path = Path(named) if named else folder.parent / "recordings" / "fluid_phantom.mcap"
    recording = read_recording(path)
    if parameters.outlines == "images":
        outlines = outlines_of(recording.frame("b_mode"))
        recording = replace(recording, contours={"outline": outlines})
    return (recording,)


def build(recording: Recording, parameters: Parameters, model: Model) -> Scene:
    p = parameters
    mesh = block_with_inclusion(_block(p), p.mesh.nodes, inclusion(recording, p))
    order = p.mesh.order or model.order
    contact = model.plates if p.plates == "as_method" else p.plates
    return between_plates(
        mesh if order == 1 else quadratic(mesh),
        Material(p.material.E, p.material.nu, model.law),
        contact,
        PLATES,
        "pointwise" if order == 2 else model.dilatation,
        cavities=(Cavity("inclusion", "cavity"),),
        friction=p.friction,
        membrane=_membrane(p.membrane),
    )


def _membrane(wall: Wall) -> tuple[Membrane, ...]:
    if wall.thickness == 0:
        return ()
    return (Membrane("cavity", wall.thickness, Material(wall.E, wall.nu)),)


def place(recording: Recording, parameters: Parameters, scene: Scene) -> Registered:
    p = parameters
    stage = driving(recording, "stage", "m")
    contours = _shifted(recording.contour("outline"), p)
    capsule = measured_inclusion(recording, p)
    shape = None if p.registration.wall == "facets" else capsule
    nearest = p.registration.wall == "nearest_node"
    wall = cavity_sampler(scene.mesh, "cavity", shape, nearest=nearest)
    signals = tuple(validating(recording, *names, quantity=q, trace=t) for names, q, t in SIGNALS)
    for signal in signals:
        require_rising(stage, signal)
    rest, *holds = holds_at(stage, contours.t, p.loads, within=0.1e-3)
    outline = observe_outlines(contours, wall, rest=_instant(rest), corners=(TOP_LEFT,))
    markers = placed_markers(
        recording,
        scene.mesh,
        method=p.registration.method,
        sampling=p.registration.sampling,
        together=TOP_FACE,
        tracker="pen",
        up=(0.0, 1.0, 0.0),
    )
    return Registered(
        (stage, outline, markers, *signals),
        tuple(holds),
        rest,
        findings=_misplaced(capsule, inclusion(recording, p)),
    )


def _instant(hold: Selection) -> float:
    assert hold.t is not None
    return float(hold.t[0])


SIGNALS = (
    (("load_cell", "N"), "force.plate", "stage.force"),
    (("pressure", "Pa"), "pressure", "inclusion.pressure"),
)
TOP_LEFT = Corner(
    "contour.top_left",
    np.deg2rad(225.0),
    "displacement of the corner nearest the probe and lowest in image x (225 deg)",
)
TOP_FACE = (
    Together(
        "marker.inplane",
        (0, 2),
        "position in the plane of the top face (x along the stage, z lateral)",
    ),
    Together("marker.vertical", (1,), "position along the vertical y"),
)


def _misplaced(measured: Capsule, meshed: Capsule) -> tuple[str, ...]:
    """A word where the meshed inclusion is not where the rest outline lies."""
    off = float(np.linalg.norm(np.array(measured.centre) - np.array(meshed.centre)))
    wide = meshed.radius - measured.radius
    if off < 0.5e-3 and abs(wide) < 0.5e-3:
        return ()
    return (
        f"The meshed inclusion's centre is {1e3 * off:.2f} mm from the measured one and its radius "
        f"{1e3 * wide:+.2f} mm off; outlines are drawn on the measured wall and cannot show that.",
    )


def inclusion(recording: Recording, parameters: Parameters) -> Capsule:
    """The inclusion that is meshed: what the user set, else what was measured."""
    measured, mine = measured_inclusion(recording, parameters), parameters.inclusion
    centre = tuple(
        m if own is None else own
        for own, m in zip(
            (mine.centre_x, mine.centre_y, mine.centre_z), measured.centre, strict=True
        )
    )
    return Capsule(
        (centre[0], centre[1], centre[2]),
        (measured.radius if mine.radius is None else mine.radius) + mine.wider,
        (measured.length if mine.length is None else mine.length) + mine.longer,
    )


def measured_inclusion(recording: Recording, parameters: Parameters) -> Capsule:
    """Centre x, z and radius of the rest outline; height and length from the declared sweep."""
    contours = _shifted(recording.contour("outline"), parameters)
    rest = holds_at(driving(recording, "stage", "m"), contours.t, (), within=0.1e-3)[0]
    moved = abs(parameters.registration.image_shift_x), abs(parameters.registration.image_shift_z)
    index = nearest_sample(contours.t, _instant(rest), "outlines")
    return outlined_capsule(contours, index, recording.record("inclusion"), sum(moved))


def _shifted(contours: Contours, parameters: Parameters) -> Contours:
    pose = contours.pose.copy()
    pose[[0, 2], 3] += parameters.registration.image_shift_x, parameters.registration.image_shift_z
    return replace(contours, pose=pose)


# --- what is judged ------------------------------------------------------------------------------


def _material(p: Parameters, **values: float) -> Parameters:
    return replace(p, material=replace(p.material, **values))


def _include(p: Parameters, **values: float) -> Parameters:
    return replace(p, inclusion=replace(p.inclusion, **values))


def _place(p: Parameters, **values: Any) -> Parameters:
    return replace(p, registration=replace(p.registration, **values))


def _finer(p: Parameters) -> Parameters:
    g = p.mesh
    return replace(p, mesh=replace(g, nodes_x=g.finer_x, nodes_y=g.finer_y, nodes_z=g.finer_z))


# --- friction from the markers' rise -------------------------------------------------------------

SHARES = np.array([0.0, 0.03, 0.08, 0.15, 0.3, 0.5, 0.75, 1.0])
HALF = 1e6  # N/m3: the tangential stiffness at a share of one half


def _rubbing(p: Parameters, share: float) -> Parameters:
    """Share 0 slips, 1 bonds, between them springs of HALF share/(1 - share)."""
    p = replace(p, mesh=replace(p.mesh, order=None))
    if share in (0.0, 1.0):
        return replace(p, plates="slip" if share == 0 else "bonded")
    return replace(p, plates="partial", friction=HALF * share / (1 - share))


def identify(recordings: Sequence[Recording], parameters: Parameters) -> Identified:
    """Plate friction from the vertical rise of the markers, by mean dilatation elements."""
    chi_square, count = [], 0
    for share in SHARES:
        rubbing = _rubbing(parameters, float(share))
        found = solve(EXPERIMENT, tuple(recordings), "md_fluid", METHODS["md_fluid"], rubbing)
        rise = [r for r in found.residuals.values() if r.quantity == "marker.vertical"]
        chi_square.append(sum(float((r.values**2).sum()) / r.sd**2 for r in rise))
        count = sum(r.count for r in rise)
    fit = profile_interval(SHARES, np.array(chi_square), count)
    words = "tangential plate stiffness k as k/(k + 1e6 N/m3): 0 slips, 1 bonds; from the rise"
    rows = (("friction.share", fit.best), ("friction.share.low", fit.low),
            ("friction.share.high", fit.high), ("friction.chi_square", fit.chi_square))  # fmt: skip
    note = (
        f"Plate friction from the markers' vertical rise ({count} values): share {fit.best:.2f}, "
        f"between {fit.low:.2f} and {fit.high:.2f} (two standard deviations), where 0 is slipping, "
        "1 bonded and 0.5 a tangential stiffness of 1e6 N/m3."
    )
    scores = tuple(
        Score(name, value, "1", count, "measured markers", words) for name, value in rows
    )
    return Identified(parameters, scores, (note,))


def _one(_: Parameters) -> float:
    return 1.0


INPUTS = (
    Input("modulus", lambda p: _material(p, E=p.material.E * (1 + p.ranges.E)), _one,
          "E within its declared relative uncertainty"),
    Input("Poisson ratio", lambda p: _material(p, nu=p.material.nu - p.ranges.nu), _one,
          "nu within its declared uncertainty"),
    Input("plate friction", lambda p: replace(p, plates="bonded"), lambda p: p.ranges.friction,
          "a share of the way from slipping to bonded plates"),
    Input("image pose x", lambda p: _place(p, image_shift_x=p.ranges.pose), _one,
          "image plane along the stage; the meshed inclusion follows"),
    Input("image pose z", lambda p: _place(p, image_shift_z=p.ranges.pose), _one,
          "image plane sideways; the meshed inclusion follows"),
    Input("inclusion radius", lambda p: _include(p, wider=p.inclusion.wider + p.ranges.radius),
          _one, "radius of the meshed inclusion"),
    Input("inclusion length", lambda p: _include(p, longer=p.inclusion.longer + p.ranges.length),
          _one, "length of the meshed inclusion"),
)  # fmt: skip

BASE = Variant("md_fluid")
EFFECTS = (
    EffectSpec("fluid", "no fluid instead of constant volume (P1)",
               Variant("p1_fluid"), Variant("p1_dry")),
    EffectSpec("plate contact", "bonded instead of slipping plates",
               BASE, Variant("md_fluid", lambda p: replace(p, plates="bonded")),
               itself="plate friction"),
    EffectSpec("partial friction", "plates with 1e5 N/m3 of tangential stiffness instead of slip",
               BASE, Variant("md_fluid", lambda p: replace(p, plates="partial", friction=1e5)),
               itself="plate friction"),
    EffectSpec("membrane", "a taut latex membrane of 0.1 mm on the cavity wall",
               BASE, Variant("md_fluid", lambda p: replace(
                   p, membrane=replace(p.membrane, thickness=1e-4)))),
    EffectSpec("locking", "P1 instead of P2 on the same mesh",
               Variant("p2_fluid"), Variant("p1_fluid")),
    EffectSpec("element", "P1 mean dilatation instead of P2 on the same mesh",
               Variant("p2_fluid"), BASE),
    EffectSpec("mesh", "the second, finer mesh", BASE, Variant("md_fluid", _finer)),
    EffectSpec("loop", "the paper's loop at 1 % instead of the exact pressure",
               Variant("p1_fluid"), Variant("p1_loop")),
    EffectSpec("nearest node", "nearest node instead of interpolation",
               BASE, Variant("md_fluid", lambda p: _place(p, sampling="nearest_node",
                                                          wall="nearest_node"))),
    EffectSpec("modulus", "E 10 % higher",
               BASE, Variant("md_fluid", lambda p: _material(p, E=1.1 * p.material.E)),
               itself="modulus"),
    EffectSpec("Poisson ratio", "nu 0.45",
               BASE, Variant("md_fluid", lambda p: _material(p, nu=0.45)),
               itself="Poisson ratio"),
    EffectSpec("radius", "inclusion radius 0.5 mm smaller",
               BASE, Variant("md_fluid", lambda p: _include(p, wider=-0.5e-3)),
               itself="inclusion radius"),
    EffectSpec("centre", "image pose 1 mm along the stage, the inclusion follows",
               BASE, Variant("md_fluid", lambda p: _place(p, image_shift_x=1e-3)),
               itself="image pose x"),
    EffectSpec("registration", "similarity (scale fitted) instead of rigid",
               BASE, Variant("md_fluid", lambda p: _place(p, method="similarity"))),
)  # fmt: skip

ADDED_SENSORS = (
    Sensor("markers tracked by camera (0.1 mm)", "marker.inplane", 0.1e-3),
    Sensor("markers tracked by camera (0.1 mm)", "marker.vertical", 0.1e-3),
    Sensor("outline at 0.05 mm", "contour", 0.05e-3),
    Sensor("load cell (0.02 N)", "force.plate", 0.02),
    Sensor("pressure transducer (10 Pa)", "pressure", 10.0),
)

# The pressure's limit is wider than a tenth of what is measured (123 Pa at 9 mm): there 2 u_val is
# 180 Pa, most of it the declared 5 % of E, and a tenth could not be decided.
ACCEPT = (
    Accept("contour", 0.41e-3, "largest error of the paper's contour, 4.5"),
    Accept("marker.inplane", 1.0e-3, "hand tracking error, 4.5"),
    Accept("marker.vertical", 1.0e-3, "hand tracking error, 4.5"),
    Accept("pressure", 200.0, "hand-set, no source: 16-18 % of the largest measured pressure"),
)


def _quick(p: Parameters) -> Parameters:
    """The first load on a coarser mesh; the nominal one serves as its finer one."""
    g = p.mesh
    coarse = replace(g, nodes_x=7, nodes_y=8, nodes_z=11,
                     finer_x=g.nodes_x, finer_y=g.nodes_y, finer_z=g.nodes_z)  # fmt: skip
    return replace(p, mesh=coarse, loads=p.loads[:1])


def trial(recording: Recording, parameters: Parameters, quick: bool) -> Trial:
    return phantom_trial(build, METHODS["p1_fluid"].scene, recording, parameters, quick)


EXPERIMENT = Experiment(
    name="fluid_phantom",
    title="Fluid inclusion in a gelatin phantom under plate compression",
    source="Gosline, Salcudean, Yan (2004), section 4",
    parameters=Parameters(),
    methods=METHODS,
    accepted=("p2_fluid",),
    accept=ACCEPT,
    load=load,
    build=build,
    place=place,
    uncertainty=Uncertainty(
        finer=_finer,
        refinement=lambda p: float(p.mesh.ratio**2 - 1),
        inputs=INPUTS,
        surrogate="md_fluid",
    ),
    effects=EFFECTS,
    sensors=ADDED_SENSORS,
    published=figures,
    identify=identify,
    ladder=Ladder(trial),
    quick=_quick,
    twin=Twin(
        record,
        seed=Parameters().twin.seed,
        notice=(
            "The recording is a twin: it and the accepted model share the law (linear "
            "elasticity), not the mesh. A real phantom's force would differ from every linear "
            "model by about 15 % at 9 mm; this recording cannot show that."
        ),
    ),
)
