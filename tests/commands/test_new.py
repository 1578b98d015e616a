"""`validate new`: the written file loads, runs, overwrites nothing and executes no data."""

import json
import os
from dataclasses import replace
from pathlib import Path
from shutil import copyfile
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

from validate.commands.main import cli, run
from validate.commands.questions.inclusion import INCLUSION
from validate.commands.questions.new import fitting
from validate.commands.questions.new import written as filled
from validate.compare.score import bias
from validate.errors import RecordingError
from validate.identify.modulus import ModulusFit
from validate.pipeline import run_in_memory
from validate.pipeline.experiment.find import load_file
from validate.pipeline.plates.scene import stated_sizes
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.types import Frames, Recording, Signal, Source
from validate.scene.geometries.box import box
from validate.scene.mesh_files.mesh_file import write_mesh

ROWS = np.arange(200)
DIAMETER, HEIGHT, E = 0.03, 0.02, 20e3


def log(name: str = "gel", **specimen: str) -> Recording:
    """A cylinder of 20 kPa between slipping plates to 8 % strain, load-cell noise 5 mN."""
    t, d = ROWS / 10, ROWS * 8e-6
    noise = np.random.default_rng(1).normal(0, 0.005, len(t))
    force = E * np.pi * DIAMETER**2 / 4 * d / HEIGHT + noise
    signals = {
        "displacement": Signal(t, d[:, None], "m", 0.0, "machine"),
        "force": Signal(t, force[:, None], "N", 0.005, "machine"),
    }
    return Recording(name, Source("x", "", 0, "x"), 0, signals=signals,
                     metadata={"specimen": {"test": "compression"} | specimen})  # fmt: skip


BLOCK = {"body.x": "0.06", "body.y": "0.045", "body.z": "0.07"}
SIZES = {"diameter_m": repr(DIAMETER), "height_m": repr(HEIGHT)}


def written(name: str, recording: Recording, source: str) -> str:
    return filled(name, recording, source, Path("experiments"), fitting(recording)[0], {})


def in_folder(folder: Path, *arguments: str) -> tuple[int, str]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        done = CliRunner().invoke(cli, list(arguments), standalone_mode=False)
    finally:
        os.chdir(before)
    if done.exception is not None:
        return 2, str(done.exception)
    return int(done.return_value or 0), done.output


def test_a_force_log_becomes_an_experiment_that_runs(tmp_path: Path) -> None:
    write_recording(log(**SIZES), tmp_path / "gel.mcap")
    assert in_folder(tmp_path, "new", "my_gel", "--from", "gel.mcap")[0] == 0
    listed = in_folder(tmp_path, "list", "my_gel", "--json")[1]
    paths = {p["path"]: p["default"] for p in json.loads(listed)["parameters"]}
    assert (paths["body.diameter"], paths["body.height"]) == (DIAMETER, HEIGHT)
    own = load_file(tmp_path / "experiments" / "my_gel.py")
    result = run_in_memory(own, {"body.cells": "4,3"})
    assert [(c.name, c.verdict) for c in result.checks] == [
        ("force.max@fit", "fitted"), ("force.max@beyond", "good enough"),
    ]  # fmt: skip
    values = {p.path: (p.default, p.origin) for p in result.parameters}
    assert values["material.E"] == (pytest.approx(E, rel=0.02), "identified")
    assert values["body.diameter"] == (DIAMETER, "recorded")
    assert values["limit"][1] == "entered"
    assert values["material.nu"] == (0.499, "entered")
    assert (result.passed, result.warnings) == (True, ())


@pytest.mark.slow
def test_verdicts_of_a_new_experiment_are_covered(tmp_path: Path) -> None:
    write_recording(log(**SIZES), tmp_path / "gel.mcap")
    in_folder(tmp_path, "new", "my_gel", "--from", "gel.mcap")
    code, output = in_folder(
        tmp_path, "study", "coverage", "my_gel", "--quick", "--workers", "0", "--json"
    )
    document = output[output.index("{\n") :]  # after lines of progress, where it takes longer
    found = {q["name"]: q for q in json.loads(document)["study"]["checks"]}
    assert found["force.max@fit"]["finding"] == "no evidence"  # it served to identify
    assert found["force.max@beyond"]["not_good_enough"]["number"] == 0
    assert code in (0, 1)


