"""Filters: estimates with uncertainty from a system and its measurements, without the truth."""

from validate.exports import lazily, names

_HOMES = {
    "filters": ("FILTERS", "Filter"),
    "measurements": ("Measurements",),
    "consistency": ("Consistency", "nees_consistency", "nis_consistency"),
    "kalman.kf_fem": ("KfFem",),
    "filterpy.filters": ("FilterpyFilter",),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
