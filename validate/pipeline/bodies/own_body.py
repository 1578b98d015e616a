"""User-defined body of an experiment: its meshes, coarser and finer, and its prescribed input.

A parameter refines the mesh where it changes the number of nodes and leaves the body's extents and
volume as they are. Without such a parameter the mesh that was built is refined uniformly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import ceil, pi, prod, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from validate.errors import SceneError, UsageError, ValidateError
from validate.files import modified
from validate.parameters import Parameter, describe, with_values
from validate.pipeline.calibration.calibrated import closed, identified_by
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.origins import opened
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.estimate import NODAL_MEAN
from validate.pipeline.run.runs import solves_here
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.scene.geometries.indented_bodies import IndentedBlock, IndentedCylinder
from validate.scene.geometries.refinement import refined
from validate.scene.geometries.specification import Box, Cylinder, Geometry, MeshFile
from validate.scene.material import LawName
from validate.scene.mesh import Mesh, cell_volumes, quadratic, require_positive_cells
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
        return float(np.abs(cell_volumes(mesh)).mean() ** (1 / mesh.dimension))

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
    return float(np.abs(cell_volumes(mesh)).sum())


# --- mesh of a measured body from its declared geometry, and its number of unknowns --------------

# --- Height and diameter of equal area of a specimen's mesh file, between its plates.

PLATES = ("lower_plate", "upper_plate")
DIAMETER, HEIGHT = "body.diameter", "body.height"  # paths
_FLAT = 0.02  # of the height: the largest spread of a plate's nodes along z


def sizes_of_mesh(mesh: Mesh, name: str = "mesh") -> dict[str, float]:
    """Return height and diameter m of a mesh by parameter; the area is volume over height.

    Raises `SceneError` for a mesh that a test between plates cannot use: without tetrahedra,
    without one of the facet sets `PLATES`, or with plates that are not flat and normal to z.
    """
    if mesh.dimension != 3 or mesh.bricks:
        raise SceneError(
            f"{name}: cells of {mesh.kind}; expected tetrahedra; for hexahedra answer "
            "experiment = body"
        )
    if absent := [plate for plate in PLATES if plate not in mesh.facets]:
        raise SceneError(
            f"{name}: no facet set {' or '.join(absent)}; there are "
            f"{', '.join(mesh.facets) or 'none'}; name both plates in the file, or answer "
            "experiment = body"
        )
    low, high = (mesh.nodes[mesh.facet_nodes(plate)][:, 2] for plate in PLATES)
    height = float(high.mean() - low.mean())
    uneven = float(max(np.ptp(low), np.ptp(high)))
    if uneven > _FLAT * abs(height):
        raise SceneError(
            f"{name}: plates {1e3 * uneven:.4g} mm out of flat along z and {1e3 * height:.4g} mm "
            "apart; expected flat plates normal to z: turn the mesh so that its axis is z"
        )
    if height <= 0:
        raise SceneError(
            f"{name}: upper_plate is {-1e3 * height:.4g} mm below lower_plate; expected it above: "
            "exchange the two names"
        )
    area = float(np.abs(cell_volumes(mesh)).sum()) / height
    return {DIAMETER: 2 * sqrt(area / pi), HEIGHT: height}


# -------------------------------------------------------------------------------------------------

_BODIES = (Box, Cylinder, MeshFile, IndentedBlock, IndentedCylinder)


def mesh_of(p: Tree, folder: Path) -> Mesh:
    """Return the body with the facet set "surface" of all of it.

    The places of a mesh file are chosen on the mesh as it is, and halved with it: smaller facets
    beside a box would enter it, and the nearest one of a point is a quarter as large. Raises
    `UsageError` for another geometry, `SceneError` for a mesh of 2-D cells.
    """
    body = p.scene.body
    if not isinstance(body, _BODIES):
        raise UsageError(
            f"body: expected one of {', '.join(kind.__name__ for kind in _BODIES)}, not "
            f"{type(body).__name__}"
        )
    file = body.file if isinstance(body, MeshFile) else ""
    places = named_places(p.scene) if file else ()
    changed = modified(folder / file) if file else 0
    return _meshed(body, folder.resolve(), places, changed)


@lru_cache(maxsize=8)
def _meshed(body: Geometry, folder: Path, places: tuple[str, ...], changed: int) -> Mesh:
    """A file is read again where it has `changed`."""
    mesh = body.placed(folder, places) if isinstance(body, MeshFile) else body.resolved(folder)
    if mesh.dimension != 3:
        raise SceneError(f"cells of {mesh.kind}; a measured body needs 3-D cells")
    return replace(mesh, facets={**mesh.facets, "surface": mesh.surface})


def named_places(scene: Scene) -> tuple[str, ...]:
    """Return the places that hold and move a declared body, in words."""
    parts: tuple[Any, ...] = (
        *scene.supports, *scene.drives, *scene.contacts, *scene.tracked, *scene.loads
    )  # fmt: skip
    places = (getattr(part, "facets", None) for part in parts)
    return tuple(dict.fromkeys(text for text in places if isinstance(text, str)))


def even_axes(scene: Scene) -> tuple[bool, ...]:
    """Axes of a block along which every grid has a middle: in the plane of a place that it rests
    on, whose middle stays. A cylinder has an axis."""
    rests = [support for support in scene.supports if support.rests]
    if not rests or not isinstance(scene.body, Box):
        return ()
    return tuple(c not in rests[0].components for c in range(3))


def grid_unknowns(cells: Sequence[float], *, round_: bool) -> float:
    """Those of quadratic hexahedra: of a disc in squares, a core and rings about it."""
    if round_:
        n = cells[0]
        return 3 * (4 * n**2 + 4 * n + 1 + 16 * n * ceil(n / 2)) * (2 * cells[1] + 1)
    return 3 * prod(2 * n + 1 for n in cells)


def unknowns_of(p: Tree, order: int, folder: Path) -> float:
    """Return the unknowns of a mesh file in elements of this order; of a grid, quadratic ones."""
    body = p.scene.body
    if not isinstance(body, MeshFile):
        return grid_unknowns(body.cells, round_=is_round(body))
    mesh = mesh_of(p.with_scene(body=replace(body, element="linear")), folder)
    return float((quadratic(mesh) if order == 2 and not mesh.bricks else mesh).nodes.size)


def costs_of(p: Tree, order: int, folder: Path) -> float:
    """Return the unknowns that a solution costs: those of nodal mean dilatation count more."""
    N = unknowns_of(p, order, folder)
    filed = isinstance(p.scene.body, MeshFile)
    return N * NODAL_MEAN if filed and order == 1 and not mesh_of(p, folder).bricks else N


def is_round(body: Geometry) -> bool:
    return isinstance(body, Cylinder | IndentedCylinder)