def test_sizes_that_nobody_measured_are_asked_for_by_line(tmp_path: Path) -> None:
    write_recording(log(), tmp_path / "gel.mcap")
    assert in_folder(tmp_path, "new", "bare", "--from", "gel.mcap")[0] == 0
    file = tmp_path / "experiments" / "bare.py"
    lines = file.read_text("utf-8").splitlines()
    places = {k: next(i for i, s in enumerate(lines, 1) if f" {k}=None," in s)
              for k in ("diameter", "height")}  # fmt: skip
    assert "ranges=CompressionRanges(E=0.05, diameter=0.005)" in "".join(lines)
    for command in (("run", "bare"), ("study", "tradeoff", "bare", "--quick", "--workers", "0")):
        code, message = in_folder(tmp_path, *command)
        assert code == 2
        assert "\n" not in message.strip()
        for name, line in places.items():
            at = str(Path("experiments") / "bare.py") + f":{line}: body.{name} (m) is not set"
            assert at in message
            assert f"--set body.{name}=VALUE" in message


@pytest.mark.slow
def test_a_part_of_the_sizes_is_enough_where_the_recording_says_the_rest(tmp_path: Path) -> None:
    write_recording(log(height_m=repr(HEIGHT)), tmp_path / "gel.mcap")
    in_folder(tmp_path, "new", "half", "--from", "gel.mcap")
    mine = load_file(tmp_path / "experiments" / "half.py")
    result = run_in_memory(mine, {"body.diameter": repr(DIAMETER), "body.height": "none"})
    found = {p.path: (p.default, p.origin) for p in result.parameters}
    assert found["body.diameter"] == (DIAMETER, "entered")
    assert found["body.height"] == (HEIGHT, "recorded")
    assert result.passed


@pytest.mark.slow
def test_metres_for_millimetres_are_warned_of_with_the_factor(tmp_path: Path) -> None:
    """What is identified follows the size, so that the checks agree all the same."""
    write_recording(log(**SIZES), tmp_path / "gel.mcap")
    in_folder(tmp_path, "new", "big", "--from", "gel.mcap")
    slip = ("--methods", "slip")
    code, output = in_folder(tmp_path, "run", "big", "--set", "body.diameter=30", "-v", *slip)
    assert code == 0
    assert "good enough" in output
    first = " ".join(output.partition("Checks of")[0].split())
    assert "body.diameter = 30 m is 1000 times 30 mm: check its unit" in first
    assert "material.E (identified) is a modulus of 0.02 Pa" in first
    assert "is a stress of" in first
    assert "was entered; the recording has 0.03 m, 1e+03 times" in first
    (folder,) = (tmp_path / "reports").glob("big+*")
    stored = json.loads((folder / "results.json").read_text("utf-8"))
    assert stored["parameters"]["body.diameter"] == {
        "value": 30.0, "unit": "m", "origin": "entered",
    }  # fmt: skip
    assert stored["parameters"]["material.E"]["origin"] == "identified"
    assert stored["sentence"].startswith("With warnings")
    page = (folder / "report.html").read_text("utf-8")
    assert 'class="band good"' not in page
    assert page.index("check its unit") < page.index("<nav")
    assert "identified" in page.split("Origin: recorded")[1]


@pytest.mark.slow
def test_each_rival_is_fitted_as_what_it_is(tmp_path: Path) -> None:
    """Bonded plates stiffen the body, so the modulus that has the measured slope is lower; given a
    modulus by the user, both take it."""
    write_recording(log(**SIZES), tmp_path / "gel.mcap")
    assert in_folder(tmp_path, "new", "my_gel", "--from", "gel.mcap")[0] == 0
    mine = load_file(tmp_path / "experiments" / "my_gel.py")
    fitted = run_in_memory(mine)
    off = {m.name: bias(m.residuals["force@fit"].values) for m in fitted.methods}
    assert off["bonded"] == pytest.approx(off["slip"], abs=0.02)
    moduli = {m.name: m.scene.material.E for m in fitted.methods}
    assert moduli["bonded"] < 0.95 * moduli["slip"]
    given = run_in_memory(mine, {"material.E": "20000"})
    assert {m.scene.material.E for m in given.methods} == {20000.0}


