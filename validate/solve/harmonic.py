"""The model that knows no mechanics: every component is interpolated by Laplace's equation.

What a law of elasticity adds to the motion of a surface is what it does better than this one.
"""

from dataclasses import dataclass
from time import perf_counter
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.fem.assemble import harmonic
from validate.fem.factor import factorise
from validate.fem.system import build
from validate.scene.scene import Scene
from validate.solve.handles import LARGE, Handles, require_handled
from validate.solve.types import Outcome, Run, Trace


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
