"""Steppers that superpose response columns: what all linear quasi-static schemes share."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import Responses
from validate.scene.scene import Scene
from validate.scene.select import nodes_of
from validate.solve.types import Ending, State


@dataclass(frozen=True)
class Superposed:
    """Amounts z (m,) of the columns, drives m and pressures Pa, and what a haptic tick needs: the
    displacements `surface` (s d,) m of the nodes of cavities and driven plates."""

    z: Floats
    surface: Floats


@dataclass(frozen=True)
class LinearStepper:
    """u = sum_a z_a u_a with z = (drives, pressures); `rows` (s d + k, m) are the columns u_a at
    the nodes of the cavities and driven plates, the condensed model that a step evaluates, and the
    plates' forces."""

    responses: Responses
    rows: Floats

    @property
    def scene(self) -> Scene:
        return self.responses.scene

    @cached_property
    def units(self) -> Mapping[str, str]:
        cavities = [c.name for c in self.scene.cavities]
        return (
            {f"{d.name}.force": "N" for d in self.scene.drives}
            | {f"{name}.pressure": "Pa" for name in cavities}
            | {f"{name}.volume_ratio": "1" for name in cavities}
        )

    def rest(self) -> State:
        return self._state(0, np.eye(self.rows.shape[1] + 1)[0], 0)

    def _state(
        self,
        k: int,
        z: Floats,
        updates: int,
        failure: tuple[Ending, str] | None = None,
        ratios: Floats | None = None,
    ) -> State:
        """From (1, z) (1 + m,), and the cavities' V/V0 where they are known already."""
        drives = self.responses.drives
        if ratios is None:
            ratios = self.ratios(z)
        moved, plates = self.rows @ z[1:], len(self.rows) - drives
        found = (*moved[plates:].tolist(), *z[drives + 1 :].tolist(), *ratios.tolist())
        numbers = dict(zip(self.units, found, strict=False))  # a stepper may add its own
        return State(k, Superposed(z[1:], moved[:plates]), failure, updates, numbers)

    def ratios(self, z: Floats) -> Floats:
        """V/V0 (c,) at (1, z) (1 + m,)."""
        return np.asarray(self.responses.volumes @ z @ z @ z / self.responses.rest_volumes)

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        return np.asarray(np.tensordot(state.inner.z, self.responses.fields, 1))


def condensed(responses: Responses) -> Floats:
    """Rows at the nodes of the cavities and driven plates, then the plates' forces."""
    scene = responses.scene
    sets = [*(c.facets for c in scene.cavities), *(d.facets for d in scene.drives)]
    if not sets:
        raise SceneError("scene without drive and cavity: nothing moves; add one")
    nodes = np.unique(np.concatenate([nodes_of(scene.mesh, place) for place in sets]))
    kept = responses.fields[:, nodes].reshape(len(responses.fields), -1).T
    forces = responses.reactions.reshape(-1, kept.shape[1])
    return np.ascontiguousarray(np.vstack([kept, forces]))
