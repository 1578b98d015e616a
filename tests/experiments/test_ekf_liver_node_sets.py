"""Node sets on a body: what faces the eye is drawn, the far side is in the other view."""

import numpy as np
from matplotlib.figure import Figure

from experiments.ekf_liver.node_sets import node_sets_picture, paint_sets
from validate.scene.geometries.box import box

MESH = box((0.1, 0.1, 0.1), (2, 2, 2))
TOP, BOTTOM = MESH.facet_nodes("z1"), MESH.facet_nodes("z0")
SETS = {"held": BOTTOM, "loaded": TOP}


def drawn() -> Figure:
    figure = Figure()
    paint_sets(figure, MESH, SETS, {"A": int(TOP[4])})
    return figure


def points(figure: Figure, view: int, label: str) -> int:
    (line,) = [x for x in figure.axes[view].lines if x.get_label() == label]
    return len(np.asarray(line.get_data_3d()[0]))


def test_each_view_has_the_nodes_of_its_own_side() -> None:
    """From above the whole top and two edges of the bottom; from below the other way round."""
    figure = drawn()
    assert (points(figure, 0, "loaded"), points(figure, 0, "held")) == (9, 5)
    assert (points(figure, 1, "loaded"), points(figure, 1, "held")) == (5, 9)


def test_a_named_node_stands_where_it_is_seen() -> None:
    """The middle of the top: in the view from above only."""
    named = [
        [t.get_text().strip() for t in ax.texts if t.get_text().strip() == "A"]
        for ax in drawn().axes
    ]
    assert named == [["A"], []]


def test_the_words_count_the_nodes() -> None:
    picture = node_sets_picture("sets", "Sets.", MESH, SETS, {"A": 4})
    assert picture.alt == "Surface from two corners: nodes 9 held, 9 loaded; A by name."
    assert picture.pixels.shape[2] == 3
