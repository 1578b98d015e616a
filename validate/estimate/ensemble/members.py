"""Members of one model with uncertain parameters, stepped together.

A member's state is a row of X (s, n): implicit members carry displacement, velocity and
acceleration, explicit ones U_t and U_{t-h}. Rows may be mixed linearly, which is what filters do.

Uncertain model parameters that a filter can estimate together with its state.

    stiffness        of every cell            stiffness.<region>  of a region's cells
    stiffness.body   of cells of no region    support.<facets>    of a foundation (or its number)
    load.<load>      the given load, scaled   bias.<load>         a force in N besides the given

Scales are estimated as logarithms, so that no estimate turns negative; a bias is one itself. All
coordinates x are 0 where the model stands.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError, UsageError
from validate.estimate.extended.explicit_filter import ExplicitStep
from validate.fem.assembly.assemble import foundation_stiffness, stiffness, stiffness_damping
from validate.fem.large_strain.explicit import ExplicitBody
from validate.fem.linear_solvers.factor import factorise
from validate.fem.system import System
from validate.scene.scene import Foundation, Load, Scene
from validate.solve.dynamic.newmark_rule import Rule, of_history, of_system

Kind = Literal["stiffness", "support", "load", "bias"]
_BODY = "body"


@dataclass(frozen=True)
class Doubtful:
    """A parameter: `nominal` in `unit` is the model's own, `sd` that of its coordinate at the
    start, `cells` (e,) those that it scales; `index` counts loads or foundations."""

    name: str
    kind: Kind
    nominal: float
    unit: str
    sd: float
    cells: NDArray[np.bool_]
    index: int = -1

    def value(self, x: float) -> float:
        """Return the parameter in its unit, of its coordinate."""
        return x if self.kind == "bias" else float(self.nominal * np.exp(x))


@dataclass(frozen=True)
class Doubts:
    """The parameters (p,) of one filter."""

    parameters: tuple[Doubtful, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(p.name for p in self.parameters)

    @property
    def sd(self) -> Floats:
        return np.array([p.sd for p in self.parameters])

    def columns(self, *kinds: Kind) -> tuple[int, ...]:
        return tuple(j for j, p in enumerate(self.parameters) if p.kind in kinds)

    def stiffest(self, x: Floats) -> float:
        """Return the largest factor on any stiffness among members x (s, p): no part has a larger
        one."""
        return float(np.exp((x @ self._factors).max(initial=0.0)))

    @cached_property
    def _factors(self) -> Floats:
        """(p, k): the coordinates that the logarithm of every factor on a stiffness is the sum of,
        of cells, then of supports."""
        masks = np.zeros((len(self.parameters), len(self.parameters[0].cells)))
        for j in self.columns("stiffness"):
            masks[j] = self.parameters[j].cells
        supports = np.eye(len(self.parameters))[:, list(self.columns("support"))]
        return np.hstack([np.unique(masks, axis=1), supports])

    def loads(self, x: Floats, given: Floats) -> Floats:
        """Every member's loads (s, l) N from the given ones (l,)."""
        loads = np.tile(given, (len(x), 1))
        for j, p in enumerate(self.parameters):
            if p.kind == "load":
                loads[:, p.index] *= np.exp(x[:, j])
        for j in self.columns("bias"):
            loads[:, self.parameters[j].index] += x[:, j]
        return loads


@dataclass(frozen=True)
class StiffnessPart:
    """Part of the stiffness that a few coordinates scale: cells of one body, or a foundation's
    springs.

    `mask` (p,) are the coordinates whose sum is the logarithm of its factor; `scene` has the part
    alone (springs: none, but `foundation`).
    """

    mask: Floats
    scene: Scene | None = None
    foundation: Foundation | None = None

    def factor(self, x: Floats) -> Floats:
        """(s,) of members x (s, p)."""
        return np.asarray(np.exp(x @ self.mask))


