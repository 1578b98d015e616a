"""Registration: measured points in the model's frame, with their uncertainty.

Transforms are named T_target_from_source; residuals are mapped source minus target; metres inside,
millimetres in messages. Fit on the rest state once, then freeze.
"""

from validate.exports import lazily, names

_HOMES = {
    "markers.quality": ("Registration", "register_points"),
    "markers.transform": ("Similarity", "fit_similarity", "fit_two_step"),
    "registration": ("Registered",),
    "observation": ("Deviation", "Observation", "Selection"),
    "markers.markers": ("MarkerObservation", "observe_markers"),
    "outlines.outlines": ("OutlineObservation", "observe_outlines"),
    "sensing": ("ForceSensing", "LengthSensing", "PoseShift", "PressureSensing", "Sensing"),
    "signals": ("SignalObservation",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
