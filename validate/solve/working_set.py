"""Displacements imposed on a condensed system on the fly: nodes, points of facets, local axes.

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
from validate.fem.condense import Condensed

_DEPENDENT = 1e-12  # of the compliance along a row: what others leave of it


@dataclass(frozen=True)
class Imposed:
    """The displacement `weights` . u[`unknowns`] of kept unknowns (r,): of a node along an axis, or
    of a point between nodes."""

    unknowns: Ints
    weights: Floats


def along(node: int, axis: Floats) -> Imposed:
    """The displacement of kept node number `node` along a unit vector (d,)."""
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
        weights = np.abs(row.weights) > 0
        column = sum(
            (w * self.condensed.column(int(i))
             for i, w in zip(row.unknowns[weights], row.weights[weights], strict=True)),
            np.zeros(self.condensed.size),
        )  # fmt: skip
        base = self.condensed.fields[:, row.unknowns] @ row.weights
        columns = column[None] if self.columns is None else np.vstack([self.columns, column])
        bases = base[None] if self.bases is None else np.vstack([self.bases, base])
        made = WorkingSet(self.condensed, (*self.rows, row), columns, None, bases)
        coupling = np.array([made._seen(c) for c in columns])
        _require_independent(coupling)
        return WorkingSet(self.condensed, made.rows, columns, (coupling + coupling.T) / 2, bases)

    def without(self, index: int) -> "WorkingSet":
        """The others, as if that one had never been."""
        kept = [i for i in range(len(self.rows)) if i != index]
        if not kept:
            return WorkingSet(self.condensed)
        assert self.columns is not None
        assert self.coupling is not None
        assert self.bases is not None
        rows = tuple(self.rows[i] for i in kept)
        coupling = self.coupling[np.ix_(kept, kept)]
        return WorkingSet(self.condensed, rows, self.columns[kept], coupling, self.bases[kept])

    def _seen(self, u: Floats) -> Floats:
        """(c,): a displacement (W,) along every row."""
        return np.array([row.weights @ u[row.unknowns] for row in self.rows])

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


def _require_independent(coupling: Floats) -> None:
    last = coupling[-1]
    own = float(last[-1])
    left = own
    if len(coupling) > 1:
        left -= float(last[:-1] @ np.linalg.solve(coupling[:-1, :-1], coupling[:-1, -1]))
    if not left > _DEPENDENT * own > 0:
        raise SceneError(
            f"what is imposed follows from the {len(coupling) - 1} others, or is held: compliance "
            f"{left:.1e} m/N is left of {own:.1e}"
        )


def displaced(system: WorkingSet, z: Floats, targets: Sequence[float]) -> tuple[Floats, Floats]:
    """Displacements (W,) m and the rows' forces (c,) N at once."""
    forces = system.forces(z, np.asarray(targets, dtype=np.float64))
    return system.displacement(z, forces), forces
