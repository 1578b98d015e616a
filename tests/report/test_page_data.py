"""What the page's script is given: hashes of its libraries, curves, the body that turns."""

import base64
import json
import tomllib
from dataclasses import replace
from hashlib import sha256
from importlib.resources import files
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from phantoms import COARSE_GRID, phantom_mesh, phantom_scene
from report_samples import PRESS, SIDE, bare_result, small_result
from tracking_samples import tracking_result

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Exhibit, Intervals, Series
from validate.report.exhibits import draw_all
from validate.report.page.html import body_view, first_pictures, forest, plot
from validate.report.scenes.body_scene import body_scene
from validate.report.sections.observations import markers_seen
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Cavity, Scene

PAGE = files("validate.report.page")


def test_libraries_are_those_of_the_manifest() -> None:
    folder = PAGE.joinpath("vendor")
    listed = tomllib.loads(folder.joinpath("manifest.toml").read_text("utf-8"))
    hashes = {name: h for one in listed.values() for name, h in one["sha256"].items()}
    kept = {f.name for f in folder.iterdir() if f.name.endswith((".min.js", ".min.css"))}
    assert kept == set(hashes)
    for name, expected in hashes.items():
        content = folder.joinpath(name).read_bytes()
        assert sha256(content).hexdigest() == expected, name
        assert b"</script" not in content
    licences = folder.joinpath("LICENSES.txt").read_text("utf-8")
    assert all(f"== {name}" in licences for name in listed)


# --- curves ---------------------------------------------------------------------------------------


def plotted(x: Floats, y: Floats, **more: Any) -> dict[str, Any]:
    chart = Chart("c", "C", "t / s", "u / mm", (Series("soft", x, y, **more),))
    return plot(small_result(), chart)


def test_a_line_to_and_fro_is_a_series_for_each_way() -> None:
    x = np.array([0.0, 1.0, 2.0, 1.5, 0.5])
    found = plotted(x, np.arange(5.0))
    ways = [(found["xs"][s["x"]], s["y"]) for s in found["series"]]
    assert ways == [([0.0, 1.0, 2.0], [0.0, 1.0, 2.0]), ([0.5, 1.5, 2.0], [4.0, 3.0, 2.0])]


def test_a_line_that_turns_often_is_shown_by_its_points() -> None:
    x = np.tile([0.0, 1.0], 40)
    (series,) = plotted(x, np.arange(80.0))["series"]
    assert series["style"] == "points"
    assert len(series["y"]) == 80


def test_no_peak_is_lost() -> None:
    y = np.zeros(100_000)
    y[[31_234, 77_777]] = 5.0, -3.0
    (series,) = plotted(np.arange(100_000.0), y)["series"]
    assert len(series["y"]) < 2000
    assert (max(series["y"]), min(series["y"])) == (5.0, -3.0)


def test_of_many_lines_the_checked_ones_and_the_first_are_shown() -> None:
    x = np.arange(3.0)
    lines = tuple(Series(f"rival {i}", x, x + i) for i in range(7))
    band = Series("rival 6: noise", x, x, style="band", upper=x + 1)
    checked = next(m.label for m in small_result().methods if m.accepted)
    measured = Series("measured", x, x, style="points")
    shown = (*lines, band, measured, Series(checked, x, x))
    found = plot(small_result(), Chart("c", "C", "t / s", "u / mm", shown))["series"]
    hidden = [s["label"] for s in found if s["hidden"]]
    assert hidden == ["rival 4", "rival 5", "rival 6", "rival 6: noise"]


def test_curves_of_many_recordings_have_the_name_of_their_method() -> None:
    x = np.arange(3.0)
    lines = tuple(Series(label, x, x, of=f"log {i}") for i in range(7) for label in ("a", "b"))
    chart = Chart("c", "C", "t / s", "u / mm", lines)
    assert {s["label"] for s in plot(small_result(), chart)["series"]} == {"a", "b"}
    few = replace(chart, series=lines[:4])
    names = [s["label"] for s in plot(small_result(), few)["series"]]
    assert names == ["a, log 0", "b, log 0", "a, log 1", "b, log 1"]


def test_rounding_is_left_out_as_in_the_figure() -> None:
    x = np.arange(3.0)
    lines = (Series("a", x, x + 1), Series("exact", x, 1e-14 * (x + 1)))
    chart = Chart("c", "C", "t / s", "e / mm", lines, log="y")
    assert [s["label"] for s in plot(small_result(), chart)["series"]] == ["a"]
    linear = replace(chart, log="")
    assert len(plot(small_result(), linear)["series"]) == 2


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60))
def test_x_always_rises(x: list[float]) -> None:
    found = plotted(np.array(x), np.arange(float(len(x))))
    assert all(np.all(np.diff(column) >= 0) for column in found["xs"])
    assert sum(len(s["y"]) for s in found["series"]) >= len(x)
    json.dumps(found, allow_nan=False)


def test_without_a_body_the_first_picture_stands_on_the_first_screen() -> None:
    x = np.arange(3.0)
    chart = Chart("curve", "C", "t / s", "u / mm", (Series("a", x, x),))
    limits = Intervals("limits", "L", ("a",), x[:1], x[:1], x[1:2], ("",), ("good enough",))
    own = Exhibit("own", "Own", charts=(chart,))
    checks = Exhibit("checks", "Checks", intervals=(limits,))
    drawn = draw_all(bare_result(), (checks, own))
    assert [p.name for p in first_pictures(drawn)] == ["chart_curve", "intervals_limits"]
    assert [p.name for p in first_pictures(drawn[:1])] == ["intervals_limits"]


