"""Displacements imposed on a condensed system at run time: nodes, facet points, local axes.

A tool that touches the body gives the displacement of a few combinations c . u of kept unknowns;
their forces follow from a system as small as their number (paper 000, section 5.2: a contact adds
a node to the working matrix). Nothing is inverted or updated in size, so nothing drifts: what was
removed has left no trace.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.linear_solvers.condense import Condensed

_DEPENDENT = 1e-12  # of the compliance along a row: what others leave of it


@dataclass(frozen=True)
class Imposed:
    """The displacement `weights` . u[`unknowns`] of kept unknowns (r,): of a node along an axis, or
    of a point between nodes."""

    unknowns: Ints
    weights: Floats


def along(node: int, axis: Floats) -> Imposed:
    """Return the displacement of kept node number `node` along a unit vector (d,)."""
    d = len(axis)
    return Imposed(node * d + np.arange(d), np.asarray(axis, dtype=np.float64))


def between(nodes: Ints, shares: Floats, axis: Floats) -> Imposed:
    """Of a point of a facet: kept nodes (m,) with their shares (m,), along a unit vector (d,)."""
    d = len(axis)
    unknowns = (nodes[:, None] * d + np.arange(d)).ravel()
    return Imposed(unknowns, np.outer(shares, axis).ravel())


@dataclass(frozen=True)
class WorkingSet:
    """Imposed rows (c): `columns` (c, W) m per newton along each, `coupling` (c, c) m/N among them,
    `bases` (c, m) what a unit of each drive and pressure moves along each."""

    condensed: Condensed
    rows: tuple[Imposed, ...] = ()
    columns: Floats | None = None
    coupling: Floats | None = None
    bases: Floats | None = None

    def with_row(self, row: Imposed) -> "WorkingSet":
        """One more. Raises `SceneError` for a row that is held, or follows from the others."""
        return self.with_rows((row,))

    def with_rows(self, rows: Sequence[Imposed]) -> "WorkingSet":
        """All of these more, at once. Raises as `with_row` does."""
        condensed = self.condensed
        found = [self.columns] if self.columns is not None else []
        found += [_column(condensed, row)[None] for row in rows]
        more = np.array([condensed.fields[:, row.unknowns] @ row.weights for row in rows])
        columns = np.vstack(found)
        bases = more if self.bases is None else np.vstack([self.bases, more])
        every = (*self.rows, *rows)
        coupling = np.array([[r.weights @ c[r.unknowns] for r in every] for c in columns])
        coupling = (coupling + coupling.T) / 2
        # Every compliance that is left beside the others, as pivots of the scaled matrix
        own = np.sqrt(np.abs(np.diag(coupling)))
        sizes = np.linalg.eigvalsh(coupling / np.outer(own, own)) if own.all() else np.zeros(1)
        if not sizes[0] > _DEPENDENT:
            raise SceneError(
                f"a prescribed motion along one of {len(coupling)} axes follows from the others, "
                f"or is already held: {sizes[0]:.1e} of its compliance remains"
            )
        return WorkingSet(condensed, every, columns, coupling, bases)

    def without(self, index: int) -> "WorkingSet":
        """Return the others, as if that one had never been."""
        kept = [i for i in range(len(self.rows)) if i != index]
        if not kept:
            return WorkingSet(self.condensed)
        assert self.columns is not None
        assert self.coupling is not None
        assert self.bases is not None
        rows = tuple(self.rows[i] for i in kept)
        coupling = self.coupling[np.ix_(kept, kept)]
        return WorkingSet(self.condensed, rows, self.columns[kept], coupling, self.bases[kept])

    def forces(self, z: Floats, targets: Floats) -> Floats:
        """(c,) N along each row, so that it moves by its target (c,) m under drives m and pressures
        Pa z (m,)."""
        if self.coupling is None or self.bases is None:
            return np.zeros(0)
        return np.asarray(np.linalg.solve(self.coupling, targets - self.bases @ z))

    def displacement(self, z: Floats, forces: Floats) -> Floats:
        """(W,) m of the kept unknowns."""
        u = z @ self.condensed.fields
        return np.asarray(u if self.columns is None else u + forces @ self.columns)


def _column(condensed: Condensed, row: Imposed) -> Floats:
    """(W,) m per newton along the row."""
    found = np.zeros(condensed.size)
    for unknown, weight in zip(row.unknowns.tolist(), row.weights.tolist(), strict=True):
        if weight:
            found += weight * condensed.column(unknown)
    return found


def displaced(system: WorkingSet, z: Floats, targets: Sequence[float]) -> tuple[Floats, Floats]:
    """Displacements (W,) m and the rows' forces (c,) N at once."""
    forces = system.forces(z, np.asarray(targets, dtype=np.float64))
    return system.displacement(z, forces), forces
