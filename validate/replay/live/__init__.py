"""A model against the clock: from a recorded path, or from packets on this machine's loopback."""

from validate.replay.live.clock import Lived, live, realtime
from validate.replay.live.listener import Listener
from validate.replay.live.path import RecordedPath
from validate.replay.live.prepared import Prepared, prepared
from validate.replay.live.replayed import as_given
from validate.replay.live.tip import recorded_tip
from validate.replay.live.written import LIVE, written

__all__ = [
    "LIVE",
    "Listener",
    "Lived",
    "Prepared",
    "RecordedPath",
    "as_given",
    "live",
    "prepared",
    "realtime",
    "recorded_tip",
    "written",
]
