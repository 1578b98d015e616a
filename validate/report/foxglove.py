"""Messages in Foxglove's well-known JSON schemas. Lengths m, colours 0..1, rotations x y z w."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints
from validate.recording.mcap.schemas import Json, stamp

_UNTURNED: Json = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
_AT_ORIGIN: Json = {"position": {"x": 0.0, "y": 0.0, "z": 0.0}, "orientation": _UNTURNED}
_LINE_LOOP = 1
_LINE_WIDTH = 2.5  # pixels on the screen
_PRIMITIVES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")


@dataclass(frozen=True)
class Rgba:
    """A colour, each part 0..1; a = 0 is transparent."""

    r: float
    g: float
    b: float
    a: float = 1.0

    @property
    def message(self) -> Json:
        return {"r": self.r, "g": self.g, "b": self.b, "a": self.a}


def frame_transforms(ns: int, parent: str, children: Sequence[tuple[str, Floats]]) -> Json:
    """`children`: frame name and T_parent_from_child (4, 4), a proper rotation and shift m."""
    return {"transforms": [_transform(ns, parent, *child) for child in children]}


def _transform(ns: int, parent: str, child: str, pose: Floats) -> Json:
    turn = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    return {
        "timestamp": stamp(ns),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": _xyz(pose[:3, 3]),
        "rotation": dict(zip("xyzw", turn, strict=True)),
    }


def scene_update(*entities: Json) -> Json:
    """Each entity takes the place of the earlier one with its id."""
    return {"deletions": [], "entities": list(entities)}


def outline(ns: int, frame: str, name: str, points: Floats, colour: Rgba, **notes: str) -> Json:
    """An entity: the closed line through points (k, 2) m in the plane z = 0 of `frame`."""
    flat = np.hstack([points, np.zeros((len(points), 1))])
    line = {
        "type": _LINE_LOOP,
        "pose": _AT_ORIGIN,
        "thickness": _LINE_WIDTH,
        "scale_invariant": True,
        "points": [_xyz(p) for p in flat],
        "color": colour.message,
        "colors": [],
        "indices": [],
    }
    return _entity(ns, frame, name, notes, lines=[line])


def spheres(
    ns: int, frame: str, name: str, centres: Floats, colour: Rgba, *, diameter: float, **notes: str
) -> Json:
    """An entity: equal spheres at centres (k, 2 or 3) m; those with NaN (not seen) are left out."""
    there = centres[np.isfinite(centres).all(axis=1)]
    size = {"x": diameter, "y": diameter, "z": diameter}
    drawn = [
        {"pose": {"position": _xyz(c), "orientation": _UNTURNED}, "size": size,
         "color": colour.message}
        for c in there
    ]  # fmt: skip
    return _entity(ns, frame, name, notes, spheres=drawn)


def surface(
    ns: int, frame: str, name: str, points: Floats, triangles: Ints, colours: Floats, **notes: str
) -> Json:
    """An entity: triangles (t, 3) between points (v, 3) m, coloured by colours (v, 4) per point.

    Points are rounded to micrometres and colours to a thousandth: it is for the eye.
    """
    shades = np.round(colours, 3).tolist()
    drawn = {
        "pose": _AT_ORIGIN,
        "points": [_xyz(p) for p in np.round(points, 6)],
        "color": Rgba(1.0, 1.0, 1.0).message,
        "colors": [dict(zip("rgba", shade, strict=True)) for shade in shades],
        "indices": triangles.ravel().tolist(),
    }
    return _entity(ns, frame, name, notes, triangles=[drawn])


def _entity(ns: int, frame: str, name: str, notes: dict[str, str], **drawn: list[Json]) -> Json:
    return {
        "timestamp": stamp(ns),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},  # for ever
        "frame_locked": True,
        "metadata": [{"key": key, "value": value} for key, value in notes.items()],
        **{kind: drawn.get(kind, []) for kind in _PRIMITIVES},
    }


def _xyz(point: Floats) -> Json:
    """Points in a plane get z = 0."""
    return dict(zip("xyz", [*point.tolist(), 0.0][:3], strict=True))
