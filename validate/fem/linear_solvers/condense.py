"""Condensed linear systems: static condensation, imposed displacements.

Condensation is exact (paper 000, eqs 17-20). Forces act on kept nodes only, so that only their rows
and columns of the inverse are needed. Two forms: `dense` holds all of them (the paper's explicit
inverse, m^2 numbers), `by columns` keeps the factor and solves for a column when a node is first
touched (m numbers each): what a step then needs is one short product with the columns in use.

Departures: the paper inverts K explicitly; here the factor is applied to unit forces, whose error
grows with the condition of K only once.

A tool that touches the body gives the displacement of a few combinations c . u of kept unknowns;
their forces follow from a system as small as their number (paper 000, section 5.2: a contact adds
a node to the working matrix). Nothing is inverted or updated in size, so nothing drifts: what was
removed has left no trace.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.cavity import CavitySurface
from validate.fem.linear_solvers.factor import Factor, Fronts
from validate.fem.system import Responses, System
from validate.memory import require_memory
from validate.scene.places import nodes_of

_AT_ONCE = 256  # right-hand sides that are solved together


@dataclass(frozen=True)
class Condensed:
    """Statics on kept nodes: u = sum_a z_a fields_a + compliance f.

    `nodes` (k,) of the mesh, ascending; `positions` (k, d) m. Unknowns are those of the kept nodes,
    node-major, W = k d. `fields` (m, W) are displacements per m of each drive and per Pa of each
    cavity, `free` (w,) the unknowns that nothing prescribes. `responses` are those of the whole
    body, which a picture needs and a step does not.
    """

    responses: Responses
    nodes: Ints
    free: Ints
    fields: Floats
    surfaces: tuple[CavitySurface, ...]
    _system: System = field(repr=False)
    _factor: Factor | Fronts = field(repr=False)
    _columns: dict[int, Floats] = field(default_factory=dict, repr=False)

    @property
    def positions(self) -> Floats:
        return self._system.scene.mesh.nodes[self.nodes]

    @property
    def size(self) -> int:
        """W: unknowns of the kept nodes."""
        return int(self.fields.shape[1])

    @property
    def dense_bytes(self) -> int:
        """What the dense form takes."""
        return int(8 * self.size**2)

    @property
    def column_bytes(self) -> int:
        """What the columns take that were asked for so far."""
        return sum(c.nbytes for c in self._columns.values())

    @cached_property
    def compliance(self) -> Floats:
        """The dense form (W, W) in m/N, symmetric; zero where an unknown is prescribed.

        Raises `MemoryShortError` where it does not fit.
        """
        require_memory(2 * self.dense_bytes, f"compliance of {self.size} kept unknowns")
        dense = np.zeros((self.size, self.size))
        for start in range(0, len(self.free), _AT_ONCE):
            part = self.free[start : start + _AT_ONCE]
            dense[:, part] = self._solved(part)
        return np.asarray((dense + dense.T) / 2)

    def column(self, unknown: int) -> Floats:
        """Return the dense form's column (W,) m/N of one unknown alone, kept once it was asked for.

        Raises `SceneError` for an unknown that is prescribed: a force on it moves nothing.
        """
        if unknown not in self._columns:
            if not np.isin(unknown, self.free):
                node = int(self.nodes[unknown // self.dimension])
                raise SceneError(f"node {node} is held or driven, so a tool cannot move it")
            self._columns[unknown] = self._solved(np.array([unknown]))[:, 0]
        return self._columns[unknown]

    def prefetch(self, unknowns: Ints) -> None:
        """Keep the columns of `unknowns` before they are asked for, so that no step has to solve.

        Raises `MemoryShortError` where they do not fit.
        """
        wanted = np.setdiff1d(np.intersect1d(unknowns, self.free), list(self._columns))
        require_memory(8 * self.size * len(wanted), f"{len(wanted)} columns of {self.size} numbers")
        for start in range(0, len(wanted), _AT_ONCE):
            part = wanted[start : start + _AT_ONCE]
            found = np.ascontiguousarray(self._solved(part).T)
            self._columns.update(zip(part.tolist(), found, strict=True))

    @property
    def dimension(self) -> int:
        return int(self._system.scene.mesh.dimension)

    def whole(self, forces: Floats) -> Floats:
        """Displacements (n, d) m of all nodes that forces (W,) N on the kept ones bring."""
        load = np.zeros(self._system.scene.mesh.nodes.size)
        load[self._unknowns] = forces
        return self._loaded(load[:, None])[:, 0].reshape(self._system.scene.mesh.nodes.shape)

    def relative_error(self, unknown: int) -> float:
        """Of the field of a newton on an unknown: what one step of refinement changes. It grows as
        the condition of K, so as 1 / (1 - 2 nu)."""
        u = self.whole(np.eye(self.size)[unknown]).ravel()
        load = np.zeros_like(u)
        load[self._unknowns[unknown]] = 1.0
        left = self._loaded((load - self._system.K @ u)[:, None])
        return float(np.abs(left).max() / np.abs(u).max())

    @cached_property
    def _unknowns(self) -> Ints:
        """(W,): the kept unknowns among those of the mesh."""
        d = self.dimension
        return (self.nodes[:, None] * d + np.arange(d)).ravel()

    def _solved(self, unknowns: Ints) -> Floats:
        """(W, c) m per newton on each of the kept unknowns (c,)."""
        loads = np.zeros((self._system.scene.mesh.nodes.size, len(unknowns)))
        loads[self._unknowns[unknowns], np.arange(len(unknowns))] = 1.0
        return self._loaded(loads)[self._unknowns]

    def _loaded(self, loads: Floats) -> Floats:
        found = np.zeros_like(loads)
        found[self._system.free] = self._factor.solve(loads[self._system.free])
        return found

    @classmethod
    def of(cls, system: System, keep: Ints) -> Self:
        """Return the system on the nodes `keep`, those of its cavities and those of its driven
        plates.

        Raises `SceneError` for nodes that the mesh does not have and for a law at large strain.
        """
        mesh = system.scene.mesh
        if len(keep) and not (keep.min() >= 0 and keep.max() < len(mesh.nodes)):
            raise SceneError(
                f"nodes {int(keep.min())}..{int(keep.max())} to keep of a mesh of {len(mesh.nodes)}"
            )
        plates = [nodes_of(mesh, drive.facets) for drive in system.scene.drives]
        nodes = np.unique(np.concatenate([keep, *(c.nodes for c in system.cavities), *plates]))
        nodes = nodes.astype(np.int64)
        whole = Responses.of(system)
        d = mesh.dimension
        free = np.flatnonzero(np.isin((nodes[:, None] * d + np.arange(d)).ravel(), system.free))
        kept = np.ascontiguousarray(
            whole.fields[:, nodes].reshape(len(whole.fields), nodes.size * d)
        )
        facets = [np.searchsorted(nodes, c.facets) for c in system.cavities]
        surfaces = tuple(
            CavitySurface(c.name, of, np.unique(of))
            for c, of in zip(system.cavities, facets, strict=True)
        )
        return cls(whole, nodes, free, kept, surfaces, system, system.factor())


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
        for row in rows:
            column = np.zeros(condensed.size)  # (W,) m per newton along the row
            for unknown, weight in zip(row.unknowns.tolist(), row.weights.tolist(), strict=True):
                if weight:
                    column += weight * condensed.column(unknown)
            found.append(column[None])
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


def displaced(system: WorkingSet, z: Floats, targets: Sequence[float]) -> tuple[Floats, Floats]:
    """Displacements (W,) m and the rows' forces (c,) N at once."""
    forces = system.forces(z, np.asarray(targets, dtype=np.float64))
    return system.displacement(z, forces), forces
