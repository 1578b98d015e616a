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
from validate.parameters import quantity
from validate.recording.images.outline import outlines_of
from validate.recording.readers import read_recording
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
from validate.replay.inclusion import (
    BlockCard,
    BlockGrid,
    GelCard,
    InclusionRanges,
    Streams,
    measured_capsule,
    placed,
    pressed_block,
)
from validate.scene.inclusion import Capsule, block_with_inclusion
from validate.scene.inclusion_shape import InclusionShape
from validate.scene.material import LawName, Material
from validate.scene.plates import Contact
from validate.scene.scene import Dilatation, Membrane, Scene


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
                f"inclusion.{given[0]} applies to a capsule; a sweep contains the place of its "
                "inclusion: set inclusion.wider or inclusion.longer"
            )


@dataclass(frozen=True)
class WallCard:
    thickness: float = quantity(0.0, "m", "latex membrane on the wall of the cavity; 0: none")
    E: float = quantity(1.2e6, "Pa", "modulus of latex, small strain")
    nu: float = quantity(0.49, "1", "Poisson ratio of latex")


@dataclass(frozen=True)
class PhantomGrid(BlockGrid):
    order: Literal[1, 2] | None = quantity(
        None, "1", "1 or 2 for every method; none: as each method declares"
    )


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
    """Everything that can be set; `recording` is a path."""

    material: GelCard = GelCard(15_200.0, 0.485)
    block: BlockCard = BlockCard(0.060, 0.045, 0.070)
    inclusion: InclusionCard = InclusionCard()
    membrane: WallCard = WallCard()
    mesh: PhantomGrid = PhantomGrid()
    registration: Placing = Placing()
    sensors: Sensors = field(default_factory=Sensors)
    ranges: PhantomRanges = PhantomRanges()
    twin: PhantomTwin = PhantomTwin()
    plates: Literal["as_method", "slip", "partial", "bonded"] = quantity(
        "as_method", "1", "contact of both plates, for every method"
    )
    friction: float = quantity(1e5, "N/m3", "tangential stiffness of the plates, if partial")
    loads: tuple[float, ...] = quantity((0.003, 0.006, 0.009), "m", "stage positions compared")
    outlines: Literal["recorded", "images"] = quantity(
        "recorded", "1", "outlines as recorded, or extracted from the B-mode images"
    )
    recording: str | None = quantity(None, "1", "MCAP file; none: the shipped one")


@dataclass(frozen=True)
class PhantomModel:
    """What a method's scene is built with."""

    order: Literal[1, 2] = quantity(1, "1", "element order")
    dilatation: Dilatation = quantity("pointwise", "1", "volume strain per cell or nodal mean")
    law: LawName = quantity("linear", "1", "linear, or at large strain svk or neo_hooke")
    plates: Contact = quantity("slip", "1", "contact of both plates")


def record(parameters: Phantom, progress: Progress) -> Recording:
    p = parameters
    material = Material(p.material.E, p.material.nu, p.twin.law)
    return record_phantom(p.twin, p.block.size, material, progress)


def load(parameters: Phantom, folder: Path) -> tuple[Recording, ...]:
    named = parameters.recording
    path = Path(named) if named else folder.parent / "recordings" / "fluid_phantom.mcap"
    return (read(read_recording(path), parameters),)


def read(recording: Recording, parameters: Phantom) -> Recording:
    """The recording with the outlines that are to be used."""
    if parameters.inclusion.shape == "sweep":
        recording = outlined_sweep(recording)
    if parameters.outlines == "recorded":
        return recording
    outlines = outlines_of(recording.frame(IMAGES), images=IMAGES)
    return replace(recording, contours={**recording.contours, "outline": outlines})


def build(recording: Recording, parameters: Phantom, model: PhantomModel) -> Scene:
    p = parameters
    mesh = block_with_inclusion(p.block.size, p.mesh.nodes, inclusion(recording, p))
    material = Material(p.material.E, p.material.nu, model.law)
    contact = model.plates if p.plates == "as_method" else p.plates
    return pressed_block(
        mesh, material, contact, p.mesh.order or model.order, model.dilatation,
        friction=p.friction, membrane=_membrane(p.membrane),
    )  # fmt: skip


def _membrane(wall: WallCard) -> tuple[Membrane, ...]:
    if wall.thickness == 0:
        return ()
    return (Membrane("cavity", wall.thickness, Material(wall.E, wall.nu)),)


def place(recording: Recording, parameters: Phantom, scene: Scene) -> Registered:
    p = parameters
    contours = _shifted(recording.contour("outline"), p)
    found, how = measured_inclusion(recording, p), p.registration
    shape = None if how.wall == "facets" else found
    wall = cavity_sampler(scene.mesh, "cavity", shape, nearest=how.wall == "nearest_node")
    seen = placed(
        recording, contours, scene, wall, STREAMS, SIGNALS, p.loads, TOP_FACE,
        corners=(TOP_LEFT,), how=how, sampling=how.sampling,
    )  # fmt: skip
    told = (off_circles(_stack(recording, p)),) if p.inclusion.shape == "sweep" else ()
    observations = tuple(map(p.sensors.of, seen.observations))
    misplaced = _misplaced(found, inclusion(recording, p))
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


def inclusion(recording: Recording, parameters: Phantom) -> InclusionShape:
    """The inclusion that is meshed: what the user set, else what was measured."""
    mine = parameters.inclusion
    if mine.shape == "sweep":
        return swept(_stack(recording, parameters), mine.free, mine.wider, mine.longer)
    measured = _outlined(recording, parameters)
    own = (mine.centre_x, mine.centre_y, mine.centre_z)
    x, y, z = (m if o is None else o for o, m in zip(own, measured.centre, strict=True))
    return Capsule(
        (x, y, z),
        (measured.radius if mine.radius is None else mine.radius) + mine.wider,
        (measured.length if mine.length is None else mine.length) + mine.longer,
    )


def measured_inclusion(recording: Recording, parameters: Phantom) -> InclusionShape:
    """The inclusion as measured: by the rest outline and the declared sweep, or by the sweep."""
    capsule = _outlined(recording, parameters)  # which refuses a mirrored image
    if parameters.inclusion.shape == "capsule":
        return capsule
    return swept(_stack(recording, parameters), parameters.inclusion.free)


def _outlined(recording: Recording, parameters: Phantom) -> Capsule:
    """Centre x, z and radius of the rest outline; height and length from the declared sweep."""
    contours = _shifted(recording.contour("outline"), parameters)
    moved = abs(parameters.registration.image_shift_x) + abs(parameters.registration.image_shift_z)
    return measured_capsule(recording, contours, STREAMS, moved)


def _stack(recording: Recording, parameters: Phantom) -> Stack:
    sweep = _shifted(recording.contour(SWEEP), parameters)
    return stack_of(recording, sweep, recording.signal(STREAMS.stage, "m"))


def _shifted(contours: Contours, parameters: Phantom) -> Contours:
    pose = contours.pose.copy()
    pose[[0, 2], 3] += parameters.registration.image_shift_x, parameters.registration.image_shift_z
    return replace(contours, pose=pose)
