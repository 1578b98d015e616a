"""Ensemble Kalman filter: random members of one model, corrected by sample covariance.

Members differ in parameters and loads, which may walk, and so in their states (Evensen 1994, with
the perturbed measurements of Burgers et al. 1998, or without any, Sakov & Oke 2008). Few members
know covariances badly: inflation keeps their spread from dying out, and localisation keeps a
measurement from moving nodes far off by chance. Parameters are of the whole body and are not
localised.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from validate.arrays import Floats
from validate.errors import UsageError
from validate.estimate.ensemble.member_filter import HANDLES, MemberModel, MemberStepper, sight
from validate.estimate.ensemble.members import Members
from validate.estimate.gating import NoiseSettings
from validate.estimate.kalman.formulas import Corrected, Reach, ensemble_update
from validate.estimate.measurements import Measurements
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.mesh import Mesh
from validate.solve.handles import Handles, require_handled

# --- How far a measurement reaches in an ensemble: a taper by the distance along the mesh.


def gaspari_cohn(distance: Floats, radius: float) -> Floats:
    """1 at distance 0, 5/24 at `radius`, 0 from twice the radius on, twice differentiable in
    between (Gaspari & Cohn 1999, eq 4.10); both in m. Raises `UsageError` for a radius <= 0."""
    if not radius > 0:
        raise UsageError(f"localisation radius {radius:g} m: expected a positive number")
    r = np.abs(np.asarray(distance, dtype=np.float64)) / radius
    near, far = np.minimum(r, 1.0), np.clip(r, 1.0, 2.0)
    inner = (((-near / 4 + 1 / 2) * near + 5 / 8) * near - 5 / 3) * near**2 + 1
    outer = ((((far / 12 - 1 / 2) * far + 5 / 8) * far + 5 / 3) * far - 5) * far + 4 - 2 / (3 * far)
    return np.where(r <= 1, inner, np.where(r < 2, np.maximum(outer, 0.0), 0.0))


def along_mesh(mesh: Mesh, rows: sparse.csr_array) -> Floats:
    """Distance (n, m) m from what each of `rows` (m, N) reads to every node, along edges: a slit
    is walked around. Infinite where the mesh does not hang together."""
    d, H = mesh.dimension, sparse.csr_array(rows)
    graph = _edges(mesh)
    columns = []
    for k in range(H.shape[0]):
        pick = slice(H.indptr[k], H.indptr[k + 1])
        weights, nodes = np.abs(H.data[pick]), H.indices[pick] // d
        nodes, weights = nodes[weights > 0], weights[weights > 0]
        point = weights @ mesh.nodes[nodes] / weights.sum()
        start = np.linalg.norm(mesh.nodes[nodes] - point, axis=1)
        columns.append(
            (dijkstra(graph, directed=False, indices=nodes) + start[:, None]).min(axis=0)
        )
    return np.stack(columns, axis=1)


def _edges(mesh: Mesh) -> sparse.csr_array:
    """Lengths m between all nodes of every cell, (n, n)."""
    k = mesh.cells.shape[1]
    a, b = (mesh.cells[:, i].ravel() for i in np.triu_indices(k, 1))
    a, b = np.minimum(a, b), np.maximum(a, b)
    a, b = np.unique(np.stack([a, b]), axis=1)
    lengths = np.linalg.norm(mesh.nodes[a] - mesh.nodes[b], axis=1)
    return sparse.csr_array((lengths, (a, b)), shape=2 * (len(mesh.nodes),))


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class EnsembleKf(MemberModel):
    """`radius`: where a measurement still reaches 5/24 of a node's covariance, by the distance
    along the mesh; nothing from twice as far on. It needs coordinates that are nodes."""

    handles: ClassVar[Handles] = HANDLES
    noise_settings: ClassVar[NoiseSettings] = NoiseSettings("walk", "R", "sd")

    runs: int = quantity(10, "1", "members")
    seed: int = quantity(1, "1", "of all random draws")
    update: Literal["perturbed", "deterministic"] = quantity(
        "perturbed", "1", "perturbed measurements for every member, or the same for all"
    )
    radius: float | None = quantity(None, "m", "of localisation, along the mesh; none: everywhere")
    walk: float = quantity(0.0, "1/s^0.5", "random walk of every scale's logarithm")
    bias_walk: float = quantity(0.0, "N/s^0.5", "random walk of every bias")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.runs < 3 or min(self.walk, self.bias_walk) < 0:
            raise UsageError(
                f"{self.runs} members, walks {self.walk:g} and {self.bias_walk:g}: at least 3, 0, 0"
            )

    def prepare(self, system: System, measurements: Measurements) -> MemberStepper:
        """Raise `SceneError` for what no member can step, `UsageError` for parameters that the
        scene does not have and for localised shapes, `ComparisonError` for times off the steps."""
        require_handled(system.scene, self)
        members = self.members(system)
        doubtful = members.doubts.parameters
        if self.runs <= len(doubtful) + 1:
            raise UsageError(
                f"{self.runs} members for {len(doubtful)} parameters: at least {len(doubtful) + 2}"
            )
        walks = [self.bias_walk if p.kind == "bias" else self.walk for p in doubtful]
        reach = None if self.radius is None else reached(members, measurements, self.radius)
        analysis = DrawnRuns(self, members.doubts.sd, np.array(walks) * np.sqrt(self.h), reach)
        looks = sight(self, members, measurements)
        return MemberStepper(self, members, analysis, looks, self.limit(system))


def reached(members: Members, measurements: Measurements, radius: float) -> Reach:
    """Gaspari and Cohn's factors for every number of a member's state, then 1 for its parameters.

    Raises `UsageError` for members in shapes, which are nowhere.
    """
    if members.nodes is None:
        raise UsageError(
            f"a radius of {radius:g} m needs members in nodes: set coordinates = nodes"
        )
    d, H = members.system.scene.mesh.dimension, measurements.H
    taper = gaspari_cohn(along_mesh(members.system.scene.mesh, H), radius)
    everywhere = np.ones((len(members.doubts.parameters), H.shape[0]))
    weights = abs(H) / np.asarray(abs(H).sum(axis=1)).reshape(-1, 1)
    seen = np.asarray(weights @ np.repeat(taper, d, axis=0))
    seen = (seen + seen.T) / 2
    np.fill_diagonal(seen, 1.0)
    return Reach(np.vstack([taper[members.nodes], everywhere]), seen)


@dataclass(frozen=True)
class DrawnRuns:
    """sd and walk of a step (p,); every step draws from a generator of its own."""

    settings: EnsembleKf
    sd: Floats
    walk: Floats
    reach: Reach | None

    @property
    def degrees(self) -> int:
        return self.settings.runs - 1

    def start(self) -> Floats:
        """DrawnRuns, then moved and stretched to exactly mean 0 and the sd of the start."""
        drawn = self._normal(0, 0, len(self.sd))
        drawn = drawn - drawn.mean(axis=0)
        root = np.linalg.cholesky(drawn.T @ drawn / self.degrees)
        return np.asarray(np.linalg.solve(root, drawn.T).T * self.sd)

    def walked(self, x: Floats, number: int) -> Floats:
        return x + self.walk * self._normal(1, number, len(self.sd)) if self.walk.any() else x

    def claimed(self, seen: Floats) -> Floats:
        apart = seen - seen.mean(axis=0)
        HPHt = np.asarray(apart.T @ apart / self.degrees)
        return HPHt if self.reach is None else self.reach.seen * HPHt

    def corrected(self, Z: Floats, seen: Floats, z: Floats, R: Floats, number: int) -> Corrected:
        noise = None
        if self.settings.update == "perturbed":
            drawn = self._normal(2, number, len(R))
            noise = (drawn - drawn.mean(axis=0)) @ np.linalg.cholesky(R).T
        return ensemble_update(Z, seen, z, R, noise, self.reach)

    def _normal(self, what: int, number: int, columns: int) -> Floats:
        """(runs, columns); the same for the same step, so that a step can be made again."""
        rng = np.random.default_rng((self.settings.seed, what, number))
        return rng.standard_normal((self.settings.runs, columns))
