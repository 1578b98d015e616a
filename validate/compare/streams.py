"""Which streams of the recordings an experiment uses, and why the others are not."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from validate.recording.types import Contours, Frames, Markers, Recording, Signal, Stream
from validate.register.registered import Registered

_KINDS: tuple[tuple[type[Stream], str], ...] = (
    (Markers, "markers"),
    (Signal, "signal"),
    (Contours, "outlines"),
    (Frames, "images"),
)
_ROLES = {
    "drives": "drives the simulation",
    "calibrates": "used to identify",
    "validates": "compared with what is simulated",
}


@dataclass(frozen=True)
class StreamUse:
    """A stream of a recording: whether the experiment uses it, and what for or why not."""

    recording: str
    topic: str
    kind: str
    used: bool
    why: str


def stream_uses(
    recordings: Sequence[Recording], methods: Sequence[Sequence[Registered]]
) -> tuple[StreamUse, ...]:
    """Every stream of every recording, read or not; `methods` hold the registrations of each."""
    return tuple(
        use
        for i, recording in enumerate(recordings)
        for use in _uses(recording, [seen[i] for seen in methods if i < len(seen)])
    )


def _uses(recording: Recording, registered: Sequence[Registered]) -> Iterator[StreamUse]:
    roles = {o.name: _ROLES[o.role] for seen in registered for o in seen.observations}
    found_in = {c.images: k for k, c in recording.contours.items() if c.images and k in roles}
    for topic, stream in recording.streams.items():
        use = _use(topic, stream, roles, found_in)
        why = use or _why_not(stream, recording, roles)
        yield StreamUse(recording.name, topic, _kind(stream), bool(use), why)
    for topic, why in recording.unread.items():
        yield StreamUse(recording.name, topic, "not read", False, why)


def _kind(stream: Stream) -> str:
    return next(name for kind, name in _KINDS if isinstance(stream, kind))


def _use(topic: str, stream: Stream, roles: Mapping[str, str], found_in: Mapping[str, str]) -> str:
    """What a stream is used for; empty where it is not."""
    if topic in found_in:
        return f"source of the outlines '{found_in[topic]}'"
    made = isinstance(stream, Contours) and stream.images
    end = f"; extracted from the images '{made}', not as recorded" if made else ""
    return f"{roles[topic]}{end}" if topic in roles else ""


def _why_not(stream: Stream, recording: Recording, roles: Mapping[str, str]) -> str:
    if not isinstance(stream, Frames):
        return "no observation of the experiment uses it"
    others = [f"'{topic}'" for topic in recording.contours if topic in roles]
    if others:
        return f"no outline is extracted from them: {', '.join(others)} are compared as recorded"
    return "no outline is extracted from them"
