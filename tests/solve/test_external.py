"""External simulators are untrusted: an error is a row of the report, a valid answer is a run."""

import json
import os
import re
import shlex
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import build
from validate.parameters import with_values
from validate.pipeline.experiment.method import Method
from validate.scene.geometries.box import grid
from validate.scene.material import Material, Region
from validate.scene.mesh_files.vtu import write_vtu
from validate.scene.scene import Drive, Load, Pin, Probe, Scene, Support, Weight
from validate.solve.external import exchange, limits
from validate.solve.external import program as ran
from validate.solve.external.exchange import NoAnswerError, echoed, write_job
from validate.solve.external.program import Ended
from validate.solve.external.scheme import ExternalSimulator, run_of
from validate.solve.march import run_scheme
from validate.solve.static.quasi_static import QuasiStatic
from validate.solve.types import Run

pytestmark = pytest.mark.usefixtures("decoded_here")

SIZE = (0.02, 0.02, 0.04)
SCENE = Scene(
    grid(SIZE, (1, 1, 2)),
    Material(1e4, 0.0, rho=1000.0),
    (Support("z0", (0, 1)),),
    pins=(Pin((0.0, 0.0, 0.04), (0, 1)),),
    drives=(Drive("lift", "z0", (0.0, 0.0, 1.0)),),
    probes=(Probe("top", (0.01, 0.01, 0.04)),),
)
T = np.array([0.5, 1.0])
INPUTS = np.array([[0.0005], [0.001]])

# Follows its drive as a rigid body does, which is what SCENE does.
HONEST = """
import json, os, sys
from pathlib import Path
import numpy as np
folder = Path(sys.argv[-1])
job = json.loads((folder / "job.json").read_text())
t = np.array(job["times"])
u = np.zeros((len(t), job["mesh"]["nodes"], 3))
for drive in job["drives"]:
    u[:, :, 2] = np.array(drive["history"])[-len(t):, None]
fields = {"t": t, "u": u, "reactions": np.zeros_like(u)}
answer = {
    "schema": "validate-external-answer/1", "name": "fake", "version": "1", "state": "finished",
    "used": job["material"], "mesh_sha256": job["mesh"]["sha256"],
    "setup_s": 1e-6, "step_s": [1e-6] * len(t),
}
"""
WRITTEN = """
np.savez(folder / "fields.npz", **fields)
(folder / "answer.json").write_text(json.dumps(answer))
"""


def simulator(
    tmp_path: Path, twist: str = "", rest: str = WRITTEN, **settings: float
) -> ExternalSimulator:
    """One whose program does something else before it writes."""
    script = tmp_path / "program.py"
    script.write_text(HONEST + twist + rest, "utf-8")
    return ExternalSimulator(shlex.join([sys.executable, str(script)]), seconds=20.0, **settings)  # type: ignore[arg-type]


def answered(
    tmp_path: Path,
    twist: str,
    rest: str = WRITTEN,
    scene: Scene = SCENE,
    inputs: Floats = INPUTS,
) -> Run:
    """The same without a process of its own, which takes most of the time."""
    job = write_job(tmp_path, scene, T, inputs, False, 1e-6)
    program = (HONEST + twist + rest).replace("sys.argv[-1]", repr(str(tmp_path)))
    exec(compile(program, "program.py", "exec"), {})
    return run_of(tmp_path, job, Ended(1.0, "", ""))


def shell(script: str, **settings: float) -> ExternalSimulator:
    """One that is a line of the shell: it starts at once."""
    return ExternalSimulator(shlex.join(["sh", "-c", script]), **settings)  # type: ignore[arg-type]


def solved(one: ExternalSimulator, scene: Scene = SCENE) -> Run:
    return run_scheme("external", one, scene, T, INPUTS, np.array([0, 1]))


SERIES = """
import meshio
mesh = meshio.read(folder / "mesh.vtu")
(folder / "answer.json").write_text(json.dumps(answer))
for i in range(len(t)):
    mesh.point_data = {"displacement": fields["u"][i], "reaction": fields["reactions"][i]}
    mesh.write(folder / f"step{i}.vtu", binary=%s)
sets = "".join(f'<DataSet timestep="{x!r}" file="step{i}.vtu"/>' for i, x in enumerate(t.tolist()))
(folder / "fields.pvd").write_text(
    f'<VTKFile type="Collection"><Collection>{sets}</Collection></VTKFile>')
"""


