"""Contact detection of nodes and rigid bodies, with constraints instead of a penalty.

A node is open, sticks or slips. What touches loses the unknown along the normal, what sticks all of
them: with u = T z + u_0 a Newton step is T^T K T z = -T^T (r + K u_0), and the contact forces are
the residual that is left at the nodes. Where nodes slip and rub, T^T becomes L^T, whose rows carry
Coulomb's law. Sets change between Newton
steps (primal-dual active set: Hintermüller, Ito & Kunisch 2003; friction: Hüeber, Stadler &
Wohlmuth 2008), so that in the end nothing penetrates and nothing pulls.

Departures: on quadratic faces the middles of edges touch, which carry a uniform pressure wholly;
corners carry none of it and may penetrate a little, as the trace says.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.fem.assembly.loads import nodal_integrals
from validate.fem.system import System
from validate.scene.contact import RigidContact
from validate.scene.places import facets_of, kind_of, nodes_of

Bools = NDArray[np.bool_]
OPEN, SLIP, STICK = 0, 1, 2
_FLAT = 1e-6  # normals with less than that along free unknowns cannot act


@dataclass(frozen=True)
class Candidates:
    """Nodes (c,) that may touch the rigid body `owner` (c,), with areas (c,) m^2, unknowns (c, d)
    and which of them are `free`; `friction` (c,).

    Of every rigid body `columns` has its input or -1, `facets` all nodes of its facets.
    """

    contacts: tuple[RigidContact, ...]
    nodes: Ints
    owner: Ints
    areas: Floats
    unknowns: Ints
    free: Bools
    friction: Floats
    columns: tuple[int, ...]
    facets: tuple[Ints, ...]

    def offset(self, k: int, inputs: Floats) -> Floats:
        """Where rigid body k has moved to (d,) m."""
        direction, j = self.contacts[k].direction, self.columns[k]
        if direction is None:
            return np.zeros(self.unknowns.shape[1])
        return np.asarray(inputs[j] * np.array(direction))

    def offsets(self, inputs: Floats) -> Floats:
        """Where the candidates' rigid bodies have moved to (c, d) m."""
        moved = [self.offset(k, inputs) for k in range(len(self.contacts))]
        return np.array(moved).reshape(-1, self.unknowns.shape[1])[self.owner]

    def look(self, x: Floats, offsets: Floats) -> tuple[Floats, Floats]:
        """Gaps (c,) m and normals (c, d) at the places x (c, d) m of the candidates."""
        gaps, normals = np.empty(len(x)), np.empty_like(x)
        for k, part in enumerate(self.contacts):
            of = self.owner == k
            gaps[of] = part.shape.gap(x[of] - offsets[of])
            normals[of] = part.shape.outward(x[of] - offsets[of])
        return gaps, normals


def candidates(system: System) -> Candidates:
    """Return the nodes of all contacts; quadratic faces by the middles of their edges."""
    scene, mesh = system.scene, system.scene.mesh
    nodes = []
    for part in scene.contacts:
        facets = facets_of(mesh, part.facets)
        quadratic = kind_of(part.facets) == "faces" and facets.shape[1] == 6
        nodes.append(np.unique(facets[:, 3:]) if quadratic else nodes_of(mesh, part.facets))
    areas = [scene.thickness * nodal_integrals(mesh, part.facets) for part in scene.contacts]
    counts = [len(n) for n in nodes]
    every = np.concatenate([*nodes, np.zeros(0, dtype=np.int64)])
    unknowns = every[:, None] * mesh.dimension + np.arange(mesh.dimension)
    movers = {part.name: j for j, part in enumerate(scene.movers)}
    first = len(scene.drives) + len(scene.loads)
    return Candidates(
        scene.contacts,
        every,
        np.repeat(np.arange(len(counts)), counts),
        np.concatenate([*(a[n] for a, n in zip(areas, nodes, strict=True)), np.zeros(0)]),
        unknowns,
        ~np.isin(unknowns, system.held),
        np.repeat([part.friction for part in scene.contacts], counts).astype(np.float64),
        tuple(first + movers[p.name] if p.name in movers else -1 for p in scene.contacts),
        tuple(nodes_of(mesh, part.facets) for part in scene.contacts),
    )


