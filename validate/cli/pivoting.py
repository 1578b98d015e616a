"""`validate calibrate --pivot`: the tip of a tracked tool, from turns about points it stands on."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats, Ints
from validate.cli.display import say
from validate.cli.recordings import written
from validate.errors import UsageError
from validate.places import try_file
from validate.recording.formats.options import length
from validate.recording.formats.poses import ROTATION, TRANSLATION
from validate.recording.mcap.write import write_recording
from validate.recording.readers import read_recording
from validate.recording.types import Markers, Recording
from validate.register.dwell import dwells
from validate.register.pivot import Pivot, pivot

_RADIUS, _LEAST = 3e-3, 1.0  # m, s: within which a tip that is roughly known stands, and how long


def calibrate_tip(file: Path, out: Path, tool: str, reference: str, rough: str) -> None:
    """Finds where the tip of `tool` is, and writes its path with that.

    The whole recording turns about one point; with a `rough` tip (as 108mm,8mm,3mm), about each
    point that it is seen to stand on.
    """
    try_file(out)
    recording = read_recording(file)
    t, R, T = _in_reference(recording, tool, reference)
    kept, point = _points(t, R, T, rough)
    found = pivot(R[kept], T[kept], point)
    for key, text in _record(found).items():
        say(f"{key}: {text}", indent="  ")
    frame = reference or recording.signal(f"{tool}/{TRANSLATION}", "m").frame
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
        "sd": f"{listed(found.sd, '.2g')}, by leaving out each tenth of the poses",
        "fitted": f"rms {1e3 * found.rms:.3g} mm per axis of {len(found.used)} of "
        f"{len(found.off)} poses about {len(found.points)} points",
        "turns": f"{turns} degrees rms in the three directions",
    }


def _poses(recording: Recording, tool: str) -> tuple[Floats, Floats, Floats]:
    tools = sorted(
        t.removesuffix(f"/{ROTATION}") for t in recording.signals if t.endswith(f"/{ROTATION}")
    )
    if tool not in tools:
        raise UsageError(f"no poses of '{tool}'; there are {', '.join(tools) or 'none'}")
    turned = recording.signal(f"{tool}/{ROTATION}", "1")
    return turned.t, turned.y.reshape(-1, 3, 3), recording.signal(f"{tool}/{TRANSLATION}", "m").y


def _in_reference(recording: Recording, tool: str, reference: str) -> tuple[Floats, Floats, Floats]:
    """Times and poses of the tool, in the frame of a tracked reference where one is named."""
    t, R, T = _poses(recording, tool)
    if not reference:
        return t, R, T
    other, Q, P = _poses(recording, reference)
    _, i, j = np.intersect1d(np.rint(1e9 * t), np.rint(1e9 * other), return_indices=True)
    if not len(i):
        raise UsageError(f"'{tool}' and '{reference}' are never seen at one time")
    Qt = np.swapaxes(Q[j], 1, 2)
    return t[i], Qt @ R[i], np.einsum("nij,nj->ni", Qt, T[i] - P[j])


def _points(t: Floats, R: Floats, T: Floats, rough: str) -> tuple[Ints, Ints]:
    """The poses that count, and which point each stands on."""
    if not rough:
        return np.arange(len(t)), np.zeros(len(t), dtype=np.int64)
    words = rough.split(",")
    if len(words) != 3:
        raise UsageError(f"--tip {rough}: expected three lengths, as 108mm,8mm,3mm")
    tip = np.array([_signed(word) for word in words])
    parts = dwells(t, R @ tip + T, _RADIUS, _LEAST)
    if not parts:
        raise UsageError(f"the tip never stands within {1e3 * _RADIUS:g} mm for {_LEAST:g} s")
    at = [np.arange(d.begin, d.end) for d in parts]
    return np.concatenate(at), np.repeat(np.arange(len(at)), [len(i) for i in at])


def _signed(word: str) -> float:
    text = word.strip()
    sign = -1.0 if text.startswith("-") else 1.0
    return sign * length({"tip": text.lstrip("+-")}, "tip", "108mm", zero=True)
