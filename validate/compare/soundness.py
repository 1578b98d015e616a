"""What must hold before shapes are compared: cells upright, boundary outward, no crossings.

An inside-out boundary has an empty symmetric difference with anything in most libraries, so that a
wrong body would score 0: it is refused here first.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.boundary import Boundary, enclosed
from validate.compare.crossing import crossings
from validate.errors import ComparisonError
from validate.fem.cells import jacobians, nodal_rule, rule
from validate.scene.mesh import Mesh


@dataclass(frozen=True)
class Soundness:
    """A deformed body: its `inverted` cells (k,) of `cells`, signed `volume` m^d enclosed, pairs
    of boundary pieces that cross."""

    inverted: Ints
    cells: int
    volume: float
    crossings: int


def soundness(mesh: Mesh, u: Floats, boundary: Boundary) -> Soundness:
    """The state of the body with displacement u (n, d) m and that deformed boundary."""
    return Soundness(
        inverted_cells(mesh, u), len(mesh.cells), enclosed(boundary), crossings(boundary)
    )


def inverted_cells(mesh: Mesh, u: Floats | None = None) -> Ints:
    """Cells (k,) whose Jacobian is not positive at a node or a Gauss point."""
    # The Jacobian of quadratic and brick cells varies; linear simplices have the same everywhere.
    lowest = np.min(
        [jacobians(mesh, r, u).min(axis=1) for r in (nodal_rule(mesh), rule(mesh, 2))], 0
    )
    return np.flatnonzero(lowest <= 0)


def require_upright(mesh: Mesh, name: str) -> None:
    """Raises `ComparisonError` with counts when cells are inverted or flat at rest."""
    wrong = inverted_cells(mesh)
    if len(wrong):
        raise ComparisonError(
            f"{len(wrong)} of {len(mesh.cells)} cells of {name} are inverted or flat at rest, "
            f"first {wrong[0]}; reverse their node order or repair the mesh"
        )


def require_comparable(sound: Soundness, name: str) -> None:
    """Raises `ComparisonError` when the deformed boundary is inside out or crosses itself."""
    inverted = f"{len(sound.inverted)} of {sound.cells} cells are inverted"
    if sound.volume <= 0:
        raise ComparisonError(
            f"{name} is turned inside out (signed volume {sound.volume:.3g}; {inverted}), so "
            "it has no interior to compare; check the run's outcome"
        )
    if sound.crossings:
        raise ComparisonError(
            f"the deformed boundary of {name} crosses itself in {sound.crossings} places "
            f"({inverted}), so its interior is not defined; compare displacements (E_i) there"
        )
