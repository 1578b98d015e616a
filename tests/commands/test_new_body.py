"""`validate new` by questions: from markers, outlines or forces and any body to a verdict."""

import json
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import click
import meshio
import numpy as np
import pytest
from command_line import called

from validate.commands.questions.answers import Question, answered, listed, read_answers
from validate.errors import RegistrationError, UsageError
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.job import Job, job_of, run_name
from validate.recording.mcap.write import write_recording
from validate.recording.types import Contours, Frames, Markers, Recording, Signal, Source
from validate.scene.geometries.box import box, grid
from validate.scene.mesh_files.mesh_file import write_mesh

pytestmark = pytest.mark.usefixtures("one_picture")

E, NU, RHO, G, SIZE = 20e3, 0.3, 1100.0, 9.80665, (0.04, 0.03, 0.05)
T = np.linspace(0.0, 4.0, 81)
SHARE = np.clip((T - 0.5) / 3.0, 0, 1)


def recording(**streams: object) -> Recording:
    return Recording("body", Source("x", "", 0, "x"), 0, **streams)  # type: ignore[arg-type]


def log() -> dict[str, Signal]:
    d = 1e-3 * SHARE
    force = E * SIZE[0] * SIZE[1] * d / SIZE[2] + np.random.default_rng(1).normal(0, 2e-3, len(T))
    return {"displacement": Signal(T, d[:, None], "m", 0.0, "machine"),
            "force": Signal(T, force[:, None], "N", 2e-3, "machine")}  # fmt: skip


def markers() -> dict[str, Markers]:
    x = np.array([(0.04, 0.03, 0.05), (0.0, 0.03, 0.04), (0.04, 0.0, 0.02), (0.02, 0.0, 0.025)])
    u = np.array([-NU, -NU, 1.0]) * -0.001 / SIZE[2] * x
    noise = np.random.default_rng(3).normal(0, 5e-6, (len(T), *x.shape))
    return {"m": Markers(T, ("A", "B", "C", "D"), x + SHARE[:, None, None] * u + noise, 5e-6, "b")}


