"""Parts of a script or a cell, without a file in the package, here and on workers."""

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest

import validate
from validate.engine.user_code import code_hash
from validate.library import load
from validate.pipeline.experiment.method import Method
from validate.pipeline.run import job as user_parts
from validate.pipeline.run.job import job_on
from validate.plugins import Registry
from validate.solve.dynamic.newmark import Newmark

# private: _REGISTRIES: registries of the test alone.

pytestmark = pytest.mark.xdist_group("library")

# A filter of `__main__`, with a constant of a plain module that no worker can import.
SCRIPT = """
import os, sys
from dataclasses import dataclass, replace
from pathlib import Path

import validate
from scales import SCALE
from validate.estimate.kalman.kf_fem import KfFem
from validate.parameters import quantity
from validate.pipeline.experiment.method import Method

HERE = Path(__file__).parent


def settings(Q):
    return KfFem(0.01, SCALE * Q, None, 1e-11)


@dataclass(frozen=True)
class Mine:
    Q: float = quantity(1e-11, "m2", "process noise")

    def prepare(self, system, looks):
        with (HERE / "pids").open("a") as out:
            out.write(f"{os.getpid()}\\n")
        return settings(self.Q).prepare(system, looks)


if __name__ == "__main__":
    experiment = validate.load(sys.argv[1])
    mine = Method("mine", Mine(), markers=("top",))
    experiment = replace(experiment, methods={"mine": mine, **experiment.methods})
    found = validate.study("filters", experiment, methods=["mine"], quick=True, seeds=[1, 2],
                           sweep=["methods.mine.settings.Q=1e-12,1e-10"], out="out",
                           workers=int(sys.argv[2]))
    print(os.getpid(), found.found["reused"], [c["failed"] for c in found.found["cells"]])
    print(found.to_pandas()["all_rmse_m"].iloc[0] if "all_rmse_m" in found.to_pandas() else "")
"""


