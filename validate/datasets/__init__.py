"""Third-party data sets: registry, local folders and download."""

from validate.exports import lazily, names

_HOMES = {
    "registry": ("DataFile", "DataSet", "data_sets", "named"),
    "bring": ("bring",),
    "home": ("cache_folder", "data_path", "searched", "sought"),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
