"""External simulators in the study of error against time."""

import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from beside import beside, experiment

from validate.errors import UsageError
from validate.pipeline.run.job import Job
from validate.recording.types import Recording, Source
from validate.scene.geometries.box import grid
from validate.scene.geometries.refinement import of_element
from validate.scene.material import Material
from validate.scene.scene import Scene
from validate.study.tradeoff.cell import TradeCell, keyed, run_cell, with_simulators

FAKE = """
import json, sys
from pathlib import Path
import numpy as np
folder = Path(sys.argv[-1])
job = json.loads((folder / "job.json").read_text())
answer = {"schema": "validate-external-answer/1", "name": "fake", "version": "7",
          "state": "cannot_run", "reason": "no such law"}
if job["material"]["law"] == "linear":
    u = np.full((len(job["times"]), job["mesh"]["nodes"], 3), -0.05)
    np.savez(folder / "fields.npz", t=job["times"], u=u)
    answer |= {"state": "finished", "used": job["material"], "setup_s": 1e-6,
               "mesh_sha256": job["mesh"]["sha256"], "step_s": [1e-3] * len(u)}
(folder / "answer.json").write_text(json.dumps(answer))
"""
NOTHING = Recording("none", Source("none", "", 0, "made here"), 0)


@pytest.mark.slow
def test_its_answer_is_read_where_all_are_compared(tmp_path: Path) -> None:
    script = tmp_path / "fake.py"
    script.write_text(FAKE, "utf-8")
    command = shlex.join([sys.executable, str(script)])
    plain = beside("hanging_bar", "study").trial(
        NOTHING, experiment("hanging_bar").parameters, quick=True
    )
    both = with_simulators(plain, (command,))
    linear, large = both.solvers[len(plain.solvers) :]
    assert (linear.name, large.name) == ("external fake", "external fake, large strain")
    assert linear.steps("H27", 2, both.steps) == ()  # a job carries none
    (stride,) = run_cell(both, TradeCell("solver", "H8", 2, both.steps, linear.name)).strides
    assert stride.u == pytest.approx(np.full((1, len(both.points), 3), -0.05))
    assert stride.step is not None
    assert (stride.step.p50, stride.setup_s, stride.memory > 10**6) == (1e-3, 1e-6, True)
    (other,) = run_cell(both, TradeCell("solver", "H8", 2, both.steps, large.name)).strides
    assert (other.u, other.failed) == (None, "refused: cannot run: no such law")
    with pytest.raises(UsageError, match="not installed"):
        with_simulators(plain, ("no-such-program",))


def test_cells_of_internal_solvers_do_not_depend_on_simulators() -> None:
    job, other = Job("x.py", "0"), Job("x.py", "0", simulators=("a program",))
    ours, theirs = (TradeCell("solver", "H8", 2, (1.0,), name) for name in ("ours", "external x"))
    assert keyed(job, ours).key == keyed(other, ours).key
    assert keyed(job, theirs).key != keyed(other, theirs).key


def test_linear_hexahedra_are_linear() -> None:
    scene = Scene(grid((1.0, 1.0, 1.0), (1, 1, 1)).quadratic(), Material(1.0, 0.3))
    assert of_element(scene, "H8").mesh.kind == "hex8"
