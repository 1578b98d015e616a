"""What calibrates: declared with bounds and a source, kept apart from what validates."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibrating import NU, OPEN, OPENED, E, Sensed, known
from command_line import here

from validate.compare.result import Result
from validate.compare.verdict import Accept
from validate.errors import ComparisonError, UsageError
from validate.pipeline.bodies.own_body import own_body
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Input, Uncertainty, vary
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.experiment.variation import change_of
from validate.pipeline.run.cached_runs import rests_on
from validate.pipeline.run.pipeline import compare, set_out
from validate.recording.types import Recording
from validate.register.sensing import ForceSensing


def test_bounds_are_two_finite_numbers_in_order() -> None:
    for low, high in ((2.0, 1.0), (1.0, 1.0), (math.nan, 1.0), (0.0, math.inf)):
        with pytest.raises(UsageError, match=r"material\.E: bounds"):
            Free("material.E", low, high, "assumed")


def test_bounds_have_a_source() -> None:
    with pytest.raises(UsageError, match="no source"):
        Free("material.E", 1.0, 2.0, " ")


def test_a_calibration_names_parameters_and_residuals_each_once() -> None:
    on = (Calibrates(("force",)),)
    with pytest.raises(UsageError, match="0 parameters on 1 quantities"):
        Calibration("fem", (), on)
    with pytest.raises(UsageError, match="1 parameters on 0 quantities"):
        Calibration("fem", (E,), (Calibrates(()),))
    with pytest.raises(UsageError, match=r"material\.E is free twice"):
        Calibration("fem", (E, E), on)


# --- through the pipeline -------------------------------------------------------------------------


@pytest.mark.slow
def test_what_stands_open_is_identified_and_what_calibrated_is_fitted() -> None:
    result = compare(OPEN, Options({}))
    (modulus,) = result.identified
    assert modulus.name == "material.E"
    assert modulus.value == pytest.approx(10e3, rel=0.05)
    assert {p.path: p.origin for p in result.parameters}["material.E"] == "identified"
    assert " Fitted: material.E = " in result.sentence
    assert (
        "with 'fem' on force@0.1mm of moved; predicted: force@0.3mm has an error of"
        in result.sentence
    )
    sources = {i.name: i.source for i in result.inputs}
    assert sources["identified material.E"].startswith("identified on")


@pytest.mark.slow
def test_a_residual_that_calibrated_is_no_evidence() -> None:
    whole = replace(OPEN, accept=(Accept("force", 1e-3, "ours"),))
    verdicts = {c.name: c.verdict for c in compare(whole, Options({})).checks}
    assert verdicts.pop("force@0.1mm") == "fitted"
    assert "fitted" not in verdicts.values()


@pytest.mark.slow
def test_the_covariance_of_what_was_identified_is_uncertain_input() -> None:
    """Force is proportional to E, so its relative uncertainty is that of E, at every load."""
    result = compare(OPEN, Options({}))
    (check,) = (c for c in result.checks if c.name == "force@0.3mm")
    (cell,) = (o for o in result.registered[0].compared if o.name == "cell")
    forces = {load: cell.at(t) for load, t in (("0.1mm", 10.0), ("0.3mm", 30.0))}
    assert check.u_input == pytest.approx(1e-4 * forces["0.3mm"] / forces["0.1mm"], rel=0.02)


def test_a_value_is_taken_as_it_is_and_then_nothing_is_fitted() -> None:
    result = compare(replace(OPEN, parameters=known(E=9e3)), Options({}))
    assert result.identified == ()
    assert "Fitted" not in result.sentence
    assert all(c.verdict != "fitted" for c in result.checks)


def test_a_figure_that_would_serve_twice_is_an_error() -> None:
    for quantities in (("force",), ("force@0.3mm",)):
        twice = replace(OPEN, calibrations=(Calibration("fem", (E,), (Calibrates(quantities),)),))
        with pytest.raises(ComparisonError, match="calibrates 'fem': each value can"):
            compare(twice, Options({}))


def test_the_judged_recording_under_another_name_serves_once_too() -> None:
    on = Calibrates(("force@0.3mm",), change_of({"material.nu": 0.3}), "another")
    twice = replace(OPEN, calibrations=(Calibration("fem", (E,), (on,)),))
    hashed = replace(twice, load=_hashed)
    with pytest.raises(ComparisonError, match="the checks use the same recording"):
        compare(hashed, Options({}))


def _hashed(p: Tree, folder: Path) -> tuple[Recording, ...]:
    return tuple(
        replace(r, source=replace(r.source, sha256="ab" * 32)) for r in OPEN.load(p, folder)
    )


@pytest.mark.slow
def test_what_is_not_identifiable_blocks_the_prediction_unless_anyway() -> None:
    """With the top moved and its force alone, Poisson ratio and modulus are one number."""
    both = replace(
        OPEN,
        parameters=known(nu=None),
        calibrations=(Calibration("fem", (E, NU), (Calibrates(("force@0.1mm", "force@0.2mm")),)),),
    )
    with pytest.raises(ComparisonError, match=r"material.nu.*the sides' motion would"):
        compare(both, Options({}))
    result = compare(both, Options({}, anyway=True))
    assert any("material.nu is not identifiable" in note for note in result.notes)


def test_a_residual_that_is_not_there_is_named_with_those_that_are() -> None:
    wrong = replace(OPEN, calibrations=(Calibration("fem", (E,), (Calibrates(("forse",)),)),))
    with pytest.raises(ComparisonError, match=r"no residual 'forse'.*force@0\.1mm"):
        compare(wrong, Options({}))


def test_a_load_that_is_not_there_is_named_with_those_that_are() -> None:
    """Beside one that is there, too: it compared nothing, and nothing is said of how far off."""
    absent = replace(OPEN, accept=(Accept("force", 0.1, "ours", ("0.3mm", "9mm")),))
    result = compare(absent, Options({"material.E": "10kPa"}))
    (there, not_there) = result.checks
    assert there.name == "force@0.3mm"
    assert (not_there.name, not_there.count) == ("force@9mm", 0)
    assert not_there.why == (
        "compared nothing: unknown load of force; there are 0.1mm, 0.2mm, 0.3mm"
    )


def test_a_marker_that_is_never_seen_calibrates_nothing() -> None:
    def unseen(p: Tree, folder: Path) -> tuple[Recording, ...]:
        (recording,) = OPEN.load(p, folder)
        markers = recording.markers["markers"]
        x = markers.x.copy()
        x[:, markers.names.index("node_B")] = np.nan
        return (replace(recording, markers={"markers": replace(markers, x=x)}),)

    on = (Calibrates(("node_B", "force@0.1mm")),)
    blind = replace(OPEN, load=unseen, calibrations=(Calibration("fem", (E,), on),))
    with pytest.raises(ComparisonError, match=r"no residual 'node_B'.*force@0\.1mm"):
        compare(replace(blind, accept=OPEN.accept[1:]), Options({}))


@pytest.mark.slow
def test_what_repeats_the_model_is_not_said_to_have_served_to_fit() -> None:
    repeats = replace(OPEN, accept=OPEN.accept[:1])
    sentence = compare(repeats, Options({})).sentence
    assert "predicted: nothing, because 3 of 3 checks only repeat the model." in sentence


@pytest.mark.slow
def test_a_sensor_is_identified_beside_the_material() -> None:
    """A cell that reads .2 N of nothing: the force's slope over the holds is the modulus'."""
    bias = Free("cell.bias", -1.0, 1.0, "assumed")
    on = Calibrates(("force@0.1mm", "force@0.2mm"))

    def off(p: Tree, folder: Path) -> tuple[Recording, ...]:
        (recording,) = OPEN.load(p, folder)
        cell = recording.signal("cell", "N")
        signals = {**recording.signals, "cell": replace(cell, y=cell.y + 0.2)}
        return (replace(recording, signals=signals),)

    biased = replace(
        OPEN,
        load=off,
        parameters=replace(OPENED, settings=Sensed(ForceSensing(bias=None))),
        calibrations=(Calibration("fem", (E, bias), (on,)),),
    )
    found = {s.name: s.value for s in compare(biased, Options({})).identified}
    assert found["cell.bias"] == pytest.approx(0.2, abs=5e-4)
    assert found["material.E"] == pytest.approx(10e3, rel=0.05)


def test_a_body_alone_has_what_stands_open_fitted() -> None:
    """Studies of schemes and meshes take the experiment's own body."""
    body = own_body(OPEN)
    assert pytest.approx(10e3, rel=0.05) == body.scene.material.E


