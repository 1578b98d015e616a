"""Small scenes at large strain that the Newton tests share."""

from dataclasses import replace
from functools import cache

import numpy as np
from phantoms import COARSE_GRID, grid_mesh, phantom_mesh, phantom_scene

from validate.fem.system import System, build
from validate.scene.material import LawName, Material
from validate.scene.scene import Cavity, Dilatation, Drive, Scene, Support
from validate.solve.static.newton import NewtonStepper, StaticNewton
from validate.solve.types import State

SIDE = 0.1


def cube(
    law: LawName,
    nu: float = 0.3,
    contact: str = "slip",
    *,
    n: int = 4,
    order: int = 1,
    dilatation: Dilatation = "pointwise",
) -> Scene:
    """The cube of paper 003: 0.1 m, E 30 kPa, pressed from above by slipping plates."""
    mesh = grid_mesh((n, n, n), 3 * (SIDE,), kind="tet10" if order == 2 else "tet4")
    supports = [Support("z0", (2,)), Support("x0", (0,)), Support("y0", (1,))]
    if contact == "bonded":
        supports = [Support("z0", (0, 1, 2)), Support("z1", (0, 1))]
    drive = Drive("stage", "z1", (0.0, 0.0, -1.0))
    material = Material(30e3, nu, law)
    return Scene(mesh, material, tuple(supports), (), (drive,), dilatation=dilatation)


def phantom(
    law: LawName = "neo_hooke", order: int = 1, dilatation: Dilatation = "nodal_mean"
) -> Scene:
    scene = phantom_scene(phantom_mesh(COARSE_GRID, order), dilatation=dilatation)
    return replace(scene, material=replace(scene.material, law=law))


def two_cavities(law: LawName = "neo_hooke") -> Scene:
    holes = ((slice(1, 2), slice(1, 3), slice(1, 3)), (slice(3, 5), slice(1, 3), slice(1, 3)))
    mesh = grid_mesh((7, 5, 5), (0.06, 0.04, 0.04), holes)
    cavities = (Cavity("left", "hole0"), Cavity("right", "hole1"))
    drives = (Drive("stage", "x1", (-1.0, 0.0, 0.0)),)
    return Scene(mesh, Material(1e4, 0.4, law), (Support("x0", (0, 1, 2)),), (), drives, cavities)


@cache
def _system(scene_key: str) -> System:
    return build({"phantom": phantom, "two": two_cavities}[scene_key]())


def phantom_system() -> System:
    return _system("phantom")


def two_cavity_system() -> System:
    return _system("two")


def prepared(scene: Scene, settings: StaticNewton | None = None) -> NewtonStepper:
    stepper = (settings or StaticNewton()).prepare(build(scene))
    assert isinstance(stepper, NewtonStepper)
    return stepper


def pressed(stepper: NewtonStepper, *drives: float) -> State:
    """Steps from rest through the drives [m]; the last state."""
    state = stepper.rest()
    for d in drives:
        state = stepper.step(state, np.array([d]))
    return state
