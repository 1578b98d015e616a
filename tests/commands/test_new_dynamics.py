"""`validate new` of bodies that move in time, on another code's recordings.

The recordings are those of `benchmarks/moving_bodies.py`.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from benchmarks import moving_bodies
from validate.commands.check import described
from validate.commands.main import cli
from validate.commands.questions import motion
from validate.commands.questions.motion import damping, held
from validate.compare.result import Result
from validate.engine.cell import Where
from validate.errors import RegistrationError, UsageError
from validate.parameters import with_given
from validate.pipeline import run_in_memory
from validate.pipeline.bodies.choices import BodyRanges, MeasuredBody
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.options import folder_of
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.case_solution import solve
from validate.pipeline.run.method_run import MAIN, MethodRun
from validate.recording.mcap.write import write_recording
from validate.recording.readers import read_recording
from validate.recording.types import Recording, Source
from validate.register.markers.markers import MarkerObservation
from validate.scene.geometries.box import box
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.mesh_files.mesh_file import write_mesh
from validate.scene.scene import Scene
from validate.study.filters.study import study

# private: _first, _scene: called alone, and replaced to count its calls.


def called(*arguments: str) -> tuple[int, str]:
    done = CliRunner().invoke(cli, list(arguments), standalone_mode=False)
    if done.exception is not None:
        return 2, str(done.exception)
    return int(done.return_value or 0), done.output


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("moving")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(moving_bodies, "bricks", cache(moving_bodies.bricks))
        for name in moving_bodies.NAMES:
            moving_bodies.written(name, folder)
    return folder


@pytest.fixture
def here(made: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One folder for all: each test writes its answers and its experiment anew."""
    monkeypatch.chdir(made)
    return made


def new(here: Path, name: str, *changes: tuple[str, str]) -> tuple[int, str]:
    """`validate new` with the answers of the benchmark, some texts of them replaced."""
    text = (here / f"{name}.toml").read_text("utf-8")
    for old, other in changes:
        assert old in text
        text = text.replace(old, other)
    (here / "a.toml").write_text(text, "utf-8")
    return called("new", "mine", "--from", f"{name}.mcap", "--answers", "a.toml", "--force")


def experiment(here: Path) -> Experiment:
    return load_file(here / "experiments" / "mine.py")


def run(of: Experiment, method: str) -> MethodRun:
    recordings = of.load(of.parameters, folder_of(of))
    return solve(of, recordings, method, of.methods[method], of.parameters)


@dataclass(frozen=True, eq=False)
class Unchanged:
    """The experiment of the benchmark's own answers, and its runs by method."""

    mine: Experiment
    lines: int
    run: Callable[[str], MethodRun]


@pytest.fixture(scope="module")
def unchanged(made: Path) -> Callable[[str], Unchanged]:
    """Made once, for tests that change no answer."""

    @cache
    def of(name: str) -> Unchanged:
        with contextlib.chdir(made):
            code, said = new(made, name)
            assert code == 0, said
            lines = len((made / "experiments" / "mine.py").read_text("utf-8").splitlines())
            mine = experiment(made)
        return Unchanged(mine, lines, cache(partial(run, mine)))

    return of


def off(followed: MethodRun) -> float:
    """Rms m of the markers' residuals, per axis."""
    values = [r.values for r in followed.residuals.values()]
    return float(np.sqrt(np.mean(np.concatenate(values) ** 2)))


STATIC = ('how = "dynamic", damping = "0.003s"', 'how = "static"')


@pytest.mark.parametrize(("name", "within", "still"), [("swinging", 1e-4, 5e-4),
                                                       ("pushed", 1e-4, 5e-4)])  # fmt: skip
def test_answers_make_a_motion_that_is_another_codes(
    unchanged: Callable[[str], Unchanged], name: str, within: float, still: float
) -> None:
    """Within a tenth of what statics is off by; the file is short and has the methods."""
    made = unchanged(name)
    assert made.lines <= 60
    names = {"implicit", "modal", "explicit", "static", "reduced_kf", "roukf"}
    assert set(made.mine.methods) >= names
    assert off(made.run("implicit")) < within
    assert off(made.run("modal")) < within
    assert off(made.run("static")) > still
    filtered = made.run("reduced_kf")
    assert filtered.run.finished
    assert off(filtered) < within


