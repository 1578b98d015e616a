"""Static contact with rigid bodies: detection, and Newton's method, linear or at large strain.

R(u) - f = r at the end of a step, with the contact forces r that are detected below: no penalty,
and nothing penetrates in the end.

Departure: a node that comes to touch within a step is anchored where it stood at the step's
beginning: rub in steps.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import nodal_integrals
from validate.fem.large_strain.hyperelastic import Elastic, elastic
from validate.fem.linear_solvers.factor import (
    elimination_order,
    factorise_general,
    factorise_indefinite,
)
from validate.fem.system import System, require_held
from validate.parameters import quantity
from validate.scene.contact import INSIDE, RigidContact
from validate.scene.places import facets_of, kind_of, nodes_of
from validate.scene.scene import Scene
from validate.solve.handles import LARGE, Handles, require_handled
from validate.solve.types import State, Stepper

# --- contact detection of nodes and rigid bodies, with constraints instead of a penalty ----------

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


# --- What a contact tells at every step: force, friction, area, penetration, nodes, work.

_EACH = {"force": "N", "friction": "N", "area": "m^2", "penetration": "m", "touching": "1",
         "slipping": "1", "work": "J"}  # fmt: skip


@dataclass(frozen=True)
class Touched:
    """Places x (n, d) m of all nodes under the inputs, forces (c, d) N on the candidates, whose
    `status` (c,) is; `work` (contacts,) J of the rigid bodies' motion so far."""

    x: Floats
    inputs: Floats
    forces: Floats
    status: Ints
    work: Floats


def contact_units(scene: Scene) -> dict[str, str]:
    """`<contact>.force` against the motion (of one that stands, along its normals), `.friction`,
    `.area` that touches, `.penetration` of the deepest node, nodes `.touching` and `.slipping`,
    `.work` that the rigid body has done. In 2-D an area is per metre of thickness."""
    return {f"{c.name}.{name}": unit for c in scene.contacts for name, unit in _EACH.items()}


def contact_numbers(parts: Candidates, scene: Scene, now: Touched) -> dict[str, float]:
    """Return the numbers of `contact_units`, on the whole body; what presses is positive."""
    numbers: dict[str, float] = {}
    for k, part in enumerate(scene.contacts):
        found = _numbers(parts, scene.copies, k, now)
        numbers |= {f"{part.name}.{name}": float(x) for name, x in found.items()}
    return numbers


def _numbers(parts: Candidates, copies: int, k: int, now: Touched) -> dict[str, float]:
    of, part = parts.owner == k, parts.contacts[k]
    offset = parts.offset(k, now.inputs)
    normals = part.shape.outward(now.x[parts.nodes[of]] - offset)
    forces, status = now.forces[of], now.status[of]
    normal = (forces * normals).sum(axis=1)
    rubbing = (forces - normal[:, None] * normals).sum(axis=0)
    along = normal.sum() if part.direction is None else forces.sum(axis=0) @ part.direction
    least = float(part.shape.gap(now.x[parts.facets[k]] - offset).min())
    return {
        "force": copies * along,
        "friction": copies * float(np.linalg.norm(rubbing)),
        "area": copies * parts.areas[of][status != OPEN].sum(),
        "penetration": max(0.0, -least),
        "touching": float((status != OPEN).sum()),
        "slipping": float((status == SLIP).sum()),
        "work": copies * now.work[k],
    }


# -------------------------------------------------------------------------------------------------

_ROUNDING = 1e-15  # of the body's unit force: below it a residual is nothing but rounding


