"""Members of one model, stepped together, each with its own parameters and state.

A member's state is a row of X (s, n): implicit members carry displacement, velocity and
acceleration, explicit ones U_t and U_{t-h}. Rows may be mixed linearly, which is what filters do.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError, UsageError
from validate.estimate.ensemble.parameters import Doubts, StiffnessPart, parts
from validate.estimate.extended.explicit_step import ExplicitStep
from validate.fem.assembly.assemble import stiffness, stiffness_damping
from validate.fem.assembly.surface import foundation_stiffness
from validate.fem.large_strain.explicit import ExplicitBody
from validate.fem.linear_solvers.factor import factorise
from validate.fem.system import System
from validate.solve.dynamic.newmark_rule import Rule, of_history, of_system

Coordinates = Literal["shapes", "nodes"]
Function = Callable[[Floats], Floats]
_FAR = 2.0  # sd of a parameter at which its shapes are taken into the basis, either way
_DEPENDENT = 1e-6  # share of a shape outside those before it that is taken as none


class Members(Protocol):
    """`displaced` (n_u, N) m makes displacements of the first n_u columns of X; None: they are."""

    @property
    def system(self) -> System: ...

    @property
    def doubts(self) -> Doubts: ...

    @property
    def size(self) -> int:
        """Numbers n of a member's state."""
        ...

    @property
    def displaced(self) -> Floats | None: ...

    @property
    def nodes(self) -> Ints | None:
        """The node that each number of a state belongs to (n,); None: numbers are shapes'."""
        ...

    def ready(self, x: Floats) -> Any:
        """All that members of these parameters (s, p) step with."""
        ...

    def step(
        self, ready: Any, X: Floats, x: Floats, begin: Floats, end: Floats, number: int
    ) -> Floats:
        """One step, `number` 1, 2, ..., between the given loads (l,) N at its begin and end."""
        ...


def in_nodes(members: Members, X: Floats) -> Floats:
    """Displacements (s, N) m, or their spread."""
    if members.displaced is None:
        return X[:, : len(members.system.moves)]
    return np.asarray(X[:, : len(members.displaced)] @ members.displaced)


# --- implicit, linear -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Projected:
    """M (r, r), loads (r, l), and K and C (q, r, r) of what is fixed, then of every part."""

    M: Floats
    K: Floats
    C: Floats
    loads: Floats
    parts: tuple[StiffnessPart, ...]


@dataclass(frozen=True)
class ReadyStep:
    """J^-1 and C (s, r, r), or (1, r, r) where all members share them."""

    inverse: Floats
    C: Floats


@dataclass(frozen=True)
class ImplicitMembers:
    """Newmark's step of every member in the coordinates of `displaced`: u = displaced^T q."""

    system: System
    doubts: Doubts
    rule: Rule
    projected: Projected
    displaced: Floats
    at_once: bool
    coordinates: Coordinates

    @property
    def size(self) -> int:
        return 3 * len(self.displaced)

    @property
    def nodes(self) -> Ints | None:
        mine = self.system.free // self.system.scene.mesh.dimension
        return np.tile(mine, 3) if self.coordinates == "nodes" else None

    def ready(self, x: Floats) -> ReadyStep:
        """Dense inverses: `step` then costs products alone."""
        p = self.projected
        mask = np.array([part.mask for part in p.parts])
        x = x if mask.any() else x[:1]
        factors = np.hstack([np.ones((len(x), 1)), np.exp(x @ mask.T)])
        K, C = (np.tensordot(factors, X, axes=1) for X in (p.K, p.C))
        m, c, k = of_system(self.rule)
        return ReadyStep(np.asarray(np.linalg.inv(m * p.M + c * C + k * K)), np.asarray(C))

    def step(
        self, ready: ReadyStep, X: Floats, x: Floats, begin: Floats, end: Floats, number: int
    ) -> Floats:
        u, v, a = np.split(X, 3, axis=1)
        f = self.doubts.loads(x, end) @ self.projected.loads.T
        if number == 1 and self.at_once:
            a = np.asarray(np.linalg.solve(self.projected.M, f.T).T)
        (mu, mv, ma), (cu, cv, ca), _ = of_history(self.rule)
        history = (mu * u + mv * v + ma * a) @ self.projected.M.T
        history += _times(ready.C, cu * u + cv * v + ca * a)
        new = _times(ready.inverse, history + f)
        return np.hstack([new, *self.rule.rates(new, u, v, a)])


