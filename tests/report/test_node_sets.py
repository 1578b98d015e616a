"""Node sets on a body: what faces the eye is drawn, the far side is in the other view."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from validate.report.scenes import points as drawing
from validate.report.scenes.maps import TOWARD_EYE, facing, screen
from validate.report.scenes.points import node_sets_picture
from validate.scene.geometries.box import box

# private: _fill_sets: called alone, case by case.

MESH = box((0.1, 0.1, 0.1), (2, 2, 2))
TOP, BOTTOM = MESH.facet_nodes("z1"), MESH.facet_nodes("z0")
SETS = {"held": BOTTOM, "loaded": TOP}


def drawn() -> Figure:
    figure = Figure()
    drawing._fill_sets(figure, MESH, SETS, {"A": int(TOP[4])})
    return figure


def points(figure: Figure, view: int, label: str) -> int:
    (line,) = [x for x in figure.axes[view].lines if x.get_label() == label]
    return len(np.asarray(line.get_xdata()))


def test_each_view_has_the_nodes_of_its_own_side() -> None:
    """From above the whole top and two edges of the bottom; from below the other way round."""
    figure = drawn()
    assert (points(figure, 0, "loaded"), points(figure, 0, "held")) == (9, 5)
    assert (points(figure, 1, "loaded"), points(figure, 1, "held")) == (5, 9)


def test_a_named_node_stands_where_it_is_seen() -> None:
    """The middle of the top: in the view from above only."""
    named = [[t.get_text() for t in ax.texts if t.get_text() == "A"] for ax in drawn().axes]
    assert named == [["A"], []]


def test_every_axis_of_the_triad_is_drawn_within_the_view() -> None:
    for ax in drawn().axes:
        letters = {t.get_text(): t for t in ax.texts if t.get_text() in ("x", "y", "z")}
        assert set(letters) == {"x", "y", "z"}
        assert not any(t.get_annotation_clip() for t in letters.values())


def test_facets_that_face_the_eye_are_half_of_a_box() -> None:
    _, facets = facing(MESH, TOWARD_EYE)
    assert len(facets) == len(MESH.surface) // 2
    right, upward = screen(TOWARD_EYE)
    frame = np.stack([right, upward, TOWARD_EYE])
    assert frame @ frame.T == pytest.approx(np.eye(3), abs=1e-12)


def test_the_words_count_the_nodes() -> None:
    picture = node_sets_picture("sets", "Sets.", MESH, SETS, {"A": 4})
    assert picture.alt == "Surface from two corners: nodes 9 held, 9 loaded; A by name."
    assert picture.pixels.shape[2] == 3
