"""Questions about a block with a fluid-filled inclusion (outlines, stage, markers)."""

from collections.abc import Sequence
from dataclasses import fields as dataclass_fields
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.commands.questions.answers import Answers, Question
from validate.commands.questions.kinds import NewKind, quantity_in
from validate.pipeline.plates.inclusion import Streams
from validate.recording.types import Recording, Signal


def _fits(recording: Recording) -> bool:
    known = {"marker_layout", "inclusion"} <= recording.metadata.keys()
    stage = any(s.unit == "m" for s in recording.signals.values())
    return bool(recording.contours and recording.markers and stage and known)


def _asks(recording: Recording, folder: Path, found: Answers) -> Sequence[Question]:
    length = quantity_in("m")
    along = {"x": "length (fixed to moving plate)", "y": "height", "z": "lateral size"}
    return [
        Question(
            f"body.{c}", f"{what} of the block, in m or as 60mm; empty: left open", check=length
        )
        for c, what in along.items()
    ]


def _fields(recording: Recording, source: str, folder: Path, found: Answers) -> dict[str, str]:
    outline, contours = next(iter(recording.contours.items()))
    topic = next(iter(recording.markers))
    layout = recording.record("marker_layout")
    stage_topic, stage = _stage(recording)
    places = np.array([[float(x) for x in v.split()] for v in layout.values()])
    reached = np.interp(contours.t, stage.t, stage.y[:, 0])
    loads = tuple(sorted({round(float(x), 4) for x in reached if abs(x) > 1e-4}))
    tracker = next((k for k, record in recording.metadata.items() if "up" in record), "pen")
    default = {f.name: f.default for f in dataclass_fields(Streams)}
    named = {"stage": stage_topic, "outline": outline, "markers": topic, "tracker": tracker}
    streams = [f"{key}={value!r}" for key, value in named.items() if value != default[key]]
    streams.append(f"signals={_scalars(recording)!r}")
    return {
        "highest": f"{float(places[:, 1].max()):.6g}",
        "side_x": f"{_side(places[:, 0]):.6g}",
        "side_z": f"{_side(places[:, 2]):.6g}",
        "loads": repr(loads),
        "streams": ", ".join(streams),
        **{f"size_{c}": _size(found.get(f"body.{c}", "")) for c in "xyz"},
    }


def _size(answer: str) -> str:
    return repr(f"{1e3 * quantity_in('m')(answer):.6g} mm") if answer else "None"


def _stage(recording: Recording) -> tuple[str, Signal]:
    lengths = {t: s for t, s in recording.signals.items() if s.unit == "m"}
    topic = "stage" if "stage" in lengths else next(iter(lengths))
    return topic, lengths[topic]


def _side(x: Floats) -> float:
    """A block whose margins on both sides are alike, to 5 mm."""
    return round(float(x.min() + x.max()) / 5e-3) * 5e-3


def _scalars(recording: Recording) -> tuple[str, ...]:
    """Topics of the first force and the first pressure."""
    found = {s.unit: topic for topic, s in reversed(list(recording.signals.items()))}
    return tuple(found[unit] for unit in ("N", "Pa") if unit in found)


def _used(recording: Recording, found: Answers) -> set[str]:
    """Images give outlines."""
    outline, contours = next(iter(recording.contours.items()))
    used = {outline, contours.images, next(iter(recording.markers)), _stage(recording)[0]}
    return used | set(_scalars(recording))


def _assumed(recording: Recording, found: Answers) -> Sequence[str]:
    return ()


INCLUSION = NewKind(
    "inclusion",
    "a block with a fluid-filled inclusion between plates",
    "outlines, a stage (m) and markers with records 'inclusion' and 'marker_layout'",
    "FEM",
    "new_inclusion.py.txt",
    _fits,
    _asks,
    _fields,
    _used,
    _assumed,
)
