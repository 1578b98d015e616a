"""What is made once from a system and asked for again: kept with it, like its cached properties."""

from collections.abc import Callable, Hashable
from typing import TypeVar

from validate.fem.system import System

V = TypeVar("V")


def once(system: System, key: Hashable, make: Callable[[], V]) -> V:
    """`make()` at the first call with this key, the same object afterwards; a copied or changed
    system starts anew. `key` names all that `make` depends on besides the system."""
    kept: dict[Hashable, V] = system.__dict__.setdefault("_once", {})
    if key not in kept:
        kept[key] = make()
    return kept[key]
