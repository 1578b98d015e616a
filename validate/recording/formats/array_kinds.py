"""Index lists, volumes and displacement fields among the arrays of a file.

None of them is a stream: triangles are rows of another array, a volume has depth where a film has
time, and a field has places where a motion has instants.
"""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validate.recording.exports.displacement_field import FieldColumns, field_columns
from validate.recording.exports.vocabulary import role_of_name

Arrays = Mapping[str, NDArray[Any]]
_LISTS = re.compile(r"faces?|tri(angle)?s?|connectivity\w*|elem(ent)?s?|edges?|simplices", re.I)
_LETTERS = re.compile(r"[tfe]|cells?", re.I)  # so are lists called, and others
_VOLUME = re.compile(r"(\w*_)?(vol|volumes?|voxels?|ct|mri?|labelmap)(_?\d+|_\w*)?", re.I)
_SPACING = re.compile(r"\w*(spacing|voxel|pixdim|pixeldim)\w*", re.I)


def no_stream(path: str, found: Arrays) -> str:
    """Return why the array at `path` is neither points nor images over time; empty where it may
    be."""
    values = found[path]
    if values.dtype.kind not in "fiu":
        return ""
    if values.ndim == 2 and values.shape[1] in (2, 3) and len(values) > 1:
        return _indices(path, found)
    deep = values.dtype == np.uint8 and values.ndim == 3 and min(values.shape) > 1
    return _volume(path, found) if deep else ""


def field_at(path: str, found: Arrays) -> FieldColumns | None:
    """Return the displacement field that the array at `path` is a column of; None where it is of
    none, or an array of times has the same shape."""
    same = {n: _leaf(n) for n, a in found.items() if a.shape == found[path].shape and a.size > 1}
    field = field_columns(list(same.values()))
    timed = any(role_of_name(leaf) == "time" for leaf in same.values())
    columns = () if field is None else (*field.places, *field.displacements, *field.strains)
    return field if not timed and same.get(path) in columns else None


def _leaf(path: str) -> str:
    return path.rpartition(".")[2]


def _indices(path: str, found: Arrays) -> str:
    """Whole numbers, each row an edge or a triangle by the rows of its corners in another array.

    Doubles are such a list where they are called so, or where numbers occur twice on average, but
    not in one row, and either all from 0 or 1 on do or another array has that many rows.
    """
    values = found[path]
    if not np.isfinite(values).all() or (values != np.rint(values)).any():
        return ""
    low, high, kinds = int(values.min()), int(values.max()), len(np.unique(values))
    what = f"a list of {('edges', 'triangles')[values.shape[1] - 2]} by the rows of another array"
    told = f"{what} (whole numbers {low} to {high}), not points"
    if values.dtype.kind in "iu":
        return f"{told}; if they are coordinates, save them as double"
    others = (a for n, a in found.items() if n != path and a.ndim == 2 and a.dtype.kind == "f")
    listed = low >= 0 and high <= max(map(len, others), default=0)
    name, twice = _leaf(path), (np.diff(np.sort(values, axis=1), axis=1) == 0).any()
    if _LISTS.fullmatch(name) or (_LETTERS.fullmatch(name) and listed):
        return told
    all_occur = low in (0, 1) and kinds == high - low + 1
    shared = values.size >= 2 * kinds and not twice
    return told if shared and (all_occur or listed) else ""


def _volume(path: str, found: Arrays) -> str:
    """By its name, or by a spacing in three directions beside it."""
    three = [n for n, a in found.items() if a.size == 3 and _SPACING.fullmatch(_leaf(n))]
    if not three and not _VOLUME.fullmatch(_leaf(path)):
        return ""
    by = f"{three[0]} has three numbers" if three else "its name says so"
    return f"a volume ({by}), not images over time; images are read as uint8 (h, w, nt)"
