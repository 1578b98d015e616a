"""A block with a fluid-filled inclusion between two plates, from outlines, markers and a stage:
what a file of one's own declares, and the experiment that follows.

Frame: x from the fixed plate (0) to the moving one, y up, z lateral; metres.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from validate.compare.result import Kind
from validate.compare.verdict import Accept
from validate.errors import ComparisonError
from validate.parameters import Ranges, known, quantity
from validate.recording.types import Contours, Recording
from validate.register.clock import clock_sd
from validate.register.fitting import MarkerFit
from validate.register.inclusion import outlined_capsule
from validate.register.markers import Together, placed_markers
from validate.register.observation import nearest_sample
from validate.register.outlines import Corner, observe_outlines
from validate.register.plane import SurfaceSampler, cavity_sampler
from validate.register.registered import Registered
from validate.register.signals import driving, holds_at, instant, require_rising, validating
from validate.replay.cards import beside, rubbed
from validate.replay.experiment import Change, Experiment, Input, MeshLadder, Uncertainty, vary
from validate.replay.method import Method
from validate.scene.inclusion import Block, Capsule, block_with_inclusion
from validate.scene.material import Material
from validate.scene.mesh import Mesh, quadratic
from validate.scene.plates import Contact, Plates, between_plates
from validate.scene.scene import Cavity, Dilatation, Drive, Scene, Support
from validate.scene.similar_grids import member
from validate.solve.fluid import ExactPressure, NoFluid

# The stage presses towards the fixed plate; the block stands on a table.
PLATES = Plates(Drive("stage", "x1", (-1.0, 0.0, 0.0)), "x0", Support("y0", (1,)))
CAVITIES = (Cavity("inclusion", "cavity"),)
_WITHIN = 0.1e-3  # m: the stage stood at a load
_TRACES = {"N": ("force.plate", "stage.force"), "Pa": ("pressure", "inclusion.pressure")}
_PLANE = (
    Together("marker.inplane", (0, 2), "position along the stage and sideways"),
    Together("marker.vertical", (1,), "position along the vertical"),
)


@dataclass(frozen=True)
class BlockCard:
    x: float | None = quantity(None, "m", "distance from the fixed to the moving plate", asked=True)
    y: float | None = quantity(None, "m", "height", asked=True)
    z: float | None = quantity(None, "m", "lateral size", asked=True)

    @property
    def size(self) -> Block:
        """Raises `UsageError` while a size is not set."""
        return Block(known(self.x, "block.x"), known(self.y, "block.y"), known(self.z, "block.z"))


@dataclass(frozen=True)
class GelCard:
    E: float = quantity(15_000.0, "Pa", "Young's modulus; affects only forces and pressures")
    nu: float = quantity(0.485, "1", "Poisson ratio")


@dataclass(frozen=True)
class BlockNodes:
    nodes_x: int = quantity(9, "1", "nodes along x (9 x 10 x 15 gives the 1328 of paper 000)")
    nodes_y: int = quantity(10, "1", "nodes along y")
    nodes_z: int = quantity(15, "1", "nodes along z")

    @property
    def nodes(self) -> tuple[int, int, int]:
        return (self.nodes_x, self.nodes_y, self.nodes_z)


@dataclass(frozen=True)
class BlockGrid(BlockNodes):
    finer: float = quantity(1.25, "1", "how many times finer the finest mesh is, for u_num")


@dataclass(frozen=True)
class InclusionRanges(Ranges):
    E: float = quantity(0.05, "1", "relative, of the modulus")
    nu: float = quantity(0.005, "1", "of the Poisson ratio")
    friction: float = quantity(0.03, "1", "absolute, of the plates' friction share k/(k + 4 E/x)")


@dataclass(frozen=True)
class Streams:
    """Topics of the recording. `signals` are a force in N or a pressure in Pa."""

    stage: str = quantity("stage", "1", "displacement of the moving plate, m")
    outline: str = quantity("outline", "1", "outlines of the inclusion")
    markers: str = quantity("markers", "1", "markers")
    signals: tuple[str, ...] = quantity((), "1", "force and pressure, where recorded")
    tracker: str = quantity("pen", "1", "record with the upward direction of the markers")


@dataclass(frozen=True)
class InclusionTest:
    """Everything a user decides; `recording` lies beside the file."""

    recording: str = quantity("", "1", "MCAP file, from the experiment's folder")
    block: BlockCard = BlockCard()
    material: GelCard = GelCard()
    mesh: BlockGrid = BlockGrid()
    ranges: InclusionRanges = InclusionRanges()
    streams: Streams = Streams()
    registration: MarkerFit = MarkerFit()
    plates: Contact = quantity("slip", "1", "contact of both plates")
    friction: float = quantity(0.0, "N/m3", "tangential stiffness of the plates, if partial")
    loads: tuple[float, ...] = quantity((), "m", "stage positions compared")


@dataclass(frozen=True)
class Filled:
    """What a method's scene is built with."""

    order: Literal[1, 2] = quantity(2, "1", "element order; 1 means nodal mean dilatation")


def filled(label: str, *, order: Literal[1, 2] = 2, fluid: bool = True) -> Method:
    """A linear model with fluid of constant volume in the inclusion, or with an empty one."""
    return Method(label, ExactPressure() if fluid else NoFluid(), Filled(order))


#: The inputs that every such experiment has, with the fields of `InclusionRanges`.
INPUTS = (
    vary("material.E", "relative ranges.E", "modulus", "E within its declared uncertainty"),
    vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
         "nu within its declared uncertainty"),
    Input("plate friction", rubbed, "share of the way from slipping to bonded plates", "assumed"),
)  # fmt: skip


