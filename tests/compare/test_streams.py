"""Streams that an experiment does not use are named, with the reason, in report and results."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from validate.compare.result import stream_uses
from validate.pipeline import load
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.pipeline import compare
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.types import Contours, Frames, Markers, Recording, Signal
from validate.report.sections.provenance import recording as section
from validate.report.stored.store import document, schema

T = np.array([0.0, 1.0])
RING = 0.01 * np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
IMAGES = Frames(T, 2 * (np.zeros((4, 4), np.uint8),), (1e-3, 1e-3), np.eye(4), "body")


def with_more(recording: Recording) -> Recording:
    """Also a signal, markers, outlines and images that no experiment knows."""
    return replace(
        recording,
        signals={**recording.signals, "thermometer": Signal(T, T[:, None], "degC", 0.1, "room")},
        markers={**recording.markers, "spare": Markers(T, ("a",), np.zeros((2, 1, 3)), 0.0, "w")},
        contours={"wall": Contours(T, (RING, RING), 1e-4, np.eye(4), "body")},
        frames={"b_mode": IMAGES},
        unread={"/lidar": "its messages are not read (foxglove.PointCloud)"},
    )


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    """The shipped block, with a recording of which it uses two streams."""
    shipped = load("kf_cube")
    return replace(
        shipped,
        load=lambda p, folder: tuple(with_more(r) for r in shipped.load(p, folder)),
        methods={"fem": shipped.methods["fem"]},
        accepted=("fem",),
    )


@pytest.mark.slow
def test_a_recording_with_more_than_an_experiment_uses(experiment: Experiment) -> None:
    result = compare(experiment, Options({}, quick=True))
    used = {s.topic: s.why for s in result.streams if s.used}
    assert used == {
        "pull": "drives the simulation", "markers": "compared with what is simulated",
    }  # fmt: skip
    named = "no observation of the experiment uses it"
    assert {s.topic: s.why for s in result.streams if not s.used} == {
        "thermometer": named, "spare": named, "wall": named,
        "b_mode": "no outline is extracted from them",
        "/lidar": "its messages are not read (foxglove.PointCloud)",
    }  # fmt: skip
    content = document(result, "2026-11-21T04:00:00Z")
    jsonschema.Draft202012Validator(schema()).validate(content)
    assert [s["topic"] for s in json.loads(json.dumps(content))["streams"] if not s["used"]] == [
        "spare", "thermometer", "wall", "b_mode", "/lidar",
    ]  # fmt: skip
    shown = section(result)
    assert shown is not None
    assert len(shown.words) == 5
    assert "Not used: images 'b_mode' of kf_cube: no outline is extracted from them." in shown.words


class Seen:
    """A registration that has only its observations."""

    def __init__(self, **roles: str) -> None:
        self.observations = [Observed(name, role) for name, role in roles.items()]


class Observed:
    def __init__(self, name: str, role: str) -> None:
        self.name, self.role = name, role


def both(images: str) -> Recording:
    made = Contours(T, (RING, RING), 1e-4, np.eye(4), "body", images)
    return replace(
        read_recording(Path(__file__).parents[2] / "recordings" / "kf_cube.mcap"),
        markers={}, signals={}, contours={"outline": made}, frames={"b_mode": IMAGES},
    )  # fmt: skip


def test_images_are_used_where_outlines_are_found_in_them() -> None:
    outline, images = stream_uses([both("b_mode")], [[Seen(outline="validates")]])
    assert outline.why.endswith("; extracted from the images 'b_mode', not as recorded")
    assert (images.used, images.why) == (True, "source of the outlines 'outline'")


def test_images_beside_recorded_outlines_are_not_used() -> None:
    _, images = stream_uses([both("")], [[Seen(outline="validates")]])
    assert not images.used
    assert "'outline' are compared as recorded" in images.why


def test_a_stream_is_used_when_any_method_observes_it() -> None:
    one, other = Seen(outline="validates"), Seen(b="validates")
    assert stream_uses([both("")], [[other], [one]])[0].used
    assert not stream_uses([both("")], [[other]])[0].used
    assert not stream_uses([both("")], [])[0].used


def test_where_outlines_come_from_is_kept_in_a_file(tmp_path: Path) -> None:
    write_recording(both("b_mode"), tmp_path / "r.mcap")
    found = read_recording(tmp_path / "r.mcap")
    assert found.contours["outline"].images == "b_mode"
    assert not any(name.startswith("pose/") for name in found.metadata)
    assert found.unread == {}


def test_topics_that_are_not_read_are_reported() -> None:
    recording = replace(both(""), unread={"/camera": "a message type that is not known"})
    found = stream_uses([recording], [])[-1]
    assert (found.topic, found.kind, found.used) == ("/camera", "not read", False)
    assert found.why == "a message type that is not known"