def _times(A: Floats, X: Floats) -> Floats:
    """A (s, r, r) or (1, r, r) on the rows of X (s, r)."""
    return np.asarray(X @ A[0].T if len(A) == 1 else (A @ X[..., None])[..., 0])


def implicit_members(
    system: System, doubts: Doubts, rule: Rule, coordinates: Coordinates, shapes: int, at_once: bool
) -> ImplicitMembers:
    """In all free unknowns, or in `shapes` shapes of every load with the model's stiffness, and
    with that of `_FAR` sd of every parameter. Raises `UsageError` for less than one shape."""
    split, free = parts(system.scene, doubts), system.free
    K, C = (_in_parts(system, split, damping) for damping in (False, True))
    whole = coordinates == "nodes"
    lift = np.eye(len(free)) if whole else _basis(system, split, K, doubts, shapes)
    projected = Projected(
        lift.T @ (system.M[free][:, free] @ lift),
        np.array([lift.T @ (k @ lift) for k in K]),
        np.array([lift.T @ (c @ lift) for c in C]),
        lift.T @ system.loads[free],
        split,
    )
    displaced = np.zeros((lift.shape[1], len(system.moves)))
    displaced[:, free] = lift.T
    return ImplicitMembers(system, doubts, rule, projected, displaced, at_once, coordinates)


def _in_parts(
    system: System, split: tuple[StiffnessPart, ...], damping: bool
) -> tuple[sparse.csr_array, ...]:
    """K, or C, over the free unknowns: what no parameter scales, then every part."""
    free, total = system.free, system.C if damping else system.K
    found = []
    for part in split:
        if part.scene is not None:
            found.append((stiffness_damping if damping else stiffness)(part.scene))
        elif part.foundation is not None and not damping:
            found.append(foundation_stiffness(system.scene.mesh, part.foundation))
        else:
            found.append(sparse.csr_array(total.shape))
    fixed = total - sum(found[1:], found[0])
    return tuple(sparse.csr_array(X[free][:, free]) for X in (fixed, *found))


def _basis(
    system: System,
    split: tuple[StiffnessPart, ...],
    K: tuple[sparse.csr_array, ...],
    of: Doubts,
    count: int,
) -> Floats:
    """Shapes (m, r), M-orthonormal: v = K^-1 f, then K^-1 M v, ... of every load and stiffness
    (load-dependent Ritz vectors; Wilson, Yuan & Dickens 1982): all that the loads set in motion."""
    if count < 1:
        raise UsageError(f"{count} shapes: at least 1")
    free, p = system.free, len(of.parameters)
    M, basis = sparse.csr_array(system.M[free][:, free]), np.zeros((len(free), 0))
    stiff = of.columns("stiffness", "support")
    away = [np.zeros(p), *(s * _FAR * of.sd[j] * np.eye(p)[j] for j in stiff for s in (-1, 1))]
    for x in away:
        solve = _solver(system, split, K, x)
        for f in system.loads[free].T:
            v = solve(np.ascontiguousarray(f))
            for _ in range(count):
                v, left = _outside(v, basis, M)
                if not left > _DEPENDENT:
                    break
                basis = np.hstack([basis, v[:, None]])
                v = solve(M @ v)
    return basis