@pytest.mark.parametrize("binary", [True, False])
def test_a_series_of_vtu_is_an_answer_as_arrays_are(tmp_path: Path, binary: bool) -> None:
    twist = "u[:, :, 0] = 1e-9 * np.arange(24).reshape(2, 12)\n"
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    plain = answered(tmp_path / "a", twist)
    series = answered(tmp_path / "b", twist, SERIES % binary)
    assert plain.outcome == series.outcome
    assert not binary or plain.said == series.said
    digits = 0.0 if binary else 1e-9  # meshio's text has eleven
    assert np.allclose(plain.u, series.u, rtol=digits, atol=0)
    assert series.traces["lift.force"].y.tolist() == plain.traces["lift.force"].y.tolist()


@pytest.mark.parametrize(
    ("after", "why"),
    [
        ("(folder / 'step1.vtu').unlink()", "step1.vtu: cannot be read"),
        ("(folder / 'step1.vtu').write_bytes(b'<VTKFile')", "damaged|cannot read"),
        ("m = meshio.read(folder / 'step0.vtu'); m.points = m.points[::-1]; m.write(folder / "
         "'step0.vtu')", "points that differ from the 12 nodes of the job"),
        ("(folder / 'fields.pvd').write_text((folder / 'fields.pvd').read_text()"
         ".replace('step1.vtu', '../step1.vtu'))", "is outside its folder"),
        ("(folder / 'fields.pvd').write_text('<!DOCTYPE a>' + '<a/>')", "declares XML entities"),
        ("m = meshio.read(folder / 'step1.vtu'); m.point_data = {'speed': m.points}; "
         "m.write(folder / 'step1.vtu')", "expected a displacement"),
        ("(folder / 'fields.pvd').write_text((folder / "
         "'fields.pvd').read_text().replace('0.5', '0.25'))", "time 0 is 0.25 s, requested 0.5 s"),
    ],
)  # fmt: skip
def test_a_series_that_is_none_is_a_row(tmp_path: Path, after: str, why: str) -> None:
    run = answered(tmp_path, "", SERIES % True + after)
    assert run.outcome.state == "invalid"
    assert re.search(why, run.outcome.why), run.outcome.why


def test_a_valid_answer_is_a_run(tmp_path: Path) -> None:
    run = solved(simulator(tmp_path))
    assert run.finished
    assert np.array_equal(run.u[1], np.tile([0.0, 0.0, 0.001], (12, 1)))
    assert run.traces["top.z"].y == pytest.approx([0.0005, 0.001])
    assert run.traces["lift.displacement"].y.tolist() == [0.0005, 0.001]
    assert run.traces["lift.force"].y.tolist() == [0.0, 0.0]
    assert (run.setup_s, run.step_s.n if run.step_s else 0) == (1e-6, 2)
    assert run.said == ("external: fake 1",)


def test_an_answer_with_the_former_schema_is_read(tmp_path: Path) -> None:
    run = answered(tmp_path, "answer['schema'] = 'validate-guest-answer/1'")
    assert run.finished
    assert run.said == (
        "external: fake 1",
        "answers by the former schema 'validate-guest-answer/1'; write "
        "'validate-external-answer/1'",
    )


