"""Real-time loop of a model: from a recorded path, or from UDP packets on loopback."""

from validate.pipeline.live.clock import LiveRun, live, realtime
from validate.pipeline.live.listener import Listener
from validate.pipeline.live.live_recording import as_given, written
from validate.pipeline.live.preparation import Prepared, RecordedPath, prepared

__all__ = [
    "Listener",
    "LiveRun",
    "Prepared",
    "RecordedPath",
    "as_given",
    "live",
    "prepared",
    "realtime",
    "written",
]
