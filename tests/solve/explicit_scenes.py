"""Small scenes at large strain for explicit and implicit dynamics."""

from dataclasses import replace

import numpy as np
from law_samples import sample

from validate.arrays import Floats
from validate.fem.system import System, build
from validate.scene.geometries.box import box
from validate.scene.scene import Drive, Load, Scene, Support
from validate.solve.march import march
from validate.solve.types import Run, Scheme, Stepper


def pulled(law: str = "svk", cells: int = 3, nu: float = 0.4, **damping: float) -> System:
    """A cube of 0.1 m, bonded at x0, pulled at x1 by a load in N."""
    mesh = box((0.1, 0.1, 0.1), (cells, cells, cells))
    material = replace(sample(law, 30e3, nu), rho=1000.0, **damping)
    supports = (Support("x0", (0, 1, 2)),)
    return build(Scene(mesh, material, supports, loads=(Load("pull", "x1", (1.0, 0.0, 0.0)),)))


def pressed(law: str = "svk", **damping: float) -> System:
    """The same between slip plates, pressed by a plate at x1 by a drive in m."""
    scene = pulled(law, 2, 0.45, **damping).scene
    supports = tuple(Support(f"{axis}0", (i,)) for i, axis in enumerate("xyz"))
    drives = (Drive("plate", "x1", (-1.0, 0.0, 0.0)),)
    return build(replace(scene, supports=supports, loads=(), drives=drives))


def ran(scheme: Scheme, system: System, inputs: Floats, dt: float) -> Run:
    """The last step's field and the traces of one input (nt,)."""
    return marched(scheme.prepare(system), inputs, dt)


def marched(stepper: Stepper, inputs: Floats, dt: float) -> Run:
    t = dt * np.arange(1, len(inputs) + 1)
    last = np.array([len(inputs) - 1])
    return march("run", stepper, t, inputs[:, None], last, 0.0)


def rise(n: int, to: float) -> Floats:
    """A smooth ramp in n steps."""
    return np.asarray(to * (1 - np.cos(np.pi * np.arange(1, n + 1) / n)) / 2)
