"""Common interface of linear and large-strain bodies for Newton's method."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.fem.large_strain.hyperelastic import Body, Inverted
from validate.fem.system import System


class Elastic(Protocol):
    """What is needed of a body at displacements u (N,) m; `unit_force` N scales its rounding."""

    @property
    def unit_force(self) -> float: ...

    def force(self, u: Floats) -> Floats: ...

    def tangent(self, u: Floats, pressures: Floats | None = None) -> sparse.csr_array: ...

    def extrapolated(self, u: Floats, du: Floats) -> Floats | None: ...

    def energy(self, u: Floats) -> float: ...

    def inverted(self, u: Floats) -> Inverted | None: ...


@dataclass(frozen=True)
class LinearBody:
    """K u, whatever u; `unit_force` N is what a displacement of the body's size would take."""

    K: sparse.csr_array
    unit_force: float

    def force(self, u: Floats) -> Floats:
        return np.asarray(self.K @ u)

    def tangent(self, u: Floats, pressures: Floats | None = None) -> sparse.csr_array:
        return self.K

    def extrapolated(self, u: Floats, du: Floats) -> None:
        return None

    def energy(self, u: Floats) -> float:
        return float(u @ (self.K @ u)) / 2

    def inverted(self, u: Floats) -> None:
        return None


def elastic(system: System) -> Elastic:
    """Return the body of a system; raises `SceneError` for what has no form at large strain."""
    scene = system.scene
    if scene.material.law != "linear":
        return Body(scene)
    size = float(np.ptp(scene.mesh.nodes, axis=0).max())
    return LinearBody(system.K, size * float(np.linalg.norm(system.K.diagonal())))
