"""References of a ladder: solvers without error in time, pairs of laws, and a swinging block.

Its candidates are those that schemes declare (`SCHEMES.candidates`).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.pipeline.bodies.own_body import with_law
from validate.pipeline.ladder.ladder import LawPair, Trial
from validate.scene.geometries.box import box, grid
from validate.scene.material import LawName
from validate.scene.scene import Scene
from validate.solve.dynamic.implicit import NewtonDynamics
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.schemes import SCHEMES
from validate.solve.static.newton import StaticNewton
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.study_entries import SwingingBody
from validate.solve.types import Scheme

_MODES = 60  # of the reference, beside the statics of the rest

# --- with inertia ---------------------------------------------------------------------------------


def exact_in_time(dt: float) -> Scheme:
    """Without error for loads that stand still within a step."""
    return Modal(dt, modes=_MODES, propagate="constant")


def exact_in_ramps(dt: float) -> Scheme:
    """Without error for loads that change linearly within a step."""
    return Modal(dt, modes=_MODES, propagate="linear")


def swinging_pair(element: str, level: int, dt: float, law: LawName = "neo_hooke") -> LawPair:
    """Average acceleration of the linear law and at large strain."""
    return LawPair(element, level, dt, implicit(), _newton_dynamics, law)


def implicit(**settings: Any) -> Callable[[float], Scheme]:
    return lambda dt: Newmark(dt, **settings)


def _newton_dynamics(dt: float) -> Scheme:
    return NewtonDynamics(dt, mass="consistent")


# --- without --------------------------------------------------------------------------------------


def still_best(cavities: bool) -> Callable[[float], Scheme]:
    """Return the linear solver without error: superposition, with the root of the fluid's
    pressure."""
    return lambda dt: ExactPressure() if cavities else QuasiStatic()


def still_pair(
    element: str, level: int, dt: float, cavities: bool, law: LawName = "neo_hooke"
) -> LawPair:
    """Linear statics and Newton's at large strain."""
    return LawPair(element, level, dt, still_best(cavities), lambda dt: StaticNewton(), law)


# --- trial solvers of a swinging block, clamped at one end and compared at the other -------------

_SMALL, _MEDIUM = 2, 4  # finest meshes of baselines that solve anew every step


def swinging_trial(
    base: Scene,
    per: tuple[int, int, int],
    steps: tuple[float, float, float],
    frames: Floats,
    inputs: Callable[[Floats], Floats],
    quick: bool,
    noise: tuple[float, str] | None = None,
) -> Trial:
    """Return a block of the scene `base` on meshes of `per` x level cells, held where it is there.

    `per` is 1 but along the longest edge, at whose free end points are compared.
    """
    size = tuple(float(x) for x in base.mesh.nodes.max(axis=0))

    def build(element: str, level: int, law: LawName) -> Scene:
        cells = tuple(n * level for n in per)
        mesh = grid(size, cells) if element == "H8" else box(size, cells)
        # P2's midside nodes are as many nodes as P1 has at twice the level.
        mesh = mesh.quadratic() if element == "P2" else mesh
        return with_law(replace(base, body=mesh), law)

    fine = (2, 4) if quick else (2, 4, 8)
    along = int(np.argmax(per))
    share = [(a, b) for a in (0.25, 0.5, 0.75) for b in (0.25, 0.5, 0.75)]
    ends = np.array([np.insert(np.array(s), along, 1.0) for s in share])
    axis = np.array([np.insert(np.array([0.5, 0.5]), along, s) for s in (0.25, 0.5, 0.75)])
    return Trial(
        build=build,
        size=lambda level: size[1] / level,
        meshes={"H8": fine, "P1": fine, "P2": (2,) if quick else (2, 4)},
        steps=steps[:2] if quick else steps,
        inputs=inputs,
        frames=frames,
        points=np.asarray(np.vstack([ends, axis]) * np.array(size)),
        reference=("P2", 4 if quick else 6),
        best=exact_in_time,
        solvers=SCHEMES.candidates(SwingingBody(steps, _SMALL, _MEDIUM)),
        pair=swinging_pair("P2", 2, steps[0]),
        dynamic=True,
        rise_s=0.0,
        noise=noise,
    )
