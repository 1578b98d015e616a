"""Meshes and scenes that several test modules share."""

from functools import cache

import numpy as np

from validate.arrays import Floats
from validate.fem.system import Responses, build
from validate.scene.geometries.inclusion import Block, Capsule
from validate.scene.material import Material
from validate.scene.mesh import Kind, Mesh, boundary_facets, kuhn_cells
from validate.scene.scene import Cavity, Dilatation, Drive, Pin, Scene, Support

BLOCK = Block(0.060, 0.045, 0.070)
CAPSULE = Capsule((0.030, 0.0225, 0.035), 0.0085, 0.028)
PAPER_GRID = (9, 10, 15)
COARSE_GRID = (7, 7, 9)


@cache
def phantom_mesh(grid: tuple[int, int, int] = PAPER_GRID, order: int = 1) -> Mesh:
    mesh = BLOCK.around(grid, CAPSULE)
    return mesh.quadratic() if order == 2 else mesh


def phantom_scene(
    mesh: Mesh,
    *,
    E: float = 15_200.0,
    nu: float = 0.485,
    bonded: bool = False,
    dilatation: Dilatation = "pointwise",
) -> Scene:
    """The set-up of paper 000: stage driven along -x, rigid modes removed."""
    supports = [Support("x0", (0,)), Support("y0", (1,))]
    if bonded:
        supports = [Support("x0", (0, 1, 2)), Support("x1", (1, 2))]
        supports.append(Support("y0", (1,)))
    return Scene(
        mesh,
        Material(E, nu),
        tuple(supports),
        (Pin((0.0, 0.0, 0.035), (2,)),),
        (Drive("stage", "x1", (-1.0, 0.0, 0.0)),),
        (Cavity("cyst", "cavity"),),
        dilatation,
    )


@cache
def phantom_responses(
    grid: tuple[int, int, int] = PAPER_GRID,
    order: int = 1,
    E: float = 15_200.0,
    nu: float = 0.485,
    bonded: bool = False,
    dilatation: Dilatation = "pointwise",
) -> Responses:
    mesh = phantom_mesh(grid, order)
    return Responses.of(
        build(phantom_scene(mesh, E=E, nu=nu, bonded=bonded, dilatation=dilatation))
    )


def grid_mesh(
    shape: tuple[int, int, int],
    sizes: tuple[float, float, float] = (1.0, 1.0, 1.0),
    holes: tuple[tuple[slice, slice, slice], ...] = (),
    kind: Kind = "tet4",
) -> Mesh:
    """A Kuhn grid of `shape` nodes with boxes of cells removed: sets "x0".."z1", "hole0", ..."""
    lines = [np.linspace(0, size, n) for n, size in zip(shape, sizes, strict=True)]
    nodes = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    boxes = np.full(np.array(shape) - 1, -1)
    for number, hole in enumerate(holes):
        boxes[hole] = number
    kept = np.tile(boxes.ravel() < 0, 6)
    cells = kuhn_cells(shape)
    facets = _grid_facets(cells, np.tile(boxes.ravel(), 6), nodes, np.array(sizes))
    used, number_of = np.unique(cells[kept], return_inverse=True)
    local = np.full(len(nodes), -1)
    local[used] = np.arange(len(used))
    mesh = Mesh(
        nodes[used],
        number_of.reshape(-1, 4),
        "tet4",
        {name: local[f] for name, f in facets.items()},
    )
    return mesh.quadratic() if kind == "tet10" else mesh


def _grid_facets(
    cells: np.ndarray, box: np.ndarray, nodes: Floats, sizes: Floats
) -> dict[str, np.ndarray]:
    outside = boundary_facets(cells, 3)
    facets = {}
    for axis, letter in enumerate("xyz"):
        for end in (0, 1):
            on = np.abs(nodes[outside, axis] - end * sizes[axis]).max(axis=1) < 1e-12 * sizes[axis]
            facets[f"{letter}{end}"] = outside[on]
    for number in range(int(box.max()) + 1):
        # The hole's own boundary, seen from the solid: its orientation turned round.
        facets[f"hole{number}"] = boundary_facets(cells[box == number], 3)[:, [0, 2, 1]]
    return facets
