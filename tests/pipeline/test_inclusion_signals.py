"""Signals of an experiment with an inclusion: known by unit, refused by name, with their sign."""

from dataclasses import replace
from pathlib import Path

import pytest

from validate.errors import RecordingError, RegistrationError, UsageError, ValidateError
from validate.parameters import with_given
from validate.pipeline.experiment.declaration import from_json, holds_code, to_json
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.inclusion import (
    BlockWithInclusion,
    InclusionTest,
    Streams,
    inclusion_test,
)
from validate.recording.mcap.read import read_recording
from validate.recording.types import Recording, Signal
from validate.scene.material import Material
from validate.scene.scene import Cavity, Drive, Foundation, Scene, Support
from validate.solve.fluid.cavities import ExactPressure

SCENE = Scene(
    BlockWithInclusion(0.060, 0.045, 0.070, (6, 7, 10)),
    Material(15e3, 0.485),
    (Support("x0", (0,)), Support("y0", (1,))),
    drives=(Drive("stage", "x1", "-x"),),  # type: ignore[arg-type]
    cavities=(Cavity("inclusion", "cavity"),),
    foundations=(Foundation("x0 + x1", (1, 2), 0.0, "slip", "plates"),),
)


def declared(*signals: str) -> Experiment:
    settings = InclusionTest(streams=Streams(signals=signals), loads=(0.003,))
    models = {"p1": Method("P1", ExactPressure())}
    tree = Tree(scene=SCENE, settings=settings)
    return inclusion_test("mine", "A block", "this test", tree, models, ("p1",), ())


def placed(recording: Recording, *signals: str) -> tuple[str, ...]:
    """Names of what is observed."""
    mine = declared(*signals)
    scene = mine.build(recording, mine.parameters, mine.methods["p1"].scene)
    return tuple(o.name for o in mine.place(recording, mine.parameters, scene).observations)


@pytest.fixture(scope="module")
def recorded(project_root: Path) -> Recording:
    return read_recording(project_root / "recordings" / "fluid_phantom.mcap")


def test_forces_and_pressures_are_observed_beside_outlines_and_markers(recorded: Recording) -> None:
    everything = ("stage", "outline", "markers", "pressure", "load_cell")
    assert placed(recorded, "pressure", "load_cell") == everything


def test_a_body_is_meshed_from_a_recorded_sweep(recorded: Recording) -> None:
    mine = declared()
    swept = with_given(mine.parameters, {"body.inclusion.shape": "sweep"})
    scene = mine.build(recorded, swept, {"body.element": "linear"})
    (said,) = mine.place(recorded, swept, scene).findings
    assert "The inclusion is meshed from 14 slices of a sweep" in said


def test_its_json_is_all_of_it(tmp_path: Path) -> None:
    """Sizes stay open, and what the library adds is no part of it."""
    mine = declared("pressure")
    opened = with_given(mine.parameters, {"body.x": None})
    text = to_json(replace(mine, parameters=opened))
    assert not holds_code(text)
    found = from_json(text, tmp_path / "mine.json")
    assert found.complete
    assert found.parameters == opened
    assert dict(found.methods) == dict(mine.methods)
    assert to_json(found) == text
    with pytest.raises(UsageError, match=r"--set body\.x=VALUE"):
        opened.scene.body.block.sizes.prod()


def turned(s: Signal) -> Signal:
    return replace(s, y=-s.y)


@pytest.mark.parametrize(
    ("topic", "change", "error", "says"),
    [
        ("load_cell", lambda s: replace(s, unit="mm"), RecordingError, "'load_cell' is in mm"),
        ("scale", None, RecordingError, "no signal 'scale'"),
        ("load_cell", turned, RegistrationError, "'force.plate' falls by .* N as 'stage' closes"),
    ],
    ids=["unit", "absent", "sign"],
)
def test_a_signal_that_cannot_be_used_is_refused(
    recorded: Recording, topic: str, change: object, error: type[ValidateError], says: str
) -> None:
    signals = dict(recorded.signals)
    if callable(change):
        signals[topic] = change(signals[topic])
    with pytest.raises(error, match=says):
        placed(replace(recorded, signals=signals), topic)
