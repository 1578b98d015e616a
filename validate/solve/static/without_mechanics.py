"""Baseline without mechanics: every component is interpolated by Laplace's equation.

What a law of elasticity adds to the motion of a surface is what it does better than this one.
"""

from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import harmonic
from validate.fem.linear_solvers.factor import factorise
from validate.fem.system import build
from validate.scene.meshless import POSE, RigidBody
from validate.scene.scene import Scene
from validate.solve.handles import LARGE, Handles, require_handled
from validate.solve.types import Outcome, Run, Trace

# --- Where the points of a rigid body are, from its pose: what a registration alone predicts.


@dataclass(frozen=True)
class RigidMotion:
    """Settings: there are none. A rigid body has no nodes, so a run has traces alone."""

    handles: ClassVar[Handles] = Handles(
        (), inertia=False, cavities=False, loads=False, contact=(), mesh=False
    )

    def solve(self, scene: Any, t: Floats, inputs: Floats) -> Run:
        """Traces `<point>.<axis>` (nt,) m under poses (nt, 6), rotation vector rad and translation
        m, at t (nt,) s.

        Raises `SceneError` for a scene that deforms, and poses of another shape.
        """
        if not isinstance(scene, RigidBody) or inputs.shape[1:] != (POSE,):
            raise SceneError(
                f"RigidMotion places a RigidBody by poses (nt, {POSE}), but it received "
                f"{type(scene).__name__} and {inputs.shape}; use QuasiStatic or StaticNewton"
            )
        R = Rotation.from_rotvec(inputs[:, :3]).as_matrix()
        x = scene.points @ R.transpose(0, 2, 1) + inputs[:, None, 3:]
        traces = {
            f"{name}.{axis}": Trace(x[:, j, c], "m")
            for j, name in enumerate(scene.names)
            for c, axis in enumerate("xyz")
        }
        traces["updates"] = Trace(np.zeros(len(t)), "1")
        none = np.zeros((len(t), 0, 3))
        done = Outcome("finished", len(t))
        return Run("", t, np.arange(len(t)), none, traces, done, 0.0, None)


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Harmonic:
    """Settings: there are none. The material is not read; what nothing moves is free."""

    handles: ClassVar[Handles] = Handles(
        ("linear", *LARGE), inertia=False, cavities=False, loads=False, contact=()
    )

    def solve(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        """Fields under inputs (nt, k) m at t (nt,) s; raises `SceneError` for other parts."""
        require_handled(scene, self)
        start = perf_counter()
        system = build(scene)
        K, d = harmonic(scene), scene.mesh.dimension
        free = system.free
        factor = factorise(K[free][:, free], free // d, scene.mesh.nodes)
        columns = system.moves.copy()
        columns[free] = factor.solve(np.ascontiguousarray(-(K @ system.moves)[free]))
        u = (inputs @ columns.T).reshape(len(t), *scene.mesh.nodes.shape)
        traces = {f"{name}.displacement": Trace(y, "m")
                  for name, y in zip(scene.inputs, inputs.T, strict=True)}  # fmt: skip
        traces["updates"] = Trace(np.zeros(len(t)), "1")
        return Run(
            "", t, np.arange(len(t)), u, traces, Outcome("finished", len(t)),
            perf_counter() - start, None,
        )  # fmt: skip
