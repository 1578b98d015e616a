"""What is free, as files of the system say it; what does not fit is refused before it is taken."""

import resource
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from validate import memory
from validate.errors import SceneError
from validate.fem.linear_solvers import factor as fill
from validate.fem.linear_solvers.factor import (
    Fronts,
    elimination_order,
    factor_bytes,
    factorise,
    next_to_nothing,
    require_solvable,
    solvable_bytes,
)
from validate.fem.system import build
from validate.memory import MemoryShortError, free_memory, require_memory
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.run import runs
from validate.pipeline.run.estimate import coarser
from validate.pipeline.run.pipeline import compare
from validate.scene.geometries.box import box, grid
from validate.scene.geometries.specification import Box, quarter_cylinder
from validate.scene.material import Material
from validate.scene.scene import Scene, Support

# private: _ROOT: the root of files, replaced by a folder of the test.


def written(root: Path, **files: str) -> None:
    for name, text in files.items():
        path = root / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "ascii")


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A system of 4 GB that the tests write."""
    monkeypatch.setattr(memory, "_ROOT", tmp_path)
    written(tmp_path, proc__meminfo="MemTotal: 8000000 kB\nMemAvailable: 4000000 kB\n")
    return tmp_path


@pytest.fixture
def little(monkeypatch: pytest.MonkeyPatch) -> None:
    """A megabyte is free."""
    monkeypatch.setattr(memory, "free_memory", lambda: 1_000_000)


def test_the_machine_says_what_is_available(root: Path) -> None:
    assert free_memory() == 4_096_000_000


def test_a_system_that_says_nothing_refuses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "_ROOT", tmp_path)
    assert free_memory() is None
    require_memory(1e18, "all")


@pytest.mark.parametrize(
    ("line", "files"),
    [
        ("0::/a/b", ("memory.max", "memory.current", "sys/fs/cgroup/a")),
        ("4:memory:/a/b", ("memory.limit_in_bytes", "memory.usage_in_bytes",
                           "sys/fs/cgroup/memory/a")),
    ],
)  # fmt: skip
def test_a_control_group_above_limits_and_its_cache_is_free(
    root: Path, line: str, files: tuple[str, str, str]
) -> None:
    written(root, proc__self__cgroup=f"{line}\n")
    limit, used, folder = files
    (root / folder / "b").mkdir(parents=True)
    (root / folder / "b" / limit).write_text("max", "ascii")
    (root / folder / limit).write_text("1000000", "ascii")
    (root / folder / used).write_text("700000", "ascii")
    assert free_memory() == 300_000
    (root / folder / "memory.stat").write_text("inactive_file 50000\nother 1\n", "ascii")
    assert free_memory() == 350_000


def test_the_process_own_limit_counts(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(root, proc__self__statm="100 50 3\n")
    limit = 1_000_000_000
    monkeypatch.setattr(resource, "getrlimit", lambda _: (limit, limit))
    assert free_memory() == limit - 100 * resource.getpagesize()


def test_a_refusal_says_what_is_needed_and_free(root: Path) -> None:
    require_memory(0.9 * 4_096_000_000, "a mesh")
    with pytest.raises(MemoryShortError) as caught:
        require_memory(16_384_000_000, "a mesh")
    assert str(caught.value) == (
        "a mesh: about 16.4 GB of memory are needed, 4.1 GB are free; take a coarser mesh"
    )
    assert caught.value.share == pytest.approx(0.9 * 0.25)


def measured(factor: object) -> int:
    assert isinstance(factor, Fronts)
    return sum(f.diagonal.nbytes + f.below.nbytes for f in factor.fronts)


@pytest.mark.parametrize("cells", [(10, 10, 10), (13, 13, 13), (60, 60), (90, 90)])
def test_the_estimate_is_that_of_real_factors(cells: tuple[int, ...]) -> None:
    """A factor is 60 to 85 % of the peak while it is made, which is what is estimated."""
    d = len(cells)
    scene = Scene(
        box((0.1,) * d, cells), Material(1e4, 0.3, "linear"), (Support("x0", tuple(range(d))),)
    )
    system = build(scene)
    kept = measured(system.factor())
    assert 0.45 < kept / factor_bytes(len(system.free), d) < 1.0


@pytest.mark.usefixtures("little")
def test_every_door_is_closed_before_memory_is_taken() -> None:
    for make in (
        lambda: box((1.0, 1.0, 1.0), (4000, 4000, 4000)),
        lambda: grid((1.0, 1.0), (10**6, 10**6)),
        lambda: quarter_cylinder(1.0, 1.0, 10**4, 10**4),
    ):
        with pytest.raises(MemoryShortError, match=r"mesh of .* nodes: about"):
            make()
    eye = sparse.csr_array(sparse.identity(5000))
    node, places = np.arange(5000) // 3, np.zeros((1667, 3))
    for door in (factorise, elimination_order):
        with pytest.raises(MemoryShortError, match="factor of 5000 unknowns in 3-D"):
            door(eye, node, places)
    with pytest.raises(MemoryShortError, match="kf with up to 5e"):
        require_solvable(5000, 3, "kf")


def test_what_is_asked_of_a_ladder_is_the_larger_of_assembly_and_factor(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert solvable_bytes(1000, 3) == 13e6  # assembled
    assert solvable_bytes(1e6, 3) == pytest.approx(300 * 1e8)  # factored
    monkeypatch.setattr(fill, "free_memory", lambda: 1.4e9)
    assert next_to_nothing(1000, 3)
    assert not next_to_nothing(1100, 3)


@pytest.mark.usefixtures("little")
def test_a_stiffness_is_not_assembled_without_room() -> None:
    scene = Scene(box((0.1, 0.1), (1, 1)), Material(1e4, 0.3, "linear"), (Support("x0", (0, 1)),))
    object.__setattr__(scene.mesh, "nodes", np.zeros((10_000, 2)))
    with pytest.raises(SceneError, match="assembly of"):
        _ = build(Scene(scene.mesh, scene.material, ())).K


def test_the_next_step_is_a_mesh_that_fits(phantom: Experiment) -> None:
    told = coarser("fluid_phantom", phantom.parameters, 1 / 16)
    assert told == "such as --set body.cells=3,4,6"
    assert coarser("own", phantom.parameters.scene.material, 0.5) == "see `validate list own`"
    bar = {"body": Box((0.1, 0.1, 0.2), (8, 8, 16))}
    assert coarser("bar", bar, 1 / 16) == "such as --set body.cells=3,3,7"


def test_a_method_whose_finest_mesh_does_not_fit_is_refused_before_anything_is_solved(
    phantom: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "free_memory", lambda: 400_000_000)
    monkeypatch.setattr(fill, "free_memory", lambda: 400_000_000)
    monkeypatch.setattr(runs, "solve", lambda *_: pytest.fail("nothing was to be solved"))
    with pytest.raises(MemoryShortError) as caught:
        compare(phantom, Options({}, ("p1_fluid", "p2_fluid")))
    said = str(caught.value)
    assert "p2_fluid with up to 5.06e+04 unknowns in 3-D: about 0.658 GB" in said
    assert "take a coarser mesh, such as --set body.cells=" in said
