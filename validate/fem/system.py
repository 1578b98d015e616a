"""System of a scene: stiffness, constrained unknowns, rigid motions, response columns.

A linear scene with drives and cavity pressures is the sum of fixed fields: u = sum_j q_j u_j
+ sum_i P_i u_i. They are solved for once; every later step is a short product (the columns of the
condensed inverse of paper 000, eqs 18-20, for just the inputs that the scene has).
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import (
    hung_masses,
    load_columns,
    lumped,
    mass,
    stiffness,
    stiffness_damping,
)
from validate.fem.assembly.assemble import mass as mass_matrix
from validate.fem.cavity import CavitySurface, cavity_surface, volume_form
from validate.fem.linear_solvers.factor import Factor, Fronts, factorise, require_assembly
from validate.scene.mesh import Mesh
from validate.scene.places import Place, nodes_of
from validate.scene.scene import Load, Scene

_FREE = 1e-14  # square of the rows, of the largest, under a motion that nothing holds
_SHOWN = 0.3  # share of a motion's largest component from which it is named


def require_held(scene: Scene, held: Ints, more: Floats | None = None, hint: str = "") -> None:
    """Raise `SceneError` that names the rigid motions that the unknowns `held` (h,), foundations
    and the rows `more` (m, N) leave free."""
    mesh = scene.mesh
    modes, words = rigid_motions(mesh)
    # Unknowns that foundations bind to the ground
    bedded = [
        int(node) * mesh.dimension + c
        for f in scene.foundations
        if f.stiffness > 0
        for node in nodes_of(mesh, f.facets)
        for c in f.components
    ]
    rows = [modes[held], modes[bedded]]
    if more is not None:
        rows.append(more @ modes)
    every = np.vstack([*rows, np.zeros((1, len(words)))])
    _, sizes, motions = np.linalg.svd(every.T @ every)
    loose = motions[sizes <= _FREE * max(float(sizes.max()), 1e-300)]
    if len(loose):
        share = np.abs(loose).max(axis=0)
        named = ", ".join(w for w, s in zip(words, share, strict=True) if s > _SHOWN * share.max())
        raise SceneError(
            f"the body can move rigidly in {len(loose)} of {len(words)} ways ({named}): "
            f"{len(held)} unknowns are held and its stiffness matrix is not positive "
            f"definite; add a support or pin{hint}"
        )


def rigid_motions(mesh: Mesh) -> tuple[Floats, tuple[str, ...]]:
    """Translations and rotations (N, 3 or 6) of the body's size, and their names."""
    d, n = mesh.dimension, len(mesh.nodes)
    x = (mesh.nodes - mesh.nodes.mean(axis=0)) / np.ptp(mesh.nodes, axis=0).max()
    planes = [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]
    modes = np.zeros((n, d, d + len(planes)))
    for c in range(d):
        modes[:, c, c] = 1.0
    for r, (i, j) in enumerate(planes):
        modes[:, i, d + r], modes[:, j, d + r] = -x[:, j], x[:, i]
    turns = ["z"] if d == 2 else list("xyz")
    words = (*(f"along {a}" for a in "xyz"[:d]), *(f"about {a}" for a in turns))
    return modes.reshape(n * d, -1), words