def test_it_names_channels_rates_units_and_what_is_not_recorded(tmp_path: Path) -> None:
    text = written("my_gel", log(), "../gel.mcap")
    assert "displacement: signal in m, sd 0; 200 in 19.9 s, 10 Hz" in text
    assert "diameter=None,  # m, not in the recording: measure it" in text
    sized = written("my_gel", log(**SIZES), "../gel.mcap")
    assert "height=0.02,  # m, recorded: in the header" in sized
    sides = written("g", log(area_m2="0.0004", height_m="0.02"), "../gel.mcap")
    assert "diameter=0.0225676,  # m, recorded: of the header's cross-section" in sides
    odd = written("g", log(diameter_m="-3", height_m="1e"), "../gel.mcap")
    assert odd.count("=None,  # m, not in the recording") == 2
    assert len(text.splitlines()) <= 60
    assert "$" not in text
    assert "TODO" not in text


def test_streams_that_are_not_used_are_named(tmp_path: Path) -> None:
    images = tuple(np.zeros((8, 8), np.uint8) for _ in range(2))
    frames = Frames(np.arange(2.0), images, (1e-4, 1e-4), np.eye(4), "image")
    write_recording(replace(log(**SIZES), frames={"camera": frames}), tmp_path / "gel.mcap")
    write_recording(log(**SIZES), tmp_path / "alone.mcap")
    _, said = in_folder(tmp_path, "new", "my_gel", "--from", "gel.mcap")
    assert "'camera' is not used by this experiment" in " ".join(said.split())
    assert "not used" not in in_folder(tmp_path, "new", "other", "--from", "alone.mcap")[1]


def test_logs_of_repeats_are_used_by_their_mean(tmp_path: Path) -> None:
    """Not one of them is named; what is no repeat still is."""
    whole = log(**SIZES)
    force, moved = whole.signals["force"], whole.signals["displacement"]
    kept = {"force": force, "displacement": moved, "force/sd": force, "force/A1": force,
            "displacement/A1": moved, "other/A1": force}  # fmt: skip
    repeated = replace(whole, signals=kept, metadata={**whole.metadata, "repeats": {"n": "2"}})
    write_recording(repeated, tmp_path / "all.mcap")
    _, said = in_folder(tmp_path, "new", "my_gel", "--from", "all.mcap")
    assert said.count("is not used by") == 1
    assert "'other/A1' is not used" in " ".join(said.split())


def test_nothing_is_overwritten_and_names_are_checked(tmp_path: Path) -> None:
    write_recording(log(), tmp_path / "gel.mcap")
    arguments = ("new", "mine", "--from", "gel.mcap", "-o", "mine.py")
    assert in_folder(tmp_path, *arguments)[0] == 0
    before = (tmp_path / "mine.py").read_bytes()
    code, message = in_folder(tmp_path, *arguments)
    assert (code, "exists; name another output" in message) == (2, True)
    assert (tmp_path / "mine.py").read_bytes() == before
    (tmp_path / "mine.py").write_text("x = 1")
    assert in_folder(tmp_path, *arguments, "--force")[0] == 0
    assert (tmp_path / "mine.py").read_bytes() == before
    for name in ("Mine", "json", "a-b", "../x"):
        assert in_folder(tmp_path, "new", name, "--from", "gel.mcap")[0] == 2
    assert "must have the experiment's name" in in_folder(tmp_path, *arguments[:-1], "other.py")[1]
    assert in_folder(tmp_path, "list", "mine.py")[0] == 0


def test_a_recordings_texts_are_never_code(tmp_path: Path) -> None:
    evil = '"""\nimport os\x00\nos.abort()\n"""\\'
    bad = log(evil)
    bad = replace(
        bad,
        signals={**bad.signals, evil: bad.signals["force"]},
        metadata={**bad.metadata, evil: {evil: evil}},
    )
    write_recording(bad, tmp_path / "gel.mcap")
    assert in_folder(tmp_path, "new", "mine", "--from", "gel.mcap", "-o", "mine.py")[0] == 0
    text = (tmp_path / "mine.py").read_text("utf-8")
    assert all(line.lstrip().startswith("#") or "title" in line or '"""' in line
               for line in text.splitlines() if "os.abort" in line)  # fmt: skip
    assert in_folder(tmp_path, "list", "mine.py")[0] == 0


