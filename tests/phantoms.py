"""Meshes and scenes that several test modules share."""

from functools import cache

import numpy as np

from validate.arrays import Floats
from validate.fem.system import Responses, build, responses
from validate.scene.inclusion import Block, Capsule, block_with_inclusion
from validate.scene.mesh import Kind, Mesh, boundary_facets, kuhn_cells, quadratic
from validate.scene.scene import Cavity, Dilatation, Drive, Material, Pin, Scene, Support

BLOCK = Block(0.060, 0.045, 0.070)
CAPSULE = Capsule((0.030, 0.0225, 0.035), 0.0085, 0.028)
PAPER_GRID = (9, 10, 15)
COARSE_GRID = (7, 7, 9)


@cache
def phantom_mesh(grid: tuple[int, int, int] = PAPER_GRID, order: int = 1) -> Mesh:
    mesh = block_with_inclusion(BLOCK, grid, CAPSULE)
    return quadratic(mesh) if order == 2 else mesh


def phantom_scene(
    mesh: Mesh,
    *,
    E: float = 15_200.0,
    nu: float = 0.485,
    bonded: bool = False,
    dilatation: Dilatation = "pointwise",
) -> Scene:
    """The set-up of science note 000: stage driven along -x, rigid modes removed."""
    supports = [Support("probe_plate", (0,)), Support("bottom", (1,))]
    if bonded:
        supports = [Support("probe_plate", (0, 1, 2)), Support("stage_plate", (1, 2))]
        supports.append(Support("bottom", (1,)))
    return Scene(
        mesh,
        Material(E, nu),
        tuple(supports),
        (Pin((0.0, 0.0, 0.035), (2,)),),
        (Drive("stage", "stage_plate", (-1.0, 0.0, 0.0)),),
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
    return responses(
        build(phantom_scene(mesh, E=E, nu=nu, bonded=bonded, dilatation=dilatation))
    )