@pytest.mark.parametrize(
    ("twist", "state", "why"),
    [
        ("u[1, 3, 0] = np.nan", "diverged", "no finite field at step 1"),
        ("u[0] = 1e300", "diverged", "no finite field at step 0"),
        ("answer['mesh_sha256'] = '0' * 64", "invalid", "differs from that of the job's mesh"),
        ("fields['u'] = u[:, 1:]", "invalid", r"u of shape \(2, 11, 3\), expected \(2, 12, 3\)"),
        ("fields['t'] = 2 * t", "invalid", "time 0 is 1 s, requested 0.5 s"),
        ("fields = {k: v[:1] for k, v in fields.items()}", "invalid",
            "1 of 2 times, although its state is 'finish"),
        ("del fields['u']", "invalid", r"arrays \['reactions', 't'\], expected t and u"),
        ("fields['u'] = u.astype(str)", "invalid", "unpacked|of type|limit"),
        ("fields['u'] = np.zeros((2, 12, 3), dtype=object)", "invalid", "not an archive of arrays"),
        ("fields['more'] = np.zeros(10**6)", "invalid", "bytes"),
        ("answer['setup_s'] = float('nan')", "invalid", "NaN is not a number"),
        ("answer = [answer]", "invalid", "not an object of schema"),
        ("answer['state'] = 'fine'", "invalid", "state 'fine', expected finished"),
        ("answer = {**answer, 'state': 'cannot_run', 'reason': 'no\\nsuch law'}", "refused",
         "cannot run: no such law"),
        ("answer = {**answer, 'state': 'not_converged', 'reason': 'at 40 %'}; "
         "fields = {k: v[:1] for k, v in fields.items()}", "not_converged", "at 40 %"),
    ],
)  # fmt: skip
def test_what_goes_wrong_is_an_outcome(tmp_path: Path, twist: str, state: str, why: str) -> None:
    run = answered(tmp_path, twist)
    assert run.outcome.state == state
    with pytest.raises(AssertionError, match=why):
        raise AssertionError(run.outcome.why)
    assert len(run.u) == len(run.t) == (1 if "1, 3" in twist or "40" in twist else 0)


@pytest.mark.parametrize(
    ("script", "why"),
    [
        ("kill -SEGV $$", "stopped by signal 11 (SIGSEGV)"),
        ("echo out of licences; echo; exit 1", "ended with code 1: out of licences"),
        ("exit 0", "answer.json was not written"),
    ],
)
def test_a_crash_is_an_outcome(script: str, why: str) -> None:
    run = solved(shell(script))
    assert (run.outcome.state, run.outcome.why) == ("invalid", why)


def test_no_answer_is_read_through_a_link_or_a_pipe(tmp_path: Path) -> None:
    for twist in ("os.symlink('/dev/zero', ", "os.mkfifo("):
        run = answered(tmp_path, f"{twist}folder / 'answer.json')", rest="")
        assert "expected an ordinary file" in run.outcome.why
        (tmp_path / "answer.json").unlink()


@pytest.mark.slow
def test_one_that_hangs_is_ended_with_all_that_it_started(tmp_path: Path) -> None:
    """The limit is seen on a clock of its own; its child is gone with it."""
    note = tmp_path / "child"
    script = f"trap '' TERM; sleep 600 & echo $! > {shlex.quote(str(note))}; wait"
    run = solved(shell(script, seconds=2.0))
    assert (run.outcome.state, run.outcome.why) == ("invalid", "over the limit of 2 s, stopped")
    assert _gone(int(note.read_text()))


def test_what_one_leaves_behind_is_ended(tmp_path: Path) -> None:
    note = tmp_path / "child"
    run = solved(shell(f"sleep 600 & echo $! > {shlex.quote(str(note))}"))
    assert run.outcome.why == "answer.json was not written"
    assert _gone(int(note.read_text()))


def _gone(pid: int) -> bool:
    """Ended, if perhaps not yet collected by whoever inherited it."""
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state in "ZX":
            return True
        os.sched_yield()
    return False


@pytest.mark.own_process
def test_output_and_memory_are_bounded(tmp_path: Path) -> None:
    run = solved(shell("exec head -c 3000000 /dev/zero > x", output=1.0))
    assert "limit of its output" in run.outcome.why or "File too large" in run.outcome.why
    run = solved(shell("for i in 1 2 3 4; do head -c 500000 /dev/zero > $i; done", output=1.0))
    assert "bytes in its folder, the limit is" in run.outcome.why
    greedy = shlex.join([sys.executable, "-S", "-c", "bytes(2**31)"])
    run = solved(ExternalSimulator(greedy, memory=1024.0))
    assert (run.outcome.state, "MemoryError" in run.outcome.why) == ("invalid", True)


def test_an_ignored_or_changed_parameter_is_a_finding(tmp_path: Path) -> None:
    run = answered(tmp_path, "answer['used'] = {'law': 'linear', 'E': 9e3}")
    assert run.finished
    assert run.said[1:] == ("used E = 9000.0 instead of 10000.0", "ignored parameter nu = 0.0")
    assert echoed({"E": 1.0}, None) == ("does not report which law and parameters it used",)
    assert echoed({"a": [1.0, 2.0]}, {"a": [1.0, 2.0 + 1e-9]}) == ()
    assert echoed({"a": [1.0, 2.0]}, {"a": {"b": 1}}) != ()