COARSE = {"body.cells": "2,2,2"}  # what is uniform is exact on any mesh
PRESSED = """
experiment = "body"
law = "linear"
body = {shape = "block", block = "40mm,30mm,50mm"}
material = {E = "20kPa", nu = 0.3}
moved = {by = "displacement", along = "-z", place = "zmax", sideways = false}
held = {x = "xmin", y = "ymin", z = "zmin"}
seen = {layout = "as seen", still = "0.4s"}
accept = {force = "50mN", marker = "0.1mm"}
why = {force = "felt", marker = "seen"}
ranges = {E = "2%", nu = 0.01, load = 0.01}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_recording(recording(signals=log(), markers=markers()), tmp_path / "all.mcap")
    (tmp_path / "a.toml").write_text(PRESSED, "utf-8")
    return tmp_path


def test_a_body_of_hexahedra_is_solved_as_its_methods_say(here: Path) -> None:
    """As they are, mixed: neither quadratic, nor by two methods that are one."""
    write_mesh(grid(SIZE, (2, 2, 2)), here / "h.npz")
    body = 'body = {shape = "block", block = "40mm,30mm,50mm"}'
    file = PRESSED.replace(body, 'body = {shape = "file", file = "h.npz"}')
    (here / "h.toml").write_text(file, "utf-8")
    assert called("new", "hexa", "--from", "all.mcap", "--answers", "h.toml")[0] == 0
    text = (here / "experiments" / "hexa.py").read_text("utf-8")
    assert '"linear": solid("linear law, mixed hexahedra", "linear")' in text
    assert '"quick"' not in text
    found = run_in_memory(load_file(here / "experiments" / "hexa.py"), quick=True)
    method = found.methods[0]
    assert {s.name: s.value for s in method.scores}["force.rms@high"] < 0.03  # of 0.48 N: exact


@pytest.mark.usefixtures("decoded_here")
def test_a_body_of_an_unusual_size_is_a_question(here: Path) -> None:
    """Read in mm, a file in metres is a twentieth of a millimetre high."""
    nodes = grid(SIZE, (2, 2, 2))
    meshio.Mesh(nodes.nodes, [("hexahedron", nodes.cells)]).write(here / "h.vtu")
    block = 'body = {shape = "block", block = "40mm,30mm,50mm"}'

    def new(name: str, body: str) -> tuple[int, str]:
        text = PRESSED.replace(block, f'body = {{shape = "file", file = "h.vtu", {body}}}')
        (here / "h.toml").write_text(text, "utf-8")
        return called("new", name, "--from", "all.mcap", "--answers", "h.toml")

    code, said = new("small", 'unit = "mm"')
    assert (code, "1 question is open: body.size (largest side of the body" in said) == (2, True)
    assert "0.04 x 0.03 x 0.05 mm (lengths in mm)" in said
    assert "40 x 30 x 50 mm in m" in said
    code, said = new("small", 'unit = "mm", size = "5mm"')
    assert (code, "body.size = 5mm: the file's largest side is 0.05 mm; if that" in said) == (
        2,
        True,
    )
    assert new("small", 'unit = "mm", size = "0.05mm"')[0] == 0
    assert new("right", 'unit = "m"')[0] == 0
    (here / "h.toml").write_text(PRESSED.replace("40mm,30mm,50mm", "40,30,50"), "utf-8")
    said = called("new", "block", "--from", "all.mcap", "--answers", "h.toml")[1]
    assert "(lengths in m); 40 x 30 x 50 mm in mm" in said


def test_answers_make_an_experiment_that_runs(here: Path) -> None:
    code, said = called("new", "mine", "--from", "all.mcap", "--answers", "a.toml")
    assert (code, "not used" in said) == (0, False)
    text = (here / "experiments" / "mine.py").read_text("utf-8")
    assert len(text.splitlines()) <= 60
    assert "material=Material(E=20000, nu=0.3, rho=1000),  # E: Pa, rho: kg/m^3" in text
    result = run_in_memory(load_file(here / "experiments" / "mine.py"), COARSE)
    assert {c.name: c.verdict for c in result.checks} == dict.fromkeys(
        ("force.max@low", "force.max@high", "marker.max@low", "marker.max@high"), "good enough"
    )


def test_what_a_user_sets_or_mistypes_of_a_method_is_seen(here: Path) -> None:
    """A scene's path set for one method had no folder of its own, and wrong names came late."""
    assert called("new", "mine", "--from", "all.mcap", "--answers", "a.toml")[0] == 0
    file = here / "experiments" / "mine.py"
    mine = load_file(file)
    coarse = {f"methods.linear.{path}": cells for path, cells in COARSE.items()}
    assert run_name(mine, Options(coarse)) != run_name(mine, Options({}))
    found = run_in_memory(mine, coarse, quick=True)
    assert [(c.path, c.value) for c in found.changed] == [("methods.linear.body.cells", [2, 2, 2])]
    with pytest.raises(UsageError, match=r"methods\.X\.material\.law.*'X'"):
        run_in_memory(mine, {"methods.X.material.law": "svk"})
    text = file.read_text("utf-8")
    for old, new, why in (
        ('accepted=("linear",)', 'accepted=("slap",)', "accepted: no method 'slap'"),
        ('"linear"),', '"linear", {"body.cell": (2, 2, 2)}),', "unknown parameter 'body.cell'"),
        ('"linear"),', '"linear", {"body.cells": [2, 2, 2]}),', "expected a number, a text or a"),
    ):
        assert old in text
        file.write_text(text.replace(old, new), "utf-8")
        with pytest.raises(UsageError, match=why):
            load_file(file)
    file.write_text(text.replace('"linear"),', '"linear", {"body.cells": (2, 2, 2)}),'), "utf-8")
    assert run_in_memory(load_file(file), quick=True).methods[0].scene.mesh.nodes.size < 2000


def _worked(job: Job) -> dict[str, float]:
    """On a worker: the scores of the job's experiment."""
    experiment = job.experiment()
    (method,) = run_in_memory(experiment, COARSE, methods=("linear",), quick=True).methods
    return {s.name: s.value for s in method.scores if s.unit in ("N", "m")}


@pytest.fixture
def job(here: Path) -> Job:
    called("new", "mine", "--from", "all.mcap", "--answers", "a.toml")
    return job_of(load_file(here / "experiments" / "mine.py"))


