"""Input of a replay: one recording with one run, and the topics made from it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.result import MethodResult
from validate.numbers import fixed_with_unit, significant, spaced
from validate.recording.mcap.schemas import POSE, POSE_KEY
from validate.recording.mcap.write import stamps_ns
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.report.scenes.body_scene import HOW, Instant, at_times, held
from validate.report.sections.observations import drive, holds, outline
from validate.solve.types import Run

Records = tuple[tuple[str, dict[str, str]], ...]
_INSTANTS = 60  # instants of what is only looked at: interpolated, or frames of a run over time


@dataclass(frozen=True)
class Track:
    """A topic: its schema's name, times ns (n,) int64, the message of number i in Protobuf.

    `note` says what was thinned; `records` are the metadata records that belong to it; a run is
    `given` what drives it, and predicts the others. A signal has a `unit` and `width` numbers.
    """

    topic: str
    schema: str
    ns: Ints
    message: Callable[[int], bytes]
    note: str = ""
    records: Records = ()
    given: bool = False
    unit: str = ""
    width: int = 1


@dataclass(frozen=True)
class ReplayView:
    """One recording and the run of the method shown; both None when no method finished.

    `prefix` is empty or "/name"; `coarse` is 1 or by how much more everything is thinned.
    """

    recording: Recording
    registered: Registered
    method: MethodResult | None
    run: Run | None
    prefix: str
    coarse: int

    @property
    def frame(self) -> str:
        """The scene's frame: the one that images are posed in, else the drive's."""
        seen = outline(self.registered)
        if seen is not None:
            for contours in self.recording.contours.values():
                if np.array_equal(contours.t, seen.t):
                    return contours.frame
        return self.drive_frame

    @property
    def drive_frame(self) -> str:
        """The frame of the first signal that drives; a drive that was derived has the machine's."""
        recorded = self.recording.signals.get(drive(self.registered).name)
        return recorded.frame if recorded else "machine"

    def local(self, name: str) -> str:
        """Return the name of a frame of this recording only, never the scene's."""
        named = f"{self.prefix[1:]}/{name}" if self.prefix else name
        return f"{named} as recorded" if named == self.frame else named

    def track(
        self,
        topic: str,
        schema: str,
        t: Floats | Sequence[float],
        message: Callable[[int, int], bytes],
        note: str = "",
        records: Records = (),
    ) -> Track:
        """Return a topic (its prefix added) at times (n,) s: message(ns, i) is that of number i."""
        named = self.prefix + topic
        ns = stamps_ns(self.recording.t0_ns, np.asarray(t, dtype=np.float64), named)
        return Track(named, schema, ns, lambda i: message(int(ns[i]), i), note, records)

    def held(self) -> tuple[Instant, ...]:
        """What the run computed, at the loads or over time; empty without a run."""
        return held(self.registered, self.run) if self.run is not None else ()

    def moving(self) -> tuple[Instant, ...]:
        """As `held`, with interpolated instants between, evenly spaced in time.

        Of a run over time only so many of its frames.
        """
        known = self.held()
        if self.run is None or len(known) < 2:
            return known
        times = np.linspace(known[0].t, known[-1].t, max(1, _INSTANTS // self.coarse) + 1)
        return at_times(self.registered, self.run, times)


def over_time(view: ReplayView) -> bool:
    """Return whether fields are output frames at their own times, not at load steps."""
    return view.run is not None and not holds(view.registered)


def load_of(instant: Instant) -> str:
    """Return the load of an instant in words, or its time."""
    if instant.hold:
        return spaced(instant.hold.label)
    if instant.computed:
        return f"t = {significant(instant.t, 4)} s"
    return f"{fixed_with_unit(instant.drive, instant.unit, 2)}, {HOW}"


def pose_records(topic: str, pose: Floats) -> Records:
    """Return the record in which our readers find T_frame_from_image (4, 4) of a topic."""
    return ((POSE + topic, {POSE_KEY: " ".join(repr(v) for v in pose.ravel().tolist())}),)
