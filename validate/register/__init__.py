"""Registration: measured points in the model's frame, with their uncertainty.

Transforms are named T_target_from_source; residuals are mapped source minus target; metres inside,
millimetres in messages. Fit on the rest state once, then freeze.
"""

from validate.exports import lazily, names

_HOMES = {
    "markers.quality": ("Registration",),
    "markers.transform": ("Similarity", "fit_similarity", "fit_two_step"),
    "registration": ("Registered",),
    "observation": ("Deviation", "Observation", "Selection"),
    "markers.markers": ("MarkerObservation",),
    "outlines.outlines": ("OutlineObservation",),
    "sensing": ("ForceSensing", "LengthSensing", "PoseShift", "PressureSensing", "Sensing"),
    "signals": ("SignalObservation",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
