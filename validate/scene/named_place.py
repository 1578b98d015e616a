"""Where a part of a scene sits, in a user's words: a label, a side, a plane, a box or a point.

    top                            the facet set of that name
    zmax                           the facets on the body's highest plane across z
    z=20mm                         those on a plane; "z=20mm~0.5mm" within half a millimetre of it
    box 0,0,18mm to 5mm,5mm,20mm   those inside a box
    near 10mm,0,20mm               the one nearest to a point
    x1 & z1                        the edges that two sides share

Lengths without a unit are metres. Several places are joined by "+".
"""

from functools import reduce
from operator import and_, or_

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError, UsageError
from validate.parameters import nearest_names
from validate.scene.mesh import Mesh
from validate.scene.select import Both, Facing, InBox, Labelled, Nearest, OnPlane, Place, Site
from validate.units import in_si, split

GRAMMAR = (
    "a facet set, zmin, zmax, z=20mm, z=20mm~0.5mm, box A to B, near P (points as 1mm,2mm,0), A & B"
)
_AXES = "xyz"
_FLAT = 2e-3  # of the body's diagonal: how far the facets of a filled surface lie off its sides


def place_of(text: str, mesh: Mesh) -> Place:
    """The facets that the words choose of a mesh; raises `SceneError` for words that say nothing,
    or choose nothing."""
    if "&" in text:
        sides = [_plane_of(_site(part.strip(), mesh)) for part in text.split("&")]
        edges = reduce(and_, sides).edges
        edges.entities(mesh)
        return edges
    sites = [_site(part.strip(), mesh) for part in text.split("+")]
    chosen = reduce(or_, sites).faces
    if len(sites) == 1 and text.strip() in mesh.facets:
        return text.strip()
    chosen.entities(mesh)
    return chosen


def axis_of(text: str) -> tuple[float, ...]:
    """The unit vector of "+x", "-z", or of three numbers; raises `SceneError` for anything else."""
    word = text.strip().lower()
    if word.lstrip("+-") in tuple(_AXES) and len(word) <= 2:
        sign = -1.0 if word.startswith("-") else 1.0
        return tuple((sign * np.eye(3)[_AXES.index(word[-1])] + 0.0).tolist())
    try:
        v = np.array([float(part) for part in text.split(",")])
    except ValueError:
        v = np.zeros(0)
    if v.shape != (3,) or not np.isfinite(v).all() or not v.any():
        raise SceneError(f"direction '{text[:40]}': one of +x -x +y -y +z -z, or three numbers")
    return tuple((v / np.linalg.norm(v)).tolist())


def pose_of(origin: tuple[float, ...], image_x: str, image_y: str) -> Floats:
    """T_body_from_image of what is declared; raises `UsageError` for axes that are not square."""
    x, y = np.array(axis_of(image_x)), np.array(axis_of(image_y))
    if len(origin) != 3 or abs(float(x @ y)) > 1e-6:
        raise UsageError(
            f"origin {origin}, image_x {image_x}, image_y {image_y}: three lengths, and two "
            "directions at right angles"
        )
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = x, y, np.cross(x, y), origin
    return pose


def point_of(text: str) -> tuple[float, ...]:
    """Three lengths as metres; raises `SceneError` for anything else, and where some of them have
    a unit and others that are not 0 have none."""
    found = [split(part) for part in text.split(",")]
    units = {bool(f[1]) for f in found if f and f[0] != 0}
    if len(found) != 3 or len(units) > 1:
        raise SceneError(
            f"point '{text[:40]}': expected three lengths with their units, for example 10mm,0,20mm"
        )
    return tuple(_metres(part) for part in text.split(","))


def box_of(text: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The corners m of "box A to B"; raises `SceneError` for anything else."""
    if not (text.startswith("box ") and " to " in text):
        raise SceneError(f"place '{text[:60]}': expected a box, as box 0,0,1mm to 4mm,4mm,2mm")
    low, high = map(point_of, text[4:].split(" to ", 1))
    return low, high


def _site(text: str, mesh: Mesh) -> Site:
    if text in mesh.facets:
        return Labelled(text)
    if text.startswith("near "):
        point = point_of(text[5:])
        _require_at(text, point, point, mesh)
        return Nearest(point)
    if text.startswith("box ") and " to " in text:
        low, high = box_of(text)
        _require_at(text, low, high, mesh)
        return InBox(low, high)
    if text[:1] in tuple(_AXES) and text[1:] in ("min", "max"):
        return _side(mesh, _AXES.index(text[0]), text[1:])
    if text[:2] in ("x=", "y=", "z="):
        return _plane(_AXES.index(text[0]), text[2:])
    known = set(mesh.facets)
    named = f"; {nearest_names(text, known)}" if known else "; the body has no facet sets"
    raise SceneError(f"place '{text[:40]}': none of {GRAMMAR}{named}")


def _require_at(text: str, low: tuple[float, ...], high: tuple[float, ...], mesh: Mesh) -> None:
    """Raises `SceneError` for a box further off the body than the body is large: the nearest point
    to millimetres that were taken for metres is some point, too."""
    gap = np.maximum(np.array(low) - mesh.nodes.max(axis=0), mesh.nodes.min(axis=0) - high)
    away = float(np.linalg.norm(np.maximum(gap, 0.0)))
    size = float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
    if away > size:
        raise SceneError(
            f"place '{text[:60]}': {1e3 * away:.3g} mm away from a body of {1e3 * size:.3g} "
            "mm; a number without a unit is in metres, write 10mm"
        )


def _plane_of(site: Site) -> Site:
    """A side without the way its faces look, which edges do not have."""
    return site.first if isinstance(site, Both) else site


def _side(mesh: Mesh, axis: int, end: str) -> Site:
    x = mesh.nodes[:, axis]
    at = np.zeros(3)
    at[axis] = x.min() if end == "min" else x.max()
    slack = _FLAT * float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
    across = _tuple(np.eye(3)[axis])
    return OnPlane(_tuple(at), across, slack) & Facing(across)  # no sides of a thin layer of cells


def _plane(axis: int, text: str) -> Site:
    where, _, within = text.partition("~")
    at = np.zeros(3)
    at[axis] = _metres(where)
    return OnPlane(_tuple(at), _tuple(np.eye(3)[axis]), _metres(within) if within else 0.0)


def _metres(text: str) -> float:
    found = split(text)
    value = in_si(found[0], found[1] or "m", "m") if found else None
    if value is None:
        raise SceneError(f"'{text[:40]}': expected a length, for example 20mm or 0.02")
    return value


def _tuple(x: Floats) -> tuple[float, ...]:
    return tuple(x.tolist())