@dataclass(frozen=True)
class ContactNewton:
    """Settings."""

    handles: ClassVar[Handles] = Handles(
        ("linear", *LARGE), inertia=False, cavities=False, contact=("foundations", "rigid")
    )

    tolerance: float = quantity(
        1e-9, "1", "residual relative to the acting forces; gaps relative to the body"
    )
    max_iterations: int = quantity(
        40, "1", "iterations of Newton and of the sets of touching nodes in a step"
    )
    cuts: int = quantity(6, "1", "number of halvings of a load step without equilibrium")

    def __post_init__(self) -> None:
        if not (self.tolerance > 0 and self.max_iterations >= 1 and self.cuts >= 0):
            raise SceneError(
                f"tolerance {self.tolerance:g}, {self.max_iterations} iterations, {self.cuts} "
                "cuts: all must be positive"
            )

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for what is not handled, and for a body that nothing holds, counting
        what touches at rest."""
        scene = system.scene
        require_handled(scene, self)
        N, free = len(system.moves), system.free
        parts = candidates(system)
        # Rows (m, N) of what the nodes that touch at rest are held along
        x = scene.mesh.nodes[parts.nodes]
        gaps, normals = parts.look(x, np.zeros_like(x))
        rows = []
        for i in np.flatnonzero(gaps < INSIDE * np.ptp(scene.mesh.nodes, axis=0).max()):
            along = np.eye(x.shape[1]) if parts.friction[i] else normals[[i]]
            full = np.zeros((len(along), scene.mesh.nodes.size))
            full[:, parts.unknowns[i]] = along
            rows.append(full)
        touched_rows = np.concatenate([*rows, np.zeros((0, scene.mesh.nodes.size))])
        require_held(scene, system.held, touched_rows, ", or place it in contact at rest")
        node, K = free // scene.mesh.dimension, system.K[free][:, free]
        order = elimination_order(K, node, scene.mesh.nodes)
        rank = np.empty(N, dtype=np.int64)
        rank[free[order]] = np.arange(len(free))
        return ContactStepper(self, system, elastic(system), rank, parts)


@dataclass(frozen=True)
class InTouch:
    """Displacements (N,) in balance under the inputs (k + l + m,); which nodes touch, the contact
    forces (c, d) N on them, and the work (contacts,) J of the tools."""

    u: Floats
    inputs: Floats
    status: Ints
    forces: Floats
    work: Floats


@dataclass(frozen=True)
class ContactStepper:
    """`rank` (N,) orders elimination."""

    settings: ContactNewton
    system: System
    body: Elastic
    rank: Ints
    parts: Candidates

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        """Forces of drives, numbers of contacts (`contact_units`), energy of the mesh."""
        forces = {f"{d.name}.force": "N" for d in self.scene.drives}
        return forces | contact_units(self.scene) | {"energy.strain": "J"}

    @property
    def _size(self) -> float:
        return float(np.ptp(self.scene.mesh.nodes, axis=0).max())

    def rest(self) -> State:
        u, inputs = np.zeros(len(self.system.moves)), np.zeros(len(self.scene.inputs))
        x, c = self._places(u), len(self.parts.nodes)
        gaps, normals = self.parts.look(x, np.zeros_like(x))
        able = np.abs(normals * self.parts.free).max(axis=1, initial=0.0) > INSIDE
        touches = (gaps < INSIDE * self._size) & able
        status = np.where(touches, np.where(self.parts.friction > 0, STICK, SLIP), OPEN)
        inner = InTouch(u, inputs, status, np.zeros((c, x.shape[1])),
                        np.zeros(len(self.scene.contacts)))  # fmt: skip
        return State(0, inner, numbers=self._numbers(inner))

    def step(self, state: State, inputs: Floats) -> State:
        """To the inputs (k + l + m,) at the end of the step: drives, loads, rigid bodies."""
        at, k = replace(state, updates=0), state.k + 1
        done, size, begin = 0.0, 1.0, state.inner.inputs
        while done < 1:
            share = min(done + size, 1.0)
            new = self._solved(at, begin + share * (inputs - begin))
            if new.failure is None:
                at, done = replace(new, updates=at.updates + new.updates), share
            elif size > 0.5**self.settings.cuts:
                size /= 2
            else:
                assert new.failure is not None
                ending, why = new.failure
                words = f"step {k}: {why}; {100 * done:.3g} % of the step's load was reached"
                return replace(state, failure=(ending, words))
        return replace(at, k=k, inner=replace(at.inner, inputs=inputs))

    def _solved(self, state: State, inputs: Floats) -> State:
        """One step by Newton and changes of the sets, from the state's displacements."""
        last: InTouch = state.inner
        drives = len(self.scene.drives)
        f, move = self._loads(inputs), self.system.moves @ (inputs - last.inputs)[:drives]
        stiff = self.system.K.diagonal()[self.parts.unknowns].mean(axis=1)  # of the candidates' own
        at = frame(self.parts, self._places(last.u), last.inputs, inputs, np.asarray(stiff))
        u, status, changed, pressures = last.u, last.status, True, None
        residual, acting = self._residual(u, f)
        deep = self.settings.tolerance * self._size
        status = entered(at, status, self._places(u), deep)
        for iteration in range(self.settings.max_iterations + 1):
            held = constraints(at, status, self._places(u), residual, move, self.system.free)
            off = float(np.linalg.norm(held.off))
            # What is still to be moved: prescribed motion, gaps to be closed.
            if (
                not changed
                and off <= self._small(acting)
                and np.abs(held.du).max(initial=0.0) <= deep
            ):
                return self._found(state, u, inputs, at, status, residual, iteration)
            if iteration == self.settings.max_iterations:
                break
            try:
                step = self._correction(u, pressures, held)
            except SceneError as vanished:
                # Contact may hold what no support holds.
                why, touching = str(vanished), int((status != OPEN).sum())
                if touching and not (status == STICK).any():
                    why = (
                        f"the body slides off: it is held only by {touching} touching nodes, and "
                        "all of them slip; add a support, or more friction"
                    )
                return replace(state, failure=("not_converged", why))
            pressures, u = self.body.extrapolated(u, step), u + step
            move = np.zeros_like(move)
            bad = self.body.inverted(u)
            if bad:
                words = f"{bad.count} of {bad.points} quadrature points inverted (det F <= 0)"
                return replace(state, failure=("invalid", words))
            residual, acting = self._residual(u, f)
            new = updated(at, status, self._places(u), residual, self._small(acting), deep)
            changed, status = bool((new != status).any()), new
        words = f"residual {off / acting if acting else np.inf:.1e} after {iteration} iterations"
        more = "; the sets of touching nodes still change" if changed else ""
        return replace(state, failure=("not_converged", words + more))

    def _small(self, acting: float) -> float:
        """The residual N that counts as none beside the forces that act."""
        return self.settings.tolerance * acting + _ROUNDING * self.body.unit_force

    def _places(self, u: Floats) -> Floats:
        """Where the candidates are (c, d) m."""
        nodes = self.scene.mesh.nodes
        return np.asarray((nodes + u.reshape(nodes.shape))[self.parts.nodes])

    def _loads(self, inputs: Floats) -> Floats:
        return np.asarray(self.system.loads @ inputs[len(self.scene.drives) :])

    def _residual(self, u: Floats, f: Floats) -> tuple[Floats, float]:
        """R - f (N,) N, contact forces among it, and the size of what acts."""
        R = self.body.force(u)
        return R - f, max(float(np.linalg.norm(x)) for x in (R, f))

    def _correction(self, u: Floats, pressures: Floats | None, held: Constraints) -> Floats:
        """The Newton correction (N,) that the constraints admit."""
        J = self.body.tangent(u, pressures)
        A = sparse.csr_array(held.L.T @ (J @ held.T))
        order = np.argsort(self.rank[held.kept])
        if held.S is None:
            factor = factorise_indefinite(A, order)
        else:
            factor = factorise_general(sparse.csr_array(A + held.S), order)
        if factor.negative_pivots:
            words = f"tangent not positive definite ({factor.negative_pivots} negative pivots)"
            raise SceneError(words)
        return np.asarray(held.T @ factor.solve(-held.off - held.L.T @ (J @ held.du)) + held.du)

    def _found(
        self, state: State, u: Floats, inputs: Floats, at: Frame, status: Ints, residual: Floats,
        iterations: int,
    ) -> State:  # fmt: skip
        last: InTouch = state.inner
        _, normals = at.look(self._places(u))
        found = rub(at, self._places(u), residual)
        r = found.normal[:, None] * normals * self.parts.free + found.along
        forces = np.where((status != OPEN)[:, None], r, 0.0)
        mean = (forces + last.forces) / 2
        moved = at.offsets - self.parts.offsets(last.inputs)
        done = np.bincount(self.parts.owner, (mean * moved).sum(axis=1), len(last.work))
        inner = InTouch(u, inputs, status, forces, last.work + done)
        return State(state.k, inner, None, iterations, self._numbers(inner))

    def _numbers(self, now: InTouch) -> Mapping[str, float]:
        """Forces N on the whole body, compression positive, energy J of the mesh."""
        scene, copies = self.scene, self.scene.copies
        acting = self.body.force(now.u) - self._loads(now.inputs)
        forces = copies * (acting @ self.system.moves)
        numbers = {f"{d.name}.force": float(x) for d, x in zip(scene.drives, forces, strict=True)}
        x = self.scene.mesh.nodes + now.u.reshape(self.scene.mesh.nodes.shape)
        numbers |= contact_numbers(
            self.parts, scene, Touched(x, now.inputs, now.forces, now.status, now.work)
        )
        return numbers | {"energy.strain": self.body.energy(now.u)}

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        u: Floats = state.inner.u
        return u.reshape(self.scene.mesh.nodes.shape)
