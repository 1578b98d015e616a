"""Every worked example of docs/developers/adding.md runs as it is printed."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Scene, Support
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.march import run_scheme
from validate.solve.static.quasi_static import QuasiStatic


def blocks(project_root: Path) -> list[str]:
    text = (project_root / "docs" / "developers" / "adding.md").read_text("utf-8")
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


PARTS = (
    "solver", "filter", "file format", "sensor", "score", "experiment",
    "geometry", "view", "command",
)  # fmt: skip


def test_the_page_adds_each_part(project_root: Path) -> None:
    text = (project_root / "docs" / "developers" / "adding.md").read_text("utf-8")
    for thing in PARTS:
        (section,) = re.findall(rf"\n## An? {thing}\n(.*?)(?=\n## |\Z)", text, flags=re.DOTALL)
        assert "assert " in section, thing


def test_an_external_simulator_takes_forty_lines(project_root: Path) -> None:
    """And `test_every_example_runs` runs it, against our own statics."""
    (block,) = (b for b in blocks(project_root) if b.startswith("SIMULATOR"))
    assert len(block.split('"""')[1].strip().splitlines()) <= 40


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("g++") is None, reason="g++ absent: no compiler of C++")
def test_an_external_simulator_in_another_language(project_root: Path, tmp_path: Path) -> None:
    source = project_root / "benchmarks" / "external" / "example_simulator.cpp"
    program = tmp_path / "my_simulator"
    subprocess.run(
        ["g++", "-O2", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-o", program, source],
        check=True,
    )
    scene = Scene(
        box((0.02, 0.02, 0.02), (3, 3, 3)),
        Material(10e3, 0.3),
        (Support("z0", (0, 1, 2)),),
        loads=(Load("pull", "z1", (0.0, 0.0, 1.0)), Load("push", "x1", (1.0, 0.0, 0.0))),
    )
    t, y = np.array([0.1, 0.2, 0.3]), np.array([[0.01, 0.0], [0.02, 0.01], [0.01, 0.03]])
    found = ExternalSimulator(str(program)).solve(scene, t, y)
    own = run_scheme("own", QuasiStatic(), scene, t, y, np.arange(3))
    assert found.finished, found.outcome.why
    assert found.said == ("external: example in C++ 1",)  # nothing ignored, in balance
    assert np.abs(found.u - own.u).max() < 1e-10 * np.abs(own.u).max()
    asleep = ExternalSimulator(str(program), inertia=True).solve(scene, t, y)
    assert asleep.outcome.state == "refused"


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
    text = (project_root / "docs" / "explanation" / "laws.md").read_text("utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    exec(compile(block, "laws.md", "exec"), {})
