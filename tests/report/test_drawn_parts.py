"""What pictures and tables of a report are drawn from, by hand: no renderer, no page."""

from types import SimpleNamespace as Made
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from validate.recording.types import Recording, Source
from validate.report.scenes import markers, outlines
from validate.report.scenes.body import indenter_surface
from validate.report.sections.provenance import _assumed, _metadata, _points
from validate.report.sections.registration import _residuals
from validate.scene.contact import RigidCylinder, RigidPlane, RigidPunch, RigidSphere, Shape

# private: _assumed, _circles, _metadata, _points, _residuals: called alone, case by case.


def test_outlines_of_one_length_have_one_number() -> None:
    assert _points(("abc", "xyz")) == "3"
    assert _points(("abc", "abcde", "abcd")) == "3 to 5"


def test_circles_stand_where_markers_were_seen() -> None:
    ax = Figure().add_subplot()
    markers._circles(ax, np.array([[1.0, 2.0], [np.nan, 3.0], [4.0, np.nan], [5.0, 6.0]]), 0.5)
    (circles,) = ax.collections
    assert np.asarray(circles.get_offsets()).tolist() == [[1.0, 2.0], [5.0, 6.0]]


def test_axes_of_markers_have_labels_each(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = Made(rest=np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]]))
    judged = Made(registered=[None], scene=None)
    shown: list[Any] = []
    for name, value in {
        "shown_method": lambda result: judged,
        "markers_seen": lambda method: seen,
        "shown_loads": lambda method: ((Made(), Made()), (0, 1)),
        "axis_label": lambda scene, i: "xyz"[i],
        "_in_plane": lambda made, method: shown.append(made),
        "_across": lambda result, made: (),
    }.items():
        monkeypatch.setattr(markers, name, value)
    assert markers.markers(Made()) is not None
    assert shown[0].labels == ("x", "y")


def test_every_load_shows_the_section_of_the_judged_method(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    judged, rival = Made(registered=[None], label="judged"), Made()
    shown: list[Any] = []
    for name, value in {
        "shown_method": lambda result: judged,
        "outline_seen": lambda method: Made(name="o", corners=(), measured=lambda t: t),
        "shown_loads": lambda method: ((Made(t=0.0), Made(t=1.0)), (0, 1)),
        "_drawn": lambda result, measured: [
            Made(method=rival, sections="rival's"),
            Made(method=judged, sections="judged's"),
        ],
        "_at_last": lambda measured, drawn: None,
        "_by_load": lambda measured, first, drawn: shown.append(first.method),
        "outline_images": lambda recording, topic, holds, sections, label: (
            shown.append((sections, label)) or ()
        ),
    }.items():
        monkeypatch.setattr(outlines, name, value)
    assert outlines.outlines(Made(recordings=(None,))) is not None
    assert shown == [("judged's", "judged"), judged]


def test_a_result_without_methods_has_no_registration_to_show() -> None:
    assert _residuals(Made(recordings=(Made(name="a"),), registered=())).rows == ()


def test_what_was_assumed_of_a_file_stands_apart_and_unfolded() -> None:
    records = {"assumed": {"test": "tension: given by --map"}, "header": {"a": "b"}}
    recording = Recording("gel", Source("x", "", 0, "x"), 0, metadata=records)
    assumed = _assumed(recording)
    assert (assumed.rows, assumed.folded) == ((("test", "tension: given by --map"),), False)
    assert _metadata(recording).rows == (("header", "a", "b"),)


@pytest.mark.parametrize(("shape", "low", "high"), [
    (RigidSphere((0.0, 0.0, 0.02), 0.005), (-5, -5, 15), (5, 5, 25)),
    (RigidCylinder((0.0, 0.0, 0.02), (0.0, 1.0, 0.0), 0.005), (-5, -12, 15), (5, 12, 25)),
    (RigidPunch((0.0, 0.0, 0.015), (0.0, 0.0, -1.0), 0.005), (-5, -5, 15), (5, 5, 20)),
    (RigidPlane((0.0, 0.0, 0.015), (0.0, 0.0, -1.0)), (-15, -15, 15), (15, 15, 16.5)),
])  # fmt: skip
def test_an_indenter_is_drawn_where_it_stands(
    shape: Shape, low: tuple[float, ...], high: tuple[float, ...]
) -> None:
    """In mm; its lowest point touches at 15 mm, endless ones are a fifth longer than the body."""
    points, triangles = indenter_surface(shape, np.array([15.0, 20.0, 0.0]))
    assert set(triangles.ravel()) == set(range(len(points)))
    np.testing.assert_allclose(points.min(axis=0), low, atol=0.02)
    np.testing.assert_allclose(points.max(axis=0), high, atol=0.02)
