"""Topics of a replay over time: signals and images."""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.recording.images.image import encode_png
from validate.recording.mcap.protobuf_messages import protobuf_message
from validate.recording.mcap.schemas import CALIBRATION, CALIBRATION_KEYS, SIGNAL, signal_message
from validate.recording.types import Frames
from validate.report.replay.foxglove import IMAGE, picture
from validate.report.replay.view import ReplayView, Track, pose_records
from validate.report.sections.observations import holds
from validate.report.sections.observations import signals as scalar_signals

_SAMPLES = 4000  # messages of one signal, at most
_IMAGE_BYTES = 1_500_000  # of one stream of images, about


def signals(view: ReplayView) -> list[Track]:
    """What drives as measured; every signal as compared, and the run's trace that predicts it."""
    drives, seen = view.registered.drives, scalar_signals(view.registered)
    # "force.plate" is "force" when nothing else is a force, else "force/plate"
    quantities = [*(d.name.strip("/") for d in drives), *(s.quantity for s in seen)]
    first = [q.split(".")[0] for q in quantities]
    names = [
        f if first.count(f) == 1 else q.replace(".", "/")
        for f, q in zip(first, quantities, strict=True)
    ]
    found = [
        replace(
            _signal(view, f"/{name}/measured", s.t, s.y, s.unit, s.sd), given=s.role == "drives"
        )
        for s, name in zip((*drives, *seen), names, strict=True)
    ]
    for s, name in zip(seen, names[len(drives) :], strict=True):
        if view.run is not None and s.trace in view.run.traces:
            trace, t = view.run.traces[s.trace], view.run.t
            simulated = f"/{name}/simulated"
            found.append(_signal(view, simulated, t, trace.y[:, None], trace.unit, 0.0))
    return found


def _signal(view: ReplayView, topic: str, t: Floats, y: Floats, unit: str, sd: float) -> Track:
    every = one_in(len(t), _SAMPLES // view.coarse)
    kept, frame, note = y[::every], view.drive_frame, thinned(every, len(t), "samples")

    def message(ns: int, i: int) -> bytes:
        return protobuf_message(SIGNAL, signal_message(ns, frame, unit, kept[i], sd))

    track = view.track(topic, SIGNAL, t[::every], message, note)
    return replace(track, unit=unit, width=y.shape[1])


def images(view: ReplayView) -> list[Track]:
    """Every stream of images, thinned to a size in bytes; with calibration and pose."""
    streams = view.recording.frames
    several = len(streams) > 1
    return [
        _images(view, f"/image/{topic.strip('/')}/measured" if several else "/image/measured", f)
        for topic, f in streams.items()
    ]


def _images(view: ReplayView, topic: str, frames: Frames) -> Track:
    size = max(1, len(encode_png(frames.images[0])))
    every = one_in(len(frames.t), _IMAGE_BYTES // view.coarse // size)
    at_loads = {int(np.abs(frames.t - hold.t).argmin()) for hold in holds(view.registered)}
    kept = sorted({*range(0, len(frames.t), every), *at_loads})
    scales = zip(CALIBRATION_KEYS, frames.m_per_px, strict=True)
    named = view.prefix + topic
    calibration = (CALIBRATION + named, {key: repr(scale) for key, scale in scales})
    return view.track(
        topic, IMAGE, frames.t[kept],
        lambda ns, i: picture(ns, frames.frame, encode_png(frames.images[kept[i]])),
        thinned(every, len(frames.t), "images, and those at the loads"),
        (*pose_records(named, frames.pose), calibration),
    )  # fmt: skip


def one_in(count: int, most: int) -> int:
    """Return the step that leaves at most `most` of `count`."""
    return max(1, -(-count // max(1, most)))


def thinned(every: int, count: int, what: str) -> str:
    """Return the share of kept samples in words, "one in 3"; empty for all of them."""
    return f"one in {every} of {count} {what}" if every > 1 else ""
