"""Quasi-static scheme: K u = f at every step, without mass."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.volume_constraints import keep_volumes
from validate.fem.system import Responses, System
from validate.scene.places import nodes_of
from validate.scene.scene import Scene
from validate.solve.dynamic.linear import InertialStepper, reactions
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled
from validate.solve.study_entries import Rival, Stepping, StillBody, StudyBody
from validate.solve.types import Ending, State, Stepper

# --- Steppers that superpose response columns: what all linear quasi-static schemes share.


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


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class QuasiStatic:
    """Linear statics of drives and loads, by superposition of one solved column per input."""

    handles: ClassVar[Handles] = replace(LINEAR_DYNAMICS, inertia=False, incompressible=True)

    @staticmethod
    def steppings() -> tuple[Stepping, ...]:
        """One map that remembers nothing."""
        words = "statics: independent of the last step"
        return (
            Stepping(
                "quasi_static", words, "consistent", lambda r: np.zeros((len(r.x), 1, 1)), order=0.0
            ),
        )

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if isinstance(asked, StillBody) and asked.cavities:
            return ()
        name = "superposition" if isinstance(asked, StillBody) else "quasi-static"
        return (Rival(name, "static superposition", lambda dt: QuasiStatic(), stepped=False),)

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for a law at large strain, cavities, or a body that can move."""
        require_handled(system.scene, self)
        columns = np.hstack([system.moves, np.zeros_like(system.loads)])
        forces = np.hstack([-(system.K @ system.moves), system.loads])
        factor = system.factor()
        columns[system.free] = factor.solve(forces[system.free])
        pressed = np.zeros((len(system.scene.drives), columns.shape[1]))
        if any(m.incompressible for m in system.scene.materials):
            columns, held = keep_volumes(system, factor, columns, system.loads)
            pressed = system.moves.T @ held
        return QuasiStaticStepper(system, reactions(system, None), columns, pressed)


@dataclass(frozen=True)
class QuasiStaticStepper(InertialStepper):
    """States carry displacements (N,) m; `columns` (N, k + l) are those of a unit input each,
    `pressed` (k, k + l) N the drives' forces of multipliers at nu = 0.5."""

    columns: Floats
    pressed: Floats

    def rest(self) -> State:
        return State(0, np.zeros(len(self.columns)))

    def step(self, state: State, inputs: Floats) -> State:
        """Return the static state under the inputs: drives in m, then loads in N."""
        u = self.columns @ inputs
        r, loads = self.reactions, inputs[len(self.scene.drives) :]
        numbers = r.named(r.K @ u - r.loads @ loads + self.pressed @ inputs)
        return State(state.k + 1, u, numbers=numbers)

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        return np.reshape(state.inner, self.scene.mesh.nodes.shape)
