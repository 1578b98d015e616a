"""Where the points of a rigid body are, from its pose: what a registration alone predicts."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from validate.arrays import Floats
from validate.errors import SceneError
from validate.scene.rigid_body import POSE, RigidBody
from validate.solve.handles import Handles
from validate.solve.types import Outcome, Run, Trace


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