def test_a_declaration_runs_as_json(here: Path, job: Job) -> None:
    """Nothing of the experiment's file is needed then."""
    file = here / "experiments" / "mine.py"
    text = called("list", str(file), "--declaration")[1]
    file.with_suffix(".json").write_text(text, "utf-8")
    assert job.declaration == text.strip()
    ours = _worked(job)
    assert len(ours) > 3
    file.unlink()
    told = ("--methods", "linear", "--quick", "--out", str(here / "reports"))
    cells = (text for path, value in COARSE.items() for text in ("--set", f"{path}={value}"))
    code, shown = called("run", str(file.with_suffix(".json")), *told, *cells)
    assert code in (0, 1), shown  # quick: what it finds is tested elsewhere
    (stored,) = (here / "reports").glob("mine+*/results.json")
    (method,) = json.loads(stored.read_text("utf-8"))["methods"]
    found = {s["name"]: s["value"] for s in method["scores"]}
    assert {name: found[name] for name in ours} == pytest.approx(ours, rel=1e-6)


@pytest.mark.slow
def test_a_declaration_runs_on_a_worker(here: Path, job: Job) -> None:
    ours = _worked(job)
    (here / "experiments" / "mine.py").unlink()
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as workers:
        assert workers.submit(_worked, job).result() == pytest.approx(ours, rel=1e-12)


def test_what_is_open_is_asked_all_at_once(here: Path) -> None:
    (here / "a.toml").write_text('experiment = "body"\nbody.shape = "block"\n', "utf-8")
    code, said = called("new", "mine", "--from", "all.mcap", "--answers", "a.toml")
    assert code == 2
    for key in ("body.block", "material.E", "material.nu", "moved.by",
                "accept.marker", "ranges.nu", "seen.layout"):  # fmt: skip
        assert f"{key} (" in said
    assert "--questions prints such a file" in said
    assert not (here / "experiments").exists()


@pytest.mark.parametrize(("line", "why"), [
    ('held.all = "lid"', "held.all = lid: place 'lid': none of"),
    ('moved.along = "down"', "direction 'down'"),
    ('material.E = "15mm"', "material.E = 15mm"),
    ('moved.by = "stage"', "one of displacement, force, markers, gravity"),
    ('accept.force = "-1"', "a number above 0 in N"),
    ('hold.all = "zmin"', "no question has the key hold.all; nearest: held.all"),
    ('body.file = "x.npz"', "no question has the key body.file"),
    ('seen.still = "soon"', "seen.still = soon"),
])  # fmt: skip
def test_a_wrong_answer_is_named(here: Path, line: str, why: str) -> None:
    key, value = line.split(" = ", 1)
    group, name = key.split(".")
    text = "\n".join(s for s in PRESSED.splitlines())
    flat = read_answers(here / "a.toml") | {f"{group}.{name}": value.strip('"')}
    text = "\n".join(f'{k} = "{v}"' for k, v in flat.items())
    (here / "a.toml").write_text(text, "utf-8")
    code, said = called("new", "mine", "--from", "all.mcap", "--answers", "a.toml")
    assert (code, why in said) == (2, True), said


@pytest.mark.parametrize(("line", "why"), [
    ('moved.markers = "A, B, C"', ""),
    ('moved.markers = "A, B"', "2 markers; at least 3 are needed"),
    ('moved.markers = "A, B, tip"', "no marker tip; there are A, B, C, D"),
    ('material.E = "unknown"', "material.E = unknown: identifying it needs a compared force"),
])  # fmt: skip
def test_what_markers_on_a_face_move_is_asked_before_it_runs(
    here: Path, line: str, why: str
) -> None:
    write_recording(recording(markers=markers()), here / "m.mcap")
    key, value = line.split(" = ")
    said = {"body.shape": "block", "body.block": "40mm,30mm,50mm", "material.E": "20kPa",
            "material.nu": "0.3", "held.all": "zmin", "moved.by": "markers", "moved.place": "zmax",
            "moved.markers": "A,B,C", "seen.layout": "as seen", "accept.marker": "1mm",
            "ranges.E": "0", "ranges.nu": "0", "ranges.load": "0"}  # fmt: skip
    said[key] = value.strip('"')
    if said["material.E"] == "unknown":
        del said["ranges.E"]
    (here / "m.toml").write_text("\n".join(f'{k} = "{v}"' for k, v in said.items()), "utf-8")
    code, told = called("new", "mine", "--from", "m.mcap", "--answers", "m.toml")
    assert (code, why in told) == (2 if why else 0, True), told
    if not why:
        parameters = load_file(here / "experiments" / "mine.py").parameters
        assert parameters.scene.tracked[0].labels == ("A", "B", "C")


