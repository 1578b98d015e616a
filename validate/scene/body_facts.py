"""Summary of a body's mesh: size, element shape and facet sets, with units."""

from collections.abc import Mapping

import numpy as np

from validate.arrays import Floats
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.third_party_meshes import pieces
from validate.scene.shape_functions import CORNERS, brick_rule
from validate.units import in_si

_ROUNDING = 1e-9  # mm for each metre of the body: what is left of a zero
USUAL = (1e-3, 10.0)  # m: the largest side of a body; beyond, its unit is doubtful
SAME = 0.05  # relative: a side that is known and one that was read
_UNITS = ("um", "mm", "cm", "inch", "m")
POOR = 0.1  # elements below such a quality shorten steps and spoil answers


def quality(mesh: Mesh) -> Floats:
    """Of every cell (e,), 1 for the best, 0 for a flat one: of simplices the mean ratio (volume
    over that of a regular one with the same sum of squared edges), of bricks the least scaled
    Jacobian of their corners."""
    x = mesh.nodes[mesh.corners]
    if mesh.bricks:
        corners = CORNERS[mesh.dimension]
        J = brick_rule(corners, np.zeros(len(corners))).jacobians(x)
        lengths = np.linalg.norm(J, axis=-2).prod(axis=-1)
        return np.asarray((np.linalg.det(J) / lengths).min(axis=1))
    d = mesh.dimension
    pairs = [(a, b) for b in range(d + 1) for a in range(b)]
    squares = sum(((x[:, a] - x[:, b]) ** 2).sum(axis=1) for a, b in pairs)
    size = np.abs(mesh.cell_volumes())
    if d == 2:
        return np.asarray(4 * np.sqrt(3) * size / squares)
    return np.asarray(12 * (3 * size) ** (2 / 3) / squares)


def largest_side(mesh: Mesh) -> float:
    """Return the largest side of the box around a body, m."""
    return float(np.ptp(mesh.nodes, axis=0).max())


def odd_size(mesh: Mesh, unit: str) -> str:
    """Return the box of a body whose largest side is unusual, as read in `unit` and as it would be
    in others; empty where it is usual."""
    sides = np.ptp(mesh.nodes, axis=0)
    if USUAL[0] <= sides.max() <= USUAL[1]:
        return ""
    factors = {u: in_si(1.0, u, "m") or 1.0 for u in (unit, *_UNITS)}
    scaled = {u: sides * factor / factors[unit] for u, factor in factors.items()}
    may = [f"{_box(x)} in {u}" for u, x in scaled.items() if USUAL[0] <= x.max() <= USUAL[1]]
    return f"{_box(sides)} (lengths in {unit}); {', '.join(may) or 'usual in no unit'}"


def _box(sides: Floats) -> str:
    return f"{' x '.join(f'{1e3 * side:.4g}' for side in sides)} mm"


def facts(mesh: Mesh) -> Mapping[str, str]:
    """Counts, box, volume, quality and facet sets, in words with units."""
    volumes, q = mesh.cell_volumes(), quality(mesh)
    low, high = 1e3 * mesh.nodes.min(axis=0), 1e3 * mesh.nodes.max(axis=0)
    low = np.where(np.abs(low) < _ROUNDING * np.ptp(mesh.nodes), 0.0, low)
    box = " x ".join(f"{b - a:.4g}" for a, b in zip(low, high, strict=True))
    at = ", ".join(f"{a:.4g}" for a in low)
    poor = int((q < POOR).sum())
    size = f"{1e6 * volumes.sum():.4g} cm3" if mesh.dimension == 3 else \
        f"{1e4 * volumes.sum():.4g} cm2"  # fmt: skip
    sets = ", ".join(f"{name} ({len(f)} facets)" for name, f in sorted(mesh.facets.items()))
    return {
        "elements": f"{len(mesh.cells)} {mesh.kind}, {len(mesh.nodes)} nodes",
        "bodies": str(pieces(mesh).max()),
        "box": f"{box} mm, from ({at}) mm",
        "volume" if mesh.dimension == 3 else "area": size,
        "quality": f"worst {q.min():.3g} (element {int(q.argmin())}), median {np.median(q):.3g}; "
        f"{poor} below {POOR:g}; 1 is best",
        "facet sets": sets
        or "none: name them by plane, box or nearest point, for example --face top=zmax",
    }