def test_a_pressure_over_time_moves_the_wall_of_a_chamber(here: Path) -> None:
    """Within the noise of the markers, 20 um."""
    assert new(here, "chamber")[0] == 0
    mine = experiment(here)
    assert off(run(mine, "implicit")) < 2.5e-5
    text = (here / "experiments" / "mine.py").read_text("utf-8")
    assert len(text.splitlines()) <= 60
    assert "loads=(Pressure(name='pressure', facets='inner'),)," in text


def test_a_film_of_a_motion_is_compared_and_given_to_filters(
    unchanged: Callable[[str], Unchanged],
) -> None:
    """Outlines at 20 Hz with 40 um of noise, one marker: the outline is within its noise, and the
    marker, which no filter is given, is where a filter of the outline says; statics is off."""
    made = unchanged("filmed")
    assert made.lines <= 60
    assert made.mine.methods["reduced_kf"].markers == ("outline",)
    found = made.run("implicit").residuals
    assert set(found) >= {"contour@film", "side@all"}
    assert np.sqrt(np.mean(found["contour@film"].values ** 2)) < 6e-5
    assert np.sqrt(np.mean(made.run("static").residuals["contour@film"].values ** 2)) > 5e-4
    filtered = made.run("reduced_kf")
    assert filtered.run.finished
    assert {"innovation.outline.0", "innovation.outline.23"} <= set(filtered.run.traces)
    assert np.sqrt(np.mean(filtered.residuals["side@all"].values ** 2)) < 1e-4


def test_filters_of_an_outline_are_ranked_at_the_marker(
    unchanged: Callable[[str], Unchanged], tmp_path: Path
) -> None:
    """Beside plain FEM and the outline's last places held."""
    mine = unchanged("filmed").mine
    found = study(mine, methods=("reduced_kf", "modal"), out=tmp_path, where=Where(workers=0))
    (ranking,) = found.rankings
    names = [r.cell.name for r in ranking.rows]
    assert names == ["reduced_kf", "modal", "last measurement, held"]
    assert {w.name for w in ranking.rows[0].result.withheld} == {"outline", "side"}
    assert not ranking.failed


@pytest.mark.slow
def test_of_three_markers_filters_are_given_two_and_each_is_held_out(
    unchanged: Callable[[str], Unchanged], tmp_path: Path
) -> None:
    """The tip moves most and is predicted; the filter beats the last measurement held."""
    mine = unchanged("swinging").mine
    assert mine.methods["reduced_kf"].markers == ("side", "middle")
    found = study(
        mine, methods=("reduced_kf", "modal"), hold_out=("each",), out=tmp_path,
        where=Where(workers=0),
    )  # fmt: skip
    (ranking,) = found.rankings
    assert (found.by, ranking.failed, found.plan.single_words) == ("held_out.rmse", (), "")
    errors = {r.cell.name: r for r in ranking.rows}
    for r in ranking.rows:
        held = {w.name for w in r.result.withheld if not w.ahead}
        assert held == {"tip", "middle", "side"}, r.cell.name
    assert errors["reduced_kf"].score.mean < errors["last measurement, held"].score.mean / 10


def test_an_answer_names_the_markers_that_filters_are_given(here: Path) -> None:
    start = 'motion = {how = "dynamic"'
    one = (start, f'filters.markers = "tip"\n{start}')
    assert new(here, "swinging", one)[0] == 0
    assert experiment(here).methods["roukf"].markers == ("tip",)
    code, said = new(here, "swinging", (start, f'filters.markers = "tip,end"\n{start}'))
    assert (code, "no marker end; there are tip, middle, side" in said) == (2, True), said


@pytest.mark.slow
@pytest.mark.parametrize(("law", "names"), [
    ("linear", "implicit,ensemble_kf,filterpy,modal"),
    ("neo_hooke", "large,static,modal"),
])  # fmt: skip
def test_methods_are_chosen(here: Path, law: str, names: str) -> None:
    """Each runs; its markers are within a millimetre, of a motion of 3.9 mm."""
    start = 'motion = {how = "dynamic"'
    chosen = (start, f'methods = "{names}"\n{start}')
    code, said = new(here, "pushed", chosen, ('law = "linear"', f'law = "{law}"'))
    assert code == 0, said
    mine = experiment(here)
    assert set(mine.methods) == set(names.split(","))
    short = replace(mine, parameters=with_given(mine.parameters, {"motion.length": 0.05}))
    for name in names.split(","):
        found = run(short, name)
        assert found.run.finished, name
        assert off(found) < 1e-3, name


