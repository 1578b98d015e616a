"""The command line from outside: exit codes, one-line errors, light help, files that appear."""

import errno
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path
from shutil import copytree
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import here, refused
from study_samples import experiment_file

from validate.catalogue import experiment_files
from validate.commands import (
    body as bodies,
)
from validate.commands import (
    calibrate as calibrating,
)
from validate.commands import (
    check as checking,
)
from validate.commands import (
    digitise as known_places,
)
from validate.commands import (
    external_check,
    tool_poses,
)
from validate.commands import main as cli
from validate.commands import (
    outline as outlining,
)
from validate.commands import (
    record as making,
)
from validate.commands import (
    study as studying,
)
from validate.commands.questions import body as new_body
from validate.commands.questions import kinds as new_body_questions
from validate.commands.questions.answers import read_answers
from validate.compare.result import Result
from validate.errors import RecordingError, SceneError, UsageError, ValidateError
from validate.library import studies
from validate.scene.geometries.box import box
from validate.scene.mesh_files.third_party_meshes import ForeignBody

# private: _MAX_TABLE: replaced by a small number: a short test.
# private: _content, _document, _drawn, _found, _metres, _part, _running, _seen: called alone,
#   case by case.
# private: _judged: replaced, to bring a case about.

COARSE = [
    "--set", "body.cells=6,7,10",
]  # fmt: skip


WIDE = {"COLUMNS": "400"}  # sentences on one line, to be looked for


def called(
    *arguments: str, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "validate", *arguments],
        capture_output=True, text=True, cwd=cwd, timeout=200,
        env={**os.environ, **WIDE, **environment},
    )  # fmt: skip


HEAVY = {
    "vtk", "pyvista", "numba", "dask", "distributed", "matplotlib", "skfem", "shapely", "filterpy",
    "jinja2", "scipy", "manifold3d",
}  # fmt: skip
FILES = {"numpy", "mcap", "cv2", "pint"}


