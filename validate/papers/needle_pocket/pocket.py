"""The body and the needle of paper 000, section 5.2: parameters, scene and registration.

The block is that of section 3.3 (5 x 5 cm, E 34 kPa, nu .35, plane strain), its pocket in the
middle; "solid" is a cube of the same side around a capsule, which the paper has not. x is centred,
y runs up from -side to 0, the lower side is held. In the plane forces are per metre of depth.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from validate.papers.needle_pocket.recorded import walkable
from validate.parameters import Ranges, quantity
from validate.recording.readers import read_recording
from validate.recording.types import Recording
from validate.register.observation import EVERYTHING
from validate.register.registered import Registered
from validate.register.signals import SignalObservation, validating
from validate.scene.hollow_block import Cavities, HollowBlock
from validate.scene.inclusion import Block, Capsule, block_with_inclusion
from validate.scene.material import Material
from validate.scene.mesh import Mesh, quadratic
from validate.scene.scene import Cavity, Scene, Support
from validate.scene.tool import Needle

TOOL, POCKET = "needle", "pocket"
AXES = "xyz"
DOWN: Mapping[int, tuple[float, ...]] = {2: (0.0, -1.0), 3: (0.0, -1.0, 0.0)}
Space = Literal["plane", "solid"]


@dataclass(frozen=True)
class PocketBody:
    space: Space = quantity("plane", "1", "the plane block of section 3.3, or a cube in 3-D")
    side: float = quantity(0.05, "m", "of the block")
    pocket: float = quantity(0.010, "m", "side of the square pocket, in the middle")
    radius: float = quantity(0.009, "m", "of the capsule, in 3-D")
    length: float = quantity(0.028, "m", "of the capsule, along z, in 3-D")

    @property
    def dimension(self) -> int:
        return 2 if self.space == "plane" else 3


@dataclass(frozen=True)
class PocketGel:
    E: float = quantity(34_000.0, "Pa", "Young's modulus, as printed in section 3.3")
    nu: float = quantity(0.35, "1", "Poisson ratio, as printed there")


@dataclass(frozen=True)
class PocketGrid:
    plane: int = quantity(40, "1", "squares across the plane block, of two triangles each")
    solid: int = quantity(8, "1", "cells along an edge of the cube, of six tetrahedra each")


@dataclass(frozen=True)
class PocketRanges(Ranges):
    E: float = quantity(0.02, "1", "relative, of the modulus")
    nu: float = quantity(0.005, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class HandCard:
    """None: in the plane 20 and 500 N per metre, in 3-D 0.1 and 5 N."""

    grip: float | None = quantity(
        None, "N", "pulling force at which contact ends; none: depends on the dimension"
    )
    limit: float | None = quantity(
        None, "N", "largest force on the hand; none: depends on the dimension"
    )


@dataclass(frozen=True)
class PocketTwin:
    """What made the recording: quadratic elements on a finer mesh, the exact pressure."""

    plane: int = quantity(80, "1", "squares across its plane block")
    solid: int = quantity(10, "1", "cells along an edge of its cube")
    depth: float = quantity(0.006, "m", "how deep the hand goes")
    tremor: float = quantity(2e-5, "m", "of the hand, rms along every axis")
    rate: float = quantity(512.0, "1/s", "samples a second, as in section 5.2")
    seed: int = quantity(5, "1", "seed of tremor and noise")
    sd_tip: float = quantity(1e-6, "m", "noise of the needle's encoders")
    sd_force: float | None = quantity(None, "N", "noise; none: .2 N/m in the plane, 1 mN in 3-D")
    sd_pressure: float = quantity(5.0, "Pa", "pressure transducer noise")


@dataclass(frozen=True)
class NeedlePocket:
    """Everything that can be set; `recording` is a path."""

    material: PocketGel = field(default_factory=PocketGel)
    body: PocketBody = field(default_factory=PocketBody)
    mesh: PocketGrid = field(default_factory=PocketGrid)
    hand: HandCard = field(default_factory=HandCard)
    ranges: PocketRanges = field(default_factory=PocketRanges)
    twin: PocketTwin = field(default_factory=PocketTwin)
    recording: str | None = quantity(None, "1", "MCAP file with the tip's path; none: shipped")

    @property
    def grip(self) -> float:
        own = self.hand.grip
        return own if own is not None else {"plane": 20.0, "solid": 0.1}[self.body.space]

    @property
    def limit(self) -> float:
        own = self.hand.limit
        return own if own is not None else {"plane": 500.0, "solid": 5.0}[self.body.space]


@dataclass(frozen=True)
class PocketModel:
    """What a method's scene is built with."""

    order: Literal[1, 2] = quantity(1, "1", "element order")
    fluid: bool = quantity(True, "1", "fluid in the pocket; without it nothing holds its volume")


