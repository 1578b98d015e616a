"""The first natural frequencies of a body as it is held."""

from dataclasses import replace

import numpy as np

from validate.errors import SceneError
from validate.fem.modes import modes_of
from validate.fem.system import build
from validate.replay.measured_cards import MeasuredBody, Tissue
from validate.replay.own_body import with_law
from validate.scene.scene import Scene

COUNT = 3
_MOST = 60_000  # unknowns
_RIGID = 1e-3  # Hz: below it a motion is one of the whole body


def assumed_density(p: MeasuredBody) -> str:
    """Words on a density that nobody stated; empty of one that was asked for, or set."""
    if p.motion.how == "dynamic" or p.moved.by == "gravity" or p.material.rho != Tissue().rho:
        return ""
    return f"with an assumed density of {p.material.rho:g} kg/m3, near that of water"


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