def loaded(*arguments: str) -> tuple[str, set[str]]:
    """What a command prints, and the libraries it has loaded at its end."""
    script = (
        "import sys; from validate.commands.main import run; code = run(sys.argv[1:]);"
        "print('LOADED', *sys.modules); sys.exit(code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    shown, _, modules = done.stdout.partition("LOADED ")
    return shown, {name.split(".")[0] for name in modules.split()}


@pytest.mark.parametrize("arguments", [["--help"], ["run", "--help"], ["inspect", "--help"], []])
def test_help_loads_none_of_the_heavy_libraries(arguments: list[str]) -> None:
    shown, modules = loaded(*arguments)
    assert "Usage" in shown
    assert not modules & (HEAVY | FILES | {"rich"})


def test_the_help_of_import_asks_the_readers_and_loads_nothing_else() -> None:
    shown, modules = loaded("import", "--help")
    assert "c3d  " in shown
    assert not modules & (HEAVY | {"rich"})


def test_the_list_of_experiments_loads_none_of_the_heavy_libraries() -> None:
    shown, modules = loaded("list")
    assert "fluid_phantom" in shown
    assert not modules & (HEAVY | FILES)


def test_inspecting_a_recording_loads_only_what_reads_and_measures_it(project_root: Path) -> None:
    shown, modules = loaded("inspect", str(project_root / "recordings" / "kf_cube.mcap"))
    assert "integrity: verified" in shown
    assert "motion of markers: 'corner' moves most, 2.43 mm peak to peak along" in " ".join(
        shown.split()
    )
    assert not modules & (HEAVY - {"scipy", "shapely"})  # which measure the motion


def test_what_a_run_imports_is_what_it_solves_with() -> None:
    """Every run pays for it twice, here and for its workers: 2 s of Python's start for all."""
    script = "import sys, validate.commands.run; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    unused = {"scipy.stats", "scipy.signal", "filterpy", "pint", "distributed", "matplotlib"}
    assert not unused & set(done.stdout.split())


def test_usage_errors_are_one_line_with_the_nearest_name() -> None:
    assert "nearest: fluid_phantom" in refused("run", "fluid_phatom")
    assert "nearest: material.E" in refused("run", "fluid_phantom", "--set", "material.EE=1")
    assert "not a number" in refused("run", "fluid_phantom", "--set", "material.E=soft")
    assert "PATH=VALUE" in refused("run", "fluid_phantom", "--set", "material.E")
    assert "nearest: p2_fluid" in refused("run", "fluid_phantom", "--methods", "p2_fluit")
    assert "one or more experiments" in refused("run")
    assert "No such option" in refused("run", "--frobnicate")
    assert "no experiment file" in refused("run", "nowhere.py")
    assert "nearest: instron" in refused("import", "x.csv", "--as", "instrom", "-o", "x.mcap")


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("material.nu=0.5", "nu = 0.5"),
        ("material.nu=-1", "nu = -1"),
        ("material.E=-15200", "E = -15200"),
        ("body.inclusion.centre_x=0.006", "x = 0"),
        ("body.inclusion.radius=0.0005", "smaller than an element"),
        ("positions=0.004", "0 matched samples"),
        ("recording=nowhere.mcap", "nowhere.mcap"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(tmp_path: Path, setting: str, says: str) -> None:
    arguments = ("run", "fluid_phantom", "--methods", "p1_fluid", "--out", str(tmp_path))
    line = refused(*arguments, "--set", setting)
    assert says in line
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_run_without_an_accepted_method_fails_but_reports(tmp_path: Path) -> None:
    arguments = ["run", "fluid_phantom", "--methods", "p1_fluid,p1_loop", "--out", str(tmp_path)]
    done = called(*arguments, *COARSE, cwd=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "nothing compared; no accepted method was run." in done.stdout
    (folder,) = tmp_path.glob("fluid_phantom+methods+*")  # other methods, another folder
    assert f"{folder.name}/report.html" in done.stdout
    results = json.loads((folder / "results.json").read_text("utf-8"))
    assert [m["name"] for m in results["methods"]] == ["p1_fluid", "p1_loop"]


@pytest.mark.slow
def test_a_method_that_does_not_settle_says_why_in_a_line(tmp_path: Path) -> None:
    arguments = ["run", "fluid_phantom", "--methods", "p1_dry,p1_loop", "--out", str(tmp_path)]
    done = called(*arguments, *COARSE, "--set", "methods.p1_loop.gain=-10kPa", cwd=tmp_path)
    printed = " ".join(done.stdout.split())
    assert re.search(r"p1_loop: (not_converged|diverged) at step \d+: .*gain", printed)
    assert "p1_dry: " not in printed


@pytest.mark.slow
def test_json_on_standard_output_is_one_document(tmp_path: Path) -> None:
    done = called(
        "run", "fluid_phantom", "--json", "--methods", "p1_dry", "--out", str(tmp_path), *COARSE
    )
    assert json.loads(done.stdout)["experiment"] == "fluid_phantom"
    first, *lines = done.stderr.splitlines()
    assert first.startswith("validate: none of the chosen methods is accepted")
    # Progress, where it took long: at most one in ten seconds.
    assert all(line.startswith("fluid_phantom: ") for line in lines)


@pytest.mark.slow
def test_an_experiment_file_anywhere_and_from_any_folder(
    tmp_path: Path, project_root: Path
) -> None:
    folder = tmp_path / "mine"
    copytree(project_root / "experiments" / "fluid_phantom", folder)
    source = (folder / "experiment.py").read_text("utf-8")
    mine = source.replace('name="fluid_phantom"', 'name="mine"')
    (folder / "experiment.py").write_text(mine, "utf-8")
    recording = project_root / "recordings" / "fluid_phantom.mcap"
    done = called(
        "run", "mine/experiment.py", "--methods", "p1_dry", *COARSE,
        "--set", f"recording={recording}", cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 1, done.stderr  # nothing accepted was run
    assert len(list((tmp_path / "reports").glob("mine+methods+*/report.html"))) == 1
    (folder / "experiment.py").write_text(source, "utf-8")
    assert "not the folder's name" in refused("run", "mine/experiment.py", cwd=tmp_path)


def test_list_names_every_parameter_with_path_type_unit_and_default(project_root: Path) -> None:
    found = json.loads(here("list", "--json")[1])
    names = {e["name"] for e in found}
    assert names == set(experiment_files(project_root))
    assert names >= {"ecoflex_cylinder", "ekf_cone", "ekf_cube", "fluid_phantom", "kf_cube"}
    detail = json.loads(here("list", "fluid_phantom", "--json")[1])
    paths = {p["path"]: p for p in detail["parameters"]}
    assert paths["material.E"] == {
        "path": "material.E", "type": "float", "unit": "Pa", "default": 15200.0,
        "doc": paths["material.E"]["doc"],
    }  # fmt: skip
    wanted = {
        "body.cells",
        "body.element",
        "body.inclusion.radius",
        "foundations.plates.contact",
        "positions",
    }
    assert wanted <= set(paths)
    assert all(p["unit"] and p["doc"] for p in paths.values())
    assert {m["name"] for m in detail["methods"]} >= {"p1_fluid", "p2_fluid", "md_fluid"}
    assert "material.E" in here("list", "fluid_phantom")[1]


def test_inspect_and_import(tmp_path: Path, project_root: Path, shared_data: Path) -> None:
    shown = here("inspect", str(project_root / "recordings" / "fluid_phantom.mcap"))[1]
    assert all(word in shown for word in ("load_cell", "371", "Pa", "integrity: verified"))
    log = shared_data / "force" / "ecoflex-compression" / "EF30_0T_A1.csv"
    out = tmp_path / "a.mcap"
    code, told, _ = here("import", str(log), "--as", "instron", "-o", str(out))
    assert code == 0
    told = " ".join(told.split())
    for found in (told, " ".join(here("inspect", str(out))[1].split())):
        assert "test: compression: the header contains 'Compression test'" in found
        assert "signs: flipped: none, so that compression is positive" in found
        assert "units: 'Time (s)' in s x 1, 'Compression (mm)' in mm x 0.001, 'Load (N)'" in found
    topics = json.loads(here("inspect", str(out), "--json")[1])["topics"]
    assert {(t["name"], t["count"], t["unit"]) for t in topics} == {
        ("displacement", 1202, "m"), ("force", 1202, "N"),
    }  # fmt: skip
    other = tmp_path / "b.mcap"
    assert "no table" in refused("import", str(log.parent / "README.txt"), "--as", "instron",
                                 "-o", str(other))  # fmt: skip
    assert "nowhere" in refused("inspect", "nowhere.mcap")
    missing = str(tmp_path / "no" / "such" / "folder.mcap")
    refused("import", str(log), "--as", "instron", "-o", missing)
    assert {p.name for p in tmp_path.iterdir()} == {"a.mcap"}


def test_a_missing_data_folder_names_the_command_that_brings_it(tmp_path: Path) -> None:
    elsewhere = {"VALIDATE_SHARED_DATA": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path)}
    line = refused("run", "ecoflex_cylinder", **elsewhere)
    assert "`validate data get ecoflex-compression`" in line
    assert "tissue-phantom-material-database" in line
    assert "--set data=FOLDER" in line


def test_exit_codes_of_known_errors_interrupts_and_bugs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def raising(error: BaseException) -> int:
        def broken(*_: object, **__: object) -> None:
            raise error

        monkeypatch.setattr(cli.cli, "main", broken)
        return cli.run(["list"])

    assert raising(ValidateError("two\nlines")) == 2
    assert capsys.readouterr().err == "validate: two lines\n"
    assert raising(KeyboardInterrupt()) == 130
    capsys.readouterr()
    assert raising(ZeroDivisionError("a bug")) == 70
    assert "Traceback" in capsys.readouterr().err


def test_check_shows_every_figure_and_fails_when_one_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, phantom_result: Result
) -> None:
    asked = ("check", "--fresh", "fluid_phantom", "--out", str(tmp_path))
    monkeypatch.setattr(checking, "compare", lambda *_, **__: phantom_result)
    code, out, _ = here(*asked, "--json")
    found = json.loads(out)[0]
    assert (code, found["holds"], len(found["published"])) == (0, True, 48)
    assert sum(p["result"] for p in found["published"]) == 14
    printed = here(*asked)[1].splitlines()
    assert printed[0] == "fluid_phantom: holds; the verdict is good enough."
    assert len(printed) <= 27  # the path of the page takes two lines here
    page = unescape((tmp_path / "published" / "report.html").read_text("utf-8"))
    assert all(p["name"] in page for p in found["published"])
    whole = here(*asked, "--verbose")[1]
    assert all(p["name"] in " ".join(whole.split()) for p in found["published"])
    moved = replace(phantom_result.published[0], expected=1.0)
    spoiled = replace(phantom_result, published=(moved,))
    monkeypatch.setattr(checking, "compare", lambda *_, **__: spoiled)
    assert here(*asked)[0] == 1
    monkeypatch.setattr(checking, "compare", lambda *_, **__: replace(phantom_result, published=()))
    assert here(*asked)[0] == 1  # nothing compared


def test_check_of_an_experiment_without_printed_figures_rests_on_its_checks(
    phantom_result: Result,
) -> None:
    bare = replace(phantom_result, published=())
    assert checking._document(checking._content(bare), declared=False)["holds"]
    assert not checking._document(checking._content(bare), declared=True)["holds"]
    nothing = checking._content(replace(bare, methods=()))
    assert not checking._document(nothing, declared=False)["holds"]


@pytest.mark.parametrize(
    ("score", "code", "fault"),
    [("kf:top.rmse", 0, ""), ("kf:top.rmsee", 1, "not computed: no score 'top.rmsee'")],
)
def test_check_fails_by_name_for_a_printed_figure_that_nothing_computes(
    tmp_path: Path, score: str, code: int, fault: str
) -> None:
    file = experiment_file(tmp_path)
    figure = f'Figure("the printed error", "{score}", 1.0, None, "m", "not comparable", "", "p. 1")'
    text = file.read_text("utf-8").replace(
        "EXPERIMENT = Experiment(",
        "from validate.compare.published import Figure\n\n"
        f"EXPERIMENT = Experiment(published=({figure},),",
    )
    file.write_text(text, "utf-8")
    asked = ("check", str(file), "--out", str(tmp_path / "out"))
    done, out, _ = here(*asked, "--json")
    (found,) = json.loads(out)[0]["published"]
    assert (done, found["name"], found["fault"]) == (code, "the printed error", fault)
    assert "the printed error" in here(*asked)[1]


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (BrokenPipeError(), 130, ""),
        (MemoryError(), 2, "out of memory: take a coarser mesh or fewer steps"),
        (MemoryError("3 GB"), 2, "out of memory (3 GB): take a coarser mesh or fewer steps"),
        (OSError(errno.ENOSPC, "No space left"), 2, "the output cannot be written: No space left"),
        (OSError(errno.EROFS, "Read-only", "/x/out"), 2, "/x/out: "),
        (OSError(errno.EBADF, "Bad file"), 70, "Traceback"),
    ],
)
def test_exit_codes_of_what_the_machine_refuses(
    error: Exception, code: int, says: str, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    def broken(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(cli.cli, "main", broken)
    assert cli.run(["list"]) == code
    said = capsys.readouterr().err
    assert said.removeprefix("validate: ").startswith(says)
    assert ("\n" in said.rstrip("\n")) == (code == 70)


def test_answers_of_a_file_too_large_are_not_read(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("#" * 100_001)
    with pytest.raises(UsageError, match=r"a.toml: 100001 bytes.*100000"):
        read_answers(tmp_path / "a.toml")


def test_places_that_cannot_be_known_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "wires.csv"
    file.write_text("target,x,y,z,x2,y2,z2\nw,1,2,3,1,2,3\n")
    with pytest.raises(RecordingError, match=r"wires.csv: wire w has two equal ends"):
        known_places.known_places(file, "mm")
    whole = tmp_path / "whole.csv"
    whole.write_text("target,x,y,z,x2,y2,z2\np,1,2,3, ,,\nw,1,2,0,1,2,3\n")
    point, wire = known_places.known_places(whole, "mm")
    assert point.along is None
    assert wire.along is not None
    assert wire.along.tolist() == [0.0, 0.0, 1.0]
    with pytest.raises(RecordingError, match=r"none.csv: cannot be read \(No such file"):
        known_places.rows_of(tmp_path / "none.csv", ("target",))
    monkeypatch.setattr(known_places, "_MAX_TABLE", 20)
    with pytest.raises(RecordingError, match=r"wires.csv: 36 bytes, the limit is 20"):
        known_places.rows_of(file, ("target",))
    monkeypatch.setattr(known_places, "read_device_set", lambda _: SimpleNamespace(landmarks={}))
    with pytest.raises(UsageError, match=r"d.xml: .* no landmarks"):
        known_places.known_places(tmp_path / "d.xml", None)


OUTLINE = dict.fromkeys(("sd", "unit", "label", "centre", "radius"))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: known_places.known_places(Path(os.devnull), "kg"), "--unit kg: expected a unit of "
                                                                    "length, as mm"),
        (lambda: bodies._metres("edge", "2"), "--edge 2: expected a length with its unit, as 2mm"),
        (lambda: bodies._metres("edge", "-2mm"), "--edge -2mm: expected a length with its unit"),
        (lambda: outlining._found(None, "", {**OUTLINE, "centre": "3px"}),
         "--centre 3px: expected X,Y as 120px,80px or"),
        (
            lambda: outlining._drawn(Path("a"), None, "", {"centre": "1px,1px", "radius": 0,
                                                           "bright": False}),
            "--centre is for searched outlines; leave it out with --from",
        ),
        (
            lambda: calibrating._seen(None, None, "probe", {}, Path(os.devnull)),
            "null: the file has no marked points",
        ),
    ],
)  # fmt: skip
def test_options_that_do_not_fit_are_refused(
    call: Callable[[], object], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibrating, "rows_of", lambda *_: [])
    with pytest.raises(UsageError, match=re.escape(says)):
        call()


