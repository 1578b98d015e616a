"""The first natural frequencies of a body as it is held."""

from dataclasses import replace
from typing import Any

import numpy as np

from validate.errors import SceneError
from validate.fem.modes import modes_of
from validate.fem.system import build
from validate.replay.measured_cards import MeasuredBody
from validate.replay.own_body import with_law
from validate.replay.tree import Tree
from validate.scene.scene import Scene, Weight

COUNT = 3
WATER = 1000.0  # kg/m3: the density of a body of which nobody said one
_MOST = 60_000  # unknowns
_RIGID = 1e-3  # Hz: below it a motion is one of the whole body


def assumed_density(p: Any) -> str:
    """Words on a density that nobody stated, of a measured body; empty of one that counts in what
    is simulated, or that was set, and of other experiments."""
    if not isinstance(p, Tree) or not isinstance(p.settings, MeasuredBody):
        return ""
    rho, weighed = p.scene.material.rho, any(isinstance(x, Weight) for x in p.scene.loads)
    if p.settings.motion.how == "dynamic" or weighed or rho != WATER:
        return ""
    return f"with an assumed density of {rho:g} kg/m3, near that of water"


def first_frequencies(scene: Scene, count: int = COUNT) -> tuple[float, ...]:
    """Hz of the lowest modes of the undeformed body, undamped, without its fluid.

    Raises `SceneError` for a body that can move as a whole, has no density, or more unknowns than
    are worth a look at its modes.
    """
    if scene.mesh.nodes.size > _MOST:
        raise SceneError(
            f"{scene.mesh.nodes.size} unknowns; modes are computed for at most {_MOST}"
        )
    bare = replace(scene, cavities=(), material=replace(scene.material, stiffness_damping=0.0))
    system = build(with_law(bare, "linear"))
    try:
        modes = modes_of(system, min(count, len(system.free)))
    except (np.linalg.LinAlgError, RuntimeError) as singular:
        raise SceneError(f"no natural frequencies: {singular}; is the body held?") from None
    found = modes.omega[:count] / (2 * np.pi)
    if not found[0] > _RIGID:
        raise SceneError(f"a natural frequency of {found[0]:.2g} Hz: the body can move as a whole")
    return tuple(found.tolist())