def test_images_alone_lead_to_an_experiment_by_what_was_noted(here: Path) -> None:
    ring = np.array([(0.01, 0.01), (0.03, 0.01), (0.03, 0.04), (0.01, 0.04)])
    t = T[::20]
    seen = Contours(t, tuple(ring for _ in t), 1e-5, np.eye(4), "image", images="us")
    frames = Frames(t, tuple(np.zeros((9, 9), np.uint8) for _ in t), (1e-3, 1e-3), np.eye(4), "i")
    write_recording(recording(frames={"us": frames}), here / "us.mcap")
    assert "validate outline" in called("new", "mine", "--from", "us.mcap", "--questions")[1]
    write_recording(recording(frames={"us": frames}, contours={"o": seen}), here / "o.mcap")
    said = {"body.shape": "block", "body.block": "40mm,30mm,50mm", "material.E": "20kPa",
            "material.nu": "0.3", "held.all": "zmin", "moved.by": "noted", "moved.place": "zmax",
            "moved.along": "-z", "moved.noted": "0, 1mm", "moved.sideways": "false",
            "seen.pose": "fitted", "seen.image_x": "+x", "seen.image_y": "+z",
            "accept.contour": "1mm", "ranges.E": "0", "ranges.nu": "0", "ranges.load": "5%",
            }  # fmt: skip
    (here / "o.toml").write_text("\n".join(f'{k} = "{v}"' for k, v in said.items()), "utf-8")
    code, told = called("new", "mine", "--from", "o.mcap", "--answers", "o.toml")
    assert (code, "not used" in told) == (0, False), told
    text = (here / "experiments" / "mine.py").read_text("utf-8")
    assert len(text.splitlines()) <= 60
    assert load_file(here / "experiments" / "mine.py").parameters.settings.noted == (0.0, 1e-3)


def test_questions_are_a_file_of_answers(here: Path) -> None:
    code, listing = called("new", "mine", "--from", "all.mcap", "--questions", "--answers",
                           "a.toml")  # fmt: skip
    assert code == 0
    (here / "again.toml").write_text(listing, "utf-8")
    assert called("new", "mine", "--from", "all.mcap", "--answers", "again.toml")[0] == 0
    bare = called("new", "other", "--from", "all.mcap", "--questions")[1]
    assert "# one of: plates, body" in bare
    assert not (here / "experiments" / "other.py").exists()


def test_markers_alone_and_a_mesh_of_ones_own(here: Path) -> None:
    write_mesh(box(SIZE, (2, 2, 2)), here / "body.npz")
    write_recording(recording(markers=markers()), here / "seen.mcap")
    (here / "a.toml").write_text(
        'law = "linear"\nbody = {shape = "file", file = "body.npz"}\n'
        'material = {E = "20kPa", nu = 0.3}\nheld = {all = "z0"}\n'
        'moved = {by = "markers", place = "z1", markers = "A,B,C"}\n'
        'seen = {layout = "as seen", still = 0.4}\naccept.marker = "0.2mm"\n'
        "ranges = {E = 0.05, nu = 0.01, load = 0.01}\n", "utf-8",
    )  # fmt: skip
    code, said = called("new", "mine", "--from", "seen.mcap", "--answers", "a.toml")
    assert code == 0, said
    text = (here / "experiments" / "mine.py").read_text("utf-8")
    assert "body=MeshFile(file='../body.npz', element='quadratic')," in text
    result = run_in_memory(load_file(here / "experiments" / "mine.py"), quick=True)
    assert [c.name for c in result.checks] == ["marker.max@low", "marker.max@high"]
    (here / "answers").mkdir()
    for name in ("../body.npz", str(here / "body.npz"), "link.npz"):
        (here / "answers" / "link.npz").unlink(missing_ok=True)
        (here / "answers" / "link.npz").symlink_to(here / "body.npz")
        text = (here / "a.toml").read_text("utf-8").replace('"body.npz"', f'"{name}"')
        (here / "answers" / "a.toml").write_text(text, "utf-8")
        code, said = called("new", "other", "--from", "seen.mcap", "--answers", "answers/a.toml")
        assert code == 2
        assert f"body.file: '{name[:60]}' is outside its folder 'answers'" in said


def test_outlines_without_a_pose_are_asked_where_they_lie(here: Path) -> None:
    ring = np.array([(0.01, 0.01), (0.03, 0.01), (0.03, 0.04), (0.01, 0.04)])
    contours = Contours(T[::20], tuple(ring for _ in T[::20]), 1e-5, np.eye(4), "image")
    write_recording(recording(signals=log(), contours={"o": contours}), here / "o.mcap")
    listing = called("new", "mine", "--from", "o.mcap", "--questions", "--answers", "a.toml")[1]
    assert 'seen.pose = ""' in listing
    assert (
        "# left out, as no question has this key: seen.layout, seen.still, accept.marker" in listing
    )
    assert "open: the recording does not answer it" in listing