@dataclass(frozen=True)
class Frame:
    """A step's view of the rigid bodies: candidates carried along with them from its beginning to
    `start` (c, d) m, gaps (c,) and normals (c, d) there; `stiff` (c,) N/m scales slips to forces.
    """

    parts: Candidates
    start: Floats
    offsets: Floats
    gaps: Floats
    normals: Floats
    stiff: Floats

    def look(self, x: Floats) -> tuple[Floats, Floats]:
        """Gaps (c,) m and normals (c, d) at x (c, d) m at the end of the step."""
        return self.parts.look(x, self.offsets)

    def anchors(self) -> Floats:
        """Where sticking nodes belong (c, d) m."""
        lift = np.where(np.isfinite(self.gaps), self.gaps, 0.0)
        return np.asarray(self.start - lift[:, None] * self.normals)


def frame(parts: Candidates, x: Floats, begin: Floats, end: Floats, stiff: Floats) -> Frame:
    """From places x (c, d) m at the inputs `begin` to the inputs `end` (k + l + m,)."""
    offsets = parts.offsets(end)
    start = x + offsets - parts.offsets(begin)
    return Frame(parts, start, offsets, *parts.look(start, offsets), stiff)


@dataclass(frozen=True)
class Rub:
    """Friction at the candidates: normal forces (c,) and tangential ones (c, d) N of the residual,
    the trial tau = F_t - rho s of slips s (c, d) m and what mu x normal force bears, (c,) N."""

    normal: Floats
    along: Floats
    trial: Floats
    bears: Floats


def rub(at: Frame, x: Floats, residual: Floats) -> Rub:
    """From the places x (c, d) m and the residual (N,) N."""
    parts = at.parts
    n = at.look(x)[1] * parts.free
    square = (n**2).sum(axis=1)
    square[square < _FLAT**2] = np.inf
    unit = n / np.sqrt(square)[:, None]
    r, slid = residual[parts.unknowns] * parts.free, (x - at.start) * parts.free
    normal = (n * r).sum(axis=1) / square
    along = r - normal[:, None] * n
    slid = slid - (slid * unit).sum(axis=1)[:, None] * unit
    trial = along - at.stiff[:, None] * slid
    return Rub(normal, along, trial, parts.friction * np.maximum(normal, 0.0))


@dataclass(frozen=True)
class Constraints:
    """A Newton step under contact: with du = T z + du_0, z of the unknowns `kept`,
    (L^T J T + S) z = -(off + L^T J du_0).

    `off` (z,) N is what is out of balance. Without nodes that slip and rub L is T and S is None.
    """

    T: sparse.csr_array
    L: sparse.csr_array
    S: sparse.csr_array | None
    du: Floats
    kept: Ints
    off: Floats


def constraints(
    at: Frame, status: Ints, x: Floats, residual: Floats, move: Floats, free: Ints
) -> Constraints:
    """Those at x (c, d) m, with prescribed motion `move` (N,) m still to do."""
    parts, N = at.parts, len(move)
    gaps, normals = at.look(x)
    n = normals * parts.free
    du, gone = move.copy(), np.zeros(N, dtype=bool)
    stuck = parts.free & (status == STICK)[:, None]
    du[parts.unknowns[stuck]] = (at.anchors() - x)[stuck]
    gone[parts.unknowns[stuck]] = True
    rows = np.flatnonzero(status == SLIP)
    p = np.abs(n[rows]).argmax(axis=1)
    pivots, n_p = parts.unknowns[rows, p], n[rows, p]
    behind = (normals * move[parts.unknowns])[rows].sum(axis=1)
    du[pivots] = (-gaps[rows] - behind) / n_p
    gone[pivots] = True
    kept = free[~gone[free]]
    column = np.full(N, -1)
    column[kept] = np.arange(len(kept))
    mine = column[parts.unknowns[rows]]
    tilt = np.where(mine >= 0, n[rows] / n_p[:, None], 0.0)
    T = _sparse((N, len(kept)), (np.ones(len(kept)), kept, column[kept]),
                (-tilt, pivots[:, None], mine))  # fmt: skip
    plain = Constraints(T, T, None, du, kept, T.T @ residual)
    rubs = parts.friction[rows] > 0
    if not rubs.any():
        return plain
    tangents = np.eye(n.shape[1])[None] * (mine >= 0)[:, :, None]
    tangents[np.arange(len(rows)), :, p] -= tilt
    some = rows[rubs]
    return _rubbing(at, plain, some, rub(at, x, residual), mine[rubs], tangents[rubs], n[some])