def _script(folder: Path, pulled: Path, workers: int, scale: str = "1.0") -> str:
    (folder / "scales.py").write_text(f"SCALE = {scale}\n")
    (folder / "mine.py").write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, "mine.py", str(pulled), str(workers)], cwd=folder, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_a_filter_of_a_script_runs_on_workers(tmp_path: Path, pulled: Path) -> None:
    out = _script(tmp_path, pulled, 2).splitlines()[0].split(" ", 2)
    pids = set((tmp_path / "pids").read_text().split())
    assert pids
    assert out[0] not in pids
    assert out[1] == "0"
    assert "'" not in out[2], out[2]  # no cell failed
    again = _script(tmp_path, pulled, 1).splitlines()[0].split(" ", 2)
    assert again[1] == "4"  # the same code in another process
    edited = _script(tmp_path, pulled, 1, "2.0").splitlines()[0].split(" ", 2)
    assert edited[1] == "0"  # another constant in a plain module is other code


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ipykernel") is None, reason="ipykernel and nbclient absent")
def test_a_filter_of_a_cell_runs_on_workers(tmp_path: Path, pulled: Path) -> None:
    """The kernel's `__main__` is no file that a worker could import."""
    head, main = SCRIPT.split('if __name__ == "__main__":\n')
    head = head.replace("from scales import SCALE", "SCALE = 1.0")
    head = head.replace("Path(__file__).parent", f"Path({str(tmp_path)!r})")
    main = dedent(main).replace("sys.argv[1]", repr(str(pulled))).replace("sys.argv[2]", "2")
    main = main.replace("print(os.getpid(), ", "Path('said').write_text(f'{os.getpid()}'); print(")
    cells = [
        {"cell_type": "code", "id": f"c{i}", "source": text, "metadata": {}, "outputs": [],
         "execution_count": None}
        for i, text in enumerate((head, main))
    ]  # fmt: skip
    notebook = {"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 5}
    (tmp_path / "cell.ipynb").write_text(json.dumps(notebook))
    program = Path(sys.executable).with_name("jupyter-execute")
    done = subprocess.run([program, "cell.ipynb"], cwd=tmp_path, capture_output=True, text=True,
                          check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    pids = set((tmp_path / "pids").read_text().split())
    assert pids
    assert (tmp_path / "said").read_text() not in pids


def _scheme(damping: float) -> type[Newmark]:
    """As two versions of one notebook cell."""

    def prepare(self: Any, system: Any) -> Any:
        return Newmark.prepare(replace(self, dt=self.dt * damping), system)

    return dataclass(frozen=True)(type("Mine", (Newmark,), {"prepare": prepare}))


def test_the_hash_is_of_what_the_code_does() -> None:
    def one(x: float) -> float:
        return x + OFFSET[0]

    def same(y: float) -> float:
        return y + OFFSET[0]

    def other(x: float) -> float:
        return x - OFFSET[0]

    same.__qualname__ = other.__qualname__ = one.__qualname__
    assert code_hash(one) == code_hash(one) != code_hash(other)
    assert code_hash(_scheme(1.0)) == code_hash(_scheme(1.0)) != code_hash(_scheme(2.0))
    before = code_hash(one)
    OFFSET[0] = 2.0
    try:
        assert code_hash(one) != before
    finally:
        OFFSET[0] = 1.0
    assert code_hash({"a": Newmark(), "b": (1, "x")}) == ""  # nothing of a user


OFFSET = [1.0]


def test_an_experiment_is_that_of_its_file_however_often_it_was_loaded(pulled: Path) -> None:
    first, second = load(pulled), load(pulled)
    assert first.place is not second.place
    jobs = [job_on(e, (), {}, False) for e in (first, second, first)]
    assert jobs[0] == jobs[1] == jobs[2]
    assert (jobs[0].changes, jobs[0].code) == (b"", "")
    changed = job_on(replace(first, axis="x"), (), {}, False)
    assert changed.code
    assert changed.experiment().axis == "x"


def test_parts_that_a_script_added_go_with_a_job(monkeypatch: pytest.MonkeyPatch) -> None:
    def registry() -> Registry[type]:
        return Registry("filters", (), lambda part: part.__name__, lambda part: "")

    here, there = registry(), registry()
    monkeypatch.setattr(user_parts, "_REGISTRIES", {"filters": here})
    assert user_parts.user_parts({}) == (b"", "")
    here.add(_scheme(1.0))
    data, mark = user_parts.user_parts({})
    here.add(_scheme(2.0))  # a cell that was run again
    (part,) = here.added
    again, other = user_parts.user_parts({})
    assert mark != other
    assert repr(data) == repr(again)  # only the hash enters keys
    monkeypatch.setattr(user_parts, "_REGISTRIES", {"filters": there})
    assert user_parts.added_here(again) == {}
    (received,) = there.added
    assert received.__name__ == part.__name__
    assert code_hash(received) == code_hash(part)


@pytest.mark.slow
def test_an_edited_scheme_is_not_taken_from_the_store(pulled: Path, tmp_path: Path) -> None:
    """The class has the name, the fields and the values of the one before."""
    experiment = load(pulled)

    def errors(scheme: type[Newmark]) -> Mapping[str, float]:
        methods = {**experiment.methods, "mine": Method("mine", scheme())}
        ran = validate.run(replace(experiment, methods=methods), quick=True, out=tmp_path)
        frame = ran.to_pandas(part="score", method="mine", quantity="side", statistic="rmse")
        return dict(zip(frame["quantity"], frame["value"], strict=True))

    first = errors(_scheme(1.0))
    assert errors(_scheme(1.0)) == first
    assert errors(_scheme(3.0))["side"] > 10 * first["side"]


@pytest.mark.slow
def test_an_experiment_of_a_cell_needs_no_file(tmp_path: Path) -> None:
    code = dedent("""
        import numpy as np
        import validate
        from validate.compare.verdict import Accept
        from validate.recording import Recording, Signal, Source
        from validate.pipeline.experiment.experiment import Experiment, Uncertainty, vary
        from validate.pipeline.experiment.method import Method
        from validate.scene.geometries.specification import Box
        from validate.scene.material import Material
        from validate.scene.scene import Drive, Scene, Support
        from validate.solve.static.quasi_static import QuasiStatic

        t = np.arange(1, 6) / 5
        stage = Signal(t, 1e-3 * t[:, None], "m", 1e-6, "stage")
        force = Signal(t, 0.2 * t[:, None], "N", 1e-3, "stage")
        source = Source("cell", "", 0, "made here")
        recording = Recording("cell", source, 0, signals={"stage": stage, "stage.force": force})
        scene = Scene(Box(("20 mm",) * 3, cells=(2, 2, 2)), Material("10 kPa", 0.3),
                      (Support("zmin"),), drives=(Drive("stage", "zmax", "-z"),))
        experiment = Experiment(
            name="cell", title="made in a cell", source="a test", scene=scene,
            variations=(vary("material.E", "relative 5 %"),),
            methods={"statics": Method("statics", QuasiStatic())}, accepted=("statics",),
            accept=(Accept("stage.force", 0.2, "all of it"),), load=lambda p, f: (recording,),
            uncertainty=Uncertainty(surrogate="statics"),
        )
        if __name__ == "__main__":
            print(validate.run(experiment, workers=2, out="out").verdict)
    """)
    done = subprocess.run([sys.executable, "-"], input=code, cwd=tmp_path, capture_output=True,
                          text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() in ("good enough", "undecided"), done.stdout
