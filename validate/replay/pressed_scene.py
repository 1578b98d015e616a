"""The scene of a body between two plates or grips: contact, sizes, and the modulus of a model.

    Scene(
        body=Cylinder("25 mm", "20 mm", element="tet10", part="quarter"),
        material=Material(None, 0.499),                  # identified
        supports=(Support("lower_plate", (2,)),),        # a whole body: rests=True
        drives=(Drive("stage", "upper_plate", "-z"),),   # pulled: "+z"
    )

Such plates slip; `BONDED_PLATES` are what a method changes where they hold the body.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from validate.errors import UsageError
from validate.identify.modulus import CylinderSize, TestKind
from validate.parameters import known
from validate.recording.types import Recording
from validate.replay.compression_cards import BONDED_PLATES
from validate.replay.fitted_moduli import modulus_in
from validate.replay.mesh_sizes import DIAMETER, HEIGHT, PLATES, sizes_of_mesh
from validate.replay.tree import Built, Tree, changed_by, mesh_of
from validate.scene.geometry import Cylinder, MeshFile
from validate.scene.scene import Scene, Support

Ends = Literal["slip", "bonded"]

LOWER, UPPER = PLATES


def between(ends: Ends, tree: Tree) -> Mapping[str, Any]:
    """What a method changes for plates that slip or hold the body."""
    if ends == "bonded":
        return BONDED_PLATES
    whole = not getattr(tree.scene.body, "held", ())
    return {"supports": (Support(LOWER, (2,), rests=whole),)}


def ends_of(scene: Scene) -> Ends:
    """Whether the moving plate holds the body sideways."""
    return "bonded" if any(s.facets == UPPER for s in scene.supports) else "slip"


def kind_of_test(tree: Tree) -> TestKind:
    """Whether the upper plate presses or pulls; raises `UsageError` for another motion."""
    moved = {(d.name, d.facets, tuple(d.direction)) for d in tree.scene.drives}
    for kind, sign in (("compression", -1.0), ("tension", 1.0)):
        if moved == {("stage", UPPER, (0.0, 0.0, sign))}:
            return kind  # type: ignore[return-value]
    raise UsageError(
        f'drives: {len(moved)} that no test between plates has; declare Drive("stage", '
        f'"{UPPER}", "-z"), in tension "+z"'
    )


def pressed_size(tree: Tree, folder: Path) -> CylinderSize:
    """Height and diameter m of the cylinder, or those of equal area of a mesh file.

    Raises `UsageError` while a size is not set, and what `sizes_of_mesh` does.
    """
    body = tree.scene.body
    if isinstance(body, Cylinder):
        return CylinderSize(known(body.diameter, DIAMETER), known(body.height, HEIGHT))
    if isinstance(body, MeshFile):
        tree = tree.with_scene(body=replace(body, halvings=0, element="linear"))
    sizes = sizes_of_mesh(mesh_of(None, tree, folder), getattr(body, "file", "body"))
    return CylinderSize(sizes[DIAMETER], sizes[HEIGHT])


def model_name(law: str, ends: str, order: int) -> str:
    """What parameters call a model."""
    return f"{law}, {ends}, order {order}"


def by_model(scene: Scene) -> str:
    """The name of the model that a scene was built with."""
    return model_name(scene.material.law, ends_of(scene), scene.mesh.order)


@dataclass(frozen=True)
class BuiltPressed(Built):
    """As `Built`; the modulus is the method's own, else that which the run identified its model
    with, else the declared one; 1 Pa while none is known, when only memory is asked for."""

    def __call__(
        self, recording: Recording | None, tree: Tree, changes: Mapping[str, Any] | None = None
    ) -> Scene:
        own = dict(changes or {})
        if "material.E" not in own:
            own["material.E"] = self._modulus(changed_by(tree, own))
        return super().__call__(recording, tree, own)

    def model(self, tree: Tree) -> str:
        """The name of the model with these parameters, a method's changes among them."""
        order = mesh_of(None, tree, self.folder).order
        return model_name(tree.scene.material.law, ends_of(tree.scene), order)

    def _modulus(self, tree: Tree) -> float:
        p, scene = tree.settings, tree.scene
        held: float | None = p.E_bonded if ends_of(scene) == "bonded" else None
        identified = modulus_in(p.by_method, self.model(tree))
        return float(identified or held or scene.material.E or 1.0)