def doubts(scene: Scene, names: Sequence[str], sd: Sequence[float], bias_sd: float) -> Doubts:
    """By name; `sd` of scales is one for all or one each, `bias_sd` N that of every bias.

    Raises `UsageError` for a name that the scene has nothing for, one twice, and an sd <= 0.
    """
    twice = [n for n in names if list(names).count(n) > 1]
    if twice:
        raise UsageError(f"parameter '{twice[0]}' is named twice; name each parameter once")
    if len(sd) not in (1, len(names)) or min(sd, default=0.0) <= 0 or bias_sd <= 0:
        raise UsageError(
            f"sd {list(sd)} and bias_sd {bias_sd:g} N of {len(names)} parameters: expected "
            "values above 0, one sd for all or one for each"
        )
    known, each = {p.name: p for p in _known(scene)}, list(sd) * (len(names) // len(sd))
    odd = [n for n in names if n not in known]
    if odd:
        raise UsageError(f"parameter '{odd[0]}': not in this scene, which has {', '.join(known)}")
    found = (known[n] for n in names)
    return Doubts(
        tuple(
            replace(p, sd=bias_sd if p.kind == "bias" else s)
            for p, s in zip(found, each, strict=True)
        )
    )


def _known(scene: Scene) -> Iterator[Doubtful]:
    """Every parameter that a scene has, without an sd."""
    every, none = (np.full(len(scene.mesh.cells), b) for b in (True, False))
    body, E = every.copy(), scene.material.E
    yield Doubtful("stiffness", "stiffness", E, "Pa", 0.0, every)
    for region in scene.regions:
        cells = none.copy()
        cells[region.cells] = True
        body &= ~cells
        yield Doubtful(f"stiffness.{region.name}", "stiffness", region.material.E, "Pa", 0.0, cells)
    if scene.regions:
        yield Doubtful(f"stiffness.{_BODY}", "stiffness", E, "Pa", 0.0, body)
    for i, f in enumerate(scene.foundations):
        name = f"support.{f.facets if isinstance(f.facets, str) else i}"
        yield Doubtful(name, "support", f.stiffness, "N/m^3", 0.0, none, i)
    for i, load in enumerate(scene.loads):
        yield Doubtful(f"load.{load.name}", "load", 1.0, "1", 0.0, none, i)
        if isinstance(load, Load):
            yield Doubtful(f"bias.{load.name}", "bias", 0.0, "N", 0.0, none, i)


def parts(scene: Scene, of: Doubts) -> tuple[StiffnessPart, ...]:
    """Return the scene's stiffness in parts: one for every group of cells that the parameters tell
    apart, then one for every foundation."""
    p = len(of.parameters)
    masks = np.zeros((len(scene.mesh.cells), p))
    for j in of.columns("stiffness"):
        masks[:, j] = of.parameters[j].cells
    groups, inverse = np.unique(masks, axis=0, return_inverse=True)
    found = [
        StiffnessPart(mask, _alone(scene, np.ravel(inverse) == g)) for g, mask in enumerate(groups)
    ]
    for i, foundation in enumerate(scene.foundations):
        mask = np.zeros(p)
        mask[[j for j in of.columns("support") if of.parameters[j].index == i]] = 1.0
        found.append(StiffnessPart(mask, foundation=foundation))
    return tuple(found)


def _alone(scene: Scene, cells: NDArray[np.bool_]) -> Scene:
    """Some cells of a scene on all its nodes, free of everything else."""
    number = np.cumsum(cells) - 1
    regions = tuple(
        replace(r, cells=number[r.cells[cells[r.cells]]])
        for r in scene.regions
        if cells[r.cells].any()
    )
    mesh = replace(scene.mesh, cells=scene.mesh.cells[cells], facets={})
    return Scene(
        mesh, scene.material, regions=regions, dilatation=scene.dilatation, plane=scene.plane,
        thickness=scene.thickness,
    )  # fmt: skip


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
        matrices = (lambda u, k=k: k @ u for _, k in self.springs)
        forces = (*(body.force for _, body in self.bodies), *matrices)
        for i, row in enumerate(X):
            u, before = row[:N], row[N:]
            R = ready[i][0] * forces[0](u)
            for s, force in zip(ready[i][1:], forces[1:], strict=True):
                R += s * force(u)
            new[i, :N] = self.explicit.following(u, before, R, loads[i], still)
            new[i, N:] = u
        return new


def explicit_members(explicit: ExplicitStep, doubts: Doubts) -> ExplicitMembers:
    """On the body of an explicit step. Raises `SceneError` as `ExplicitBody` does."""
    scene = explicit.system.scene
    split = parts(scene, doubts)
    bodies = tuple((p, ExplicitBody(p.scene)) for p in split if p.scene is not None)
    springs = tuple(
        (p, foundation_stiffness(scene.mesh, p.foundation)) for p in split if p.foundation
    )
    return ExplicitMembers(explicit.system, doubts, explicit, bodies, springs)
