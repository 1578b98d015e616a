"""Variations: one meaning of a path and a rule, over all experiments."""

from pathlib import Path
from typing import Any

import pytest
from beside import experiment
from hypothesis import given
from hypothesis import strategies as st

from validate.catalogue import experiment_files
from validate.errors import UsageError
from validate.parameters import describe, value_at
from validate.pipeline.bodies.choices import MeasuredBody
from validate.pipeline.experiment.experiment import Case, Variant, vary
from validate.pipeline.experiment.find import load_file
from validate.pipeline.experiment.tree import TrackedTwin, Tree
from validate.pipeline.experiment.variation import Shift, change_of
from validate.pipeline.run.runs import ExperimentRuns
from validate.scene.contact import Indenter, RigidContact
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Scene


def of(material: Material) -> Tree:
    """A block that an indenter presses."""
    shape: Any = Indenter("sphere", 5e-3)
    pressed = RigidContact("stage", "zmax", shape, (0.0, 0.0, -1.0))
    body = Box((0.03,) * 3, (6, 6, 6), "hex8")
    return Tree("", Scene(body, material, contacts=(pressed,)), MeasuredBody())


BODY, GAP = of(Material(10e3, 0.45)), "contacts.stage.shape.gap"
ROOT3 = 3**0.5
SHIPPED = sorted(experiment_files(Path(__file__).parents[2]).items())


@given(z=st.floats(-ROOT3, ROOT3), share=st.floats(0.0, 0.5))
def test_a_relative_uncertainty_is_a_share_of_the_value(z: float, share: float) -> None:
    moved = Shift(("material.E",), f"relative {100 * share} %")(BODY, z)
    assert pytest.approx(10e3 * (1 + z * share), rel=1e-12) == moved.scene.material.E


@given(z=st.floats(-ROOT3, ROOT3), sd=st.floats(1e-5, 0.1), nu=st.floats(0.0, 0.4999))
def test_no_input_passes_its_bound_and_one_uncertainty_stays_one(
    z: float, sd: float, nu: float
) -> None:
    body = of(Material(1.0, nu))
    rule = Shift(("material.nu",), f"absolute {sd!r}, below 0.5")
    assert rule(body, z).scene.material.nu <= 0.4999
    assert abs(rule(body, 1.0).scene.material.nu - nu) == pytest.approx(sd, abs=1e-12)


@pytest.mark.parametrize(
    ("bound", "moved"), [("below 0.5", 0.47), ("at most 0.5", 0.5), ("at least 0.5", 0.51)]
)
def test_a_bound_turns_a_value_round_or_stops_it(bound: str, moved: float) -> None:
    path = "contacts.stage.friction"
    body = change_of({path: 0.49})(BODY)
    at = value_at(Shift((path,), f"absolute 0.02, {bound}")(body, 1.0), path)[0]
    assert at == pytest.approx(moved, abs=1e-12)


def test_an_amount_has_a_unit_or_is_another_parameter() -> None:
    by_path = Shift(("material.E",), "relative ranges.E")
    assert pytest.approx(10e3 * 1.05) == by_path(BODY, 1.0).scene.material.E
    moved = Shift((GAP,), "absolute 1 mm")(BODY, 2.0)
    assert moved.scene.contacts[0].shape.gap == pytest.approx(2e-3)
    for wrong in ("absolute 1 kPa", "absolute 1 mm, under 3", "twice", "relative"):
        with pytest.raises(UsageError, match=r"shape\.gap"):
            Shift((GAP,), wrong)(BODY, 1.0)


def test_values_by_path_are_texts_with_units_numbers_factors_and_steps() -> None:
    change = change_of({"material.E": "x 1.5", "seen.states": "+ 2", "body.size": "1cm,2cm,30mm",
                        "material.nu": 0.3})  # fmt: skip
    changed = change(BODY)
    assert (changed.scene.material.E, changed.settings.seen.states) == (15e3, 32)
    assert (changed.scene.body.size, changed.scene.material.nu) == ((0.01, 0.02, 0.03), 0.3)
    one = TrackedTwin(every=1)
    assert [change_of({"every": by})(one).every for by in ("- 1", "x 0.3")] == [3, 1]
    assert Case("a", "b", {}).change(BODY) is BODY
    with pytest.raises(UsageError, match=r"nearest: material\.nu"):
        change_of({"material.mu": 1.0})(BODY)


@pytest.mark.parametrize(("name", "file"), SHIPPED)
def test_one_meaning_of_every_standard_uncertainty(name: str, file: Path) -> None:
    """z moves the declared paths alone, in proportion; a Poisson ratio everywhere by its own
    units, and below .5."""
    experiment = load_file(file)
    declared = experiment.uncertainty.inputs if experiment.uncertainty else ()
    for one in declared:
        if not isinstance(one.move, Shift):
            continue
        p, moved = experiment.parameters, one.move(experiment.parameters, 1.0)
        before, after = ({d.path: d.default for d in describe(x)} for x in (p, moved))
        paths = {path for path in after if after[path] != before[path]}
        assert paths <= set(one.move.paths)
        for path in paths:
            value, sd = value_at(p, path)[0], one.move.sd(value_at(p, path)[0], p, path)
            assert abs(after[path] - value) == pytest.approx(sd, rel=1e-6)
        if (
            any(path.rpartition(".")[2] == "nu" for path in one.move.paths)
            and name != "gel_indentation"
        ):
            assert one.move.rule == "absolute ranges.nu, below 0.5"


def test_an_input_needs_a_rule() -> None:
    with pytest.raises(UsageError, match='for example "relative 3 %"'):
        vary("material.E", "3 %")


def test_a_change_is_parsed_once_for_all_that_is_asked_of_it() -> None:
    """The time that is left, the memory and the runs themselves ask one and the same variant."""
    parsed: list[object] = []

    def change(parameters: object) -> object:
        parsed.append(parameters)
        return parameters

    declared = experiment("kf_cube")
    runs = ExperimentRuns(declared, declared.methods, declared.parameters, None, quick=False)
    variants = [Variant("fem", change), Variant("kf_reduced", change)]
    runs.expect(variants)
    assert [runs.wanted(v).method for v in variants] == ["fem", "kf_reduced"]
    assert runs.finer(variants[0]) == 1.0
    assert len(parsed) == 1