def test_a_part_of_a_body_that_is_none_names_the_file() -> None:
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(SceneError, match=r"body.msh: "):
        bodies._part(Path("body.msh"), ForeignBody(mesh, {}), "nowhere")
    whole = ForeignBody(mesh, {})
    assert bodies._part(Path("body.msh"), whole, None) is whole


def test_a_study_that_is_interrupted_says_how_many_cells_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    experiment = SimpleNamespace(name="x", path=tmp_path / "x.py")
    settings = studies.StudySettings(tmp_path)
    cells = studies.study_folder(experiment, "tradeoff", tmp_path) / studies.CELLS  # type: ignore[arg-type]
    cells.mkdir(parents=True)
    for i in range(3):
        (cells / f"{i}.json").write_text("{}")
    with (
        pytest.raises(KeyboardInterrupt),
        studying.noted(),
        studies._running(experiment, "choose", "choose", settings),  # type: ignore[arg-type]
    ):
        raise KeyboardInterrupt
    assert "3 finished cells are kept; the same command resumes" in capsys.readouterr().err


def test_commands_without_what_they_need_report_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "kept").write_text("x")
    with pytest.raises(UsageError, match="this folder is not empty; name another"):
        external_check.job("x", tmp_path, None, 2, (), inertia=False, force=False)
    experiment = SimpleNamespace(methods={"linear": None}, accepted=("linear",), twin=None)
    for module in (external_check, making):
        monkeypatch.setattr(module, "find", lambda *_: experiment)
    monkeypatch.setattr(external_check, "own_body", lambda found: SimpleNamespace(experiment=found))
    with pytest.raises(UsageError, match=r"no method 'lin'; .*linear"):
        external_check.job("x", tmp_path / "new", "lin", 2, (), inertia=False, force=False)
    with pytest.raises(UsageError, match=r"'x' has no synthetic recording"):
        making.record("x", tmp_path / "x.mcap", ())
    with pytest.raises(UsageError, match="no such file; paths start from"):
        new_body_questions.there(str(tmp_path / "nowhere"))
    new_body_questions.there(str(tmp_path / "kept"))


