"""Public names of a package, loaded at first access (PEP 562).

A package that imported all of its modules would load compiled kernels, image libraries and the
scheduler for whoever wants one type of it: the list of experiments is to appear at once.
"""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any


def lazily(package: str, homes: Mapping[str, Sequence[str]]) -> Callable[[str], Any]:
    """A module's `__getattr__` for names by the modules of the package that define them."""
    home = {name: module for module, names in homes.items() for name in names}

    def load(name: str) -> Any:
        if name not in home:
            raise AttributeError(f"module '{package}' has no attribute '{name}'")
        return getattr(import_module(f"{package}.{home[name]}"), name)

    return load


def names(homes: Mapping[str, Sequence[str]]) -> list[str]:
    """`__all__` of such a package."""
    return sorted(name for found in homes.values() for name in found)