def body_mesh(body: PocketBody, plane: int, solid: int, order: int) -> Mesh:
    """Facet sets "bottom", "top" and "pocket"; y = 0 is the upper side.

    Raises `SceneError` for a pocket that the mesh cannot hold.
    """
    mesh = _plane(body, plane) if body.space == "plane" else _solid(body, solid)
    return quadratic(mesh) if order == 2 else mesh


def _plane(body: PocketBody, squares: int) -> Mesh:
    cavity = Cavities(1, body.pocket, body.pocket)
    mesh = HollowBlock(body.side, body.side, squares, cavities=cavity).resolved(Path())
    facets = {k: mesh.facets[k] for k in ("bottom", "top")} | {POCKET: mesh.facets["cavity0"]}
    return Mesh(mesh.nodes, mesh.cells, mesh.kind, facets)


def _solid(body: PocketBody, cells: int) -> Mesh:
    a = body.side
    shape = Capsule((a / 2, a / 2, a / 2), body.radius, body.length, axis=2)
    mesh = block_with_inclusion(Block(a, a, a), (cells + 1,) * 3, shape)
    facets = {"bottom": "y0", "top": "y1", POCKET: "cavity"}
    return Mesh(
        mesh.nodes - [a / 2, a, a / 2], mesh.cells, mesh.kind,
        {name: mesh.facets[of] for name, of in facets.items()},
    )  # fmt: skip


def pocket_scene(
    mesh: Mesh, material: Material, tip: tuple[float, ...], *, fluid: bool = True
) -> Scene:
    """The body, held below, and a needle whose tip stands at `tip` (d,) m."""
    d = mesh.dimension
    return Scene(
        mesh, material, (Support("bottom", tuple(range(d))),),
        cavities=(Cavity(POCKET, POCKET),) if fluid else (),
        tools=(Needle(TOOL, "top", tip, DOWN[d]),),
    )  # fmt: skip


def load(p: NeedlePocket, folder: Path) -> tuple[Recording, ...]:
    """The recording that is named, else the shipped one of that space."""
    name = "needle_pocket" if p.body.space == "plane" else "needle_pocket_solid"
    own = folder.parent / "recordings" / f"{name}.mcap"
    return (read_recording(Path(p.recording) if p.recording else own),)


def build(recording: Recording, p: NeedlePocket, model: PocketModel) -> Scene:
    mesh = body_mesh(p.body, p.mesh.plane, p.mesh.solid, model.order)
    tip = tuple(walkable(recording, mesh).x[0].tolist())
    material = Material(p.material.E, p.material.nu)
    return pocket_scene(mesh, material, tip, fluid=model.fluid)


def place(recording: Recording, p: NeedlePocket, scene: Scene) -> Registered:
    """The tip drives; what was recorded of force and pressure is compared at every sample."""
    path = walkable(recording, scene.mesh)
    moved = path.x - np.array(scene.tools[0].tip)
    drives = tuple(
        SignalObservation(f"tip.{a}", "drives", path.t, moved[:, [c]], "m", path.sd)
        for c, a in enumerate(AXES[: scene.mesh.dimension])
    )
    seen = tuple(
        validating(recording, topic, unit, quantity=topic, trace=trace)
        for topic, unit, trace in compared(scene.mesh.dimension)
        if topic in recording.signals
    )
    return Registered((*drives, *seen), (EVERYTHING,), findings=path.findings)


def compared(d: int) -> tuple[tuple[str, str, str], ...]:
    """Topic, unit and trace of what a recording may hold: measured, or given by the live loop."""
    axes = AXES[:d]
    return (
        *((f"force.{a}", "N", f"{TOOL}.force.{a}") for a in axes),
        ("pressure", "Pa", f"{POCKET}.pressure"),
        *((f"given.{a}", "N", f"{TOOL}.force.{a}") for a in axes),
    )


def sets(p: NeedlePocket, seen: Registered) -> Mapping[str, Any]:
    return {"grip": p.grip, "limit": p.limit}


def refined(share: float) -> Any:
    """The parameters with so many times the cells along every edge."""

    def change(p: NeedlePocket) -> NeedlePocket:
        plane, solid = round(share * p.mesh.plane), round((1 + share) / 2 * p.mesh.solid)
        return replace(p, mesh=PocketGrid(plane, solid))

    return change


def cell_size(p: NeedlePocket) -> float:
    """m along an edge."""
    return p.body.side / (p.mesh.plane if p.body.space == "plane" else p.mesh.solid)