def test_other_recordings_are_refused_with_what_they_hold(tmp_path: Path) -> None:
    lone = replace(log(), signals={"pressure": replace(log().signals["force"], unit="Pa")})
    write_recording(lone, tmp_path / "p.mcap")
    code, message = in_folder(tmp_path, "new", "mine", "--from", "p.mcap")
    assert code == 2
    assert "holds ['pressure']" in message
    assert not (tmp_path / "experiments").exists()
    assert run(["new", "mine", "--from", str(tmp_path / "absent.mcap")]) == 2


def test_a_test_in_tension_is_not_pressed() -> None:
    with pytest.raises(RecordingError, match=r"tension, .* --map test=compression"):
        ModulusFit.of(log(test="tension", **SIZES))


def test_a_test_in_tension_becomes_an_experiment_that_pulls(tmp_path: Path) -> None:
    """Imported logs have compression positive; free ends: the modulus is that of the bar."""
    pulled = log(test="tension", **SIZES)
    turned = {k: replace(s, y=-s.y) for k, s in pulled.signals.items()}
    write_recording(replace(pulled, signals=turned), tmp_path / "gel.mcap")
    assert in_folder(tmp_path, "new", "strip", "--from", "gel.mcap")[0] == 0
    text = (tmp_path / "experiments" / "strip.py").read_text("utf-8")
    assert 'drives=(Drive("stage", "upper_plate", "+z"),),  # tension, recorded' in text
    assert 'Method("linear, gripped ends", NoFluid(), BONDED_PLATES)' in text
    mine = load_file(tmp_path / "experiments" / "strip.py")
    result = run_in_memory(mine, {"body.cells": "4,3"})
    assert [c.verdict for c in result.checks] == ["fitted", "good enough"]
    assert any("by bonded for grips" in note for note in result.notes)
    found = {p.path: p.default for p in result.parameters}
    assert found["material.E"] == pytest.approx(E, rel=0.02)
    (slip,) = [m for m in result.methods if m.name == "slip"]
    tops = slip.scene.mesh.facet_nodes("upper_plate")
    assert slip.runs[0].u[-1][tops, 2].mean() > 0
    with pytest.raises(RecordingError, match="one in compression: its drive is along"):
        run_in_memory(mine, {"drives.stage.direction": "0,0,-1"})


def test_what_presses_is_asked_where_nothing_says_it(tmp_path: Path) -> None:
    """It was taken as compression."""
    write_recording(log(test="", **SIZES), tmp_path / "gel.mcap")
    code, said = in_folder(tmp_path, "new", "a", "--from", "gel.mcap")
    assert (code, "whether the test presses or pulls" in said) == (2, True)
    assert not (tmp_path / "experiments" / "a.py").exists()
    told = 'test = "tension"\naccept.force = "40mN"\n'
    (tmp_path / "a.toml").write_text(f'{told}why.force = "felt"\n', "utf-8")
    arguments = ("new", "b", "--from", "gel.mcap", "--answers", "a.toml")
    assert in_folder(tmp_path, *arguments)[0] == 0
    text = (tmp_path / "experiments" / "b.py").read_text("utf-8")
    assert '"upper_plate", "+z"),),  # tension, answered' in text
    assert """Accept("force", 0.04, 'felt')""" in text
    (tmp_path / "a.toml").write_text(told, "utf-8")
    assert in_folder(tmp_path, "new", "c", *arguments[2:])[0] == 0
    (bare,) = load_file(tmp_path / "experiments" / "c.py").accept
    assert bare.required is None  # a limit without a reason is no requirement


