"""The project's own code as syntax trees, each file parsed once for all tests that look at it."""

import ast
import gc
from functools import cache
from pathlib import Path

import pytest

ONE_PROCESS = pytest.mark.xdist_group("tree")  # parsing is most of what these tests do


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """Every node of a file, in `ast.walk`'s order. A million of them are no garbage: looking for
    it among them would take longer than parsing."""
    found = tuple(ast.walk(parsed(path)))
    gc.freeze()
    return found