def _rubbing(
    at: Frame, plain: Constraints, rows: Ints, found: Rub, mine: Ints, t: Floats, n: Floats
) -> Constraints:
    """Coulomb's law for the candidates `rows` that slip, along their tangents t (r, d, d).

    F_t = mu F_n tau/|tau|, linearised with its direction (Alart & Curnier 1991): with H =
    mu F_n/|tau| (1 - d d^T), (1 - H) dF_t + rho H ds - mu d dF_n = -(F_t - mu F_n d).
    """
    size = np.maximum(np.linalg.norm(found.trial[rows], axis=1), 1e-300)
    d = found.trial[rows] / size[:, None]
    eye = np.eye(d.shape[1])
    share = np.minimum(found.bears[rows] / size, 1.0)[:, None, None]
    H = share * (eye - d[:, :, None] * d[:, None, :])
    normal = n / (n**2).sum(axis=1)[:, None]
    mu, unknowns = at.parts.friction[rows], at.parts.unknowns[rows]
    lean = -(t @ H) - (mu[:, None] * np.einsum("rjk,rk->rj", t, d))[:, :, None] * normal[:, None]
    T, shape = plain.T, plain.T.shape
    L = sparse.csr_array(T + _sparse(shape, (lean, unknowns[:, None, :], mine[:, :, None])))
    stiff = at.stiff[rows][:, None, None] * (t @ H @ np.swapaxes(t, 1, 2))
    both = (mine[:, :, None] >= 0) & (mine[:, None, :] >= 0)
    square = (len(plain.kept), len(plain.kept))
    S = _sparse(square, (stiff, mine[:, :, None], np.where(both, mine[:, None, :], -1)))
    off = plain.off.copy()
    missed = found.along[rows] - found.bears[rows][:, None] * d
    there = mine >= 0
    off[mine[there]] = np.einsum("rjk,rk->rj", t, missed)[there]
    return replace(plain, L=L, S=S, off=off)


def _sparse(shape: tuple[int, int], *entries: tuple[Floats, Ints, Ints]) -> sparse.csr_array:
    """Values, rows and columns, broadcast, without those of a negative row or column."""
    parts = [np.broadcast_arrays(*entry) for entry in entries]
    values, rows, columns = (np.concatenate([p[i].ravel() for p in parts]) for i in range(3))
    there = (rows >= 0) & (columns >= 0)
    places = (rows[there], columns[there])
    return sparse.csr_array(sparse.coo_array((values[there], places), shape=shape))


def entered(at: Frame, status: Ints, x: Floats, deep: float) -> Ints:
    """Return the status (c,) with what lies deeper than `deep` m at x (c, d) m put in touch."""
    parts, (gaps, normals) = at.parts, at.look(x)
    able = np.abs(normals * parts.free).max(axis=1, initial=0.0) > _FLAT
    kind = np.where(parts.friction > 0, STICK, SLIP)
    return np.where((status == OPEN) & (gaps < -deep) & able, kind, status)


def updated(
    at: Frame, status: Ints, x: Floats, residual: Floats, small: float, deep: float
) -> Ints:
    """Return the status (c,) that gaps below -`deep` m and forces beyond `small` N ask for."""
    parts, found = at.parts, rub(at, x, residual)
    leaves = (status != OPEN) & (found.normal < -small)
    rubs = (status != OPEN) & (parts.friction > 0) & ~leaves
    beyond = np.linalg.norm(found.trial, axis=1) > found.bears + small
    new = entered(at, status, x, deep)
    new[rubs] = np.where(beyond, SLIP, STICK)[rubs]
    new[leaves] = OPEN
    return new