@pytest.mark.parametrize(("test", "sides", "area"), [
    ("tension", {"width": 0.01, "thickness": 0.003, "length": 0.05}, 3e-5),
    ("tension", {"width": 0.01, "length": 0.05}, None),
    ("tension", {"thickness": 0.003, "height": 0.05}, None),
    ("compression", {"width": 0.02, "length": 0.03, "height": 0.01}, 6e-4),
    ("compression", {"width": 0.02, "length": 0.03, "thickness": 0.01}, None),
    ("compression", {"width": 0.02, "thickness": 0.01}, None),
])  # fmt: skip
def test_a_cross_section_is_taken_from_sides_that_tell_it_alone(
    test: str, sides: dict[str, float], area: float | None
) -> None:
    """A slab's width and thickness were its area, and so were a strip's width and length."""
    said = {f"{name}_m": repr(value) for name, value in sides.items()}
    found = stated_sizes(log(test=test, **said)).get("body.diameter")
    assert found == (None if area is None else pytest.approx(2 * np.sqrt(area / np.pi)))


def test_the_header_s_lengths_stand_beside_the_question_for_a_size(tmp_path: Path) -> None:
    said = {"width_m": "0.02", "thickness_m": "0.01"}
    write_recording(log(**said), tmp_path / "gel.mcap")
    _, listed = in_folder(tmp_path, "new", "a", "--from", "gel.mcap", "--questions")
    assert listed.count("; the header gives width 20 mm, thickness 10 mm, in m or as") == 2


def test_several_lengths_of_a_strip_are_shown_and_none_is_taken(tmp_path: Path) -> None:
    """A header with the length between grips and that of the gauge was refused."""
    top = "Zugversuch\nEinspannlänge;100;mm\nMesslänge;50;mm\nBreite;10;mm\nDicke;2;mm\n"
    rows = "".join(f"{i / 10};{i / 100};{i / 20}\n" for i in range(50))
    (tmp_path / "z.csv").write_text(f"{top}Zeit (s);Weg (mm);Kraft (N)\n{rows}", "utf-8")
    assert in_folder(tmp_path, "import", "z.csv", "-o", "z.mcap")[0] == 0
    _, listed = in_folder(tmp_path, "new", "a", "--from", "z.mcap", "--questions")
    assert "the header gives width 10 mm, thickness 2 mm, Einspannlänge 100 mm, Messlä" in listed
    assert "body.diameter" not in listed


def test_an_answered_height_decides_what_is_judged_and_accepted(tmp_path: Path) -> None:
    """To 1.6 mm of 40 mm: the limit is within 4 % strain, and no tenth of the largest force of the
    log stands as an answer before the height is known."""
    write_recording(log(diameter_m=repr(DIAMETER)), tmp_path / "gel.mcap")
    arguments = ("new", "a", "--from", "gel.mcap")
    assert '\naccept.force = ""' in in_folder(tmp_path, *arguments, "--questions")[1]
    answers = tmp_path / "a.toml"
    asked = (*arguments, "--answers", "a.toml")
    answers.write_text('body.height = "high"', "utf-8")
    assert in_folder(tmp_path, *asked, "--questions")[1].startswith("body.height = high: ")
    answers.write_text('body.height = "40mm"', "utf-8")
    assert (
        "a tenth of the force at the strain limit, ass"
        in in_folder(tmp_path, *asked, "--questions")[1]
    )
    assert in_folder(tmp_path, *asked)[0] == 0
    text = (tmp_path / "experiments" / "a.py").read_text("utf-8")
    assert "limit=0.0358," in text
    assert "a tenth of the force at the strain limit'" in text


def test_the_file_of_an_inclusion_is_short(project_root: Path) -> None:
    recording = read_recording(project_root / "recordings" / "fluid_phantom.mcap")
    assert len(written("mine", recording, "../x.mcap").splitlines()) <= 60


def test_outlines_stage_and_markers_become_an_experiment(
    tmp_path: Path, project_root: Path
) -> None:
    source = project_root / "recordings" / "fluid_phantom.mcap"
    assert in_folder(tmp_path, "new", "mine", "--from", str(source))[0] == 0
    listed = json.loads(in_folder(tmp_path, "list", "mine", "--json")[1])
    defaults = {p["path"]: p["default"] for p in listed["parameters"]}
    assert defaults["loads"] == [0.003, 0.006, 0.009]
    assert [defaults[f"body.{axis}"] for axis in "xyz"] == [None] * 3
    code, message = in_folder(tmp_path, "run", "mine")
    assert (code, message.count("(m) is not set"), message.count("mine.py:")) == (2, 3, 3)
    coarse = BLOCK | {"body.cells": "6,7,10"}
    mine = load_file(tmp_path / "experiments" / "mine.py")
    assert mine.declared_kind == "twin"  # as the recording says of itself
    result = run_in_memory(mine, coarse, methods=("p1_fluid", "p1_dry"))
    rms = {m.name: {s.name: s.value for s in m.scores} for m in result.methods}
    assert rms["p1_fluid"]["contour.rms@9mm"] < rms["p1_dry"]["contour.rms@9mm"] < 0.6e-3


