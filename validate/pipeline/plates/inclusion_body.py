"""Block with an inclusion: a body whose mesh follows from a recording.

The settings beside such a scene say where the outlines are (`streams`) and how the image lies
(`registration`); see `pipeline.plates.inclusion`.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from validate.errors import UsageError
from validate.parameters import known, quantity, take_units
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.inclusion_sweep import SWEEP, stack_of, swept
from validate.recording.types import Contours, Recording
from validate.register.observation import nearest_sample
from validate.register.outlines.round_outlines import outlined_capsule
from validate.register.outlines.sweep import Stack
from validate.register.signals import driving, holds_at, instant
from validate.scene.geometries.box import member
from validate.scene.geometries.inclusion import Block, Capsule, InclusionShape, block_with_inclusion
from validate.scene.mesh import Mesh, quadratic

WITHIN = 0.1e-3  # m: the stage stood at a load


@dataclass(frozen=True)
class MeshedInclusion:
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
        take_units(self)
        own = ("centre_x", "centre_y", "centre_z", "radius", "length")
        given = [name for name in own if getattr(self, name) is not None]
        if self.shape == "sweep" and given:
            raise UsageError(
                f"body.inclusion.{given[0]} applies to a capsule; a sweep contains the place "
                "of its inclusion: set body.inclusion.wider or body.inclusion.longer"
            )


@dataclass(frozen=True)
class BlockWithInclusion:
    """A block from the origin with an inclusion that the recording shows; sets x0 to z1, cavity.

    Sizes may stay open (None) until they are measured.
    """

    x: float | None = quantity(None, "m", "distance from the fixed to the moving plate", asked=True)
    y: float | None = quantity(None, "m", "height", asked=True)
    z: float | None = quantity(None, "m", "lateral size", asked=True)
    cells: tuple[int, ...] = quantity(
        (8, 9, 14), "1", "cells along x, y, z (8 x 9 x 14 has the 1328 nodes of paper 000)"
    )
    element: Literal["linear", "quadratic"] = quantity("linear", "1", "element order")
    inclusion: MeshedInclusion = MeshedInclusion()

    def __post_init__(self) -> None:
        take_units(self)
        if len(self.cells) != 3:
            raise UsageError(f"body.cells = {self.cells}: expected three numbers of cells")

    @property
    def block(self) -> Block:
        """Raises `UsageError` while a size is open."""
        return Block(known(self.x, "body.x"), known(self.y, "body.y"), known(self.z, "body.z"))

    @property
    def cell_size(self) -> float:
        """The edge m of a cube as large as a mean cell of the block without its inclusion."""
        return float(np.cbrt(self.block.sizes.prod() / np.prod(self.cells)))

    def scaled(self, share: float) -> "BlockWithInclusion":
        return replace(self, cells=member(self.cells, share))

    def __call__(self, recording: Recording, tree: Tree) -> Mesh:
        x, y, z = self.cells
        grid = (x + 1, y + 1, z + 1)
        mesh = block_with_inclusion(self.block, grid, inclusion(recording, tree))
        return quadratic(mesh) if self.element == "quadratic" else mesh


def inclusion(recording: Recording, tree: Tree) -> InclusionShape:
    """Return the inclusion that is meshed: what the user set, else what was measured."""
    mine: MeshedInclusion = tree.scene.body.inclusion
    if mine.shape == "sweep":
        return swept(sweep_stack(recording, tree), mine.free, mine.wider, mine.longer)
    measured = _outlined(recording, tree)
    own = (mine.centre_x, mine.centre_y, mine.centre_z)
    x, y, z = (m if o is None else o for o, m in zip(own, measured.centre, strict=True))
    return Capsule(
        (x, y, z),
        (measured.radius if mine.radius is None else mine.radius) + mine.wider,
        (measured.length if mine.length is None else mine.length) + mine.longer,
    )


def measured_inclusion(recording: Recording, tree: Tree) -> InclusionShape:
    """Return the inclusion as measured: by the rest outline and the declared sweep, or by the
    sweep."""
    capsule = _outlined(recording, tree)  # which refuses a mirrored image
    if tree.scene.body.inclusion.shape == "capsule":
        return capsule
    return swept(sweep_stack(recording, tree), tree.scene.body.inclusion.free)


def sweep_stack(recording: Recording, tree: Tree) -> Stack:
    """Return the slices of the recorded sweep, as the image is placed."""
    sweep = shifted(recording.contour(SWEEP), tree)
    return stack_of(recording, sweep, recording.signal(tree.settings.streams.stage, "m"))


def shifted(contours: Contours, tree: Tree) -> Contours:
    """Outlines with the correction of their image's pose."""
    pose, how = contours.pose.copy(), tree.settings.registration
    pose[[0, 2], 3] += how.image_shift_x, how.image_shift_z
    return replace(contours, pose=pose)


def _outlined(recording: Recording, tree: Tree) -> Capsule:
    """Centre x, z and radius of the rest outline; height and length from record 'inclusion'."""
    streams, how = tree.settings.streams, tree.settings.registration
    contours = shifted(recording.contour(streams.outline), tree)
    rest = holds_at(driving(recording, streams.stage, "m"), contours.t, (), within=WITHIN)[0]
    index = nearest_sample(contours.t, instant(rest), "outlines")
    moved = abs(how.image_shift_x) + abs(how.image_shift_z)
    return outlined_capsule(contours, index, recording.record("inclusion"), moved)