# --- checks against limits ------------------------------------------------------------------------


def test_a_line_lies_where_its_share_is() -> None:
    values, halves, limits = np.array([0.5, -9.0]), np.array([0.25, 1.0]), np.array([1.0, 1.0])
    found = forest(
        Intervals("limits", "L", ("m: a", "m: b"), values, halves, limits, ("", ""),
                  ("good enough", "differs"), quantities=("a", "b")),
        {"a": "#markers"},
    )  # fmt: skip
    far, near = found.lines
    assert (far.label, far.beyond, far.colour, far.link) == ("b", "below", "bad", "")
    assert (near.label, near.beyond, near.link) == ("a", "", "#markers")
    zero, one = found.zero, found.within[0] + found.within[1]
    assert near.at == pytest.approx(zero + 0.5 * (one - zero), abs=0.02)
    assert near.low == pytest.approx(zero + 0.25 * (one - zero), abs=0.02)
    assert near.wide == pytest.approx(0.5 * (one - zero), abs=0.03)


def test_what_decides_stands_above_what_was_fitted() -> None:
    values, ones = np.array([3.0, 0.1, 0.5]), np.ones(3)
    answers = ("fitted", "good enough", "undecided")
    shown = Intervals("limits", "L", ("a", "b", "c"), values, 0.1 * ones, ones, ("",) * 3, answers)
    assert [line.label for line in forest(shown, {}).lines] == ["c", "b", "a"]


# --- the body -------------------------------------------------------------------------------------


def array(text: str, kind: str) -> Any:
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def test_the_body_moves_as_computed() -> None:
    view = body_view(small_result())
    assert view is not None
    assert view["labels"] == ["0 mm", "2 mm"]
    first = view["methods"][0]
    nodes = array(first["nodes"], "<f4").reshape(-1, 3)
    u = first["u"]["top"] / 32767 * array(first["u"]["shares"], "<i2").reshape(2, -1, 3)
    assert np.ptp(nodes, axis=0) == pytest.approx(1e3 * SIDE)
    assert u[0] == pytest.approx(0.0)
    assert u[1, :, 0] == pytest.approx(-1e3 * PRESS * nodes[:, 0] / (1e3 * SIDE), abs=1e-3)
    strain = first["fields"]["largest principal strain / %"]
    found = strain["top"] / 32767 * array(strain["shares"], "<i2").reshape(2, -1)
    assert found == pytest.approx(0.0, abs=1e-3)  # pressed along x alone: no stretch anywhere
    young, nu, pressed = 1e4, 0.4, PRESS / SIDE
    uniaxial = young * pressed / (1 + nu)  # von Mises of a strain along x alone, Pa
    stress = first["fields"]["von Mises stress / Pa"]
    found = stress["top"] / 32767 * array(stress["shares"], "<i2").reshape(2, -1)
    assert found[1] == pytest.approx(uniaxial, rel=1e-3)


def test_markers_stand_where_they_were_measured() -> None:
    """At each instant shown: measured on the line between two samples, simulated by the run."""
    result = tracking_result()
    view = body_view(result)
    seen = markers_seen(result.methods[0])
    assert view is not None
    assert seen is not None
    shown = view["methods"][0]["markers"]
    count = len(view["labels"])
    run = result.methods[0].run
    scene = body_scene(result, count)
    assert scene is not None
    frames = scene.methods[0].frames
    measured = array(shown["measured"], "<f4").reshape(count, -1, 3)
    for i, t in enumerate(run.t[run.at][frames]):
        expected = [np.interp(t, seen.t, x) for x in seen.x.reshape(len(seen.t), -1).T]
        assert measured[i].ravel() == pytest.approx(1e3 * np.array(expected), abs=1e-4, nan_ok=True)
    simulated = array(shown["simulated"], "<f4").reshape(count, -1, 3)
    assert simulated[-1] == pytest.approx(1e3 * seen.simulated(run.u[-1]), abs=1e-4)


def test_nothing_finished_has_no_body() -> None:
    assert body_view(bare_result()) is None


def test_a_body_with_a_cavity_can_be_opened() -> None:
    result = small_result()
    scene = phantom_scene(phantom_mesh(COARSE_GRID))
    n = len(scene.mesh.nodes)
    method = result.methods[0]
    run = replace(method.run, u=np.zeros((2, n, 3)))
    one = replace(method, scene=scene, runs=(run, run))
    view = body_view(replace(result, methods=(one,)))
    assert view is not None
    assert {p["name"] for p in view["methods"][0]["parts"]} == {"outside", scene.cavities[0].name}
    wall = 1e3 * scene.mesh.nodes[scene.mesh.facet_nodes("cavity")]
    along = wall @ np.array(view["cut"]["normal"])
    assert along.min() < view["cut"]["at"] < along.max()


def test_a_planar_body_lies_flat_and_is_not_cut() -> None:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    mesh = Mesh(nodes, np.array([[0, 1, 2]]), "tri3", {"hole": np.array([[0, 1]])})
    scene = Scene(mesh, Material(1e4, 0.4), cavities=(Cavity("hole", "hole"),))
    method = small_result().methods[0]
    run = replace(method.run, u=np.zeros((2, 3, 2)))
    one = replace(method, scene=scene, runs=(run, run))
    view = body_view(replace(small_result(), methods=(one,)))
    assert view is not None
    assert view["flat"] is True
    assert view["cut"] is None
    assert array(view["methods"][0]["nodes"], "<f4").reshape(-1, 3)[:, 2] == pytest.approx(0.0)