def test_forces_out_of_balance_and_a_drive_not_followed_are_findings(tmp_path: Path) -> None:
    def findings(twist: str) -> str:
        run = answered(tmp_path, twist)
        assert run.finished
        return " | ".join(run.said)

    assert "no reaction forces" in findings("del fields['reactions']")
    assert "out of balance by 1 N" in findings("fields['reactions'][1, 0, 2] = 1.0")
    assert "0.5 mm away from their prescribed position" in findings("u[1, 0, 2] = 0.0015")
    assert "could not: be quick" in findings("answer['could_not'] = ['be quick', 3]")
    assert "reports that it took 1e+05 s" in findings("answer['setup_s'] = 1e5")


def test_weight_is_in_the_balance(tmp_path: Path) -> None:
    """The weight of the body, 0.016 kg, is what its supports push."""
    scene = Scene(SCENE.mesh, SCENE.material, (Support("z0", (0, 1, 2)),),
                  loads=(Weight("gravity", (0.0, 0.0, -1.0)),))  # fmt: skip
    twist = (
        "g = job['weights'][0]['history'][-1]\n"
        "fields['reactions'][:, 0, 2] = .02 * .02 * .04 * 1000 * g"
    )
    scales = [(" ", ()), ("/ 2 ", "reactions and weight are out of balance by 0.0785 N of 0.157 N")]
    for half, found in scales:
        said = answered(tmp_path, f"{twist}{half}", scene=scene, inputs=np.full((2, 1), 9.81)).said
        assert said[1:] == ((found,) if found else ())


@pytest.mark.slow
def test_it_is_at_home_in_the_folder_alone(tmp_path: Path) -> None:
    twist = (
        "inside = [os.getcwd(), *(os.environ[k] for k in ('HOME', 'TMPDIR', 'XDG_CACHE_HOME'))]\n"
        "assert all(Path(p).is_dir() and Path(p).is_relative_to(folder) for p in inside), inside"
    )
    assert solved(simulator(tmp_path, twist)).finished


def test_the_job_is_the_scene(tmp_path: Path) -> None:
    """Of a linear scene, what the job says is enough to solve it."""
    scene = Scene(
        grid(SIZE, (2, 2, 2)), Material(1e4, 0.3), (Support("z0", (0, 1, 2)),),
        drives=(Drive("press", "z1", (0.0, 0.0, -1.0)),), loads=(Load("pull", "x1", (1.0, 0, 0)),),
    )  # fmt: skip
    job = write_job(tmp_path, scene, T, np.array([[1e-3, 0.1], [2e-3, 0.2]]), False, 1e-6)
    said = json.loads((tmp_path / "job.json").read_text())
    f, known = np.zeros((27, 3)), np.full((27, 3), np.nan)
    (drive,), (load,) = said["drives"], said["loads"]
    known[said["held"]["nodes"], said["held"]["components"]] = 0.0
    known[drive["nodes"], drive["components"]] = np.array(drive["per_unit"]) * drive["history"][-1]
    f[load["nodes"]] = np.array(load["forces"]) * load["history"][-1]
    K, u = build(scene).K.toarray(), known.ravel().copy()
    free = np.isnan(u)
    u[free] = np.linalg.solve(
        K[np.ix_(free, free)], f.ravel()[free] - K[np.ix_(free, ~free)] @ u[~free]
    )
    ours = run_scheme("ours", QuasiStatic(), scene, T, job.inputs, np.array([1]))
    assert u.reshape(-1, 3) == pytest.approx(ours.u[0], abs=1e-12)
    assert said["instants"] == [0.0, 0.5, 1.0]
    assert drive["history"] == [0.0, 1e-3, 2e-3]
    assert load["history"] == [0.1, 0.1, 0.2]
    assert said["material"] == {"law": "linear", "E": 1e4, "nu": 0.3}


