"""Programs of others as methods of any experiment."""

import re
import shlex
import shutil
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from validate.compare.result import Result
from validate.errors import UsageError
from validate.pipeline import load
from validate.pipeline.experiment.options import (
    Options,
    configure,
    external_methods,
    with_simulators,
)
from validate.pipeline.run.job import run_name
from validate.pipeline.run.pipeline import compare
from validate.solve.external.scheme import ExternalLetGo, ExternalSimulator

FAKE = """
import json, sys
from pathlib import Path
import numpy as np
folder = Path(sys.argv[-1])
job = json.loads((folder / "job.json").read_text())
ballast = bytearray(60_000_000)
u = np.zeros((len(job["times"]), job["mesh"]["nodes"], 3))
u[..., 2] = -0.05
np.savez(folder / "fields.npz", t=job["times"], u=u)
answer = {"schema": "validate-external-answer/1", "name": "fake", "version": "7",
          "state": "finished", "used": job["material"], "mesh_sha256": job["mesh"]["sha256"],
          "setup_s": 1e-6, "step_s": [1e-3] * len(u)}
(folder / "answer.json").write_text(json.dumps(answer))
"""


@pytest.fixture
def fake(tmp_path: Path) -> str:
    script = tmp_path / "fake_simulator.py"
    script.write_text(FAKE, "utf-8")
    return shlex.join([sys.executable, str(script)])


def test_a_command_becomes_a_method_like_the_first_declared_simulator(fake: str) -> None:
    beam = with_simulators(load("silicone_beam"), (fake, fake))
    one, two = beam.methods["fake"], beam.methods["fake_2"]
    declared = next(iter(external_methods(beam.methods).values()))
    assert one.settings.command == two.settings.command == fake
    assert one.scene == declared.scene
    assert isinstance(load("silicone_beam").methods["calculix"].settings, ExternalLetGo)


def test_where_none_is_declared_it_is_run_as_what_is_accepted(fake: str) -> None:
    gel, cube = (with_simulators(load(n), (fake,)) for n in ("gel_indentation", "kf_cube_inertia"))
    mine = gel.methods["fake"]
    assert isinstance(mine.settings, ExternalSimulator)
    assert (mine.scene, mine.settings.inertia) == (gel.methods["linear"].scene, False)
    assert cube.methods["fake"].settings.inertia
    assert cube.methods["fake"].markers == ()
    with pytest.raises(UsageError, match="not installed"):
        with_simulators(gel, ("no-such-program",))


def test_a_method_has_the_name_of_its_script() -> None:
    commands = ("python my_guest.py", "python my_simulator.py", "python _simulator.py")
    added = with_simulators(load("kf_cube_inertia"), commands).methods
    assert list(added)[-3:] == ["my", "my_2", "external"]


def test_it_is_run_whatever_is_chosen_in_a_folder_of_its_own(fake: str) -> None:
    beam = with_simulators(load("silicone_beam"), (fake,))
    options = Options({}, ("mixed",), simulators=(fake,))
    assert list(configure(beam, options)[1]) == ["mixed", "fake"]
    shipped = beam.methods["felupe"].settings.command
    again = Options({}, ("mixed",), simulators=(shipped,))
    assert list(configure(with_simulators(beam, (shipped,)), again)[1]) == ["mixed", "felupe_2"]
    assert run_name(load("silicone_beam"), Options({})) == "silicone_beam"
    name = run_name(beam, Options({}, simulators=(fake,)))
    assert re.fullmatch(r"silicone_beam\+external-\w+", name)


@pytest.fixture
def judged(fake: str, shared_data: Path) -> Result:
    options = Options({"body.cells": "2,2,6"}, ("tetrahedra",), quick=True, simulators=(fake,))
    return compare(with_simulators(load("hanging_bar"), (fake,)), options)


@pytest.mark.slow
def test_the_table_has_program_error_rate_and_memory(judged: Result) -> None:
    assert judged.kind == "reference"
    (exhibit,) = (e for e in judged.exhibits if e.anchor == "external_simulators")
    (row,) = (r for r in exhibit.tables[0].rows if r[1] == "fake 7")
    assert (row[2], row[8], row[10]) == ("-", pytest.approx(1000.0), "finished")
    assert isinstance(row[9], float)
    assert row[9] > 60
    said = " ".join(str(r[1]) for r in exhibit.tables[1].rows)
    assert "no reaction forces" in said
    assert "held or driven nodes are up to 50 mm away from their prescribed position" in said
    mine = next(m for m in judged.methods if m.name == "fake")
    assert mine.residuals["drop@all"].values == pytest.approx(
        np.array([[0.05 - 44.102e-3]]), abs=1e-5
    )


def test_an_external_simulator_reports_that_a_job_has_no_cavity(phantom_result: Result) -> None:
    (mine,) = (m for m in phantom_result.methods if m.name == "felupe")
    (exhibit,) = (e for e in phantom_result.exhibits if e.anchor == "external_simulators")
    assert [row[0] for row in exhibit.tables[0].rows] == [mine.label]  # none of 72 rows of ours
    assert mine.run.outcome.state == "refused"
    assert mine.run.outcome.why.startswith(
        "cannot run: ExternalSimulator does not support fluid in cavities"
    )


@pytest.mark.slow
@pytest.mark.skipif(find_spec("felupe") is None, reason="felupe absent: the extra 'peers' has it")
@pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx absent: apt-get calculix-ccx")
def test_the_hanging_bar_is_what_it_was_printed_to_be(
    shared_data: Path, whole: Callable[[str], Result]
) -> None:
    """dolfinx's four meshes within .01 %, the converged drop between meshes graded in two ways."""
    result = whole("hanging_bar")
    assert result.passed
    figures = {p.name: p.verdict for p in result.published}
    assert [v for n, v in figures.items() if n.startswith("dolfinx")] == ["reproduced"] * 4
    (check,) = result.checks
    assert check.verdict == "good enough"
    rows = {
        str(r[0]): r
        for e in result.exhibits
        if e.anchor == "external_simulators"
        for r in e.tables[0].rows
    }
    felupe = rows["FElupe, linear tetrahedra, dolfinx's mesh"]
    ours = rows["linear tetrahedra, dolfinx's mesh"]
    assert felupe[3].value == pytest.approx(ours[3].value, rel=1e-6)
    assert felupe[7] == ours[7] == "differs"
    said = [
        str(r[1])
        for e in result.exhibits
        if e.anchor == "external_simulators"
        for r in e.tables[1].rows
    ]
    assert any("used volumetric = K/2 (J - 1)^2 instead of coupled" in line for line in said)
    words = next(e.words[0] for e in result.exhibits if e.anchor == "converged")
    assert words.startswith("The drop converges to 44.085")
