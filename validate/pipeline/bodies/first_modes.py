"""First natural frequencies of a supported body."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from validate.errors import SceneError
from validate.fem.critical import Modes
from validate.fem.system import build
from validate.pipeline.bodies.choices import MeasuredBody
from validate.pipeline.bodies.own_body import with_law
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.scene.material import LawName
from validate.scene.scene import Scene, Weight

# --- What a method changes of a measured body's scene: its law, and the element of its cells.

Changes = Mapping[str, Any]  # values by path, as a method's `scene`
_QUADRATIC = ("quadratic", "hex27", "tet10")


def model_of(law: LawName, element: str = "") -> dict[str, str]:
    """Return the changes by path; without an element that of the declared body."""
    return {"material.law": law, **({"body.element": element} if element else {})}


def law_of(method: Method, p: Tree) -> str:
    """Return the law that a method has of the declared scene's material."""
    return str((method.scene or {}).get("material.law", p.scene.material.law))


def element_of(method: Method, p: Tree) -> str:
    """Return the element of the cells that a method is solved in."""
    return str((method.scene or {}).get("body.element", p.scene.body.element))


def is_quadratic(element: str) -> bool:
    return element in _QUADRATIC


# -------------------------------------------------------------------------------------------------

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
        modes = Modes.of(system, min(count, len(system.free)))
    except (np.linalg.LinAlgError, RuntimeError) as singular:
        raise SceneError(f"no natural frequencies: {singular}; is the body held?") from None
    found = modes.omega[:count] / (2 * np.pi)
    if not found[0] > _RIGID:
        raise SceneError(f"a natural frequency of {found[0]:.2g} Hz: the body can move as a whole")
    return tuple(found.tolist())