def test_what_a_job_does_not_carry_is_refused(tmp_path: Path) -> None:
    stiff = Region("stiff", np.array([0]), Material(2e4, 0.0))
    scene = Scene(SCENE.mesh, SCENE.material, SCENE.supports, drives=SCENE.drives, regions=(stiff,))
    refused = solved(ExternalSimulator(sys.executable), scene)
    assert refused.outcome.state == "refused"
    assert refused.outcome.why.startswith(
        "cannot run: a job for an external simulator cannot contain regions"
    )
    assert (
        "increasing" in ExternalSimulator(sys.executable).solve(SCENE, T[::-1], INPUTS).outcome.why
    )
    flat = grid((0.02, 0.02), (2, 2))
    with pytest.raises(SceneError, match="not quad4"):
        write_job(tmp_path, Scene(flat, SCENE.material), T, INPUTS, False, 1e-6)
    with pytest.raises(SceneError, match="carries tet4"):
        write_vtu(flat, tmp_path / "flat.vtu")


def test_a_program_that_is_not_there_is_a_row() -> None:
    for command, why in (("", "no command"), ("no-such-program x", "no program"), ("'", "closing")):
        outcome = solved(ExternalSimulator(command)).outcome
        assert outcome.state == "refused"
        assert why in outcome.why
    assert (
        "not installed: there is no program 'no-such-program'"
        in solved(ExternalSimulator("no-such-program x")).outcome.why
    )


@pytest.mark.parametrize("kind", ["tet4", "tet10", "hex8"])
def test_the_mesh_is_read_by_another_library(tmp_path: Path, kind: str) -> None:
    meshio = pytest.importorskip("meshio")
    from validate.scene.geometries.box import box

    pass

    mesh = grid(SIZE, (1, 2, 2)) if kind == "hex8" else box(SIZE, (1, 2, 2))
    mesh = mesh.quadratic() if kind == "tet10" else mesh
    write_vtu(mesh, tmp_path / "mesh.vtu")
    read = meshio.read(tmp_path / "mesh.vtu")
    assert np.array_equal(read.points, mesh.nodes)
    assert np.array_equal(read.cells[0].data, mesh.cells)
    volume = {"tet4": "tetra", "tet10": "tetra10", "hex8": "hexahedron"}
    assert read.cells[0].type == volume[kind]


def test_it_stands_in_an_experiment_and_is_set_as_others_are() -> None:
    method = with_values(
        Method("external", ExternalSimulator()), {"command": "python g.py", "seconds": "3"}
    )
    assert (method.settings.command, method.settings.seconds) == ("python g.py", 3.0)


def test_a_simulator_that_weighs_the_body_needs_a_density() -> None:
    assert exchange._density(Material(1.0, 0.3, rho=1000.0)) == 1000.0
    with pytest.raises(SceneError, match=r"needs a density; give material.rho"):
        exchange._density(Material(1.0, 0.3))


def test_files_that_go_while_they_are_counted_are_not_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, size in (("kept", 5), ("gone", 7)):
        (tmp_path / name).write_bytes(bytes(size))
    lstat = os.lstat

    def missing(path: Path) -> os.stat_result:
        if Path(path).name == "gone":
            raise FileNotFoundError(path)
        return lstat(path)

    assert ran.size_of(tmp_path) == 12
    monkeypatch.setattr(ran.os, "lstat", missing)
    assert ran.size_of(tmp_path) == 5


def test_a_program_that_cannot_be_started_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def forbidden(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    def ended(code: int) -> None:
        raise SystemExit(code)

    monkeypatch.setattr(limits.resource, "setrlimit", lambda *_: None)
    monkeypatch.setattr(limits.os, "execvp", forbidden)
    monkeypatch.setattr(limits.os, "_exit", ended)
    with pytest.raises(SystemExit, match="127"):
        limits.become(["solver", "job"], 2**30, 2**20)
    assert capsys.readouterr().out == "solver: Permission denied\n"


def test_an_answer_that_unpacks_to_more_than_the_job_has_is_not_unpacked(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "fields.npz", u=np.zeros(10**6))
    mesh = SimpleNamespace(nodes=np.zeros((4, 3)))
    asked = SimpleNamespace(scene=SimpleNamespace(mesh=mesh), times=np.zeros(2))
    with pytest.raises(NoAnswerError, match=r"fields\.npz: 8000\d\d\d bytes unpacked"):
        exchange._arrays(tmp_path / "fields.npz", asked)  # type: ignore[arg-type]
