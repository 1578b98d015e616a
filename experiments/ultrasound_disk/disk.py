"""A disk of nominal diameter in real B-mode images: parameters, recording, scene, registration.

The outline is found in every image by itself. Image metres are the file's pixels times their side,
which rests on the speed of sound that the scanner assumed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats, rms
from validate.datasets.home import data_path
from validate.errors import RecordingError, UsageError
from validate.parameters import Ranges, quantity
from validate.pipeline.experiment.tree import Tree
from validate.recording.outlines.outline import extract_outline
from validate.recording.readers import recognised
from validate.recording.types import Contours, Recording
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.meshless import RigidBody

from .round_outlines import ENDS, RoundOutlines

FOLDER, FILE = "ultrasound/disk", "bmode_PWI_disk.mat"
OUTLINES, FOUND = "disk", "outlines"
_SIDE = 1e-4  # m: of a pixel of the data set's images
_FEWEST = 0.5  # of the images in which the disk must be seen


@dataclass(frozen=True)
class Disk:
    diameter: float = quantity(20e-3, "m", "nominal diameter")

    def __post_init__(self) -> None:
        if not 0 < self.diameter < 1:
            raise UsageError(
                f"disk.diameter = {self.diameter:g} m: expected a size above 0 and below 1 m, "
                "for example 20mm"
            )


@dataclass(frozen=True)
class ImageCard:
    m_per_px: float | None = quantity(
        None, "m", "side of a pixel; none: the file's, 0.1 mm where its format states none"
    )
    rate: float = quantity(
        1.0, "Hz", "images a second, if the file has none; no result depends on it"
    )
    topic: str | None = quantity(None, "1", "the images among several; none: the only ones")
    bright: bool = quantity(True, "1", "whether the disk is brighter than what surrounds it")
    scale: float = quantity(1.0, "1", "true lengths over those of the images")


@dataclass(frozen=True)
class DiskRanges(Ranges):
    scale: float = quantity(0.01, "1", "relative, of the images' lengths: the speed of sound")
    diameter: float = quantity(0.05e-3, "m", "of the nominal diameter")


@dataclass(frozen=True)
class ImagedDisk:
    """The recording: any file of images that a reader takes; where none is named the data set's."""

    disk: Disk = Disk()
    image: ImageCard = ImageCard()
    ranges: DiskRanges = DiskRanges()


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """The images with the outline found in each; those without one are named in its records.

    Raises `RecordingError` where fewer than half of the images show a disk.
    """
    p: ImagedDisk = tree.settings
    path = data_path(FOLDER, FILE, folder, tree.recording or None)
    recording = _read(path, p.image)
    topic = _topic(recording, p.image.topic)
    frames = recording.frame(topic)
    # Outlines by image, and why others have none
    outlines, refused = {}, {}
    for i, image in enumerate(frames.images):
        try:
            outlines[i] = extract_outline(image, frames.m_per_px, bright=p.image.bright)
        except RecordingError as error:
            refused[i] = str(error)
    if len(outlines) < _FEWEST * len(frames.images):
        raise RecordingError(
            f"{recording.name}: the disk is found in {len(outlines)} of {len(frames.images)} "
            f"images; first refusal: {next(iter(refused.values()))}; the disk was assumed to be "
            f"{'bright' if p.image.bright else 'dark'}: --set image.bright={not p.image.bright}"
        )
    at = np.array(sorted(outlines))
    contours = Contours(
        frames.t[at], tuple(outlines[i].points for i in at), rms([o.sd for o in outlines.values()]),
        frames.pose, frames.frame, topic,
    )  # fmt: skip
    told = {f"image {i}": why for i, why in refused.items()}
    told["contrast"] = f"{min(o.contrast for o in outlines.values()):.2f}"
    return (
        replace(
            recording,
            contours={**recording.contours, OUTLINES: contours},
            metadata={**recording.metadata, FOUND: told},
        ),
    )


def _read(path: Path, image: ImageCard) -> Recording:
    try:
        return recognised(path).read(path, _options(path, image))
    except UsageError as error:
        raise UsageError(f"{error}; in a run --set image.m_per_px=0.1mm") from None


def _options(path: Path, image: ImageCard) -> Mapping[str, str]:
    """What formats that state no scale are asked for; one that does is taken at its word, unless
    the user says otherwise."""
    kind, side = recognised(path).name, image.m_per_px
    if kind in ("matlab", "png-stack"):
        return {"m_per_px": repr(side or _SIDE), "rate": repr(image.rate)}
    if kind in ("metaimage", "nrrd") and side:
        return {"m_per_px": repr(side)}
    return {}


def _topic(recording: Recording, wanted: str | None) -> str:
    topics = list(recording.frames)
    if wanted is None and len(topics) != 1:
        raise RecordingError(
            f"{recording.name}: {len(topics)} streams of images {topics}; --set image.topic=NAME"
        )
    return wanted or topics[0]


def build(recording: Recording, tree: Tree, model: None) -> RigidBody:
    """Two points of the disk, a diameter apart; it does not deform."""
    p: ImagedDisk = tree.settings
    radius = p.disk.diameter / 2
    return RigidBody(ENDS, np.array([[-radius, 0.0, 0.0], [radius, 0.0, 0.0]]))


def place(recording: Recording, tree: Tree, scene: RigidBody) -> Registered:
    """The disk's centre is that of the circle through every outline; its diameter is predicted."""
    p: ImagedDisk = tree.settings
    seen = outlined(recording, p)
    centres: Floats = np.array([[*c.centre, 0.0] for c in seen.circles])
    none = np.zeros(centres.shape)
    drives = (
        SignalObservation("rotation", "drives", seen.t, none, "rad", 0.0),
        SignalObservation("translation", "drives", seen.t, centres, "m", 0.0),
    )
    return Registered((*drives, seen))


def outlined(recording: Recording, p: ImagedDisk) -> RoundOutlines:
    """The disk as it was found in the images."""
    contours = recording.contour(OUTLINES)
    frames = recording.frame(contours.images)
    return RoundOutlines("diameter", "validates", contours, frames, p.image.scale)