@pytest.mark.slow
def test_the_phantoms_experiment_agrees_as_written(tmp_path: Path, project_root: Path) -> None:
    source = project_root / "recordings" / "fluid_phantom.mcap"
    in_folder(tmp_path, "new", "mine", "--from", str(source))
    sizes = [part for path, value in BLOCK.items() for part in ("--set", f"{path}={value}")]
    code, output = in_folder(tmp_path, "run", "mine", *sizes)
    assert code == 0, output
    assert "9 of 9 requirements are met" in " ".join(output.split())


@pytest.mark.slow
def test_a_mesh_file_is_a_body_too(tmp_path: Path) -> None:
    """A block of the cylinder's area between slipping plates: the same force, by statics."""
    side = float(np.sqrt(np.pi) * DIAMETER / 2)
    block = box((side, side, HEIGHT), (2, 2, 2))
    named = {"lower_plate": block.facets["z0"], "upper_plate": block.facets["z1"]}
    write_mesh(replace(block, facets=named), tmp_path / "body.npz")
    write_recording(log(**SIZES), tmp_path / "gel.mcap")
    (tmp_path / "a.toml").write_text('body.file = "body.npz"', "utf-8")
    asked = ("new", "my_gel", "--from", "gel.mcap", "--answers", "a.toml")
    assert in_folder(tmp_path, *asked)[0] == 0
    mine = load_file(tmp_path / "experiments" / "my_gel.py")
    result = run_in_memory(mine)
    assert [c.verdict for c in result.checks] == ["fitted", "good enough"]
    assert result.methods[0].scene.copies == 1


def test_two_records_make_an_inclusions_experiment() -> None:
    """Outlines, markers, a length that drives; no other record is needed."""
    stage, records = SimpleNamespace(unit="m"), {"marker_layout": {}, "inclusion": {}}
    seen = SimpleNamespace(
        name="x", signals={"stage": stage}, metadata=records, contours={"o": 1}, markers={"m": 1},
        frames={},
    )  # fmt: skip
    assert INCLUSION.fits(seen)  # type: ignore[arg-type]
    del records["inclusion"]
    assert not INCLUSION.fits(seen)  # type: ignore[arg-type]
    assert "records 'inclusion' and 'marker_layout'" in INCLUSION.needs


def test_a_prediction_of_a_few_samples_is_no_evidence(tmp_path: Path) -> None:
    write_recording(log(**SIZES), tmp_path / "gel.mcap")
    in_folder(tmp_path, "new", "sliver", "--from", "gel.mcap")
    sets = ("--set", "fit_to=0.05", "--set", "limit=0.0502")
    code, output = in_folder(tmp_path, "run", "sliver", *sets, "--methods", "slip", "--quick")
    assert code == 2
    assert "window 'beyond'" in output
    assert "10 are needed to check a prediction" in output


def test_the_kind_may_be_answered_where_the_recording_leaves_no_choice(
    tmp_path: Path, project_root: Path
) -> None:
    copyfile(project_root / "recordings" / "kf_cube.mcap", tmp_path / "cube.mcap")
    (kind,) = (k.name for k in fitting(read_recording(tmp_path / "cube.mcap")))
    asked = ("new", "a", "--from", "cube.mcap", "--questions", "--answers", "a.toml")
    (tmp_path / "a.toml").write_text(f'experiment = "{kind}"', "utf-8")
    listed = in_folder(tmp_path, *asked)
    assert listed[0] == 0
    assert "left out" not in listed[1]
    (tmp_path / "a.toml").write_text('experiment = "inclusion"', "utf-8")
    assert f"fits {kind} only" in in_folder(tmp_path, *asked)[1]
