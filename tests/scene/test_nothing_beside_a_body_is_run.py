"""Opening a body runs no code that lies beside it."""

from pathlib import Path

import pytest
from canaries import folder, ran
from command_line import here
from test_bodies_robust import MAKE

__all__ = ["folder"]  # a fixture


FILLED = ("x.obj", "x.ply")  # as x.stl, by the same processes: two seconds each


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] if name in FILLED else []) for name in MAKE],
)
def test_beside_a_body(name: str, folder: Path) -> None:
    MAKE[name](folder / name)
    here("body", name, "--unit", "mm", "-o", "out.npz", cwd=folder)
    assert ran(folder) == ""
