"""The notebooks are committed without outputs, are linked, and their claims hold."""

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
NAMES = [n.stem for n in NOTEBOOKS]


def cells(notebook: Path) -> list[dict[str, Any]]:
    content: list[dict[str, Any]] = json.loads(notebook.read_text("utf-8"))["cells"]
    return content


def test_there_are_four_and_the_page_links_them() -> None:
    page = (ROOT / "docs" / "notebooks.md").read_text("utf-8")
    assert NAMES == ["comparing_filters", "first_report", "own_recording", "own_scheme"]
    assert all(f"(notebooks/{name}.ipynb)" in page for name in NAMES)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=NAMES)
def test_a_notebook_is_small_without_outputs_and_asserts_its_claims(notebook: Path) -> None:
    code = [c for c in cells(notebook) if c["cell_type"] == "code"]
    assert notebook.stat().st_size < 20_000
    assert [c for c in code if c["outputs"] or c["execution_count"]] == []
    assert sum("assert " in "".join(c["source"]) for c in code) >= 2


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("ipykernel") is None and "VALIDATE_REQUIRE_NOTEBOOKS" not in os.environ,
    reason="ipykernel and nbclient absent: the extra `notebooks`",
)
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=NAMES)
def test_a_notebook_runs(notebook: Path, tmp_path: Path) -> None:
    copy = shutil.copy(notebook, tmp_path)
    command = [str(Path(sys.executable).with_name("jupyter-execute")), "--timeout=200", str(copy)]
    quiet = {k: v for k, v in os.environ.items() if k != "VALIDATE_SHARED_DATA"}
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=False, env=quiet
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "reports").is_dir()
