"""Third-party data sets: registry, local folders and download."""

from validate.exports import lazily, names

_HOMES = {
    "bring": ("bring",),
    "home": (
        "DataFile",
        "DataSet",
        "cache_folder",
        "data_path",
        "data_sets",
        "data_set_of",
        "searched",
        "sought",
    ),
}

__all__ = names(_HOMES)
__getattr__ = lazily(__name__, _HOMES)