@pytest.mark.parametrize(("law", "names", "damping"), [
    ("neo_hooke", "large,reduced_ekf,modal", "0s"),
    ("linear", "implicit,load_scale,modal", "0.5s"),  # it creeps
])  # fmt: skip
def test_filters_of_a_mesh_file_run(here: Path, law: str, names: str, damping: str) -> None:
    """They were offered, but none had ever run: the cells' dilatation had no explicit form."""
    write_mesh(box((0.12, 0.02, 0.02), (6, 1, 1)), here / "bar.npz")
    block = 'body = {shape = "block", block = "120mm,20mm,20mm"}'
    code, said = new(
        here, "pushed", (block, 'body = {shape = "file", file = "bar.npz"}'),
        ("motion = {", f'methods = "{names}"\nmotion = {{'), ('law = "linear"', f'law = "{law}"'),
        ('damping = "0.003s"', f'damping = "{damping}"'),
    )  # fmt: skip
    assert code == 0, said
    mine = experiment(here)
    assert set(mine.methods) == set(names.split(","))
    short = replace(mine, parameters=with_given(mine.parameters, {"motion.length": 0.05}))
    for name in names.split(","):
        assert run(short, name).run.finished, name


def test_a_method_that_does_not_fit_is_refused(here: Path) -> None:
    start = 'motion = {how = "dynamic"'
    for names, why in (("implicit,reduced_ekf", "no method reduced_ekf fits; choose of implicit"),
                       ("implicit,load_scale", "no method load_scale fits"),  # it swings
                       ("static,modal", "'implicit' is missing")):  # fmt: skip
        code, said = new(here, "pushed", (start, f'methods = "{names}"\n{start}'))
        assert (code, why in said) == (2, True), said


def test_the_release_starts_the_clock_and_the_axis_is_that_of_the_swing(
    unchanged: Callable[[str], Unchanged],
) -> None:
    mine = unchanged("swinging").mine
    recordings = mine.load(mine.parameters, folder_of(mine))
    assert mine.follows(mine, recordings, mine.parameters).axis == "z"
    followed = unchanged("swinging").run("modal")
    markers = followed.seen.of(MarkerObservation)[0]
    assert len(markers.t) == 350  # samples after 0.25 s of 2 s, at 200 Hz
    assert markers.sd_t == pytest.approx(0.005 / np.sqrt(12))


def test_what_rings_is_proposed_as_dynamic_and_its_questions_are_open(here: Path) -> None:
    code, said = new(here, "pushed", ('motion = {how = "dynamic", damping = "0.003s"}\n', ""))
    assert code == 2
    assert "motion.damping (damping: stiffness-proportional" in said
    listing = called("new", "mine", "--from", "pushed.mcap", "--answers", "a.toml", "--questions")
    assert 'motion.how = "dynamic"' in listing[1]
    assert "first mode of the body at 2.86 Hz (with an assumed density of 1000" in listing[1]
    assert "inertia matters above 0.33 of it" in listing[1]


@pytest.mark.parametrize(("change", "why"), [
    (('held = "0.015N"', 'held = "0.015"'), "expected a force, as 0.2N, or a displacement, as 5mm"),
    (('damping = "0.003s"', 'damping = "heavy"'), "motion.damping = heavy"),
    (STATIC, "motion.how = static: a release is a motion in time"),
])  # fmt: skip
def test_wrong_answers_are_named(here: Path, change: tuple[str, str], why: str) -> None:
    changes = [change]
    if change is STATIC:
        changes += [(', rho = "0.2%", damping = "2%"', ""), (", rho = 1050", ""),
                    (', held = "0.015N"', "")]  # fmt: skip
    code, said = new(here, "swinging", *changes)
    assert (code, why in said) == (2, True), said


def test_answers_on_damping_and_release_are_parameters() -> None:
    assert damping("3ms") == ("material.stiffness_damping", "3ms")
    assert damping("0.03") == ("motion.damping_ratio", "0.03")
    assert held("5mm") == ("motion.held_displacement", "5mm")
    with pytest.raises(UsageError):
        held("5")


def test_a_release_from_a_displacement_is_one_from_its_force(
    here: Path, unchanged: Callable[[str], Unchanged]
) -> None:
    """The end of the beam hangs by 3.87 mm under the 15 mN of the benchmark's coarser mesh."""
    by_force = unchanged("swinging").run("modal")
    sag = -by_force.seen.inputs[0, 0]
    assert sag == pytest.approx(0.015)
    new(here, "swinging", ('held = "0.015N"', 'held = "3.87mm"'))
    found = -run(experiment(here), "modal").seen.inputs[0, 0]
    assert found == pytest.approx(0.015, rel=0.02)


