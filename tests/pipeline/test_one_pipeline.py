"""What one kind of pipeline has the other has too: the same tiny block over time and at holds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tiny import AT_HOLDS, LOADS, STEPS, TINY, Breaks, stiffer

from validate.compare.convergence import convergence
from validate.compare.effects import Declared, Sensor
from validate.compare.exhibit import Chart, Exhibit, NumberTable, Series
from validate.compare.published import Figure
from validate.compare.result import MethodResult, Result
from validate.compare.score import Score
from validate.compare.verdict import Accept
from validate.errors import ComparisonError
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import (
    Case,
    EffectSpec,
    Experiment,
    Identified,
    ReportAdditions,
    Uncertainty,
    Variant,
    vary,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.options import Options
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.experiment.variation import change_of
from validate.pipeline.run.method_run import Cases
from validate.pipeline.run.pipeline import compare
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.scene import Scene
from validate.solve.fluid.cavities import NoFluid

harder = change_of({"material.E": "x 1.3"})
shifted = change_of({"sd": "x 2"})
MESHES = vary("body.cells", "x 2")
FINER = Uncertainty(MESHES)
KINDS = pytest.mark.parametrize("base", [TINY, AT_HOLDS], ids=["over time", "at holds"])


def declared(base: Experiment, **more: Any) -> Experiment:
    """The experiment with one method, no other case and no twin of the same model."""
    twin = replace(base.twin, kind="twin") if base.twin else None
    methods = {"fem": base.methods["fem"]}
    return replace(base, **{"methods": methods, "cases": (), "twin": twin} | more)


def of(result: Result, name: str) -> MethodResult:
    return next(m for m in result.methods if m.name == name)


# --- a recording over time without a twin ---------------------------------------------------------


@pytest.fixture(scope="module")
def untold() -> Result:
    """Nobody knows the truth, and another recording lies beside."""
    case = Case("other", "another recording", shifted, shipped=True)
    fem_and_filter = {name: TINY.methods[name] for name in ("fem", "kf")}
    own = replace(
        TINY, methods=fem_and_filter, twin=None, uncertainty=FINER, cases=(case,), load=as_measured
    )
    return compare(own, Options({}))


def as_measured(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """The recording as an instrument writes it: it does not say that a model made it."""
    (made,) = TINY.load(tree, folder)
    told = {k: v for k, v in made.metadata.items() if k not in ("provenance", "made_with")}
    return (replace(made, metadata=told),)


def test_a_recording_without_a_twin_is_judged_by_its_residuals(untold: Result) -> None:
    assert untold.passed
    (check,) = untold.checks
    assert (check.name, check.count) == ("node_B.max@all", STEPS)
    residual = of(untold, "fem").residuals["node_B@all"]
    assert check.value == np.linalg.norm(residual.values, axis=1).max()
    assert (untold.kind, untold.seed, untold.twin_notice) == ("measured", None, "")


def test_without_a_twin_nothing_is_scored_or_drawn_against_a_truth(untold: Result) -> None:
    for method in untold.methods:
        assert {s.against for s in method.scores} <= {"measured recording", "none"}
    texts = [w for e in untold.exhibits for w in (e.title, *e.words)]
    texts += [
        text
        for e in untold.exhibits
        for t in e.tables
        for text in (t.title, t.note, *t.headings, *(str(v) for row in t.rows for v in row))
    ]
    texts += [
        text
        for e in untold.exhibits
        for c in e.charts
        for text in (c.title, c.y, c.caption, *(s.label for s in c.series))
    ]
    assert len(texts) > 50
    assert not [t for t in texts if "reference" in t or "truth" in t or "twin" in t]
    charts = {c.name: c for e in untold.exhibits for c in e.charts}
    shown = charts["displacement_node_B"].series
    assert [s.label for s in shown] == ["measured", "FEM", "filter"]


def test_a_case_that_nobody_can_record_is_refused() -> None:
    case = Case("stiff", "no twin makes it", stiffer)
    with pytest.raises(ComparisonError, match="case 'stiff' has no shipped recording"):
        compare(declared(TINY, twin=None, uncertainty=FINER, cases=(case,)), Options({}))


# --- both pipelines -------------------------------------------------------------------------------


@KINDS
def test_effects_and_sensors(base: Experiment) -> None:
    """A stiffer model and the same one: the second moves nothing and no sensor sees it.

    What is recorded of a sensor moves with the modulus: markers under a force, a force at holds.
    """
    quantity_, unit = ("force", "N") if base is AT_HOLDS else ("node_B", "m")
    fine = Sensor("a finer one", quantity_, 1e-12)
    effects = (
        EffectSpec("modulus", "30 % stiffer", Variant("fem"), Variant("fem", harder)),
        EffectSpec("nothing", "the same again", Variant("fem"), Variant("fem")),
    )
    experiment = declared(base, effects=effects, sensors=(fine,), uncertainty=FINER)
    modulus, nothing = compare(experiment, Options({})).effects
    moved = {c.name: c for c in modulus.changes}
    seen = {c for c in moved if c.startswith(f"{quantity_}@")}
    assert seen <= set(modulus.seen_by)
    assert all(moved[name].unit == unit and moved[name].rms > 0 for name in seen)
    assert len(seen) == (len(LOADS) if base is AT_HOLDS else 1)
    assert (nothing.seen_by, nothing.would_see) == ((), ())
    assert "a finer one" in modulus.would_see
    assert compare(experiment, Options({}, quick=True)).effects == ()


@KINDS
def test_identification(base: Experiment) -> None:
    """What was identified from the recordings is what the models run with."""
    given: list[int] = []

    def identify(
        recordings: Sequence[Recording], tree: Tree, methods: Mapping[str, Method]
    ) -> Identified:
        given.append(len(recordings))
        score = Score("modulus.E", 12e3, "Pa", 1, "measured recording", "told")
        known = with_given(tree, {"material.E": 12e3})
        return Identified(known, (score,), ("It was told.",), "E = 12 kPa")

    result = compare(declared(base, identify=identify, uncertainty=FINER), Options({}))
    assert given == [1]
    assert of(result, "fem").scene.material.E == 12e3
    assert [s.name for s in result.identified] == ["modulus.E"]
    assert "It was told." in result.notes
    assert result.sentence.startswith("E = 12 kPa; ")
    assert {p.path: p.default for p in result.parameters}["material.E"] == 12e3


@KINDS
def test_bands(base: Experiment) -> None:
    banded = declared(base, uncertainty=FINER, band="sd")
    assert of(compare(banded, Options({})), "fem").band == base.parameters.settings.sd
    bare = declared(base, uncertainty=FINER)
    assert of(compare(bare, Options({})), "fem").band == 0.0


@KINDS
def test_cases(base: Experiment) -> None:
    """Scores of another truth carry its name, and a table shows how every method ended on it."""
    result = compare(replace(declared(base, uncertainty=FINER), cases=base.cases[:1]), Options({}))
    scores = {s.name for s in of(result, "fem").scores}
    assert {"node_B.rmse", "node_B.rmse@stiff"} <= scores
    (table,) = (t for e in result.exhibits for t in e.tables if t.name == "cases")
    assert [(row[0], row[1], row[-1]) for row in table.rows] == [("stiff", "FEM", "finished")]


@KINDS
def test_own_exhibits_printed_figures_and_captions(base: Experiment) -> None:
    chart = Chart("own", "Own", "t / s", "y / m", (Series("y", np.arange(2.0), np.ones(2)),))
    table = NumberTable("counts", "Runs", ("cases / 1",), ((1,),))

    def tell(tree: Tree, cases: Cases, progress: Callable[[str], None]) -> ReportAdditions:
        exhibit = Exhibit("own", "Own", (), (table,), (chart,))
        return ReportAdditions((exhibit,), {"runs": float(len(cases))})

    figure = Figure("runs", "told:runs", 1.0, 0.0, "1", "reproduced", "", "here")
    experiment = declared(
        base, uncertainty=FINER, exhibits=tell, published=(figure,),
        captions={"own": "Under the own chart.", "displacement_node_B": "Under a common one."},
    )  # fmt: skip
    result = compare(experiment, Options({}))
    captions = {c.name: c.caption for e in result.exhibits for c in e.charts}
    assert captions["own"] == "Under the own chart."
    if base is TINY:
        assert captions["displacement_node_B"] == "Under a common one."
    assert [t.name for e in result.exhibits for t in e.tables if e.anchor == "own"] == ["counts"]
    assert [(p.ours, p.fault) for p in result.published] == [(1.0, "")]


@pytest.mark.slow
@KINDS
def test_a_stand_in_takes_a_slow_methods_place_on_every_mesh(base: Experiment) -> None:
    """The slow one is never built there; u_num is the stand-in's, and the check says so."""
    built: list[tuple[str, int]] = []

    def build(recording: Recording, tree: Tree, changes: Mapping[str, Any] | None) -> Scene:
        built.append(("slow" if changes else "fast", tree.scene.body.cells[0]))
        return Built()(recording, tree, changes)

    slow = replace(base.methods["fem"], scene={"dilatation": "pointwise"})
    methods = {"slow": slow, "fast": base.methods["fem"]}
    uncertainty = Uncertainty(vary("body.cells", "x 2 3"), stand_in={"slow": "fast"})
    experiment = declared(
        base, build=build, methods=methods, accepted=("slow",), uncertainty=uncertainty,
        reference="fast",
    )  # fmt: skip
    check = compare(experiment, Options({})).checks[-1]
    assert sorted(set(built)) == [("fast", 3), ("fast", 6), ("fast", 9), ("slow", 3)]
    assert check.numerical.endswith("by fast in its place")
    name = "force@0.3mm" if base is AT_HOLDS else "node_B@all"
    own = declared(base)
    same = replace(own, twin=replace(base.twin, kind="same model"))  # type: ignore[type-var]
    meshes = [Options({"body.cells": f"{n},{n},{n}"}) for n in "369"]
    answers = [of(compare(same, mesh), "fem").residuals[name].values for mesh in meshes]
    assert check.u_num == pytest.approx(convergence((6, 3, 2), answers, 0, 2.0).u, rel=1e-12)
    assert 0 < check.u_num < np.inf


