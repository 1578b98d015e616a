"""replay.mcap: the numbers that were judged, on the recording's clock, in Foxglove's schemas."""

import importlib.util
import json
import os
import shutil
import struct
import subprocess
from collections import defaultdict
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader
from report_samples import bare_result, small_result

from validate.arrays import Floats
from validate.compare.result import Result
from validate.recording.mcap.read import read_recording
from validate.recording.preflight import inspect_recording
from validate.recording.types import Frames
from validate.register.outline_geometry import normal_distances
from validate.register.plane import from_image
from validate.report import observed, replay_mcap, replay_signals
from validate.report.foxglove_schemas import DEFINITIONS
from validate.report.replay_mcap import tracks, views, write_replay
from validate.scene.mesh import boundary_facets

pytestmark = [pytest.mark.xdist_group("two methods of the phantom"), pytest.mark.slow]
Messages = dict[str, list[tuple[int, Any]]]
LOADS = ("0mm", "3mm", "6mm", "9mm")


def read(path: Path) -> Messages:
    """Messages by topic, by the mcap package, CRCs checked."""
    found: Messages = defaultdict(list)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        for _, channel, message in reader.iter_messages(log_time_order=False):
            found[channel.topic].append((message.log_time, json.loads(message.data)))
    return dict(found)


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
        "/outline/measured": 4, "/outline/measured/scene": 4,
        "/outline/simulated": 4, "/outline/simulated/scene": 61,
        "/markers/measured": 4, "/markers/measured/scene": 4,
        "/markers/simulated": 4, "/markers/simulated/scene": 61,
        "/surface/simulated": 61,
    }  # fmt: skip


def test_inspected_without_defects(path: Path) -> None:
    seen = inspect_recording(path)
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
    for s, name in zip(observed.signals(seen), ("force", "pressure"), strict=True):
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
    seen = observed.markers(result.methods[0].registered[0])
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
    seen = observed.outline(result.methods[0].registered[0])
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
    ns, content = messages["/surface/simulated"][-1]
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
        messages["/surface/simulated"][i][1]["entities"][0]["triangles"][0]["colors"]
        for i in (0, -1)
    )
    violet, yellow = (0.267, 0.005, 0.329), (0.993, 0.906, 0.144)  # the ends of viridis
    assert all((c["r"], c["g"], c["b"]) == pytest.approx(violet, abs=2e-3) for c in rest)
    assert any((c["r"], c["g"], c["b"]) == pytest.approx(yellow, abs=2e-3) for c in last)


def test_between_loads_it_says_interpolated(messages: Messages, result: Result) -> None:
    known = {ns for ns, _ in messages["/outline/simulated"]}
    for topic in ("/outline/simulated/scene", "/markers/simulated/scene", "/surface/simulated"):
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
    record = found["validate.replay"]
    assert (record["experiment"], record["method"]) == ("fluid_phantom", "p1_fluid")
    assert (record["thinned"], record["left_out"]) == ("nothing", "other methods: p1_dry")
    assert "linearly in the drive" in record["interpolated"]