def test_a_body_that_is_not_held_or_not_compared_is_no_experiment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(new_body, "answered_mesh", lambda found: None)
    monkeypatch.setattr(new_body, "_judged", lambda found: ())
    with pytest.raises(UsageError, match=r"held\.all, .*\.slides are all empty"):
        new_body._fields(None, "", Path(), {})  # type: ignore[arg-type]
    with pytest.raises(UsageError, match=r"seen\.force, .*outline are all none"):
        new_body._fields(None, "", Path(), {"held.all": "x0"})  # type: ignore[arg-type]


def test_tools_that_are_never_tracked_together_and_files_that_would_lose_topics(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    poses = {"a": np.arange(3.0), "b": np.arange(3.0) + 0.5}

    def seen(recording: object, tool: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return poses[tool], np.tile(np.eye(3), (3, 1, 1)), np.zeros((3, 3))

    monkeypatch.setattr(tool_poses, "tool_poses", seen)
    with pytest.raises(UsageError, match=r"'a' and 'b' are never visible"):
        tool_poses.in_reference(None, "a", "b")  # type: ignore[arg-type]
    partly = SimpleNamespace(unread={"/x": "", "/y": ""})
    monkeypatch.setattr(outlining, "read_recording", lambda file: partly)
    with pytest.raises(UsageError, match=r"a\.mcap has 2 topics that are not read"):
        outlining.outline(Path("a.mcap"), None, "", "", None, {})


@pytest.mark.parametrize("seconds", ["0", "-1", "inf", "nan"])
def test_a_loop_takes_seconds_above_zero(seconds: str) -> None:
    line = refused("live", "needle_block", "--seconds", seconds)
    assert f"--seconds {float(seconds):g}: expected a number above 0" in line