@KINDS
def test_inputs(base: Experiment) -> None:
    """One standard uncertainty of an input, by the surrogate, is part of u_val."""
    source = vary("material.E", "relative 3 %", "modulus", "E")
    uncertain = replace(FINER, inputs=(source,), surrogate="fem")
    whole = tuple(replace(a, statistic="rms") for a in base.accept)
    result = compare(declared(base, uncertainty=uncertain, accept=whole), Options({}))
    check = result.checks[-1]
    assert check.u_input > 0
    assert check.u_val == pytest.approx(np.sqrt(check.u_D**2 + check.u_num**2 + check.u_input**2))
    first = {j.name: j for j in result.joint}
    assert first[check.name.replace(".rms", "")].first_order == pytest.approx(check.u_input)
    assert all(j.draws == 12 for j in result.joint)
    assert all(abs(j.percent or 0.0) < 5 for j in result.joint)
    assert result.inputs == (Declared("modulus", "E", "assumed"),)


@KINDS
def test_a_quick_run_draws_nothing(base: Experiment) -> None:
    source = vary("material.E", "relative 3 %", "modulus", "E")
    quick = Options({}, quick=True)
    uncertain = replace(FINER, inputs=(source,), surrogate="fem")
    assert compare(declared(base, uncertainty=uncertain), quick).joint == ()


