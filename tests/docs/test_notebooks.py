"""The notebooks are committed without outputs and state their claims; `test_site.py` runs them."""

import json
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "docs" / "tutorials").glob("*.ipynb"))
NAMES = [n.stem for n in NOTEBOOKS]


def cells(notebook: Path) -> list[dict[str, Any]]:
    content: list[dict[str, Any]] = json.loads(notebook.read_text("utf-8"))["cells"]
    return content


def test_there_are_four() -> None:
    assert NAMES == ["comparing_filters", "first_report", "own_recording", "own_scheme"]


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=NAMES)
def test_a_notebook_is_small_without_outputs_and_asserts_its_claims(notebook: Path) -> None:
    code = [c for c in cells(notebook) if c["cell_type"] == "code"]
    assert notebook.stat().st_size < 20_000
    assert [c for c in code if c["outputs"] or c["execution_count"]] == []
    assert sum("assert " in "".join(c["source"]) for c in code) >= 2
