"""Steppers that superpose response columns: what all linear quasi-static schemes share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import Responses
from validate.scene.scene import Scene
from validate.solve.types import Ending, State, Trace


@dataclass(frozen=True)
class LinearStepper:
    """u = sum_a z_a u_a with z = (drives, pressures); `kept` (s, d, m) are the columns u_a at the
    nodes of the cavities and driven plates, the condensed model that a step evaluates."""

    responses: Responses
    kept: Floats

    @property
    def scene(self) -> Scene:
        return self.responses.scene

    def rest(self) -> State:
        zeros = np.zeros(self.kept.shape[2])
        k = self.responses.drives
        return State(zeros[:k], zeros[k:], 0, np.zeros(self.kept.shape[:2]))

    def _state(
        self, inputs: Floats, updates: int, failure: tuple[Ending, str] | None = None
    ) -> State:
        k = self.responses.drives
        return State(inputs[:k], inputs[k:], updates, self.kept @ inputs, failure)

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        return np.asarray(np.tensordot(state.inputs, self.responses.fields, 1))

    def traces(self, states: Sequence[State]) -> dict[str, Trace]:
        """Drives, plate forces, pressures and volumes of every step."""
        r = self.responses
        z = np.array([s.inputs for s in states]).reshape(len(states), r.fields.shape[0])
        traces = {}
        for j, drive in enumerate(r.scene.drives):
            traces[f"{drive.name}.displacement"] = Trace(z[:, j], "m")
            traces[f"{drive.name}.force"] = Trace(z @ r.reactions[j], "N")
        one = np.hstack([np.ones((len(z), 1)), z])
        for i, cavity in enumerate(r.scene.cavities):
            V = np.einsum("abc,ta,tb,tc->t", r.volumes[i], one, one, one, optimize=True)
            traces[f"{cavity.name}.pressure"] = Trace(z[:, r.drives + i], "Pa")
            traces[f"{cavity.name}.volume_ratio"] = Trace(V / r.rest_volumes[i], "1")
        return traces


def condensed(responses: Responses) -> Floats:
    """Columns at the nodes of the cavities and driven plates: the condensed model."""
    scene = responses.scene
    sets = [c.facets for c in scene.cavities] + [d.facets for d in scene.drives]
    if not sets:
        raise SceneError("scene without drive and cavity: nothing moves")
    nodes = np.unique(np.concatenate([scene.mesh.facet_nodes(name) for name in sets]))
    return np.ascontiguousarray(responses.fields[:, nodes].transpose(1, 2, 0))