@dataclass(frozen=True)
class System:
    """A scene with its unknowns: `free` ones, moves (N, drives) of a unit drive, cavities.

    Matrices are assembled when first asked for: what a scheme does not use costs nothing. K, M and
    C are (N, N) in N/m, kg and N s/m; `masses` (N,) are the lumped ones; `loads` (N, l) are the
    nodal forces of one newton of each load, or one m/s^2 of a weight.
    """

    scene: Scene
    free: Ints
    moves: Floats
    cavities: tuple[CavitySurface, ...]

    @cached_property
    def K(self) -> sparse.csr_array:
        self._require_room()
        return stiffness(self.scene)

    @cached_property
    def M(self) -> sparse.csr_array:
        self._require_room()
        body = mass(self.scene)
        if not self.scene.masses:
            return body
        return sparse.csr_array(body + sparse.diags_array(hung_masses(self.scene)))

    @cached_property
    def masses(self) -> Floats:
        if not self.scene.masses:
            return lumped(self.scene, self.M)
        hung = hung_masses(self.scene)
        return lumped(self.scene, self.M - sparse.diags_array(hung)) + hung

    @cached_property
    def C(self) -> sparse.csr_array:
        """Rayleigh damping of every cell, alpha M_e + beta K_e (paper 001, eq 7)."""
        self._require_room()
        C = mass(self.scene, damping=True) + stiffness_damping(self.scene)
        return sparse.csr_array(C)

    @cached_property
    def loads(self) -> Floats:
        return load_columns(self.scene)

    def _require_room(self) -> None:
        require_assembly(self.scene.mesh.nodes.size, self.scene.mesh.dimension)

    @property
    def held(self) -> Ints:
        """The unknowns that supports, pins and drives prescribe."""
        return np.setdiff1d(np.arange(len(self.moves)), self.free)

    def factor(self) -> Factor | Fronts:
        """Factorisation of K over the free unknowns; `SceneError` if not positive definite, with
        the rigid motions that nothing holds."""
        require_held(self.scene, self.held)
        d = self.scene.mesh.dimension
        free = self.K[self.free][:, self.free]
        return factorise(free, self.free // d, self.scene.mesh.nodes)


@dataclass(frozen=True)
class Responses:
    """Fields (m, n, d) m per unit input: drives (m per m) first, then cavities (m per Pa).

    `reactions` (drives, m): force of the drive per unit input, N/m and N/Pa, compression positive.
    `volumes` (cavities, m + 1, m + 1, m + 1): see `volume_form`; the first slot is the rest shape.
    """

    scene: Scene
    fields: Floats
    reactions: Floats
    volumes: Floats

    @property
    def drives(self) -> int:
        return len(self.scene.drives)

    @property
    def rest_volumes(self) -> Floats:
        """Volume m^3 of every cavity at rest."""
        return np.asarray(self.volumes[:, 0, 0, 0])

    @classmethod
    def of(cls, system: System) -> Self:
        """Solve for every response column: one factorisation, one solve per input.

        Raises `SceneError` for a law at large strain: its fields are no sums of columns.
        """
        law = system.scene.material.law
        if law != "linear":
            raise SceneError(f"a linear scheme cannot solve the law '{law}'; use StaticNewton")
        if system.scene.loads:
            raise SceneError(
                "response columns support drives and cavities only; for loads use a dynamic scheme"
            )
        mesh, factor = system.scene.mesh, system.factor()
        loads = [c.pressure_load(mesh.nodes).ravel() for c in system.cavities]
        columns = []
        for move in system.moves.T:
            u = move.copy()
            u[system.free] = factor.solve(-(system.K @ move)[system.free])
            columns.append(u)
        for load in loads:
            u = np.zeros_like(load)
            u[system.free] = factor.solve(load[system.free])
            columns.append(u)
        fields = np.array(columns).reshape(-1, *mesh.nodes.shape)
        shapes = np.concatenate([mesh.nodes[None], fields])
        forms = [volume_form(c, shapes) for c in system.cavities]
        volumes = np.array(forms).reshape(-1, *(3 * [len(shapes)]))  # also without cavities
        # Force of each drive on the body along it: residual K u - f of every column
        drives = len(system.scene.drives)
        residuals = [system.K @ u for u in columns]
        for i, load in enumerate(loads):
            residuals[drives + i] = residuals[drives + i] - load
        copies = system.scene.copies
        reactions = np.array(
            [[copies * float(move @ r) for r in residuals] for move in system.moves.T]
        )
        return cls(system.scene, fields, reactions, volumes)


def build(scene: Scene) -> System:
    """Assemble the scene; raises `SceneError` for elements, supports or cavities that fail."""
    mesh = scene.mesh
    N = mesh.nodes.size
    held = np.zeros(N, dtype=bool)
    for support in scene.supports:
        held[_unknowns(scene, support.facets, support.components)] = True
    for pin in scene.pins:
        node = mesh.nearest_node(np.array(pin.point))
        held[[node * mesh.dimension + c for c in pin.components]] = True
    moves = np.zeros((N, len(scene.drives)))
    for j, drive in enumerate(scene.drives):
        if drive.follows:
            part, i = drive.follows
            nodes = nodes_of(mesh, part.facets)
            driven = _unknowns(scene, part.facets, tuple(range(mesh.dimension)))
            held[driven] = True
            moves[driven, j] = part.columns(mesh.nodes[nodes])[:, i]
            continue
        if drive.shape is not None:
            # Each node moves by its own, per metre.
            driven, u = _unknowns(scene, drive.facets, tuple(range(mesh.dimension))), drive.shape.u
            if u.size != len(driven):
                raise SceneError(
                    f"drive '{drive.name}': a shape of {u.shape} for {len(driven)} unknowns of its "
                    "nodes"
                )
            held[driven] = True
            moves[driven, j] = u.ravel()
            continue
        axes = np.flatnonzero(drive.direction)
        if len(axes) != 1:
            raise SceneError(
                f"drive '{drive.name}' must move along one axis, got {drive.direction}"
            )
        driven = _unknowns(scene, drive.facets, (int(axes[0]),))
        if drive.point is not None:
            places = mesh.nodes[driven // mesh.dimension]
            away = np.linalg.norm(places - np.array(drive.point), axis=1)
            driven = driven[[int(np.argmin(away))]]
        held[driven] = True
        moves[driven, j] = sum(drive.direction)
    if held.all():
        raise SceneError(
            f"all {N} unknowns of {len(mesh.nodes)} nodes are held or driven, so nothing is "
            "left to solve: put at least 2 elements between held faces, or one of order 2"
        )
    _require_felt(scene, held & ~moves.any(axis=1))
    cavities = tuple(cavity_surface(mesh, c.name, c.facets) for c in scene.cavities)
    return System(scene, np.flatnonzero(~held), moves, cavities)


def _require_felt(scene: Scene, held: NDArray[np.bool_]) -> None:
    """Raises `SceneError` for a load or mass all of whose unknowns are held still: it would do
    nothing. What acts on a driven set is felt by the drive."""
    mesh = scene.mesh
    free = ~held.reshape(mesh.nodes.shape)
    loads = [load for load in scene.loads if isinstance(load, Load)]
    parts = [("load", p.name, p.facets, np.array(p.direction) != 0) for p in loads]
    every = np.ones(mesh.dimension, dtype=bool)
    parts += [("mass", p.name, p.facets, every) for p in scene.masses]
    for what, name, place, along in parts:
        nodes = nodes_of(mesh, place)
        if free[nodes][:, along].any():
            continue
        open_ones = np.flatnonzero(free[:, along].any(axis=1))
        hint = "the body has no free node"
        if len(open_ones):
            away, index = cKDTree(mesh.nodes[open_ones]).query(mesh.nodes[nodes])
            nearest = open_ones[np.asarray(index)[int(np.argmin(away))]]
            at = ", ".join(f"{1e3 * x:.3g}" for x in mesh.nodes[nearest])
            far = 1e3 * float(np.min(away))
            hint = f"the nearest free node is at ({at}) mm, {far:.3g} mm away"
        raise SceneError(
            f"{what} '{name}': supports and pins hold all {len(nodes) * int(along.sum())} "
            f"unknowns of its {len(nodes)} nodes, so it would have no effect; {hint}"
        )


def _unknowns(scene: Scene, facets: Place, components: tuple[int, ...]) -> Ints:
    nodes = nodes_of(scene.mesh, facets)
    unknowns: Ints = (nodes[:, None] * scene.mesh.dimension + np.array(components)).ravel()
    return unknowns


# --- What is made once from a system and asked for again: kept with it, like its cached
# properties.

V = TypeVar("V")


def once(system: System, key: Hashable, make: Callable[[], V]) -> V:
    """`make()` at the first call with this key, the same object afterwards; a copied or changed
    system starts anew. `key` names all that `make` depends on besides the system."""
    kept: dict[Hashable, V] = system.__dict__.setdefault("_once", {})
    if key not in kept:
        kept[key] = make()
    return kept[key]


# --- Masses and dampings of a system as a scheme takes them: two switches, each with its own
# price.

MassName = Literal["consistent", "lumped"]
DampingTerms = Literal["full", "mass"]


def mass_of(system: System, mass: MassName) -> sparse.csr_array:
    """M (N, N) kg as the setting names it."""
    if mass == "consistent":
        return system.M
    return sparse.csr_array(sparse.diags_array(system.masses))


def damping_of(system: System, mass: MassName, terms: DampingTerms) -> sparse.csr_array:
    """C (N, N) N s/m: alpha M of the mass in use, with `terms` "full" plus beta K.

    Without beta K lumped masses leave C diagonal: paper 002's price of explicit steps.
    """
    if (mass, terms) == ("consistent", "full"):
        return system.C
    C = mass_matrix(system.scene, damping=True)
    if mass == "lumped":
        C = sparse.csr_array(sparse.diags_array(lumped(system.scene, C)))
    return C if terms == "mass" else sparse.csr_array(C + stiffness_damping(system.scene))
