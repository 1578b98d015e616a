"""Recordings: measured streams with units, clocks, calibration and provenance.

The only floor that knows file formats. `types` holds what every reader returns.
"""

from validate.exports import lazily, names

_HOMES = {
    "types": ("Clock", "Contours", "Frames", "Markers", "Recording", "Signal", "Source"),
    "reader": ("Reader",),
    "readers": ("READERS", "read_recording"),
    "mcap.write": ("write_recording",),
    "preflight": ("Inspection",),
    "clocks.alignment": ("Offset",),
    "clocks.events": ("offset_by_event",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
