"""A rubber strip pulled in steps: tracked points and registration; what its scene does not hold.

No force and no thickness were recorded: moduli cannot be known, nor whether the strip contracts in
thickness as it does in width; a law has one Poisson ratio for both.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validate.datasets.home import data_path
from validate.errors import RecordingError
from validate.parameters import quantity
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording, Signal
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.meshless import MaterialPoint

from .points_file import read_points
from .stretches import Seen, Stretches, stretches

FOLDER = "markers/rubber-strip"
POINTS = "points3d_mm.npz"
FIRST, LAST = "stretch.transverse.first", "stretch.transverse.last"


@dataclass(frozen=True)
class StripRatios:
    svk: float | None = quantity(None, "1", "Poisson ratio, St. Venant-Kirchhoff; none: identified")
    neo_split: float | None = quantity(None, "1", "neo-Hooke, split; none: identified")
    neo_coupled: float | None = quantity(None, "1", "neo-Hooke, coupled; none: identified")
    incompressible: float = quantity(0.4999, "1", "of the candidate of constant volume")


@dataclass(frozen=True)
class Strip:
    """`first` steps calibrate, the last one is predicted."""

    nu: StripRatios = StripRatios()
    first: float = quantity(0.06, "1", "axial strain up to which steps calibrate")
    patches: int = quantity(8, "1", "parts of the strip, along it, that the mean is over")
    unit: str | None = quantity(None, "1", "of the points; none: the end of the file's name")
    stage: str = quantity(
        "rbm_cam*_px.npz", "1", "files of the stage test in the folder of the recording"
    )


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """Mean stretches of the strip at every state."""
    own: Strip = tree.settings
    points = read_points(recorded(tree, folder), own.unit)
    seen = stretches(points.marker("points").x, own.patches)
    return (_reduced(points, seen, own),)


def recorded(tree: Tree, folder: Path) -> Path:
    """The file of the tracked points; where none is named that of VALIDATE_SHARED_DATA."""
    return data_path(FOLDER, POINTS, folder, tree.recording or None)


def _reduced(points: Recording, seen: Stretches, p: Strip) -> Recording:
    axial, across = seen.axial.mean(axis=1), seen.across.mean(axis=1)
    early: Seen = np.asarray((axial > 1) & (axial <= 1 + p.first))
    early[0] = False  # at rest
    if early.sum() < 2 or axial[-1] <= 1 + p.first:
        raise RecordingError(
            f"{points.name}: {early.sum()} states up to first = {100 * p.first:g} % axial strain, "
            f"the last one at {100 * (axial[-1] - 1):.3g} %: two states and a later last one are "
            "needed; --set first="
        )
    t = points.marker("points").t
    signals = {
        "axial": Signal(t, axial[:, None], "1", seen.sd_axial, "strip"),
        "across": Signal(t, across[:, None], "1", seen.sd_across, "strip"),
    }
    said = {"states that calibrate": " ".join(map(str, np.flatnonzero(early))),
            "apart": repr(_apart(seen, early))}  # fmt: skip
    return replace(
        points, markers={}, signals=signals, metadata={**points.metadata, "stretches": said}
    )


def _apart(seen: Stretches, early: Seen) -> float:
    """Standard error of the last mean stretch across, by how the patches differ in what became of
    their own first ratio: the strip is not homogeneous, and each patch stretches on by itself."""
    log = np.log(seen.axial[early])
    first = (log**2 * seen.ratio[early[1:]]).sum(axis=0) / (log**2).sum(axis=0)
    change = seen.ratio[-1] - first
    error = change.std(ddof=1) / np.sqrt(len(change))
    return float(error * np.log(seen.axial[-1].mean()) * seen.across[-1].mean())


def place(recording: Recording, tree: Tree, scene: MaterialPoint) -> Registered:
    """The axial stretch drives; across, the first states calibrate and the last one validates."""
    across, said = recording.signal("across", "1"), recording.record("stretches")
    early = [int(k) for k in said["states that calibrate"].split()]
    first = SignalObservation(
        "across", "calibrates", across.t[early], across.y[early], "1", across.sd, FIRST,
        "free_stretch",
    )  # fmt: skip
    last = replace(
        first, role="validates", t=across.t[-1:], y=across.y[-1:], quantity=LAST,
        sd=float(np.hypot(across.sd, float(said["apart"]))),
    )  # fmt: skip
    return Registered(
        (SignalObservation.driving(recording, "axial", "1"), first, last), timed=False
    )