def test_images_alone_lead_to_their_outlines(here: Path) -> None:
    frames = Frames(T[:2], (np.zeros((8, 8), np.uint8),) * 2, (1e-4, 1e-4), np.eye(4), "image")
    write_recording(recording(frames={"us": frames}), here / "us.mcap")
    code, said = called("new", "mine", "--from", "us.mcap")
    assert (code, "validate outline us.mcap -o outlined.mcap" in said) == (2, True)


def test_a_terminal_is_asked_until_it_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    def check(text: str) -> None:
        if text != "7":
            raise UsageError("it is seven")

    asks = [Question("n", "how many", open=True, check=check), Question("m", "more", "1", "rule")]
    replies = iter(["", "6", "7", "1"])
    monkeypatch.setattr(click, "prompt", lambda *_, **__: next(replies))
    assert answered(lambda _: asks, {}, terminal=True) == {"n": "7", "m": "1"}
    assert answered(lambda _: asks, {"n": "7"}, terminal=False) == {"n": "7", "m": "1"}
    assert 'm = "1"' in listed(lambda _: asks, {})


def test_a_file_of_answers_is_toml(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text("a = {b = [1, 2.5], c = true}", "utf-8")
    assert read_answers(file) == {"a.b": "1,2.5", "a.c": "true"}
    file.write_text("a = = 1", "utf-8")
    for path in (file, tmp_path / "none.toml"):
        with pytest.raises(UsageError):
            read_answers(path)


@pytest.mark.slow
def test_markers_that_the_layout_calls_otherwise_are_named(here: Path) -> None:
    """They were "0 names, 0 different ones" where none is called alike, and left out in silence."""
    head = "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n"
    head += "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"
    seen = markers()["m"]
    fifth = np.concatenate([seen.x, seen.x[:, :2].mean(axis=1, keepdims=True)], axis=1)
    five = replace(seen, names=(*seen.names, "E"), x=fifth)
    write_recording(recording(signals=log(), markers={"m": five}), here / "all.mcap")
    x = 1e3 * fifth[0]
    (here / "a.toml").write_text(PRESSED.replace("as seen", "own.fcsv"), "utf-8")

    def laid(names: str) -> None:
        rows = (
            f"1,{p[0]},{p[1]},{p[2]},0,0,0,1,1,1,0,{n},,\n" for n, p in zip(names, x, strict=True)
        )
        (here / "own.fcsv").write_text(head + "".join(rows), "utf-8")

    laid("abcde")
    called("new", "mine", "--from", "all.mcap", "--answers", "a.toml")
    experiment = load_file(here / "experiments" / "mine.py")
    with pytest.raises(RegistrationError, match=r"'a', 'b', 'c', 'd', 'e'.*'A'"):
        run_in_memory(experiment)
    laid("ABCDX")
    assert "markers not in the layout are left out: 'E'" in run_in_memory(experiment).notes


@pytest.mark.parametrize(("shape", "record", "answer"), [
    ("cylinder", {"diameter_m": "0.03", "height_m": "0.02"}, "30mm,20mm"),
    ("block", {"width_m": "0.04", "thickness_m": "0.03", "height_m": "0.05"}, "40mm,30mm,50mm"),
])  # fmt: skip
def test_sides_in_the_header_are_taken(
    here: Path, shape: str, record: dict[str, str], answer: str
) -> None:
    """They were asked for; one side alone is named in the question, which stays open."""
    write_recording(recording(signals=log(), metadata={"specimen": record}), here / "s.mcap")
    said = f'experiment = "body"\nbody.shape = "{shape}"\n'
    (here / "s.toml").write_text(said, "utf-8")
    arguments = ("new", "mine", "--from", "s.mcap", "--answers", "s.toml")
    assert f'body.{shape} = "{answer}"' in called(*arguments, "--questions")[1]
    assert f"body.{shape}" not in called(*arguments)[1]
    one = {"height_m": record["height_m"]}
    write_recording(recording(signals=log(), metadata={"specimen": one}), here / "s.mcap")
    assert f"body.{shape} (" in (open_ := called(*arguments)[1])
    assert f"the header gives height {1e3 * float(record['height_m']):g} mm" in open_