def test_a_damping_ratio_is_that_of_the_first_mode(here: Path) -> None:
    """beta = 2 zeta / w: the benchmark's 3 ms are 2.64 % of critical at 2.8 Hz."""
    new(here, "swinging", ('damping = "0.003s"', 'damping = "0.0264"'))
    mine = experiment(here)
    assert mine.parameters.settings.motion.damping_ratio == 0.0264
    scene = run(mine, "modal").body
    assert scene.material.stiffness_damping == pytest.approx(3e-3, rel=0.01)


def test_identified_damping_is_fitted_and_only_later_is_evidence(here: Path) -> None:
    fitted = ('damping = "0.003s"', 'damping = "identified", fit_window = "1.2s"')
    assert new(here, "swinging", fitted, (', damping = "2%"', ""))[0] == 0
    mine = experiment(here)
    recordings = mine.load(mine.parameters, folder_of(mine))
    assert mine.identify is not None
    found = mine.identify(recordings, mine.parameters, mine.methods)
    assert found.parameters.scene.material.stiffness_damping == pytest.approx(3e-3, rel=0.05)
    assert found.calibrated == ("tip@first", "middle@first", "side@first")
    assert "identified, not predicted" in " ".join(found.notes)
    labels = {s.label: len(s.t) for s in run(mine, "static").seen.selections if s.t is not None}
    assert labels == {"first": 240, "later": 110}


def test_an_assumed_density_is_said_where_it_makes_a_frequency(here: Path) -> None:
    """Statics asks for none: 1000 kg/m3 in place of the true 1050."""
    changes = (STATIC, (', rho = "0.2%", damping = "2%"', ""), (", rho = 1050", ""))
    assert new(here, "pushed", *changes)[0] == 0
    words = "first mode of the body at 2.86 Hz (with an assumed density of 1000 kg/m3, near that"
    listing = called("new", "mine", "--from", "pushed.mcap", "--answers", "a.toml", "--questions")
    assert words in listing[1]
    mine = experiment(here)
    recordings = mine.load(mine.parameters, folder_of(mine))
    assert mine.identify is not None
    assert words in mine.identify(recordings, mine.parameters, mine.methods).headline
    assert "of the body: 2.86, 2.86, 14.9 Hz (with an assumed density" in described(mine)[-1]
    p = with_given(mine.parameters, {"material.rho": 1050.0})
    assert "assumed" not in "".join(described(replace(mine, parameters=p)))


def test_millimetres_declared_as_metres_are_doubted_with_the_command(here: Path) -> None:
    """`new` and `run` name the factor, and the command makes a recording that is good."""
    true = read_recording(here / "pushed.mcap")
    wide = true.markers["markers"]
    wide = replace(wide, x=1000 * wide.x, sd=1000 * wide.sd)
    write_recording(replace(true, markers={"markers": wide}), here / "wide.mcap")
    (here / "wide.toml").write_bytes((here / "pushed.toml").read_bytes())
    code, said = new(here, "wide")
    assert code == 0
    doubt = "markers span 60 m, the body is 0.12 m: mm declared as m, a factor 1000? `validate "
    assert f"{doubt}import wide.mcap --map unit=mm -o NEW.mcap`" in said
    with pytest.raises(RegistrationError, match=r"'tip' by 121938.* a factor 1000") as refused:
        run(experiment(here), "modal")
    assert "stalks" not in str(refused.value)
    assert called("import", "wide.mcap", "--map", "unit=mm", "-o", "narrow.mcap")[0] == 0
    narrow = read_recording(here / "narrow.mcap")
    np.testing.assert_allclose(narrow.markers["markers"].x, true.markers["markers"].x, atol=1e-12)
    assert narrow.metadata["taken_as"] == {"markers": "declared in m, taken as mm"}


def judged(result: Result) -> set[tuple[str, str]]:
    return {(c.validation, c.acceptance) for c in result.checks}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["swinging", "pushed", "chamber"])
def test_true_constants_are_good_enough(here: Path, name: str) -> None:
    new(here, name)
    result = run_in_memory(experiment(here))
    assert judged(result) == {("not distinguishable", "good enough")}
    assert result.sentence.startswith("dynamic: recorded motion mostly at")
    assert not [e for e in result.exhibits if e.anchor == "likely-causes"]


