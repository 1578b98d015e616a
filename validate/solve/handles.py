"""Capabilities of a scheme or filter, declared on its settings, and refusal of other scenes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Protocol, cast

from validate.errors import SceneError
from validate.scene.laws import LAWS, further_laws
from validate.scene.material import LawName
from validate.scene.meshless import AnyScene, MaterialPoint
from validate.scene.scene import Scene

ContactName = Literal["foundations", "membranes", "rigid", "needle"]
LARGE = cast(tuple[LawName, ...], tuple(kind.name for kind in LAWS.own))
GLUED: tuple[ContactName, ...] = ("foundations", "membranes")


@dataclass(frozen=True)
class Handles:
    """`law`: the package's laws that it solves; `contact`: what may be glued to facets, or touch
    them ("rigid", "needle").

    `inertia` says that it marches in time with masses; the others which parts a scene may have.
    `mesh` is False for what solves a scene without one; `viscous`: that stress may relax;
    `incompressible`: nu = 0.5.
    """

    law: tuple[LawName, ...]
    inertia: bool
    cavities: bool
    drives: bool = True
    loads: bool = True
    contact: tuple[ContactName, ...] = ("foundations",)
    mesh: bool = True
    viscous: bool = False
    incompressible: bool = False

    def covers(self, scene: AnyScene) -> bool:
        return not _refused(self, scene)

    def solves(self, law: str) -> bool:
        """Return whether it takes the law. What solves every law at large strain solves those of
        plug-ins, too."""
        return law in self.law or (set(LARGE) <= set(self.law) and law in further_laws())


def handles_faults(part: Any) -> str:
    """Return the fault of a class's declared capabilities; "" for none."""
    handles = getattr(part, "handles", None)
    return "" if isinstance(handles, Handles) else f"{part.__name__}.handles: expected Handles(...)"


LINEAR_DYNAMICS = Handles(("linear",), inertia=True, cavities=False, contact=GLUED)
LARGE_DYNAMICS = Handles(LARGE, inertia=True, cavities=False, viscous=True)
LARGE_STATICS = Handles(LARGE, inertia=False, cavities=True, viscous=True, incompressible=True)


class Handling(Protocol):
    """Settings that declare what they handle."""

    handles: ClassVar[Handles]


# Where to go instead: what handles the refused part, by name. A test asserts that each does.
INSTEAD: Mapping[str, tuple[str, ...]] = {
    "rigid_body": ("RigidMotion",),
    "mesh": ("QuasiStatic", "StaticNewton"),
    "point": ("StretchTest",),
    "linear": ("ExactPressure", "Newmark"),
    **dict.fromkeys(LARGE, ("StaticNewton", "NewtonDynamics")),
    "incompressible": ("QuasiStatic", "StaticNewton"),
    "viscous": ("StaticNewton", "NewtonDynamics"),
    "cavities": ("ExactPressure", "StaticNewton"),
    "loads": ("QuasiStatic", "NewtonDynamics"),
    "drives": ("KfFem", "ModalKf"),
    "membranes": ("QuasiStatic", "Newmark"),
    "rigid": ("ContactNewton",),
    "needle": ("NeedleLoop",),
}


def require_handled(scene: AnyScene, settings: Handling) -> None:
    """Raise `SceneError` that names what the settings cannot handle, and what can."""
    refused = _refused(settings.handles, scene)
    if refused:
        what, why = refused
        name, others = type(settings).__name__, " or ".join(INSTEAD.get(what, INSTEAD[LARGE[0]]))
        raise SceneError(f"{name} {why}; use {others}")


def _refused(handles: Handles, scene: AnyScene) -> tuple[str, str] | None:
    """The first part of a scene that is not handled, as a key of `INSTEAD` and in words."""
    if not isinstance(scene, Scene | MaterialPoint):
        return "rigid_body", "needs a deformable body"
    law, point = scene.material.law, isinstance(scene, MaterialPoint)
    if not isinstance(scene, MaterialPoint):  # the first that is not handled, or the body's own
        laws = (law, *(r.material.law for r in scene.regions))
        law = next((x for x in laws if not handles.solves(x)), law)
    if handles.mesh == point:
        return ("point", "needs a mesh") if point else ("mesh", "solves only a material point")
    if not handles.solves(law):
        return law, f"cannot solve the law '{law}', only {', '.join(handles.law)}"
    if any(m.prony.g for m in scene.materials) and not handles.viscous:
        return "viscous", "does not support a Prony series"
    if any(m.incompressible for m in scene.materials) and not handles.incompressible:
        return "incompressible", "solves nu <= 0.4999 only, not 0.5"
    if isinstance(scene, MaterialPoint):
        return None
    if scene.cavities and not handles.cavities:
        return "cavities", "does not support fluid in cavities; remove them from the scene"
    if scene.loads and not handles.loads:
        return "loads", f"does not support loads, the scene has {len(scene.loads)}"
    if not handles.drives and (scene.drives or not scene.loads):
        counts = f"{len(scene.drives)} drives and {len(scene.loads)} loads"
        return "drives", f"needs a scene with loads only, the scene has {counts}"
    if scene.membranes and "membranes" not in handles.contact:
        return "membranes", "does not support membranes: they are linear only"
    if scene.contacts and "rigid" not in handles.contact:
        return "rigid", (
            f"does not support contact with rigid bodies, the scene has {len(scene.contacts)}"
        )
    if scene.tools and "needle" not in handles.contact:
        return "needle", "does not support a needle with a prescribed path"
    return None
