"""Ladder of an experiment in studies: refinements, solvers and compared quantities.

An experiment may declare its ladder; `pipeline.ladder.default` derives one from its scene.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.recording.types import Recording
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Scene
from validate.solve.study_entries import RUNGS as RUNGS
from validate.solve.study_entries import SHOWN as SHOWN
from validate.solve.study_entries import Rival as Rival
from validate.solve.study_entries import Rung as Rung
from validate.solve.types import Scheme

LARGEST = 1000  # unknowns of a body whose stability is mapped: all its modes are taken many times
# Worst altitude ratios of its cells.
QUALITY = (1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01)

#: Orders of convergence of displacements in smooth fields, by element.
ORDERS: Mapping[str, float] = MappingProxyType(
    {"H8": 2.0, "Q4": 2.0, "P1": 2.0, "MD": 2.0, "P2": 3.0}
)

# --- error against time ---------------------------------------------------------------------------


@dataclass(frozen=True)
class LawPair:
    """Two solvers, of the declared law and at large strain, alike in all else, on one coarse mesh.

    The difference of their answers is what the declared law costs.
    """

    element: str
    level: int
    dt: float
    declared: Callable[[float], Scheme]
    large: Callable[[float], Scheme]
    law: LawName = "neo_hooke"


@dataclass(frozen=True)
class Trial:
    """A body and its loading, made on any mesh of the ladder by any element.

    `build(element, level, law)`; `size(level)` m is that of a cell; `meshes` the levels by element,
    rising, `orders` their theoretical orders of convergence in displacements. `inputs(t)` (nt, k)
    at the steps' ends t (nt,) s; every dt of `steps` divides the time between `frames` (no,) s, at
    which displacements at `points` (p, d) m are compared. `best(dt)` is the solver without solver
    error, taken on `reference` (element, level) for the reference and on every mesh to split the
    error. `rise_s`: time in which the load comes on; `noise` m of a recording and where it is
    declared. In a static scene a step is a load increment.
    """

    build: Callable[[str, int, LawName], Scene]
    size: Callable[[int], float]
    meshes: Mapping[str, tuple[int, ...]]
    steps: tuple[float, ...]
    inputs: Callable[[Floats], Floats]
    frames: Floats
    points: Floats
    reference: tuple[str, int]
    best: Callable[[float], Scheme]
    solvers: tuple[Rival, ...]
    pair: LawPair | None
    dynamic: bool
    rise_s: float
    orders: Mapping[str, float] = field(default_factory=lambda: ORDERS)
    noise: tuple[float, str] | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "meshes", MappingProxyType(dict(self.meshes)))
        object.__setattr__(self, "orders", MappingProxyType(dict(self.orders)))
        for dt in self.steps:
            ends = self.frames / dt
            if np.abs(ends - ends.round()).max() > 1e-6:
                raise SceneError(f"steps of {dt:g} s do not end on the frames of the ladder")

    def times(self, dt: float) -> Floats:
        """Return the ends (nt,) s of all steps of dt s."""
        return dt * np.arange(1, round(float(self.frames[-1]) / dt) + 1, dtype=np.float64)

    @property
    def largest_inputs(self) -> Floats:
        """The inputs (k,) of the step at which they are largest."""
        inputs = self.inputs(self.times(self.steps[-1]))
        return np.asarray(inputs[int(np.argmax(np.abs(inputs).sum(axis=1)))])

    def solver(self, name: str) -> Rival:
        return next(s for s in self.solvers if s.name == name)


def marker_noise(recording: Recording) -> tuple[float, str] | None:
    """Return the declared standard deviation m of the markers, and what declares it."""
    for name, marker in recording.markers.items():
        if marker.sd:
            return float(marker.sd), f"markers '{name}' of the recording"
    return None


# --- stability ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Turned:
    """E Pa, nu, rho kg/m^3, Rayleigh damping 1/s and s, `mesh` (a number), `quality`.

    `quality` is the worst altitude ratio: the cells' least altitude along x over the regular
    mesh's. One layer of cells in the middle is squeezed to it, the others share what that leaves.
    """

    E: float
    nu: float
    rho: float
    mass_damping: float
    stiffness_damping: float
    mesh: int
    quality: float = 1.0

    @property
    def material(self) -> Material:
        return Material(
            self.E, self.nu, "linear", self.rho, self.mass_damping, self.stiffness_damping
        )

    @classmethod
    def of(cls, material: Material, mesh: int) -> Self:
        """Return a material with density, on a mesh."""
        m = material
        if m.rho is None:
            raise SceneError("a motion needs a density; set the material's rho, kg/m3")
        return cls(m.E, m.nu, m.rho, m.mass_damping, m.stiffness_damping, mesh)


@dataclass(frozen=True)
class PaperSetting:
    """A printed setting: the body that comes nearest to it, and its step dt s."""

    label: str
    source: str
    variant: Turned
    dt: float


@dataclass(frozen=True)
class StabilityBody:
    """What a stability map turns: `shaped` makes it of a mesh number and a material.

    `meshes` are coarse to fine, `dt` s is the middle of the studied steps. `pull` is the load of
    its static questions (None: its own): locking and precision. `papers` are the printed settings
    that lie on its maps, `qualities` the altitude ratios its cells can be squeezed to.
    """

    words: str
    shaped: Callable[[int, Material], Scene]
    base: Turned
    meshes: tuple[int, ...]
    dt: float
    papers: tuple[PaperSetting, ...] = ()
    pull: Load | None = None
    qualities: tuple[float, ...] = QUALITY

    def build(self, body: Turned) -> Scene:
        """Raise `SceneError` for materials, meshes and cells that cannot be."""
        if not body.quality > 0:
            raise SceneError(
                f"altitude ratio {body.quality:g}: cells are flat or inverted; it must be positive"
            )
        scene = self.shaped(body.mesh, body.material)
        if scene.mesh.nodes.size > LARGEST:
            raise SceneError(
                f"{scene.mesh.nodes.size} unknowns at mesh {body.mesh}: a stability map has at "
                f"most {LARGEST}; coarsen it"
            )
        return replace(scene, body=squeezed(scene.mesh, body.quality))

    def pulled(self, body: Turned) -> Scene:
        """Return the body under its one static load."""
        scene = self.build(body)
        return scene if self.pull is None else replace(scene, drives=(), loads=(self.pull,))


def squeezed(mesh: Mesh, quality: float) -> Mesh:
    """Return the mesh with the layer of cells just beyond the middle of x at `quality` of its
    thickness.

    The others are stretched alike, so that the outline stays.
    """
    x = mesh.nodes[:, 0]
    lines = np.unique(np.round(x, 12))
    k = len(lines) // 2
    widths = np.diff(lines)
    widths[k - 1] *= quality
    moved = lines[0] + np.concatenate([[0.0], np.cumsum(widths)]) / widths.sum() * np.ptp(lines)
    nodes = mesh.nodes.copy()
    nodes[:, 0] = np.interp(x, lines, moved)
    return replace(mesh, nodes=nodes)


# --- what an experiment declares ------------------------------------------------------------------


@dataclass(frozen=True)
class Ladder:
    """Parts that are None are derived from the experiment's scene.

    `trial(recording, parameters, quick)` is what `tradeoff` and `choose` run, coarser where
    `quick`; `body` what `stability` maps.
    """

    trial: Callable[[Recording, Any, bool], Trial] | None = None
    body: StabilityBody | None = None
