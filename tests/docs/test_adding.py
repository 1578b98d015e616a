"""Every worked example of docs/adding.md runs as it is printed."""

import re
from pathlib import Path

import pytest


def blocks(project_root: Path) -> list[str]:
    text = (project_root / "docs" / "adding.md").read_text("utf-8")
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


def test_the_page_adds_each_of_the_six(project_root: Path) -> None:
    text = (project_root / "docs" / "adding.md").read_text("utf-8")
    for thing in ("solver", "filter", "file format", "sensor", "score", "experiment"):
        (section,) = re.findall(rf"\n## An? {thing}\n(.*?)(?=\n## |\Z)", text, flags=re.DOTALL)
        assert "assert " in section, thing


@pytest.mark.slow
def test_every_example_runs(
    project_root: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "adding_page.py").write_text("\n\n".join(blocks(project_root)), "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    import adding_page  # type: ignore[import-not-found]

    assert adding_page.check.count == 20


def test_the_page_of_laws_runs(project_root: Path) -> None:
    text = (project_root / "docs" / "laws.md").read_text("utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    exec(compile(block, "laws.md", "exec"), {})
