"""The phantom of paper 000: settings beside its scene, recording and registration.

Frame "phantom": x from the probe plate (0) to the stage plate, y up, z lateral; metres.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import rms
from validate.errors import RecordingError
from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Tree, beside
from validate.pipeline.plates.inclusion import (
    InclusionRanges,
    InclusionRegistration,
    InclusionTest,
    Streams,
)
from validate.recording.outlines.outline import extract_outline
from validate.recording.types import Contours, Frames, Recording
from validate.register.markers.markers import Together
from validate.register.observation import Observation
from validate.register.outlines.outlines import Corner
from validate.register.registration import Registered
from validate.register.sensing import ForceSensing, PressureSensing
from validate.register.signals import SignalObservation
from validate.scene.scene import Scene

from .twin import PhantomTwin, record_phantom


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

    streams: ClassVar[Streams] = Streams(signals=("load_cell", "pressure"))
    registration: InclusionRegistration = InclusionRegistration()
    sensors: Sensors = field(default_factory=Sensors)
    ranges: PhantomRanges = PhantomRanges()
    twin: PhantomTwin = field(default_factory=PhantomTwin)
    positions: tuple[float, ...] = quantity((0.003, 0.006, 0.009), "m", "stage positions compared")
    outlines: Literal["recorded", "images"] = quantity(
        "recorded", "1", "outlines as recorded, or extracted from the B-mode images"
    )


def record(tree: Tree, progress: Progress) -> Recording:
    return record_phantom(tree.settings.twin, tree.scene, progress)


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    return tuple(read(recording, tree) for recording in beside(tree, folder))


def read(recording: Recording, tree: Tree) -> Recording:
    """The recording with the outlines that are to be used."""
    recording = InclusionTest.read(recording, tree)
    if tree.settings.outlines == "recorded":
        return recording
    outlines = outlines_in(recording.frame(IMAGES), IMAGES)
    return replace(recording, contours={**recording.contours, "outline": outlines})


def outlines_in(frames: Frames, topic: str) -> Contours:
    """The outline of every image of `topic`; sd is the root mean square of all.

    Raises `RecordingError` naming the first image without one and how many there are: none is left
    out silently.
    """
    outlines, refused = [], []
    for i, image in enumerate(frames.images):
        try:
            outlines.append(extract_outline(image, frames.m_per_px))
        except RecordingError as error:
            refused.append(f"image {i} (t = {frames.t[i]:.3f} s): {error}")
    if refused:
        raise RecordingError(
            f"{len(refused)} of {len(frames.images)} images without an outline, first {refused[0]}"
        )
    points, sd = tuple(o.points for o in outlines), rms([o.sd for o in outlines])
    return Contours(frames.t, points, sd, frames.pose, frames.frame, topic)


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    p: Phantom = tree.settings
    seen = InclusionTest.place(recording, tree, scene, p.positions, TOP_FACE, corners=(TOP_LEFT,))
    return replace(seen, observations=tuple(map(p.sensors.of, seen.observations)))


IMAGES = "b_mode"
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
