"""Channels of a recording by name, for synchronisation of two clocks.

`force` is a signal of one column, `force.1` the second column of several, `markers.tip.z` a
marker's coordinate, `images.brightness` the mean grey level of each image (a flash) and
`images.change` the rms difference of each image from the one before (a motion). A leading `-` turns
the sign.
"""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError
from validate.recording.types import Frames, Markers, Recording, Signal

_AXES = "xyz"
_OF_IMAGES = ("brightness", "change")


def channel(recording: Recording, name: str) -> Signal:
    """Return the channel as a signal (nt, 1), samples where nothing was seen left out.

    Raises `UsageError` with the channels that there are.
    """
    plain = name.removeprefix("-")
    topics = [t for t in recording.streams if plain == t or plain.startswith(f"{t}.")]
    if not topics:
        raise _unknown(recording, name)
    topic = max(topics, key=len)
    stream, rest = recording.streams[topic], plain[len(topic) + 1 :]
    found = _found(stream, rest)
    if found is None:
        raise _unknown(recording, name)
    seen = np.isfinite(found.y[:, 0])
    sign = -1.0 if name.startswith("-") else 1.0
    return replace(found, t=found.t[seen], y=sign * found.y[seen])


def _found(stream: object, rest: str) -> Signal | None:
    match stream:
        case Signal() if not rest and stream.y.shape[1] == 1:
            return stream
        case Signal() if rest.isdecimal() and int(rest) < stream.y.shape[1]:
            return replace(stream, y=stream.y[:, [int(rest)]])
        case Markers():
            return _coordinate(stream, rest)
        case Frames() if rest in _OF_IMAGES:
            return _of_images(stream, rest)
    return None


def _coordinate(markers: Markers, rest: str) -> Signal | None:
    marker, _, axis = rest.rpartition(".")
    axes = _AXES[: markers.x.shape[2]]
    if marker not in markers.names or len(axis) != 1 or axis not in axes:
        return None
    x = markers.x[:, markers.names.index(marker), axes.index(axis)]
    # Missing ones leave before a signal of finite numbers is made.
    seen = np.isfinite(x)
    return Signal(markers.t[seen], x[seen, None], "m", markers.sd, markers.frame)


def _of_images(frames: Frames, rest: str) -> Signal | None:
    if rest == "brightness":
        return _grey(frames.t, [image.mean() for image in frames.images])
    pairs = zip(frames.images[:-1], frames.images[1:], strict=True)
    away = [np.sqrt(((b.astype(float) - a) ** 2).mean()) for a, b in pairs]
    return _grey((frames.t[1:] + frames.t[:-1]) / 2, away) if away else None


def _grey(t: Floats, values: list[float]) -> Signal:
    return Signal(t, np.array(values)[:, None], "grey level", 0.0, "image")


def _unknown(recording: Recording, name: str) -> UsageError:
    listed = ", ".join(n for topic in recording.streams for n in _names(recording, topic))
    return UsageError(f"{recording.name}: no channel '{name}'; there are {listed}")


def _names(recording: Recording, topic: str) -> list[str]:
    match recording.streams[topic]:
        case Signal() as s if s.y.shape[1] == 1:
            return [topic]
        case Signal() as s:
            return [f"{topic}.{i}" for i in range(s.y.shape[1])]
        case Markers() as m:
            return [f"{topic}.{m.names[0]}.x", f"... ({len(m.names)} markers)"]
        case Frames():
            return [f"{topic}.{what}" for what in _OF_IMAGES]
    return []
