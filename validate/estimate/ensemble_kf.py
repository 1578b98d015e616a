"""Ensemble Kalman filter: random members of one model, corrected by their own sample covariance.

Members differ in parameters and loads, which may walk, and so in their states (Evensen 1994, with
the perturbed measurements of Burgers et al. 1998, or without any, Sakov & Oke 2008). Few members
know covariances badly: inflation keeps their spread from dying out, and localisation keeps a
measurement from moving nodes far off by chance. Parameters are of the whole body and are not
localised.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError
from validate.estimate.localisation import along_mesh, gaspari_cohn
from validate.estimate.measurements import Measurements
from validate.estimate.member_filter import HANDLES, MemberModel, MemberStepper, sight
from validate.estimate.members import Members
from validate.estimate.noise_settings import NoiseSettings
from validate.estimate.sampled_kalman import Corrected, Reach, ensemble_update
from validate.fem.system import System
from validate.parameters import quantity
from validate.solve.handles import Handles, require_handled


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
        """Raises `SceneError` for what no member can step, `UsageError` for parameters that the
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