# --- what is compared with nothing ----------------------------------------------------------------


@KINDS
def test_a_marker_that_no_probe_answers_is_a_note(base: Experiment) -> None:
    (note,) = compare(declared(base, uncertainty=FINER), Options({})).notes
    assert note == (
        "markers: f1, f2, f3 compared with nothing, because no probe or trace of the scene "
        "has that name"
    )


def test_a_check_that_compared_nothing_carries_the_unit_of_its_quantity() -> None:
    """A run that ends before it compared anything has failed in newtons and in metres."""
    ended = replace(AT_HOLDS.methods["fem"], settings=Breaks(inner=NoFluid()))
    result = compare(declared(AT_HOLDS, methods={"fem": ended}, uncertainty=FINER), Options({}))
    assert [(c.name, c.unit, c.count, c.verdict) for c in result.checks] == [
        ("node_B", "m", 0, "nothing compared"), ("force", "N", 0, "nothing compared"),
    ]  # fmt: skip
    assert all("compared nothing: refused: told so" in c.why for c in result.checks)
    unknown = declared(AT_HOLDS, accept=(Accept("nowhere", 1.0, "ours"),), uncertainty=FINER)
    (check,) = compare(unknown, Options({})).checks
    assert (check.unit, check.why) == (
        "-",
        "compared nothing: the recording does not have this quantity; nearest: force, node_B, "
        "node_A",
    )


def test_a_signal_whose_trace_no_method_has_is_a_note_and_a_failed_check() -> None:
    def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
        seen = AT_HOLDS.place(recording, tree, scene)
        (cell,) = seen.of(SignalObservation)
        (markers,) = seen.of(MarkerObservation)
        renamed = replace(cell, trace="nowhere.force")
        return replace(seen, observations=(*seen.drives, markers, renamed))

    result = compare(declared(AT_HOLDS, place=place, uncertainty=FINER), Options({}))
    assert any(note.startswith("cell: cell compared with nothing") for note in result.notes)
    (check,) = (c for c in result.checks if c.name == "force")
    assert (check.unit, check.count, check.verdict) == ("N", 0, "nothing compared")
    assert not result.passed
