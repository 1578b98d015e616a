"""Static equilibrium of a hyperelastic body with fluid cavities under drives and dead loads.

Unknowns are the free displacements and the cavity pressures:

    f_int(u) - sum_i P_i dV_i/dx = f,    V_i(x) = volume ratio x V_i0

Newton's bordered system [A, -G; G^T, 0], A = K_t - sum_i P_i d2V_i/dx2 and G = dV/dx, is solved by
block elimination with one factorisation of A. It has as many negative eigenvalues as A has plus the
positive ones of S = G^T A^-1 G, so the Hessian on the constraints G^T du = 0, whose signs decide
stability, has (negative of A) - (negative of S): A may be indefinite while the fluid holds the body
(Gould 1985).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.fem.cavity import pressure_load, volume_hessian, volume_of
from validate.fem.large_strain.hyperelastic import Body
from validate.fem.linear_solvers.factor import Factor, elimination_order, factorise_indefinite
from validate.fem.rigid import require_held
from validate.fem.system import System


@dataclass(frozen=True)
class Balance:
    """Forces at u (N,) m and P (c,) Pa under `inputs` (k + l,), drives in m and then loads.

    `residual` (N,) N holds the reactions, `loads` (c, N) m^2 are dV/dx. `stresses` (e, q) Pa are
    the volumetric law's slopes that the next tangent takes: those of u, but on the way of an
    iteration the ones that it has foreseen (`Body.extrapolated`).

    `unbalanced` N is the residual's norm over the free unknowns, zero where it is the stress's own
    rounding; `acting` N the norm of the forces that act; `gap` the largest error of V/V0, of
    cavities and of cells with nu = 0.5, whose `multipliers` (e, q) Pa keep it
    (`fem.large_strain.hyperelastic`).
    """

    u: Floats
    pressures: Floats
    inputs: Floats
    residual: Floats
    loads: Floats
    ratios: Floats
    gap: float
    unbalanced: float
    acting: float
    stresses: Floats | None = None
    multipliers: Floats | None = None

    def merit(self, force: float) -> float:
        """What a line search lowers: the residual in units of `force` N and the volume error."""
        return float(np.hypot(self.unbalanced / force, self.gap))


@dataclass(frozen=True)
class Tangent:
    """A factorised at u (N,) m: what unit inputs (N, k + l) and unit pressures (N, c) move.

    `negative` counts the negative eigenvalues of the Hessian under constant volume.
    """

    factor: Factor
    inputs: Floats
    pressures: Floats
    negative: int
    u: Floats


@dataclass(frozen=True)
class Equilibrium:
    """The parts of the balance that stay: body, system, rest volumes (c,) m^3, elimination order.

    With `constrained` False the cavities are empty: no pressures, no constraint.
    """

    body: Body
    system: System
    constrained: bool
    rest_volumes: Floats
    order: Ints

    def balance(
        self,
        u: Floats,
        pressures: Floats,
        inputs: Floats,
        target: Floats,
        stresses: Floats | None = None,
        multipliers: Floats | None = None,
    ) -> Balance:
        """Return the forces at u, P and the inputs, with volumes asked for as ratios `target`
        (c,)."""
        cavities = self.system.cavities
        x = self._places(u)
        ratios = np.array([volume_of(c, x) for c in cavities]) / self.rest_volumes
        loads = np.array([pressure_load(c, x).ravel() for c in cavities]).reshape(-1, len(u))
        multipliers = self.body.multipliers if multipliers is None else multipliers
        inner = self.body.holding(multipliers).force(u)
        f = self.system.loads @ inputs[len(self.system.scene.drives) :]
        residual = inner - pressures @ loads - f
        rounding = 4 * np.finfo(float).eps * self.body.unit_force
        free = float(np.linalg.norm(residual[self.system.free]))
        pushing = float(np.abs(pressures) @ np.linalg.norm(loads, axis=1))
        acting = max(*(float(np.linalg.norm(x)) for x in (inner, f)), pushing, rounding)
        gap = float(np.abs(ratios - target).max(initial=0.0)) if self.constrained else 0.0
        gap = max(gap, self.body.volume_error(u))
        unbalanced = free if free > rounding else 0.0
        return Balance(
            u, pressures, inputs, residual, loads, ratios, gap, unbalanced, acting, stresses,
            multipliers,
        )  # fmt: skip

    def tangent(self, at: Balance) -> Tangent:
        """Factorise A at a balance; `SceneError` where a pivot vanishes."""
        free, moves = self.system.free, self.system.moves
        A = self._matrix(at)
        factor = factorise_indefinite(A[free][:, free], self.order)
        driven = self._solved(factor, -(A @ moves).T).T + moves
        loaded = self._solved(factor, self.system.loads.T).T
        pressed = self._solved(factor, at.loads).T
        negative = factor.negative_pivots
        if self.constrained:
            S = at.loads @ pressed
            negative -= int((np.linalg.eigvalsh((S + S.T) / 2) < 0).sum())
        return Tangent(factor, np.hstack([driven, loaded]), pressed, negative, at.u)

    def _matrix(self, at: Balance) -> sparse.csr_array:
        A = self.body.holding(at.multipliers).tangent(at.u, at.stresses)
        x = self._places(at.u)
        for P, cavity in zip(at.pressures, self.system.cavities, strict=True):
            if P:
                A = sparse.csr_array(A - P * volume_hessian(cavity, x))
        return A

    def _places(self, u: Floats) -> Floats:
        """Nodes (n, d) m of the deformed mesh."""
        nodes = self.system.scene.mesh.nodes
        return np.asarray(nodes + u.reshape(nodes.shape))

    def _solved(self, factor: Factor, rows: Floats) -> Floats:
        """Fields (k, N) of the right-hand sides (k, N), zero where held."""
        out = np.zeros_like(rows)
        if len(rows):
            out[:, self.system.free] = factor.solve(rows[:, self.system.free].T.copy()).T
        return out

    def predicted(self, at: Balance, tangent: Tangent, move: Floats, target: Floats) -> Balance:
        """Return the linear response to a change `move` (k + l,) of the inputs, forces not yet
        known."""
        return self._moved(at, tangent, tangent.inputs @ move, target)

    def correction(self, at: Balance, tangent: Tangent, target: Floats) -> Balance:
        """Return the Newton correction of an imbalance, forces not yet known."""
        field = -self._solved(tangent.factor, at.residual[None])[0]
        return self._moved(at, tangent, field, target)

    def _moved(self, at: Balance, tangent: Tangent, field: Floats, target: Floats) -> Balance:
        """`at` moved by `field` and by the pressures that close the volumes to first order."""
        if not self.constrained:
            return replace(at, u=at.u + field)
        error = (at.ratios - target) * self.rest_volumes + at.loads @ field
        dP = np.linalg.solve(at.loads @ tangent.pressures, -error)
        return replace(at, u=at.u + field + tangent.pressures @ dP, pressures=at.pressures + dP)

    def forces(self, at: Balance) -> Floats:
        """Forces (k,) N of the plates on the whole body, compression positive."""
        return np.asarray(self.system.scene.copies * (at.residual @ self.system.moves))


def equilibrium(system: System, constrained: bool) -> Equilibrium:
    """Prepare the body and the elimination order, which holds for every tangent."""
    mesh, free = system.scene.mesh, system.free
    require_held(system.scene, system.held)
    body = Body(system.scene)
    K = system.K[free][:, free]
    order = elimination_order(sparse.csr_array(K), free // mesh.dimension, mesh.nodes)
    volumes = np.array([volume_of(c, mesh.nodes) for c in system.cavities])
    return Equilibrium(body, system, constrained, volumes, order)