@pytest.mark.slow
def test_statics_of_a_pushed_beam_names_inertia_first(here: Path) -> None:
    new(here, "pushed", STATIC, (', rho = "0.2%", damping = "2%"', ""), (", rho = 1050", ""))
    result = run_in_memory(experiment(here))
    assert ("differs", "not good enough") in judged(result)
    assert "statics, although inertia matters" in result.sentence
    assert "Likely causes, in order: inertia" in result.sentence
    assert any("answer motion.how = dynamic" in w for w in result.warnings)


@pytest.mark.slow
def test_a_wrong_modulus_is_named_by_its_frequency(here: Path) -> None:
    new(here, "swinging", ("E = 165000", "E = 250000"))
    result = run_in_memory(experiment(here))
    assert "Likely causes, in order: " in result.sentence
    causes = next(e for e in result.exhibits if e.anchor == "likely-causes").tables[0].rows
    assert {str(row[3]) for row in causes} >= {"modulus or density"}


@pytest.mark.slow
def test_large_strain_agrees_where_strains_are_small(here: Path) -> None:
    new(here, "swinging", ('law = "linear"', 'law = "neo_hooke"'))
    mine = experiment(here)
    assert mine.accepted == ("large",)
    period = replace(mine, parameters=with_given(mine.parameters, {"motion.length": 0.4}))
    assert off(run(period, "large")) < 1.5e-4


@pytest.mark.slow
def test_statics_of_a_film_alone_names_inertia_first(here: Path) -> None:
    """No marker is judged: the outline's motion has causes, too."""
    changes = (
        STATIC, (', rho = "0.2%", damping = "2%"', ""), (", rho = 1050", ""),
        ('layout = "as seen", still = "0.2s"', 'markers = "none"'), (', marker = "0.5mm"', ""),
        (', marker = "a fifteenth of the swing, peak to peak"', ""),
    )  # fmt: skip
    assert new(here, "filmed", *changes)[0] == 0
    result = run_in_memory(experiment(here))
    assert "Likely causes, in order: inertia" in result.sentence
    causes = next(e for e in result.exhibits if e.anchor == "likely-causes").tables[0]
    assert {row[1] for row in causes.rows} == {"outline"}


def test_a_report_has_one_largest_motion_and_says_where_it_rests(
    unchanged: Callable[[str], Unchanged],
) -> None:
    """Note and exhibit are of the whole recording, which begins at rest and ends in motion."""
    mine = unchanged("pushed").mine
    recordings = mine.load(mine.parameters, folder_of(mine))
    assert mine.identify is not None
    (note,) = mine.identify(recordings, mine.parameters, mine.methods).notes
    followed = mine.follows(mine, recordings, mine.parameters)
    cases = {MAIN: {"modal": unchanged("pushed").run("modal")}}
    (shown,) = followed.exhibits(mine.parameters, cases, lambda *_: None).exhibits
    facts = {row[0]: row for row in shown.tables[0].rows}
    largest = facts["largest motion, peak to peak"][1]
    assert f"{largest:.3g} mm peak to peak" in note
    for words in (note, facts["rests until"][3]):
        assert "at rest until 0.265 s, not at rest at the end" in words
    assert [s.label for s in shown.charts[0].series] == ["measured", mine.methods["modal"].label]


def test_a_first_frequency_is_computed_once_for_a_recording_and_a_body(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Questions are listed again and again; ranges change no frequency, another recording does."""
    solved: list[object] = []
    monkeypatch.setattr(motion, "_scene", lambda recording, *_: solved.append(recording))
    monkeypatch.setattr(motion, "first_frequencies", lambda *_: (3.0,))
    monkeypatch.setattr(motion, "unknowns_of", lambda *_: 10)
    scene = Scene(Box((0.1, 0.02, 0.02), (5, 1, 1), "hex27"), Material(1e5, 0.45))
    body = Tree("none.mcap", scene, MeasuredBody())
    source = Source("x", "", 0, "x")
    one, other = (Recording("log", source, 0) for _ in range(2))
    wider = replace(body, settings=MeasuredBody(ranges=BodyRanges(E=0.5)))
    for recording, of in ((one, body), (one, wider), (other, body), (one, body)):
        assert motion._first(recording, of, Path()) == 3.0
    assert [r is one for r in solved] == [True, False]
