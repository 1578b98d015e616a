"""What a method's set-up costs: the scene, its assembly and the prepared, by a clock by hand."""

from itertools import count
from types import SimpleNamespace

import pytest

from validate.pipeline.ladder import default as ladder_default
from validate.pipeline.run import case_solution
from validate.scene.geometries.box import box, centroids

# private: _Runs, _points, _stepper: called alone, case by case.


def test_set_up_is_the_scene_and_what_is_made_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(case_solution, "perf_counter", count(100.0).__next__)
    monkeypatch.setattr(case_solution, "build_system", lambda scene: "system")
    scene = SimpleNamespace(mesh=box((1.0, 1.0, 1.0), (1, 1, 1)))
    method = SimpleNamespace(markers=(), prepare=lambda system, seen, given, own: f"on {system}")
    own = SimpleNamespace(methods={})
    runs = case_solution._Runs(own, "x", method, None, scene, 0.25, lambda words: None)
    assert runs._stepper(scene, None, {}) == ("on system", 1.25)
    assert runs._stepper(scene, None, {}) == ("on system", 1.25)  # made once


def test_points_of_a_ladder_lie_in_every_mesh() -> None:
    """A finer mesh that is shorter leaves out the coarse centroids beyond its end."""
    levels = {1: box((1.0, 1.0, 1.0), (4, 1, 1)), 2: box((0.5, 1.0, 1.0), (4, 2, 2))}
    own = SimpleNamespace(
        at=lambda level: SimpleNamespace(mesh=levels[level]), scene=SimpleNamespace(probes=())
    )
    points = ladder_default._points(own, {"P1": (1, 2)}, ("P1", 2))
    assert len(points) > 2
    assert (points[:, 0] < 0.5).all()


@pytest.mark.parametrize(("off", "kept"), [(5e-7, True), (5e-6, False)])
def test_a_point_within_rounding_of_a_face_is_inside(off: float, kept: bool) -> None:
    """Of a body of 1 km rounding is a micrometre."""
    coarse = box((1000.0, 1.0, 1.0), (1, 1, 1))
    last = float(centroids(coarse)[:, 0].max())
    levels = {1: coarse, 2: box((last - off, 1.0, 1.0), (1, 1, 1))}
    own = SimpleNamespace(
        at=lambda level: SimpleNamespace(mesh=levels[level]), scene=SimpleNamespace(probes=())
    )
    points = ladder_default._points(own, {"P1": (1,)}, ("P1", 2))
    assert (points[:, 0].max() == last) == kept