def test_a_recording_that_only_calibrates_is_named_among_the_files() -> None:
    on = Calibrates(("force@0.1mm",), change_of({"material.nu": 0.3}), "another")
    apart = replace(OPEN, calibrations=(Calibration("fem", (E,), (on,)),))
    assert [f.role for f in rests_on(apart, Options({})).files][-1] == "calibrates"
    taken = replace(apart, parameters=known(E=1e4))
    assert "calibrates" not in [f.role for f in rests_on(taken, Options({})).files]


@pytest.mark.slow
def test_several_recordings_calibrate_at_once() -> None:
    """Two looks at one force with independent noise halve the variance of one."""
    once = Calibrates(("force@0.1mm",))
    again = Calibrates(("force@0.1mm",), change_of({"material.nu": 0.3}), "a repeat")
    one, two = (
        compare(replace(OPEN, calibrations=(Calibration("fem", (E,), on),)), Options({}))
        for on in ((once,), (once, again))
    )
    (single,), (double,) = (_inputs(r) for r in (one, two))
    assert double == pytest.approx(single / np.sqrt(2), rel=5e-3)
    assert "force@0.1mm of moved and force@0.1mm of a repeat" in two.sentence


@pytest.mark.slow
def test_a_declared_range_of_what_was_identified_gives_way_to_its_covariance() -> None:
    """A range that moves anything besides stays, and so does one of what was not identified."""

    def both(p: Tree, z: float) -> Tree:
        m = p.scene.material
        return known(E=m.E * (1 + 0.1 * z), nu=m.nu + 0.01 * z)

    ranges = (
        vary("material.E", "relative 0.1", "modulus"),
        Input("both", both, "both", "assumed"),
        vary("material.nu", "absolute 0.01", "Poisson ratio"),
    )
    asked = replace(OPEN, uncertainty=Uncertainty(None, ranges, "fem"))
    kept = [i.name for i in set_out(asked, Options({})).experiment.uncertainty.inputs]
    assert kept == ["both", "Poisson ratio", "identified material.E"]
    given = set_out(replace(asked, parameters=known(E=9e3)), Options({}))
    assert given.experiment.uncertainty.inputs == ranges


def _inputs(result: Result) -> list[float]:
    return [c.u_input for c in result.checks if c.name == "force@0.3mm"]


AS_FILE = """
from dataclasses import replace
from calibrating import OPEN
EXPERIMENT = replace(OPEN, name="opened")
"""


@pytest.mark.parametrize(
    "command", ["check", pytest.param("study coverage", marks=pytest.mark.slow)]
)
def test_other_commands_identify_by_the_same_cells(command: str, tmp_path: Path) -> None:
    """`check` where cells of a run are stored, and a coverage study."""
    (tmp_path / "opened.py").write_text(AS_FILE, "utf-8")
    out = tmp_path / "reports"
    (out / "opened" / "cells").mkdir(parents=True)
    quick = ("--quick",) if command.startswith("study") else ()
    code, _, err = here(*command.split(), "opened.py", *quick, "--out", str(out), cwd=tmp_path)
    assert code in (0, 1), err
    assert list(out.glob("opened/study-identify*/cells/*.json"))
