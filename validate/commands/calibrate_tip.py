"""`validate calibrate --pivot`: tip of a tracked tool by pivot calibration."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats, Ints
from validate.commands.digitise import LEAST, RADIUS
from validate.commands.display import say
from validate.commands.recordings import written
from validate.commands.tool_poses import in_reference, tip_offset
from validate.errors import UsageError
from validate.places import try_file
from validate.recording.mcap.write import write_recording
from validate.recording.motion_capture.poses import TRANSLATION
from validate.recording.readers import read_recording
from validate.recording.types import Markers
from validate.register.tools.landmarks import dwells
from validate.register.tools.pivot import Pivot, pivot


def calibrate_tip(file: Path, out: Path, tool: str, reference: str, rough: str) -> None:
    """Finds where the tip of `tool` is, and writes its path with that.

    The whole recording turns about one point; with a `rough` tip (as 108mm,8mm,3mm), about each
    point that it is seen to stand on.
    """
    try_file(out)
    recording = read_recording(file)
    t, R, T, frame = in_reference(recording, tool, reference)
    kept, point = _points(t, R, T, rough)
    found = pivot(R[kept], T[kept], point)
    for key, text in _record(found).items():
        say(f"{key}: {text}", indent="  ")
    path = Markers(t, ("tip",), (R @ found.tip + T)[:, None], found.rms, frame)
    done = replace(
        recording,
        markers={**recording.markers, f"{tool}/tip": path},
        clock={**recording.clock, f"{tool}/tip": recording.clock[f"{tool}/{TRANSLATION}"]},
        metadata={**recording.metadata, f"pivot/{tool}": _record(found)},
    )
    write_recording(done, out)
    written(done, out)


def _record(found: Pivot) -> dict[str, str]:
    def listed(x: Floats, form: str) -> str:
        return ", ".join(format(1e3 * v, form) for v in x) + " mm"

    turns = ", ".join(f"{np.degrees(v):.3g}" for v in found.turns)
    return {
        "tip": listed(found.tip, ".5g"),
        "sd": f"{listed(found.sd, '.2g')}, from leaving out each tenth of the poses",
        "fitted": f"rms {1e3 * found.rms:.3g} mm per axis of {len(found.used)} of "
        f"{len(found.off)} poses about {len(found.points)} points",
        "turns": f"{turns} degrees rms in the three directions",
    }


def _points(t: Floats, R: Floats, T: Floats, rough: str) -> tuple[Ints, Ints]:
    """The poses that count, and which point each stands on."""
    if not rough:
        return np.arange(len(t)), np.zeros(len(t), dtype=np.int64)
    tip = tip_offset(rough)
    parts = dwells(t, R @ tip + T, RADIUS, LEAST)
    if not parts:
        raise UsageError(
            f"the tip never stays within {1e3 * RADIUS:g} mm for {LEAST:g} s; check --tip"
        )
    at = [np.arange(d.begin, d.end) for d in parts]
    return np.concatenate(at), np.repeat(np.arange(len(at)), [len(i) for i in at])
