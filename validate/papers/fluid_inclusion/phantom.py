"""The phantom of paper 000 as it is modelled: parameters, recording, scene and registration.

Frame "phantom": x from the probe plate (0) to the stage plate, y up, z lateral; metres.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from validate.errors import UsageError
from validate.papers.fluid_inclusion.swept import (
    SWEEP,
    off_circles,
    outlined_sweep,
    stack_of,
    swept,
)
from validate.papers.fluid_inclusion.twin import PhantomTwin, record_phantom
from validate.parameters import quantity, take_units
from validate.recording.images.outline import outlines_of
from validate.recording.types import Contours, Recording
from validate.register.fitting import MarkerFit
from validate.register.markers import Sampling, Together
from validate.register.observation import Observation
from validate.register.outlines import Corner
from validate.register.plane import cavity_sampler
from validate.register.registered import Registered
from validate.register.sensing import ForceSensing, PressureSensing
from validate.register.signals import SignalObservation
from validate.register.sweep import Stack
from validate.replay.experiment import Progress
from validate.replay.inclusion import InclusionRanges, Streams, measured_capsule, placed
from validate.replay.tree import Tree, beside
from validate.scene.inclusion import Block, Capsule, block_with_inclusion
from validate.scene.inclusion_shape import InclusionShape
from validate.scene.mesh import Mesh, quadratic
from validate.scene.scene import Scene
from validate.scene.similar_grids import member


@dataclass(frozen=True)
class InclusionCard:
    """None: centre x, z and radius from the rest outline, the rest from the declared sweep."""

    shape: Literal["capsule", "sweep"] = quantity(
        "capsule", "1", "capsule through the rest outline, or meshed from the outlines of a sweep"
    )
    free: float = quantity(
        0.0, "1", "sections of a sweep: circles of equal area (0) to the outlines themselves (1)"
    )
    centre_x: float | None = quantity(None, "m", "centre along the stage; none: from the outline")
    centre_y: float | None = quantity(None, "m", "height of the centre; none: from the sweep")
    centre_z: float | None = quantity(None, "m", "lateral centre; none: from the outline")
    radius: float | None = quantity(None, "m", "radius; none: from the outline")
    length: float | None = quantity(None, "m", "length along y; none: from the sweep")
    wider: float = quantity(0.0, "m", "added to the radius that is meshed")
    longer: float = quantity(0.0, "m", "added to the length that is meshed")

    def __post_init__(self) -> None:
        own = ("centre_x", "centre_y", "centre_z", "radius", "length")
        given = [name for name in own if getattr(self, name) is not None]
        if self.shape == "sweep" and given:
            raise UsageError(
                f"body.inclusion.{given[0]} applies to a capsule; a sweep contains the place "
                "of its inclusion: set body.inclusion.wider or body.inclusion.longer"
            )


@dataclass(frozen=True)
class PhantomBody:
    """The body of a scene: a block with an inclusion that the recording shows."""

    x: float = quantity(0.060, "m", "distance from the fixed to the moving plate")
    y: float = quantity(0.045, "m", "height")
    z: float = quantity(0.070, "m", "lateral size")
    cells: tuple[int, ...] = quantity(
        (8, 9, 14), "1", "cells along x, y, z (8 x 9 x 14 has the 1328 nodes of paper 000)"
    )
    element: Literal["linear", "quadratic"] = quantity("linear", "1", "element order")
    inclusion: InclusionCard = InclusionCard()

    def __post_init__(self) -> None:
        take_units(self)
        if len(self.cells) != 3:
            raise UsageError(f"body.cells = {self.cells}: expected three numbers of cells")

    @property
    def block(self) -> Block:
        return Block(self.x, self.y, self.z)

    @property
    def cell_size(self) -> float:
        """The edge m of a cube as large as a mean cell of the block without its inclusion."""
        return float(np.cbrt(self.block.sizes.prod() / np.prod(self.cells)))

    def scaled(self, share: float) -> "PhantomBody":
        return replace(self, cells=member(self.cells, share))

    def __call__(self, recording: Recording, tree: Tree) -> Mesh:
        x, y, z = self.cells
        grid = (x + 1, y + 1, z + 1)
        mesh = block_with_inclusion(self.block, grid, inclusion(recording, tree))
        return quadratic(mesh) if self.element == "quadratic" else mesh


@dataclass(frozen=True)
class Placing(MarkerFit):
    sampling: Sampling = quantity("barycentric", "1", "markers to nodes")
    wall: Literal["measured", "facets", "nearest_node"] = quantity(
        "measured", "1", "wall on the measured circle, on the mesh's facets, or by nearest node"
    )
    image_shift_x: float = quantity(0.0, "m", "correction of the image pose along x")
    image_shift_z: float = quantity(0.0, "m", "correction of the image pose along z")


@dataclass(frozen=True)
class PhantomRanges(InclusionRanges):
    pose: float = quantity(0.1e-3, "m", "of the image pose, per axis")
    radius: float = quantity(0.05e-3, "m", "of the inclusion's radius")
    length: float = quantity(0.5e-3, "m", "of the inclusion's length")


@dataclass(frozen=True)
class Sensors:
    load_cell: ForceSensing = field(default_factory=ForceSensing)
    pressure: PressureSensing = field(default_factory=PressureSensing)

    def of(self, seen: Observation) -> Observation:
        """What was there, of what a sensor read."""
        own = getattr(self, seen.name, None)
        return own.of(seen) if own and isinstance(seen, SignalObservation) else seen


@dataclass(frozen=True)
class Phantom:
    """What no scene holds."""

    registration: Placing = Placing()
    sensors: Sensors = field(default_factory=Sensors)
    ranges: PhantomRanges = PhantomRanges()
    twin: PhantomTwin = PhantomTwin()
    positions: tuple[float, ...] = quantity((0.003, 0.006, 0.009), "m", "stage positions compared")
    outlines: Literal["recorded", "images"] = quantity(
        "recorded", "1", "outlines as recorded, or extracted from the B-mode images"
    )


def record(tree: Tree, progress: Progress) -> Recording:
    twin, scene = tree.settings.twin, tree.scene
    material = replace(scene.material, law=twin.law)
    return record_phantom(twin, scene.body.block, material, progress)


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    return tuple(read(recording, tree) for recording in beside(tree, folder))


def read(recording: Recording, tree: Tree) -> Recording:
    """The recording with the outlines that are to be used."""
    if tree.scene.body.inclusion.shape == "sweep":
        recording = outlined_sweep(recording)
    if tree.settings.outlines == "recorded":
        return recording
    outlines = outlines_of(recording.frame(IMAGES), images=IMAGES)
    return replace(recording, contours={**recording.contours, "outline": outlines})


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    p: Phantom = tree.settings
    contours = _shifted(recording.contour("outline"), tree)
    found, how = measured_inclusion(recording, tree), p.registration
    shape = None if how.wall == "facets" else found
    wall = cavity_sampler(scene.mesh, "cavity", shape, nearest=how.wall == "nearest_node")
    seen = placed(
        recording, contours, scene, wall, STREAMS, SIGNALS, p.positions, TOP_FACE,
        corners=(TOP_LEFT,), how=how, sampling=how.sampling,
    )  # fmt: skip
    swept_one = tree.scene.body.inclusion.shape == "sweep"
    told = (off_circles(_stack(recording, tree)),) if swept_one else ()
    observations = tuple(map(p.sensors.of, seen.observations))
    misplaced = _misplaced(found, inclusion(recording, tree))
    return replace(seen, observations=observations, findings=(*told, *misplaced))


STREAMS, IMAGES = Streams(), "b_mode"
SIGNALS = {"load_cell": "N", "pressure": "Pa"}
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


def _misplaced(measured: InclusionShape, meshed: InclusionShape) -> tuple[str, ...]:
    """A word where the meshed inclusion is not where the rest outline lies."""
    off = float(np.linalg.norm(np.array(measured.centre) - np.array(meshed.centre)))
    wide = meshed.radius - measured.radius
    if off < 0.5e-3 and abs(wide) < 0.5e-3:
        return ()
    return (
        f"The meshed inclusion's centre is {1e3 * off:.2f} mm from the measured one and its "
        f"radius {1e3 * wide:+.2f} mm off; outlines are drawn on the measured wall and do not "
        "show this.",
    )


def inclusion(recording: Recording, tree: Tree) -> InclusionShape:
    """The inclusion that is meshed: what the user set, else what was measured."""
    mine: InclusionCard = tree.scene.body.inclusion
    if mine.shape == "sweep":
        return swept(_stack(recording, tree), mine.free, mine.wider, mine.longer)
    measured = _outlined(recording, tree)
    own = (mine.centre_x, mine.centre_y, mine.centre_z)
    x, y, z = (m if o is None else o for o, m in zip(own, measured.centre, strict=True))
    return Capsule(
        (x, y, z),
        (measured.radius if mine.radius is None else mine.radius) + mine.wider,
        (measured.length if mine.length is None else mine.length) + mine.longer,
    )


def measured_inclusion(recording: Recording, tree: Tree) -> InclusionShape:
    """The inclusion as measured: by the rest outline and the declared sweep, or by the sweep."""
    capsule = _outlined(recording, tree)  # which refuses a mirrored image
    if tree.scene.body.inclusion.shape == "capsule":
        return capsule
    return swept(_stack(recording, tree), tree.scene.body.inclusion.free)


def _outlined(recording: Recording, tree: Tree) -> Capsule:
    """Centre x, z and radius of the rest outline; height and length from the declared sweep."""
    contours = _shifted(recording.contour("outline"), tree)
    how: Placing = tree.settings.registration
    moved = abs(how.image_shift_x) + abs(how.image_shift_z)
    return measured_capsule(recording, contours, STREAMS, moved)


def _stack(recording: Recording, tree: Tree) -> Stack:
    sweep = _shifted(recording.contour(SWEEP), tree)
    return stack_of(recording, sweep, recording.signal(STREAMS.stage, "m"))


def _shifted(contours: Contours, tree: Tree) -> Contours:
    pose = contours.pose.copy()
    how: Placing = tree.settings.registration
    pose[[0, 2], 3] += how.image_shift_x, how.image_shift_z
    return replace(contours, pose=pose)
