"""replay.mcap: the numbers that were judged, on the recording's clock, in Foxglove's Protobuf."""

import importlib.util
import json
import os
import re
import shutil
import struct
import subprocess
import sys
from collections import defaultdict
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args, get_type_hints

import cv2
import numpy as np
import pytest
from foxglove import layouts
from google.protobuf import descriptor_pb2, descriptor_pool
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from report_samples import bare_result, small_result
from script_modules import module_of

from validate.arrays import Floats
from validate.compare.result import Result
from validate.installation import install_command
from validate.recording.mcap.read import read_recording
from validate.recording.preflight import Inspection
from validate.recording.types import Frames
from validate.register.outlines.outlines import normal_distances
from validate.register.outlines.sections import from_image
from validate.report.replay import mcap as replay_mcap
from validate.report.replay import space as replay_signals
from validate.report.replay.mcap import tracks, views, write_replay
from validate.report.replay.view import Track
from validate.report.sections import observations
from validate.scene.mesh import boundary_facets

# private: _ALL: a limit or list of the code, which the test must meet exactly.
# private: _IMAGE_BYTES, _SAMPLES: replaced by a small number: a short test.

pytestmark = [pytest.mark.xdist_group("two methods of the phantom"), pytest.mark.slow]
Messages = dict[str, list[tuple[int, Any]]]
LOADS = ("0mm", "3mm", "6mm", "9mm")


def read(path: Path) -> Messages:
    """Messages by topic, by the mcap package and its Protobuf decoder, CRCs checked."""
    found: Messages = defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, content in reader.iter_decoded_messages(log_time_order=False):
            found[channel.topic].append((message.log_time, plain(content)))
    return dict(found)


def plain(value: Any) -> Any:
    """Protobuf's messages as dicts, its times as {sec, nsec}."""
    descriptor = getattr(value, "DESCRIPTOR", None)
    if descriptor is None:
        return value
    if descriptor.name == "Timestamp":
        return {"sec": value.seconds, "nsec": value.nanos}
    return {
        f.name: [plain(v) for v in inner] if f.is_repeated else plain(inner)
        for f in descriptor.fields
        for inner in (getattr(value, f.name),)
    }


def cloud(message: dict[str, Any]) -> Floats:
    """Points (k, 3) m and colours 0..255 (k, 4) of a packed cloud, as rows of seven numbers."""
    kinds = {7: "<f4", 1: "u1"}  # of foxglove.PackedElementField
    fields = message["fields"]
    layout = np.dtype(
        {
            "names": [f["name"] for f in fields],
            "formats": [kinds[f["type"]] for f in fields],
            "offsets": [f["offset"] for f in fields],
            "itemsize": message["point_stride"],
        }
    )
    rows = np.frombuffer(message["data"], layout)
    return np.stack([rows[name].astype(float) for name in layout.names or ()], axis=1)


def metadata(path: Path) -> dict[str, dict[str, str]]:
    with path.open("rb") as stream:
        return {m.name: dict(m.metadata) for m in make_reader(stream).iter_metadata()}


