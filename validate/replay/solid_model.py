"""What a method changes of a measured body's scene: its law, and the element of its cells."""

from collections.abc import Mapping
from typing import Any

from validate.replay.method import Method
from validate.replay.tree import Tree
from validate.scene.material import LawName

Changes = Mapping[str, Any]  # values by path, as a method's `scene`
_QUADRATIC = ("quadratic", "hex27", "tet10")


def model_of(law: LawName, element: str = "") -> dict[str, str]:
    """The changes by path; without an element that of the declared body."""
    return {"material.law": law, **({"body.element": element} if element else {})}


def law_of(method: Method, p: Tree) -> str:
    """The law that a method has of the declared scene's material."""
    return str((method.scene or {}).get("material.law", p.scene.material.law))


def element_of(method: Method, p: Tree) -> str:
    """The element of the cells that a method is solved in."""
    return str((method.scene or {}).get("body.element", p.scene.body.element))


def is_quadratic(element: str) -> bool:
    return element in _QUADRATIC