def _solver(
    system: System, split: tuple[StiffnessPart, ...], K: tuple[sparse.csr_array, ...], x: Floats
) -> Function:
    """K^-1 with parameters of coordinates x (p,). Raises `SceneError` for a stiffness beyond the
    number range: a member far off the model has it."""
    with np.errstate(over="ignore", under="ignore"):
        factors = [float(part.factor(x[None, :])[0]) for part in split]
    if not all(np.finfo(float).tiny < s < np.inf for s in factors):
        raise _off_model("stiffnesses")
    total = sum((s * k for s, k in zip(factors, K[1:], strict=True)), K[0])
    d = system.scene.mesh.dimension
    return factorise(sparse.csr_array(total), system.free // d, system.scene.mesh.nodes).solve


def _outside(v: Floats, basis: Floats, M: sparse.csr_array) -> tuple[Floats, float]:
    """The share of v outside the basis, of length 1 in M, and how large it was.

    Raises `SceneError` for a v beyond the number range: a member far off the model made it.
    """
    with np.errstate(all="ignore"):
        whole = float(np.sqrt(v @ (M @ v))) if np.isfinite(v).all() else np.inf
    if not np.isfinite(whole):
        raise _off_model("shapes")
    for _ in range(2):  # once leaves what rounding leaves
        v = v - basis @ (basis.T @ (M @ v))
    left = float(np.sqrt(v @ (M @ v)))
    return v / max(left, np.finfo(float).tiny), left / max(whole, np.finfo(float).tiny)


def _off_model(what: str) -> SceneError:
    return SceneError(
        f"a member is so far from the model that its {what} overflow; take a smaller sd of the "
        "parameters"
    )


# --- explicit, at large strain --------------------------------------------------------------------


@dataclass(frozen=True)
class ExplicitMembers:
    """Central difference of every member; rows of X are U_t and U_{t-h} (s, 2 N) m.

    Internal forces are linear in the stiffness of every part: `bodies` are those of cells, each
    with the coordinates that scale it, `springs` those of foundations.
    """

    system: System
    doubts: Doubts
    explicit: ExplicitStep
    bodies: tuple[tuple[StiffnessPart, ExplicitBody], ...]
    springs: tuple[tuple[StiffnessPart, sparse.csr_array], ...]

    @property
    def size(self) -> int:
        return 2 * len(self.system.moves)

    @property
    def displaced(self) -> None:
        return None

    @property
    def nodes(self) -> Ints:
        return np.tile(np.repeat(np.arange(len(self.system.moves) // 3), 3), 2)

    def ready(self, x: Floats) -> Floats:
        """Factors (s, parts) on the forces of every part."""
        return np.array([p.factor(x) for p, _ in (*self.bodies, *self.springs)]).T

    def step(
        self, ready: Floats, X: Floats, x: Floats, begin: Floats, end: Floats, number: int
    ) -> Floats:
        N, still = len(self.system.moves), np.zeros(0)
        loads, new = self.doubts.loads(x, begin), np.empty_like(X)
        for i, row in enumerate(X):
            u, before = row[:N], row[N:]
            R = self._force(u, ready[i])
            new[i, :N] = self.explicit.following(u, before, R, loads[i], still)
            new[i, N:] = u
        return new

    def _force(self, u: Floats, factors: Floats) -> Floats:
        matrices = (lambda u, k=k: k @ u for _, k in self.springs)
        forces = (*(body.force for _, body in self.bodies), *matrices)
        R = factors[0] * forces[0](u)
        for s, force in zip(factors[1:], forces[1:], strict=True):
            R += s * force(u)
        return np.asarray(R)


def explicit_members(explicit: ExplicitStep, doubts: Doubts) -> ExplicitMembers:
    """On the body of an explicit step. Raises `SceneError` as `ExplicitBody` does."""
    scene = explicit.system.scene
    split = parts(scene, doubts)
    bodies = tuple((p, ExplicitBody(p.scene)) for p in split if p.scene is not None)
    springs = tuple(
        (p, foundation_stiffness(scene.mesh, p.foundation)) for p in split if p.foundation
    )
    return ExplicitMembers(explicit.system, doubts, explicit, bodies, springs)
