"""User-defined body of an experiment on coarser and finer meshes, with its prescribed input.

A parameter refines the mesh where it changes the number of nodes and leaves the body's extents and
volume as they are. Without such a parameter the mesh that was built is refined uniformly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from validate.errors import SceneError, ValidateError
from validate.parameters import Parameter, describe, with_values
from validate.pipeline.calibration.calibrated import closed, identified_by
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.origins import opened
from validate.pipeline.run.runs import solves_here
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.scene.geometries.refinement import refined
from validate.scene.material import LawName
from validate.scene.mesh import Mesh, require_positive_cells
from validate.scene.meshless import AnyScene, Meshless
from validate.scene.scene import Scene

_SAME = 0.02  # relative: extents and volume of a body with curved faces on two meshes


@dataclass(frozen=True, eq=False)
class ExperimentBody:
    """The scene that an experiment builds for its first accepted method.

    A level is a hundred times the ratio of cells along an edge to those of the experiment's own
    mesh: 200 is twice as fine.
    """

    experiment: Experiment
    parameters: Any
    recording: Recording
    _scenes: dict[int, Scene] = field(default_factory=dict, repr=False)

    @cached_property
    def scene(self) -> Scene:
        return self._built(self.parameters)

    @cached_property
    def seen(self) -> Registered:
        return self.experiment.place(self.recording, self.parameters, self.scene)

    @cached_property
    def refining(self) -> tuple[Parameter, ...]:
        """Parameters that are numbers of cells or nodes of the mesh, or sizes of its cells."""
        candidates = [p for p in describe(self.parameters) if _may_refine(p)]
        return tuple(p for p in candidates if self._refines(p))

    def at(self, level: int) -> Scene:
        """Raise `SceneError` for a level at which the body cannot be meshed."""
        if level not in self._scenes:
            self._scenes[level] = self._meshed(level)
        return self._scenes[level]

    def levels(self, wanted: Sequence[int]) -> tuple[int, ...]:
        """Those `wanted` that can be meshed, are touched at the same place and differ, rising: of
        equal meshes the first."""
        known = wanted if self.refining else [n for n in (100, 200, 400) if n <= max(wanted)]
        found: dict[int, int] = {}
        for level in sorted(known):
            cells = self._cells(level)
            if cells and cells not in found.values():
                found[level] = cells
        return tuple(found)

    def size(self, level: int) -> float:
        """Edge m of a cube (in 2-D a square) as large as a cell is on average."""
        mesh = self.at(level).mesh
        return float(np.abs(mesh.cell_volumes()).mean() ** (1 / mesh.dimension))

    def _meshed(self, level: int) -> Scene:
        if self.refining:
            values = {p.path: _scaled(p, level / 100) for p in self.refining}
            scene = self._built(with_values(self.parameters, values))
            require_positive_cells(scene.mesh)
            return scene
        return self.scene if level <= 100 else refined(self.at(level // 2))

    def _cells(self, level: int) -> int:
        try:
            scene = self.at(level)
        except ValidateError:
            return 0
        mine, first = (_acted_on(s) for s in (scene, self.scene))
        return len(scene.mesh.cells) if np.allclose(mine, first) else 0

    def _built(self, parameters: Any) -> Scene:
        method = self.experiment.methods[self.experiment.accepted[0]]
        return meshed(self.experiment.build(self.recording, parameters, method.scene))

    def _refines(self, p: Parameter) -> bool:
        changed = with_values(self.parameters, {p.path: _scaled(p, 2.0)})
        try:
            # Other nodes, the same body
            other = self._built(changed).mesh
            extents = np.allclose(
                np.ptp(self.scene.mesh.nodes, axis=0), np.ptp(other.nodes, axis=0), rtol=_SAME
            )
            volume = np.isclose(_volume(self.scene.mesh), _volume(other), rtol=_SAME)
            return bool(extents and volume) and len(self.scene.mesh.nodes) != len(other.nodes)
        except ValidateError:
            return False


def own_body(experiment: Experiment) -> ExperimentBody:
    """With what the experiment identifies from its recordings."""
    found = opened(experiment, experiment.parameters)
    recordings = found.recordings
    parameters = closed(experiment, found.parameters, recordings)
    identified = identified_by(
        experiment, recordings, parameters, experiment.methods, (),
        lambda p: solves_here(experiment, recordings, p),
    )  # fmt: skip
    if identified is not None:
        parameters = identified.parameters
    return ExperimentBody(experiment, parameters, recordings[0])


def meshed(scene: AnyScene) -> Scene:
    """Return the scene; raises `SceneError` for one without a mesh, where nothing can be refined,
    and for rigid bodies that touch, which the schemes of a derived ladder do not know."""
    if isinstance(scene, Meshless):
        raise SceneError("the scene has no mesh and no steps; a study needs both")
    if scene.contacts:
        raise SceneError(
            f"the scene touches {len(scene.contacts)} rigid bodies, which a derived ladder does "
            f"not support; run the experiment, or declare its ladder"
        )
    return scene


def with_law(scene: Scene, law: LawName) -> Scene:
    """Return the scene with that law everywhere."""
    regions = tuple(replace(r, material=r.material.of_law(law)) for r in scene.regions)
    return replace(scene, material=scene.material.of_law(law), regions=regions)


def _acted_on(scene: Scene) -> list[float]:
    """Places m of the nodes nearest to tools' tips, and to points at which drives act."""
    points = [t.tip for t in scene.tools] + [d.point for d in scene.drives if d.point is not None]
    nodes = [scene.mesh.nodes[scene.mesh.nearest_node(np.array(p))] for p in points]
    return [float(x) for place in nodes for x in place]


def _may_refine(p: Parameter) -> bool:
    if _counts(p):
        return True
    if isinstance(p.default, bool) or not isinstance(p.default, int | float):
        return False
    whole = p.type.startswith("int") and p.default >= 1
    return whole or (p.unit == "m" and p.default > 0 and "mesh" in p.path)


def _counts(p: Parameter) -> bool:
    """Whether it is the cells of a declared body, along its axes."""
    return p.type.startswith("tuple[int") and p.path == "body.cells" and bool(p.default)


def _scaled(p: Parameter, factor: float) -> str:
    if _counts(p):
        return ",".join(str(max(1, round(n * factor))) for n in p.default)
    if p.type.startswith("int"):
        return str(max(1, round(p.default * factor)))
    return repr(float(p.default / factor))


def _volume(mesh: Mesh) -> float:
    return float(np.abs(mesh.cell_volumes()).sum())
