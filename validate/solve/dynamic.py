"""What linear schemes with inertia share: fields, traces and the forces of drives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.factor import factorise
from validate.fem.matrices import DampingTerms, MassName, damping_of, mass_of
from validate.fem.system import System
from validate.scene.scene import Scene, Weight
from validate.solve.types import NO_SURFACE, NOTHING, State, Trace

StartName = Literal["equilibrium", "zero"]


@dataclass(frozen=True)
class Reactions:
    """Plate forces on the body along each drive: rows (k, N) of K, C and M, and of loads (k, l)."""

    names: tuple[str, ...]
    copies: int
    K: Floats
    C: Floats
    M: Floats
    loads: Floats

    def numbers(self, u: Floats, v: Floats, a: Floats, loads: Floats) -> Mapping[str, float]:
        """`<drive>.force` N, compression positive, with damping and inertia; u, v, a (N,)."""
        if not self.names:
            return {}
        return self.named(self.K @ u + self.C @ v + self.M @ a - self.loads @ loads)

    def named(self, forces: Floats) -> Mapping[str, float]:
        """The forces (k,) N of the mesh as those on the whole body, by trace name."""
        return {
            f"{name}.force": self.copies * float(force)
            for name, force in zip(self.names, forces, strict=True)
        }


def reactions(
    system: System, mass: MassName | None = "consistent", terms: DampingTerms = "full"
) -> Reactions:
    """Rows of the drives' forces; `mass` None for a scheme without rates: no M, no C is made."""
    rows, names = system.moves.T, tuple(d.name for d in system.scene.drives)
    still = np.zeros_like(rows)
    C = still if mass is None else rows @ damping_of(system, mass, terms)
    M = still if mass is None else rows @ mass_of(system, mass)
    return Reactions(names, system.scene.copies, rows @ system.K, C, M, rows @ system.loads)


def require_linear(system: System) -> None:
    """Raises `SceneError` for a law at large strain, or a cavity, whose fluid nobody would feel."""
    law = system.scene.material.law
    if law != "linear":
        raise SceneError(f"a linear scheme cannot solve the law '{law}'; use StaticNewton")
    if system.scene.cavities:
        raise SceneError(
            "linear schemes with loads know no fluid in cavities; drop them from the scene, or "
            "use ExactPressure"
        )


@dataclass(frozen=True)
class InertialStepper:
    """Base of steppers whose states name their inputs and the drives' forces."""

    system: System
    reactions: Reactions

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @property
    def _drives(self) -> int:
        return len(self.scene.drives)

    def _state(self, inputs: Floats, k: int, updates: int = 0, **fields: object) -> State:
        return State(inputs, NOTHING, updates, NO_SURFACE, k=k, **fields)  # type: ignore[arg-type]

    def rest(self) -> State:
        zeros = np.zeros(self.system.moves.shape[0])
        inputs = np.zeros(len(self.scene.inputs))
        still = self.reactions.named(np.zeros(self._drives))
        return self._state(inputs, 0, u=zeros, v=zeros, a=zeros, numbers=still)

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        assert state.u is not None
        return state.u.reshape(self.scene.mesh.nodes.shape)

    def traces(self, states: Sequence[State]) -> dict[str, Trace]:
        """`<drive>.displacement` m, `<drive>.force` N (compression positive), `<load>.force` N.

        A load's force is its input: with `per_node` that at each node, else the total. A weight's
        trace is `<weight>.acceleration` m/s^2.
        """
        names = self.scene.inputs
        inputs = np.array([s.drives for s in states]).reshape(len(states), len(names))
        traces = {}
        for j, name in enumerate(names):
            moved = j < self._drives
            kind, unit = input_kind(self.scene, j)
            traces[f"{name}.{kind}"] = Trace(inputs[:, j], unit)
            if moved:
                force = np.array([s.numbers[f"{name}.force"] for s in states])
                traces[f"{name}.force"] = Trace(force, "N")
        return traces


def input_kind(scene: Scene, j: int) -> tuple[str, str]:
    """What the scene's input j is, and its unit."""
    drives = len(scene.drives)
    if j < drives:
        return "displacement", "m"
    weighs = isinstance(scene.loads[j - drives], Weight)
    return ("acceleration", "m/s^2") if weighs else ("force", "N")


def starting_accelerations(
    system: System, mass: MassName = "consistent", a0: StartName = "equilibrium"
) -> Floats | None:
    """M^-1 f (m, l) m/s^2 that one unit of each load gives the body at rest; None for a0 = 0."""
    if a0 == "zero":
        return None
    loads = system.loads[system.free]
    if mass == "lumped":
        return np.asarray(loads / system.masses[system.free][:, None])
    mesh = system.scene.mesh
    M = system.M[system.free][:, system.free]
    return factorise(M, system.free // mesh.dimension, mesh.nodes).solve(loads)


def elastic_forces(system: System, u: Floats) -> Floats:
    """Share K u of the drives' forces (nt, k) N in fields u (nt, n, d) m, compression positive.

    Where a drive's velocity jumps, damping makes its whole force jump; this share does not.
    """
    forces: Floats = u.reshape(len(u), -1) @ (system.K @ system.moves)
    return system.scene.copies * forces


def spread(system: System, free: Floats, driven: Floats) -> Floats:
    """All unknowns (N,) from the free ones (m,) and the drives' (k,)."""
    full = system.moves @ driven if len(driven) else np.zeros(len(system.moves))
    full[system.free] = free
    return full