@pytest.fixture(scope="module")
def path(result: Result, tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("replay") / "replay.mcap"
    write_replay(result, made)
    return made


@pytest.fixture(scope="module")
def messages(path: Path) -> Messages:
    return read(path)


def points(listed: list[dict[str, float]]) -> Floats:
    return np.array([[p["x"], p["y"], p["z"]] for p in listed])


def parent_from(messages: Messages, child: str) -> Floats:
    """T_parent_from_child (4, 4) of /tf, its quaternion unfolded here by the textbook formula."""
    ((_, content),) = messages["/tf"]
    (found,) = (t for t in content["transforms"] if t["child_frame_id"] == child)
    assert found["parent_frame_id"] == "phantom"
    x, y, z, w = (found["rotation"][k] for k in "xyzw")
    assert x * x + y * y + z * z + w * w == pytest.approx(1.0, abs=1e-12)
    T = np.eye(4)
    T[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    T[:3, 3] = [found["translation"][k] for k in "xyz"]
    return T


def test_counts_per_topic(messages: Messages) -> None:
    assert {topic: len(found) for topic, found in messages.items()} == {
        "/tf": 1, "/stage/measured": 371,
        "/force/measured": 371, "/force/simulated": 371,
        "/pressure/measured": 371, "/pressure/simulated": 371,
        "/outline/measured": 4, "/outline/measured/scene": 4, "/outline/measured/points": 4,
        "/outline/simulated": 4, "/outline/simulated/scene": 61, "/outline/simulated/points": 61,
        "/markers/measured": 4, "/markers/measured/scene": 4, "/markers/measured/points": 4,
        "/markers/simulated": 4, "/markers/simulated/scene": 61, "/markers/simulated/points": 61,
        "/surface/simulated/scene": 61, "/surface/simulated/points": 61,
    }  # fmt: skip


def test_inspected_without_defects(path: Path) -> None:
    seen = Inspection.of(path)
    assert seen.defects == ()
    assert seen.source.integrity == "verified"
    units = {t.name: t.unit for t in seen.topics if t.kind == "signal"}
    assert units["/force/measured"] == units["/force/simulated"] == "N"
    assert units["/pressure/measured"] == units["/pressure/simulated"] == "Pa"
    assert path.stat().st_size < 5_000_000


def test_one_timeline_on_the_recordings_clock(
    path: Path, messages: Messages, result: Result
) -> None:
    with path.open("rb") as stream:
        reader = make_reader(stream)
        times = [m.log_time for _, _, m in reader.iter_messages(log_time_order=False)]
    assert all(a <= b for a, b in pairwise(times))
    recording = result.recordings[0]
    assert times[0] == recording.t0_ns
    force = [ns for ns, _ in messages["/force/simulated"]]
    assert force == (recording.t0_ns + np.rint(1e9 * result.methods[0].run.t)).astype(int).tolist()
    for topic, found in messages.items():
        ns = [n for n, _ in found]
        assert all(a < b for a, b in pairwise(ns)), topic
        stamps = [c.get("stamp") or c.get("timestamp") for _, c in found]
        assert all(s is None or s["sec"] * 10**9 + s["nsec"] == n
                   for s, n in zip(stamps, ns, strict=True)), topic  # fmt: skip
        entities = [(e["timestamp"], n) for n, c in found for e in c.get("entities", [])]
        assert all(s["sec"] * 10**9 + s["nsec"] == n for s, n in entities), topic


def test_tf_comes_first(path: Path) -> None:
    with path.open("rb") as stream:
        first = next(iter(make_reader(stream).iter_messages(log_time_order=False)))
    assert first[1].topic == "/tf"


def test_forces_and_pressures_are_those_compared(messages: Messages, result: Result) -> None:
    run, seen = result.methods[0].run, result.methods[0].registered[0]
    for s, name in zip(observations.signals(seen), ("force", "pressure"), strict=True):
        for who, y, sd in (("measured", s.y, s.sd), ("simulated", run.traces[s.trace].y, 0.0)):
            found = [c for _, c in messages[f"/{name}/{who}"]]
            assert [c["values"] for c in found] == np.reshape(y, (-1, 1)).tolist()
            assert {(c["unit"], c["sd"]) for c in found} == {(s.unit, sd)}


def test_our_reader_reads_the_outlines_that_were_judged(path: Path, result: Result) -> None:
    back = read_recording(path)
    measured, simulated = back.contour("/outline/measured"), back.contour("/outline/simulated")
    for i, load in enumerate(LOADS[1:], start=1):
        apart = normal_distances(simulated.outlines[i], measured.outlines[i])
        residual = result.methods[0].residuals[f"contour@{load}"].values[:, 0]
        assert apart == pytest.approx(residual, abs=1e-12)
    original = result.recordings[0].contour("outline")
    assert all(np.array_equal(*pair) for pair in zip(measured.outlines, original.outlines,
                                                     strict=True))  # fmt: skip
    assert np.array_equal(measured.pose, original.pose)


def test_a_measured_marker_lands_where_the_comparison_has_it(
    messages: Messages, result: Result
) -> None:
    seen = observations.markers(result.methods[0].registered[0])
    assert seen is not None
    T = parent_from(messages, "pen")
    for i, (_, content) in enumerate(messages["/markers/measured"]):
        assert content["frame"] == "pen"
        assert tuple(content["names"]) == seen.names
        x = np.array([content[k] for k in "xyz"], dtype=float).T
        assert x @ T[:3, :3].T + T[:3, 3] == pytest.approx(seen.x[i], abs=1e-12, nan_ok=True)
        (ball,) = messages["/markers/measured/scene"][i][1]["entities"]
        there = points([s["pose"]["position"] for s in ball["spheres"]])
        assert ball["frame_id"] == "pen"
        assert np.array_equal(there, x[np.isfinite(x).all(axis=1)])
    assert np.abs(T[:3, :3] - np.eye(3)).max() > 0.1  # a pen that is turned, else nothing is tested


def test_simulated_less_measured_markers_are_the_residual(
    messages: Messages, result: Result
) -> None:
    T = parent_from(messages, "pen")
    measured, simulated = (
        np.array([[c[k] for k in "xyz"] for _, c in messages[f"/markers/{who}"]], dtype=float)
        for who in ("measured", "simulated")
    )
    for i, load in enumerate(LOADS[1:], start=1):
        off = simulated[i].T - (measured[i].T @ T[:3, :3].T + T[:3, 3])
        off = off[np.isfinite(off).all(axis=1)]
        residuals = result.methods[0].residuals
        for name, axes in (("marker.inplane", [0, 2]), ("marker.vertical", [1])):
            expected = residuals[f"{name}@{load}"].values
            assert off[:, axes] == pytest.approx(expected, abs=1e-12)


def test_outlines_to_look_at_lie_in_the_image_plane(messages: Messages, result: Result) -> None:
    seen = observations.outline(result.methods[0].registered[0])
    assert seen is not None
    T = parent_from(messages, "image")
    for i, (ns, content) in enumerate(messages["/outline/simulated"]):
        (line,) = (
            e["lines"][0]
            for n, c in messages["/outline/simulated/scene"]
            for e in c["entities"]
            if n == ns
        )
        drawn = points(line["points"])
        flat = np.array([content["x"], content["y"]]).T
        assert line["type"] == 1
        assert np.array_equal(drawn, np.hstack([flat, np.zeros((len(flat), 1))]))
        there = from_image(seen.pose, seen.simulated(result.methods[0].run.u[i]))
        assert drawn @ T[:3, :3].T + T[:3, 3] == pytest.approx(there, abs=1e-12)


def test_the_surface_is_the_deformed_boundary(messages: Messages, result: Result) -> None:
    method = result.methods[0]
    mesh, u = method.scene.mesh, method.run.u[-1]
    ns, content = messages["/surface/simulated/scene"][-1]
    assert ns == messages["/outline/simulated"][-1][0]
    outside, wall = content["entities"]
    assert (outside["id"], wall["id"]) == ("surface outside", "surface inclusion")
    corners = []
    for entity in (outside, wall):
        (part,) = entity["triangles"]
        assert len(part["points"]) == len(part["colors"])
        corners.append(points(part["points"])[np.array(part["indices"]).reshape(-1, 3)])
        assert {m["key"]: m["value"] for m in entity["metadata"]}["load"] == "9 mm"
    assert len(corners[1]) == len(mesh.facets["cavity"])
    expected = (mesh.nodes + u)[boundary_facets(mesh.corners, 3)]
    drawn = np.vstack(corners)
    assert np.array_equal(np.sort(_centres(drawn)), np.sort(_centres(np.round(expected, 6))))
    assert {c["a"] for c in outside["triangles"][0]["colors"]} == {0.3}
    assert {c["a"] for c in wall["triangles"][0]["colors"]} == {1.0}


def _centres(corners: Floats) -> Floats:
    return np.round(corners.sum(axis=1), 9).view([("", float)] * 3).ravel()


def test_colours_grow_with_displacement(messages: Messages) -> None:
    rest, last = (
        messages["/surface/simulated/scene"][i][1]["entities"][0]["triangles"][0]["colors"]
        for i in (0, -1)
    )
    violet, yellow = (0.267, 0.005, 0.329), (0.993, 0.906, 0.144)  # the ends of viridis
    assert all((c["r"], c["g"], c["b"]) == pytest.approx(violet, abs=2e-3) for c in rest)
    assert any((c["r"], c["g"], c["b"]) == pytest.approx(yellow, abs=2e-3) for c in last)


def test_between_loads_it_says_interpolated(messages: Messages, result: Result) -> None:
    known = {ns for ns, _ in messages["/outline/simulated"]}
    for topic in (
        "/outline/simulated/scene",
        "/markers/simulated/scene",
        "/surface/simulated/scene",
    ):
        for ns, content in messages[topic]:
            for entity in content["entities"]:
                said = {m["key"]: m["value"] for m in entity["metadata"]}["load"]
                assert ("interpolated" in said) == (ns not in known), topic


def test_what_it_was_made_from(path: Path, result: Result) -> None:
    found = metadata(path)
    source = result.recordings[0].source
    assert found["input/fluid_phantom"] == {
        "path": "fluid_phantom.mcap", "sha256": source.sha256, "bytes": str(source.bytes),
        "integrity": "verified",
    }  # fmt: skip
    record = found["validate.pipeline"]
    assert (record["experiment"], record["method"]) == ("fluid_phantom", "p1_fluid")
    assert (record["thinned"], record["left_out"]) == ("nothing", "other methods: p1_dry")
    assert "linearly in the drive" in record["interpolated"]


def test_same_result_same_bytes(result: Result, path: Path, tmp_path: Path) -> None:
    write_replay(result, tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()


def test_every_schema_stands_alone(path: Path) -> None:
    """A reader without Foxglove's files can build every type from those in the file."""
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert {c.message_encoding for c in summary.channels.values()} == {"protobuf"}
    for schema in summary.schemas.values():
        pool = descriptor_pool.DescriptorPool()
        for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
            pool.Add(file)
        assert schema.encoding == "protobuf"
        assert pool.FindMessageTypeByName(schema.name).full_name == schema.name
    assert {s.name for s in summary.schemas.values()} == {
        "validate.Signal", "validate.Contour", "validate.Markers", "foxglove.SceneUpdate",
        "foxglove.PointCloud", "foxglove.FrameTransforms",
    }  # fmt: skip


def test_points_are_what_the_scenes_draw(messages: Messages) -> None:
    """For viewers without scenes: the same places to float32, in the same colours."""
    for what in ("outline/measured", "outline/simulated", "markers/measured", "markers/simulated"):
        scenes, clouds = messages[f"/{what}/scene"], messages[f"/{what}/points"]
        assert [ns for ns, _ in clouds] == [ns for ns, _ in scenes]
        for (_, scene), (_, packed) in zip(scenes, clouds, strict=True):
            (entity,) = scene["entities"]
            places = [s["pose"]["position"] for s in entity["spheres"]] or entity["lines"][0][
                "points"
            ]
            rows = cloud(packed)
            assert packed["frame_id"] == entity["frame_id"]
            np.testing.assert_allclose(rows[:, :3], points(places), atol=1e-8)
            drawn = (entity["spheres"] or entity["lines"])[0]["color"]
            assert set(map(tuple, rows[:, 3:])) == {tuple(round(255 * drawn[k]) for k in "rgba")}


def test_the_surface_as_points_is_its_nodes(messages: Messages, result: Result) -> None:
    method = result.methods[0]
    rows = cloud(messages["/surface/simulated/points"][-1][1])
    there = method.scene.mesh.nodes + method.run.u[-1]
    surface = np.unique(boundary_facets(method.scene.mesh.corners, 3))
    np.testing.assert_allclose(rows[:, :3], there[surface], atol=1e-8)
    assert (rows[:, 6] == 255).all()


# --- two readers of others -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def by_node(path: Path, project_root: Path) -> dict[str, Any]:
    """What the MCAP project's TypeScript reader finds, checked by ajv against what is published."""
    modules = os.environ.get("VALIDATE_NODE_MODULES")
    if not modules or shutil.which("node") is None:
        assert os.environ.get("VALIDATE_REQUIRE_NODE") != "1", "no node or no VALIDATE_NODE_MODULES"
        pytest.skip("no VALIDATE_NODE_MODULES (VALIDATE_REQUIRE_NODE=1 makes this a failure)")
    script = project_root / "tests" / "report" / "read_replay.mjs"
    done = subprocess.run(
        ["node", str(script), str(path)], capture_output=True, text=True, timeout=120, check=True
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_node_reads_the_same(by_node: dict[str, Any], messages: Messages, path: Path) -> None:
    assert by_node["ordered"]
    counted = {
        topic: (found["count"], int(found["first"]), int(found["last"]))
        for topic, found in by_node["topics"].items()
    }
    assert counted == {t: (len(m), m[0][0], m[-1][0]) for t, m in messages.items()}
    assert by_node["metadata"] == metadata(path)


def test_every_message_fits_what_foxglove_publishes(by_node: dict[str, Any]) -> None:
    assert by_node["wrong"] == []
    assert by_node["checked"] == 1 + 2 * (2 * 4 + 3 * 61)
    assert set(by_node["published"]) == {
        "foxglove.SceneUpdate", "foxglove.FrameTransforms", "foxglove.PointCloud"
    }  # fmt: skip


def test_node_decodes_our_own_messages(by_node: dict[str, Any], messages: Messages) -> None:
    for topic in ("/force/measured", "/outline/simulated", "/markers/simulated"):
        assert by_node["topics"][topic]["example"] == messages[topic][0][1]


@pytest.fixture(scope="module")
def by_rerun(path: Path, project_root: Path) -> dict[str, Any]:
    """What Rerun's own reader makes of each topic."""
    if importlib.util.find_spec("rerun") is None:
        assert os.environ.get("VALIDATE_REQUIRE_RERUN") != "1", "no rerun-sdk"
        pytest.skip(f"no rerun-sdk; {install_command('viewers')}")
    script = project_root / "tests" / "report" / "read_by_rerun.py"
    done = subprocess.run(
        [sys.executable, str(script), str(path)],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def test_rerun_decodes_every_message(by_rerun: dict[str, Any], messages: Messages) -> None:
    """None is left as bytes; what it draws is drawn, the fields of the others are there."""
    drawn = {"/tf": "Transform3D:translation"}
    for topic, there in messages.items():
        own = {"points": "Points3D:positions", "scene": "foxglove.SceneUpdate:message"}
        kind = {"outline": "Contour", "markers": "Markers"}.get(topic.split("/")[1], "Signal")
        column = drawn.get(topic) or own.get(topic.split("/")[-1]) or f"validate.{kind}:message"
        rows = by_rerun["/" + topic.strip("/")]["rows"]
        assert rows[column] == (2 if topic == "/tf" else len(there)), topic
        assert not any("McapMessage" in name for name in rows)


def test_rerun_has_the_numbers(by_rerun: dict[str, Any], messages: Messages) -> None:
    (_, sample), *_ = messages["/force/measured"]
    (force,) = by_rerun["/force/measured"]["first"]["validate.Signal:message"]
    assert force["values"] == sample["values"]
    assert force["unit"] == "N"
    there = by_rerun["/markers/simulated/points"]["first"]
    (_, packed), *_ = messages["/markers/simulated/points"]
    np.testing.assert_array_equal(there["Points3D:positions"], cloud(packed)[:, :3])
    assert there["CoordinateFrame:frame"] == ["phantom"]
    children = by_rerun["/tf"]["first"]["Transform3D:child_frame"]
    assert children == ["image"]


# --- the layout ----------------------------------------------------------------------------------


def leaves(tree: Any) -> list[str]:
    """The panels of a tree of splits, each of which has two sides."""
    if isinstance(tree, str):
        return [tree]
    assert set(tree) == {"first", "second", "direction", "splitPercentage"}
    assert tree["direction"] in ("row", "column")
    assert 0 < tree["splitPercentage"] < 100
    return leaves(tree["first"]) + leaves(tree["second"])


def as_foxgloves(kind: Any, config: dict[str, Any]) -> Any:
    """A panel's settings in the types that Foxglove publishes for them: every key one of theirs,
    every word one of those allowed."""
    known = get_type_hints(kind)
    values = {}
    for key, value in config.items():
        name = re.sub("([A-Z])", r"_\1", key).lower()
        assert name in known, f"{kind.__name__} has no {key}"
        allowed = [a for part in get_args(known[name]) for a in get_args(part)]
        if isinstance(value, str) and allowed and all(isinstance(a, str) for a in allowed):
            assert value in allowed, f"{key} = {value}"
        values[name] = value
    return kind(**values)


def test_the_panels_are_settings_that_foxglove_knows(path: Path) -> None:
    """Read into the vendor's own types (foxglove-sdk), and written by them again as they were."""
    parts = {"cameraState": layouts.ThreeDeeCameraState, "imageMode": layouts.ImageModeConfig}
    kinds = {"Plot": layouts.PlotConfig, "3D": layouts.ThreeDeeConfig, "Image": layouts.ImageConfig}
    made = json.loads(path.with_suffix(".layout.json").read_text("utf-8"))
    seen = set()
    for name, config in made["configById"].items():
        title = config.pop("foxglovePanelTitle")
        own = {**config, "paths": [as_foxgloves(layouts.PlotSeries, s) for s in config["paths"]]
               } if "paths" in config else dict(config)  # fmt: skip
        for key, kind in parts.items():
            if key in own:
                own[key] = as_foxgloves(kind, own[key])
        panel = as_foxgloves(kinds[name.partition("!")[0]], own)
        assert title
        assert json.loads(panel.to_json()) == config
        seen.add(name.partition("!")[0])
    assert seen >= {"Plot", "3D"}


def test_the_layout_shows_every_topic_of_the_replay(path: Path, messages: Messages) -> None:
    made = json.loads(path.with_suffix(".layout.json").read_text("utf-8"))
    panels = made["configById"]
    assert sorted(leaves(made["layout"])) == sorted(panels)
    (space,) = (p for name, p in panels.items() if name.startswith("3D!"))
    seen = {t for t, there in messages.items() if t.endswith(("/scene", "/points"))}
    assert set(space["topics"]) == seen
    assert {t for t, s in space["topics"].items() if s["visible"]} == {
        t for t in seen if t.endswith("/scene")
    }
    frames = {e["frame_id"] for _, c in messages["/surface/simulated/scene"]
              for e in c["entities"]}  # fmt: skip
    assert frames == {space["followTf"]}
    plots = {p["foxglovePanelTitle"]: p for n, p in panels.items() if n.startswith("Plot!")}
    assert set(plots) == {"stage / m", "force / N", "pressure / Pa"}
    for plot in plots.values():
        for series in plot["paths"]:
            topic, _, field = series["value"].partition(".")
            assert len(messages[topic][0][1]["values"]) == 1
            assert field == "values[0]"
    assert [s["label"] for s in plots["force / N"]["paths"]] == ["measured", "simulated"]


def test_the_camera_sees_the_body(path: Path, result: Result) -> None:
    made = json.loads(path.with_suffix(".layout.json").read_text("utf-8"))
    camera = made["configById"][made["layout"]["first"]]["cameraState"]
    nodes = result.methods[0].scene.mesh.nodes
    away = np.linalg.norm(nodes - camera["target"], axis=1)
    assert camera["near"] < camera["distance"] - away.max()
    assert camera["far"] > camera["distance"] + away.max()
    wide = camera["distance"] * np.tan(np.deg2rad(camera["fovy"] / 2))
    assert 0.5 * wide < away.max() < 1.2 * wide


def test_several_recordings_have_a_tab_each(tmp_path: Path) -> None:
    write_replay(small_result(), tmp_path / "replay.mcap")
    made = json.loads((tmp_path / "replay.layout.json").read_text("utf-8"))
    tabs = made["configById"][made["layout"]]["tabs"]
    assert [t["title"] for t in tabs] == ["cube_a", "cube_b"]
    shown = [name for tab in tabs for name in leaves(tab["layout"])]
    assert sorted([*shown, made["layout"]]) == sorted(made["configById"])


# --- a third reader ------------------------------------------------------------------------------


def test_a_walk_by_the_specification_reads_the_same(
    path: Path, messages: Messages, project_root: Path
) -> None:
    where = project_root / "tests" / "recording" / "mcap_samples.py"
    module = module_of(where)
    topics: dict[int, str] = {}
    found: Messages = defaultdict(list)
    for opcode, content in module.walk(path.read_bytes()):
        if opcode == 4:
            topics[struct.unpack_from("<H", content)[0]] = module.text_at(content, 4)[0]
        if opcode == 5:
            channel, _, ns, publish = struct.unpack_from("<HIQQ", content)
            assert ns == publish
            found[topics[channel]].append((ns, content[22:]))
    with path.open("rb") as stream:
        theirs: Messages = defaultdict(list)
        for _, their_channel, message in make_reader(stream).iter_messages(log_time_order=False):
            theirs[their_channel.topic].append((message.log_time, message.data))
    assert found == theirs


# --- other results -------------------------------------------------------------------------------


def test_several_recordings_each_under_its_name(tmp_path: Path) -> None:
    write_replay(small_result(), tmp_path / "replay.mcap")
    found = read(tmp_path / "replay.mcap")
    assert {t: len(m) for t, m in found.items()} == {
        f"/{name}/{topic}": n
        for name in ("cube_a", "cube_b")
        for topic, n in (("stage/measured", 21), ("force/measured", 21), ("force/simulated", 21),
                         ("surface/simulated/scene", 61), ("surface/simulated/points", 61))
    }  # fmt: skip
    assert set(metadata(tmp_path / "replay.mcap")) == {
        "validate.pipeline", "input/cube_a", "input/cube_b"
    }  # fmt: skip
    assert "/somewhere" not in str(metadata(tmp_path / "replay.mcap"))
    assert Inspection.of(tmp_path / "replay.mcap").defects == ()


def test_recordings_of_one_name_are_numbered() -> None:
    result = small_result()
    twins = replace(result, recordings=(result.recordings[0], result.recordings[0]))
    assert [v.prefix for v in views(twins)] == ["/1_cube_a", "/2_cube_a"]


def test_nothing_simulated_when_nothing_finished(tmp_path: Path) -> None:
    result = small_result()
    ended = replace(bare_result().methods[0], registered=result.registered)
    ended = replace(ended, runs=(ended.run, ended.run))
    write_replay(replace(result, methods=(ended,)), tmp_path / "replay.mcap")
    assert all(t.endswith("/measured") for t in read(tmp_path / "replay.mcap"))
    left_out = metadata(tmp_path / "replay.mcap")["validate.pipeline"]["left_out"]
    assert left_out == "everything simulated: no method finished"


def test_without_recordings_only_metadata(tmp_path: Path) -> None:
    write_replay(bare_result(), tmp_path / "replay.mcap")
    assert read(tmp_path / "replay.mcap") == {}
    assert Inspection.of(tmp_path / "replay.mcap").defects == ()


def test_a_signal_without_a_trace_is_named(tmp_path: Path) -> None:
    result = small_result()
    one = result.methods[0]
    runs = tuple(replace(r, traces={"updates": r.traces["updates"]}) for r in one.runs)
    write_replay(replace(result, methods=(replace(one, runs=runs),)), tmp_path / "replay.mcap")
    left_out = metadata(tmp_path / "replay.mcap")["validate.pipeline"]["left_out"]
    assert "/cube_a/force/simulated: the run does not predict it" in left_out


def decoded(track: Track, i: int) -> Any:
    """The message of number i, by the mcap package's Protobuf decoder."""
    schema = replay_mcap._ALL[track.schema]
    theirs = Schema(1, schema.data, schema.encoding, schema.name)
    decode = DecoderFactory().decoder_for("protobuf", theirs)
    assert decode is not None
    return plain(decode(track.message(i)))


def test_a_scaled_registration_leaves_markers_in_the_scene(result: Result) -> None:
    """A transform of Foxglove has no scale: the markers are put where the comparison has them."""
    one = result.methods[0]
    seen = observations.markers(one.registered[0])
    assert seen is not None
    transform = replace(seen.registration.transform, s=1.01)
    registration = replace(seen.registration, transform=transform)
    scaled = replace(seen, registration=registration)
    others = (o for o in one.registered[0].observations if o is not seen)
    registered = replace(one.registered[0], observations=(*others, scaled))
    methods = (replace(one, registered=(registered,)),)
    (view,) = views(replace(result, methods=methods))
    found = {t.topic: t for t in tracks(view)}
    tf = decoded(found["/tf"], 0)["transforms"]
    assert [t["child_frame_id"] for t in tf] == ["image"]
    content = decoded(found["/markers/measured"], 3)
    assert content["frame"] == "phantom"
    x = np.array([content[k] for k in "xyz"], dtype=float).T
    assert np.array_equal(x, seen.x[3], equal_nan=True)


# --- images and size -----------------------------------------------------------------------------


def with_images(result: Result, count: int) -> Result:
    recording = result.recordings[0]
    rng = np.random.default_rng(3)
    images = tuple(rng.integers(0, 256, (40, 30), dtype=np.uint8) for _ in range(count))
    t = np.linspace(3.5, 33.5, count)
    frames = Frames(t, images, (2e-4, 1e-4), recording.contour("outline").pose, "phantom")
    return replace(result, recordings=(replace(recording, frames={"bmode": frames}),))


def test_images_are_those_recorded(result: Result, tmp_path: Path) -> None:
    imaged = with_images(result, 4)
    write_replay(imaged, tmp_path / "replay.mcap")
    back = read_recording(tmp_path / "replay.mcap").frames["/image/measured"]
    original = imaged.recordings[0].frames["bmode"]
    assert all(np.array_equal(*pair) for pair in zip(back.images, original.images, strict=True))
    assert back.m_per_px == original.m_per_px
    assert np.array_equal(back.pose, original.pose)
    assert Inspection.of(tmp_path / "replay.mcap").defects == ()
    (_, content), *_ = read(tmp_path / "replay.mcap")["/image/measured"]
    shown = cv2.imdecode(np.frombuffer(content["data"], np.uint8), cv2.IMREAD_UNCHANGED)
    assert content["format"] == "png"
    assert np.array_equal(shown, original.images[0])


def test_many_images_are_thinned_but_for_the_loads(
    result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_signals, "_IMAGE_BYTES", 20_000)
    write_replay(with_images(result, 31), tmp_path / "replay.mcap")
    found = read(tmp_path / "replay.mcap")
    kept = [ns for ns, _ in found["/image/measured"]]
    assert 8 <= len(kept) < 20
    assert {ns for ns, _ in found["/outline/measured"]} <= set(kept)
    thinned = metadata(tmp_path / "replay.mcap")["validate.pipeline"]["thinned"]
    assert "of 31 images, and those at the loads" in thinned


def test_too_large_a_file_is_thinned_and_says_so(
    result: Result, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_mcap, "MAX_BYTES", path.stat().st_size // 2)
    monkeypatch.setattr(replay_signals, "_SAMPLES", 400)
    write_replay(result, tmp_path / "replay.mcap")
    assert (tmp_path / "replay.mcap").stat().st_size <= path.stat().st_size // 2
    found = read(tmp_path / "replay.mcap")
    assert 10 <= len(found["/surface/simulated/scene"]) < 61
    assert len(found["/outline/simulated"]) == 4
    assert len(found["/force/measured"]) < 371
    thinned = metadata(tmp_path / "replay.mcap")["validate.pipeline"]["thinned"]
    assert "/force/measured: one in" in thinned
    assert "interpolated instants: one in 4" in thinned