def test_same_result_same_bytes(result: Result, path: Path, tmp_path: Path) -> None:
    write_replay(result, tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == path.read_bytes()


def test_every_kind_of_message_fits_its_schema(path: Path) -> None:
    """All messages but the many of a signal and of a surface: the node reader checks those too."""
    checked = 0
    with path.open("rb") as stream:
        reader = make_reader(stream)
        validators: dict[str, Any] = {}
        counts: dict[str, int] = defaultdict(int)
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            counts[channel.topic] += 1
            if counts[channel.topic] > (2 if channel.topic.startswith("/surface") else 70):
                continue
            definition = json.loads(schema.data)
            if schema.name in DEFINITIONS:
                assert definition == DEFINITIONS[schema.name]
            validator = validators.setdefault(schema.name, jsonschema.Draft7Validator(definition))
            validator.validate(json.loads(message.data))
            checked += 1
    assert checked > 450
    assert {"foxglove.SceneUpdate", "foxglove.FrameTransforms", "validate.Signal"} < set(validators)


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
    assert by_node["checked"] == 1 + 2 * 4 + 3 * 61


def test_our_definitions_are_those_published(by_node: dict[str, Any]) -> None:
    assert len(by_node["published"]) == 2
    for name, published in by_node["published"].items():
        assert _bare(published) == DEFINITIONS[name]


def _bare(schema: Any) -> Any:
    """Without descriptions and comments, where these are keywords and no properties."""
    if isinstance(schema, list):
        return [_bare(s) for s in schema]
    if not isinstance(schema, dict):
        return schema
    kept = {k: v for k, v in schema.items() if k not in ("description", "$comment")}
    return {
        k: {name: _bare(s) for name, s in v.items()} if k == "properties" else _bare(v)
        for k, v in kept.items()
    }


def test_a_walk_by_the_specification_reads_the_same(
    path: Path, messages: Messages, project_root: Path
) -> None:
    where = project_root / "tests" / "recording" / "mcap_samples.py"
    spec = importlib.util.spec_from_file_location("mcap_walk", where)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    topics: dict[int, str] = {}
    found: Messages = defaultdict(list)
    for opcode, content in module.walk(path.read_bytes()):
        if opcode == 4:
            topics[struct.unpack_from("<H", content)[0]] = module.text_at(content, 4)[0]
        if opcode == 5:
            channel, _, ns, publish = struct.unpack_from("<HIQQ", content)
            assert ns == publish
            found[topics[channel]].append((ns, json.loads(content[22:])))
    assert dict(found) == messages


# --- other results -------------------------------------------------------------------------------


def test_several_recordings_each_under_its_name(tmp_path: Path) -> None:
    write_replay(small_result(), tmp_path / "replay.mcap")
    found = read(tmp_path / "replay.mcap")
    assert {t: len(m) for t, m in found.items()} == {
        f"/{name}/{topic}": n
        for name in ("cube_a", "cube_b")
        for topic, n in (("stage/measured", 21), ("force/measured", 21), ("force/simulated", 21),
                         ("surface/simulated", 61))
    }  # fmt: skip
    assert set(metadata(tmp_path / "replay.mcap")) == {
        "validate.replay", "input/cube_a", "input/cube_b"
    }  # fmt: skip
    assert "/somewhere" not in str(metadata(tmp_path / "replay.mcap"))
    assert inspect_recording(tmp_path / "replay.mcap").defects == ()


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
    left_out = metadata(tmp_path / "replay.mcap")["validate.replay"]["left_out"]
    assert left_out == "everything simulated: no method finished"


def test_without_recordings_only_metadata(tmp_path: Path) -> None:
    write_replay(bare_result(), tmp_path / "replay.mcap")
    assert read(tmp_path / "replay.mcap") == {}
    assert inspect_recording(tmp_path / "replay.mcap").defects == ()


def test_a_signal_without_a_trace_is_named(tmp_path: Path) -> None:
    result = small_result()
    one = result.methods[0]
    runs = tuple(replace(r, traces={"updates": r.traces["updates"]}) for r in one.runs)
    write_replay(replace(result, methods=(replace(one, runs=runs),)), tmp_path / "replay.mcap")
    left_out = metadata(tmp_path / "replay.mcap")["validate.replay"]["left_out"]
    assert "/cube_a/force/simulated: the run does not predict it" in left_out


def test_a_scaled_registration_leaves_markers_in_the_scene(result: Result) -> None:
    """A transform of Foxglove has no scale: the markers are put where the comparison has them."""
    one = result.methods[0]
    seen = observed.markers(one.registered[0])
    assert seen is not None
    transform = replace(seen.registration.transform, s=1.01)
    registration = replace(seen.registration, transform=transform)
    scaled = replace(seen, registration=registration)
    others = (o for o in one.registered[0].observations if o is not seen)
    registered = replace(one.registered[0], observations=(*others, scaled))
    methods = (replace(one, registered=(registered,)),)
    (view,) = views(replace(result, methods=methods))
    found = {t.topic: t for t in tracks(view)}
    tf = found["/tf"].message(0)["transforms"]
    assert [t["child_frame_id"] for t in tf] == ["image"]
    content = found["/markers/measured"].message(3)
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
    assert inspect_recording(tmp_path / "replay.mcap").defects == ()
    (_, content), *_ = read(tmp_path / "replay.mcap")["/image/measured"]
    jsonschema.Draft7Validator(DEFINITIONS["foxglove.CompressedImage"]).validate(content)


def test_many_images_are_thinned_but_for_the_loads(
    result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_signals, "_IMAGE_BYTES", 20_000)
    write_replay(with_images(result, 31), tmp_path / "replay.mcap")
    found = read(tmp_path / "replay.mcap")
    kept = [ns for ns, _ in found["/image/measured"]]
    assert 8 <= len(kept) < 20
    assert {ns for ns, _ in found["/outline/measured"]} <= set(kept)
    thinned = metadata(tmp_path / "replay.mcap")["validate.replay"]["thinned"]
    assert "of 31 images, and those at the loads" in thinned


def test_too_large_a_file_is_thinned_and_says_so(
    result: Result, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replay_mcap, "MAX_BYTES", path.stat().st_size // 2)
    monkeypatch.setattr(replay_signals, "_SAMPLES", 400)
    write_replay(result, tmp_path / "replay.mcap")
    assert (tmp_path / "replay.mcap").stat().st_size <= path.stat().st_size // 2
    found = read(tmp_path / "replay.mcap")
    assert 10 <= len(found["/surface/simulated"]) < 61
    assert len(found["/outline/simulated"]) == 4
    assert len(found["/force/measured"]) < 371
    thinned = metadata(tmp_path / "replay.mcap")["validate.replay"]["thinned"]
    assert "/force/measured: one in" in thinned
    assert "interpolated instants: one in 4" in thinned
