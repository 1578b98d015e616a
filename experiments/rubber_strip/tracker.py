"""A tracker against a stage: a rigid body moved by known steps, seen by each camera in pixels."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.exhibit import Chart, Exhibit, NumberTable, Series
from validate.errors import RecordingError

from .points_file import StageTest, read_stage

_UM = 1e6


@dataclass(frozen=True)
class AgainstStage:
    """One camera: `along`, `aside` (nt,) m, what the mean of all points is off the stage along its
    motion and across it; `scatter` m of one point about that mean; `scale` px per m."""

    name: str
    points: int
    stage: Floats
    along: Floats
    aside: Floats
    scatter: float
    scale: float


def against_stage(test: StageTest) -> AgainstStage:
    """Every point has a straight path of its own, in proportion to the stage: perspective gives
    each another length. What is left is the tracker, the stage and the cameras' mounting.

    Raises `RecordingError` for fewer than four positions, a stage that stands, and points that are
    nowhere seen throughout.
    """
    x = test.points[:, np.isfinite(test.points).all(axis=(0, 2))]
    s = test.stage - test.stage.mean()
    if len(s) < 4 or not s.any() or not x.shape[1]:
        raise RecordingError(
            f"{test.name}: {len(s)} positions over {1e3 * np.ptp(test.stage):g} mm, {x.shape[1]} "
            "points seen throughout; 4 positions of a stage that moves are needed"
        )
    centred = x - x.mean(axis=0)
    slopes = np.einsum("k,kni->ni", s, centred) / (s @ s)
    left = centred - s[:, None, None] * slopes
    mean, way = left.mean(axis=1), slopes.mean(axis=0)
    scale = float(np.linalg.norm(way))
    e = way / scale
    lost = np.sqrt(len(s) / (len(s) - 2))  # two numbers of every path are fitted
    scatter = rms((left - mean[:, None]).reshape(-1, 1)) * lost / scale
    aside = mean @ np.array([-e[1], e[0]])
    return AgainstStage(
        test.name, x.shape[1], test.stage, mean @ e / scale, aside / scale, float(scatter), scale
    )


def stage_exhibit(folder: Path, pattern: str) -> Exhibit | None:
    """The stage test beside a recording; None where there is none."""
    files = sorted(folder.glob(pattern))
    found = [against_stage(read_stage(file)) for file in files]
    if not found:
        return None
    return Exhibit(
        "tracker", "Tracker compared with a stage", _WORDS, (_table(found),), (_chart(found),)
    )


_WORDS = (
    "A rigid body on a motor stage, each camera separately, in pixels. The scale comes from "
    "the stage, because the data contain no calibration of the cameras. An error of scale or "
    "in the third direction cannot be detected. The residual includes errors of the stage and "
    "of the mounting of the cameras.",
)


def _table(found: Sequence[AgainstStage]) -> NumberTable:
    rows = [
        (
            one.name, one.points, len(one.stage), 1e-3 * one.scale, _UM * rms(one.along[:, None]),
            _UM * float(np.abs(one.along).max()), _UM * rms(one.aside[:, None]), _UM * one.scatter,
        )
        for one in found
    ]  # fmt: skip
    return NumberTable(
        "tracker",
        "Mean of all points minus stage, rms and largest over the positions, along its motion "
        "and across it; and the standard deviation of one point about the mean.",
        ("camera", "points", "positions", "scale / px/mm", "along, rms / um", "along, max / um",
         "across, rms / um", "one point / um"),
        tuple(rows),
    )  # fmt: skip


def _chart(found: Sequence[AgainstStage]) -> Chart:
    series = [Series(f"{one.name}, along", 1e3 * one.stage, _UM * one.along) for one in found]
    series += [Series(f"{one.name}, across", 1e3 * one.stage, _UM * one.aside) for one in found]
    return Chart(
        "tracker", "Mean of all points minus stage", "stage / mm", "error / um", tuple(series)
    )
