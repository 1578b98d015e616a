"""Testing machine on a material point: stress against stretch, the full record at once."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.laws.plane_stress import response
from validate.scene.meshless import MaterialPoint
from validate.solve.handles import LARGE, Handles, require_handled
from validate.solve.types import Outcome, Run, Trace

_UNITS = {
    "nominal_stress": "Pa", "second_stress": "Pa", "free_stretch": "1", "volume_ratio": "1",
}  # fmt: skip


@dataclass(frozen=True)
class StretchTest:
    """Settings: there are none. A point has no nodes, so a run has traces alone."""

    handles: ClassVar[Handles] = Handles(
        LARGE, inertia=False, cavities=False, loads=False, contact=(), mesh=False, viscous=True
    )

    def solve(self, scene: MaterialPoint, t: Floats, inputs: Floats) -> Run:
        """Under stretches (nt, 1), biaxial (nt, 2), at t (nt,) s, at rest until then; refused, with
        the reason, where one of them has no stress.

        Raises `SceneError` for a scene that is no material point, and the linear law.
        """
        require_handled(scene, self)
        try:
            found, outcome = response(scene, inputs, t), Outcome("finished", len(t))
        except SceneError as none:
            t, inputs, outcome = t[:0], inputs[:0], Outcome("refused", 0, str(none))
            found = dict.fromkeys(_UNITS, t)
        traces = {name: Trace(y, _UNITS[name]) for name, y in found.items()}
        given = zip(scene.inputs, inputs.T, strict=True)
        traces |= {name: Trace(stretch, "1") for name, stretch in given}
        traces["updates"] = Trace(np.zeros(len(t)), "1")
        return Run("", t, np.arange(len(t)), np.zeros((len(t), 0, 3)), traces, outcome, 0.0, None)
