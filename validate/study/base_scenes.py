"""Small bodies of the papers that can be turned along every axis of the stability map.

The body of a paper stays; material, damping, mesh and the shape of its cells change. Steps are
studied around the paper's own one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from validate.errors import SceneError, UsageError
from validate.papers.accuracy.needle import MP1, MP2, needle_block
from validate.papers.accuracy.needle import STEP as PAPER_002_STEP
from validate.papers.accuracy.rod import MP3, bending_rod
from validate.parameters import nearest_names
from validate.scene.box import box
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Material, Scene, Support

LARGEST = 1000  # unknowns of the mesh: all modes of a body are taken many times


@dataclass(frozen=True)
class Variant:
    """E Pa, nu, rho kg/m^3, Rayleigh damping 1/s and s, `mesh` (cells across), `quality`.

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


@dataclass(frozen=True)
class PaperSetting:
    """A printed setting: the variant that comes nearest to it, and its step dt s."""

    label: str
    source: str
    variant: Variant
    dt: float


@dataclass(frozen=True)
class BaseScene:
    """A body by name: `shaped` makes it of a mesh number and a material; `meshes` coarse to fine.

    `dt` s is the middle of the studied steps. `pull` is the load of its static questions (None:
    its own): locking and precision. `papers` are the printed settings that lie on its maps.
    """

    name: str
    words: str
    shaped: Callable[[int, Material], Scene]
    base: Variant
    meshes: tuple[int, ...]
    dt: float
    papers: tuple[PaperSetting, ...]
    pull: Load | None = None

    def build(self, variant: Variant) -> Scene:
        """Raises `SceneError` for materials, meshes and cells that cannot be."""
        v = variant
        if not v.quality > 0:
            raise SceneError(
                f"altitude ratio {v.quality:g}: cells are flat or inverted; it must be positive"
            )
        material = Material(
            v.E, v.nu, "linear", v.rho, v.mass_damping, v.stiffness_damping
        )  # fmt: skip
        scene = self.shaped(v.mesh, material)
        if scene.mesh.nodes.size > LARGEST:
            raise SceneError(
                f"{scene.mesh.nodes.size} unknowns at mesh {v.mesh}: a stability map has at most "
                f"{LARGEST}; coarsen it"
            )
        return replace(scene, mesh=squeezed(scene.mesh, v.quality))

    def pulled(self, variant: Variant) -> Scene:
        """The body under its one static load."""
        scene = self.build(variant)
        return scene if self.pull is None else replace(scene, drives=(), loads=(self.pull,))


def squeezed(mesh: Mesh, quality: float) -> Mesh:
    """The mesh with the layer of cells just beyond the middle of x at `quality` of its thickness.

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


def base_scene(name: str) -> BaseScene:
    """Raises `UsageError` naming the nearest ones."""
    if name not in BASE_SCENES:
        raise UsageError(
            f"no base scene '{name}' for a stability map; {nearest_names(name, set(BASE_SCENES))}"
        )
    return BASE_SCENES[name]


def _of(material: Material, mesh: int) -> Variant:
    m = material
    assert m.rho is not None
    return Variant(m.E, m.nu, m.rho, m.mass_damping, m.stiffness_damping, mesh)


def _block(n: int, material: Material) -> Scene:
    """Paper 001's block under traction, n cells across its 4 mm."""
    size = (0.004, 0.004, 0.007)
    return Scene(
        box(size, (n, n, round(7 * n / 4))),
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
    )


def _cube(n: int, material: Material) -> Scene:
    """Paper 003's cube pulled at a side, n cells along its 100 mm: coarser than printed."""
    return Scene(
        box((0.1, 0.1, 0.1), (n, n, n)),
        material,
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "x0", (-1.0, 0.0, 0.0)),),
    )


_NEEDLE, _ROD = _of(MP1, 10), _of(MP3, 3)
_KF = Variant(10e3, 0.47, 1068.0, 0.0, 0.1, 4)
_EKF = Variant(30e3, 0.49, 1000.0, 0.0, 0.0, 4)
_CONE = replace(_EKF, E=3 * 22.081e3, nu=0.5, rho=1060.0)

BASE_SCENES: Mapping[str, BaseScene] = {
    scene.name: scene
    for scene in (
        BaseScene(
            "needle_block",
            "paper 002's block (unit square, quadrilaterals in plane strain)",
            needle_block,
            _NEEDLE,
            (6, 10, 14, 20),
            PAPER_002_STEP,
            (
                PaperSetting("002 MP1", "paper 002, section IV.A", _NEEDLE, PAPER_002_STEP),
                PaperSetting("002 MP2", "paper 002, section IV.A", _of(MP2, 10), PAPER_002_STEP),
            ),
            Load("shear", "x1", (0.0, 1.0)),
        ),
        BaseScene(
            "bending_rod",
            "paper 002's rod (hexahedra)",
            bending_rod,
            _ROD,
            (2, 3, 4),
            PAPER_002_STEP,
            (PaperSetting("002 MP3", "paper 002, section IV.B", _ROD, PAPER_002_STEP),),
        ),
        BaseScene(
            "kf_cube",
            "paper 001's block (tetrahedra)",
            _block,
            _KF,
            (2, 3, 4),
            0.002,
            (PaperSetting("001", "paper 001, section 4", _KF, 0.002),),
        ),
        BaseScene(
            "ekf_cube",
            "paper 003's cube, coarser (tetrahedra)",
            _cube,
            _EKF,
            (3, 4, 5),
            0.001,
            (
                PaperSetting("003 cube", "paper 003, coarser mesh", _EKF, 0.001),
                PaperSetting("003 cone", "paper 003, the cone's material here", _CONE, 1e-4),
            ),
        ),
    )
}