def inclusion_test(
    name: str,
    title: str,
    source: str,
    parameters: InclusionTest,
    methods: Mapping[str, Method],
    accepted: tuple[str, ...],
    accept: tuple[Accept, ...],
    kind: Kind = "measured",
) -> Experiment:
    """The experiment; the last method, the cheapest, is the one that inputs are varied with."""
    return Experiment(
        name, title, source, parameters, methods, accepted, accept, beside, _build, _place,
        kind=kind,
        uncertainty=Uncertainty(
            mesh=BLOCK_MESHES,
            inputs=INPUTS,
            surrogate=next(n for n, m in methods.items() if m.scene == Filled(1)),
        ),
    )  # fmt: skip


def _build(recording: Recording, p: InclusionTest, model: Filled) -> Scene:
    capsule = measured_capsule(recording, recording.contour(p.streams.outline), p.streams)
    mesh = block_with_inclusion(p.block.size, p.mesh.nodes, capsule)
    return pressed_block(
        mesh, Material(p.material.E, p.material.nu), p.plates, model.order, friction=p.friction
    )


def _place(recording: Recording, p: InclusionTest, scene: Scene) -> Registered:
    contours = recording.contour(p.streams.outline)
    wall = cavity_sampler(scene.mesh, "cavity", measured_capsule(recording, contours, p.streams))
    units = {topic: _unit(recording, topic) for topic in p.streams.signals}
    return placed(
        recording, contours, scene, wall, p.streams, units, p.loads, _PLANE, how=p.registration
    )


def _unit(recording: Recording, topic: str) -> str:
    """The unit of a signal; where it is absent or of another kind, the one to be asked for."""
    found = recording.signals.get(topic)
    return found.unit if found is not None and found.unit in _TRACES else "N"


# --- what a paper's own block of this kind uses too -----------------------------------------------


def measured_capsule(
    recording: Recording, contours: Contours, streams: Streams, allowance: float = 0.0
) -> Capsule:
    """Centre x, z and radius of the rest outline; height and length from record 'inclusion'.

    `allowance` m and what is raised: `outlined_capsule`.
    """
    rest = holds_at(driving(recording, streams.stage, "m"), contours.t, (), within=_WITHIN)[0]
    index = nearest_sample(contours.t, instant(rest), "outlines")
    return outlined_capsule(contours, index, recording.record("inclusion"), allowance)


def pressed_block(
    mesh: Mesh, material: Material, contact: Contact, order: Literal[1, 2],
    dilatation: Dilatation = "nodal_mean", **more: Any,
) -> Scene:  # fmt: skip
    """The block of linear cells, made of `order`, between its plates; `dilatation` is of order 1,
    `more` goes to `between_plates`."""
    return between_plates(
        mesh if order == 1 else quadratic(mesh), material, contact, PLATES,
        "pointwise" if order == 2 else dilatation, cavities=CAVITIES, **more,
    )  # fmt: skip


def placed(
    recording: Recording, contours: Contours, scene: Scene, wall: SurfaceSampler, streams: Streams,
    units: Mapping[str, str], loads: tuple[float, ...], together: tuple[Together, ...], *,
    corners: tuple[Corner, ...] = (), **registration: Any,
) -> Registered:  # fmt: skip
    """Stage, outlines, markers and signals (`units` by topic, N or Pa) at rest and at `loads` m.

    `registration` goes to `placed_markers`. Raises `RegistrationError` for a signal that falls as
    the plates close, and what the parts raise.
    """
    stage = driving(recording, streams.stage, "m")
    signals = []
    for topic, unit in units.items():
        measured, trace = _TRACES[unit]
        signals.append(validating(recording, topic, unit, quantity=measured, trace=trace))
        require_rising(stage, signals[-1])
    if not loads:
        raise ComparisonError("no loads: nothing can be compared; set stage positions in m")
    rest, *holds = holds_at(stage, contours.t, loads, within=_WITHIN)
    outline = observe_outlines(
        contours, wall, rest=instant(rest), corners=corners, name=streams.outline,
        sd_t=clock_sd(recording, streams.outline),
    )  # fmt: skip
    markers = placed_markers(
        recording, scene.mesh, topic=streams.markers, together=together, tracker=streams.tracker,
        up=(0.0, 1.0, 0.0), **registration,
    )  # fmt: skip
    return Registered((stage, outline, markers, *signals), tuple(holds), rest)


def gridded(share: float | None) -> Change:
    """The most similar grid with about `share` of the cells along every edge (none: its own
    `finer`)."""

    def change(p: Any) -> Any:
        g = p.mesh
        by = g.finer if share is None else share
        cells = member([n - 1 for n in g.nodes], by)
        names = ("nodes_x", "nodes_y", "nodes_z")
        return replace(p, mesh=replace(g, **{k: n + 1 for k, n in zip(names, cells, strict=True)}))

    return change


def _cell(p: Any) -> float:
    """The edge m of a cube as large as a mean cell."""
    cells = np.prod(np.array(p.mesh.nodes) - 1)
    return float(np.cbrt(np.prod(p.block.size.sizes) / cells))


# More than three: the inclusion is cut from the grids, which scatters. 8 x 9 x 14 cells have no
# common factor: within 5 % the grids are similar. Order 2: corners at the plates and facets on the
# wall limit that of quadratic elements.
_COARSER = (0.625, 0.75, 0.875)
BLOCK_MESHES = MeshLadder(tuple(gridded(share) for share in (*_COARSER, None)), _cell)
