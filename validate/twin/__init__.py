"""Twins: synthetic recordings of simulated experiments (scene + scheme + sensors + seed)."""

from validate.exports import lazily, names

_HOMES = {
    "sensors": ("LoadCell", "signal", "streams"),
    "tracker": ("Camera", "Origin", "Points", "Reading", "SteppedTwin"),
    "ultrasound": ("Scanner",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
