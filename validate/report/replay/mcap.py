"""replay.mcap and its layout: measurement and simulation in one timeline for Foxglove or Rerun.

Topics, after /<recording> where there are several; X is `measured` or `simulated`:

    /<drive>/measured      validate.Signal           what drives, m or N
    /<signal>/X            validate.Signal           every sample as compared, every step
    /outline/X             validate.Contour          image plane, as judged; simulated at the loads
    /outline/X/scene       foxglove.SceneUpdate      the same as lines, the simulated one moving
    /outline/X/points      foxglove.PointCloud       the same as points
    /markers/X             validate.Markers          with names; simulated at the loads
    /markers/X/scene       foxglove.SceneUpdate      the same as spheres, the simulated ones moving
    /markers/X/points      foxglove.PointCloud       the same as points
    /surface/simulated/scene   foxglove.SceneUpdate  coloured by displacement, moving
    /surface/simulated/points  foxglove.PointCloud   its nodes
    /image/measured        foxglove.CompressedImage  where the recording has images
    /tf                    foxglove.FrameTransforms  image and marker frames in the scene's

Every message is Protobuf. Rerun draws points, images and transforms, and gives the fields of the
others; Foxglove draws all (`replay_layout` writes which panels show them).

Time is the recording's own clock, t0_ns + t. Simulated numbers are those of the method that the
report shows, with sd 0. What is interpolated, thinned or left out stands in the metadata record
`validate.pipeline`; a run over time gives its output frames at their own times in place of loads.
The file stays under `MAX_BYTES` by thinning everything more.
"""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from validate.compare.result import MethodResult, Result
from validate.recording.mcap.protobuf_messages import protobuf_schema
from validate.recording.mcap.schemas import CONTOUR, MARKERS, SIGNAL, Json
from validate.recording.mcap.write import WrittenChannel, WrittenMessage, write_channels
from validate.report.replay import foxglove
from validate.report.replay.foxglove import CLOUD, IMAGE, SCENE
from validate.report.replay.space import (
    COLOURS,
    images,
    markers,
    outlines,
    signals,
    surface,
    transforms,
)
from validate.report.replay.view import ReplayView, Track, over_time
from validate.report.scenes.body_scene import HOW
from validate.report.sections.observations import shown_method
from validate.report.stored.environment import file_name

MAX_BYTES = 5_000_000
RECORD = "validate.pipeline"
INPUT = "input/"  # metadata record INPUT + name of every recording
_NUMBERS = (SIGNAL, CONTOUR, MARKERS)
_COARSEST = 64
_ALL = {**foxglove.SCHEMAS, **{name: protobuf_schema(name) for name in _NUMBERS}}


def write_replay(result: Result, path: Path) -> None:
    """Write the replay of `result` to `path`, and its layout beside it (`.layout.json`).

    Without recordings it holds metadata only, and has no layout.
    """
    inputs = {
        INPUT + (prefix[1:] or r.name): {
            "path": file_name(r.source.path),
            "sha256": r.source.sha256,
            "bytes": str(r.source.bytes),
            "integrity": r.source.integrity,
        }
        for r, prefix in zip(result.recordings, _prefixes(result), strict=True)
    }
    method = shown_method(result)
    frames_alone = any(over_time(view) for view in views(result))
    record = {
        "format": "1",
        "experiment": result.name,
        "method": method.name if method else "",
        "method_label": method.label if method else "",
        "quick": "yes" if result.quick else "no",
        "kind": result.kind,
        "interpolated": "nothing: output frames keep their times" if frames_alone
                        else f".../simulated/scene and points: {HOW}",
    }  # fmt: skip
    coarse = 1
    while True:
        shown = [(view, tracks(view)) for view in views(result, coarse)]
        found = tuple(t for _, tracks in shown for t in tracks)
        channels = [WrittenChannel(t.topic, _ALL[t.schema]) for t in found]
        thinned = [f"{t.topic}: {t.note}" for t in found if t.note]
        thinned += [f"interpolated instants: one in {coarse}"] if coarse > 1 else []
        record["thinned"] = "; ".join(thinned) or "nothing"
        record["left_out"] = "; ".join(_left_out(result, method, found)) or "nothing"
        metadata = {RECORD: record, **inputs}
        metadata |= {name: values for t in found for name, values in t.records}
        write_channels(path, channels, _in_time(found), metadata)
        if path.stat().st_size <= MAX_BYTES or coarse >= _COARSEST:
            break
        coarse *= 2
    if shown:
        path.with_suffix(".layout.json").write_text(layout(shown), "utf-8")


def views(result: Result, coarse: int = 1) -> tuple[ReplayView, ...]:
    """One view per recording, of the accepted method or the first that finished."""
    method = shown_method(result)
    registered = method.registered if method else result.registered
    runs = method.runs if method else (None,) * len(registered)
    return tuple(
        ReplayView(recording, seen, method, run, prefix, coarse)
        for recording, seen, run, prefix in zip(
            result.recordings, registered, runs, _prefixes(result), strict=True
        )
    )


def _prefixes(result: Result) -> list[str]:
    names = [r.name for r in result.recordings]
    if len(names) == 1:
        return [""]
    count = Counter(names)
    return [f"/{n}" if count[n] == 1 else f"/{i}_{n}" for i, n in enumerate(names, start=1)]


def tracks(view: ReplayView) -> tuple[Track, ...]:
    """Every topic of one recording, transforms first."""
    found = [
        *images(view),
        *signals(view),
        *outlines(view),
        *markers(view),
        *surface(view),
    ]
    every = (*transforms(view, found), *found)
    # Foxglove's stamps end in 2106; ours do not
    return tuple(
        t for t in every if t.schema not in foxglove.SCHEMAS or int(t.ns[-1]) <= foxglove.LAST_NS
    )


def _in_time(found: Sequence[Track]) -> Iterator[WrittenMessage]:
    """All messages in order of time, topics in their order when equal."""
    if not found:
        return
    ns = np.concatenate([t.ns for t in found])
    which = np.repeat(np.arange(len(found)), [len(t.ns) for t in found])
    number = np.concatenate([np.arange(len(t.ns)) for t in found])
    for k in np.argsort(ns, kind="stable"):
        track = found[which[k]]
        yield WrittenMessage(track.topic, int(ns[k]), track.message(int(number[k])))


def _left_out(result: Result, method: MethodResult | None, found: Sequence[Track]) -> Iterator[str]:
    if method is None:
        yield "everything simulated: no method finished"
        return
    others = [m.name for m in result.methods if m is not method]
    if others:
        yield f"other methods: {', '.join(others)}"
    topics = [t.topic for t in found if t.schema in _NUMBERS and not t.given]
    for topic in topics:
        other = topic.replace("/measured", "/simulated")
        if other not in topics:
            yield f"{other}: the run does not predict it"
    if any(int(t.ns[-1]) > foxglove.LAST_NS for t in found):
        yield "all but numbers: Foxglove's stamps end in 2106"
    if method.scene.mesh.dimension != 3:
        yield "surface: the mesh is planar"


# --- replay.layout.json: panels of a replay for Foxglove or Lichtblick ---------------------------

_WIDE = 60  # per cent of the width for what lies in space
_FAR = 2.5  # of the camera, over the size of the body
_SIZE = 0.1  # m, where no body is known
Shown = Sequence[tuple[ReplayView, Sequence[Track]]]


def layout(shown: Shown) -> str:
    """Return the layout of the topics of every recording, as JSON."""
    panels: dict[str, Json] = {}
    tabs = [{"title": _title(view), "layout": _recording(view, tracks, panels)}
            for view, tracks in shown if tracks]  # fmt: skip
    root = (
        tabs[0]["layout"]
        if len(tabs) == 1
        else _add(panels, "Tab", {"activeTabIdx": 0, "tabs": tabs})
    )
    found = {"configById": panels, "globalVariables": {}, "userNodes": {},
             "playbackConfig": {"speed": 1}, "layout": root}  # fmt: skip
    return json.dumps(found, indent=1, allow_nan=False) + "\n"


def _title(view: ReplayView) -> str:
    return view.prefix[1:] or view.recording.name


def _add(panels: dict[str, Json], kind: str, config: Json) -> str:
    """The id of a new panel."""
    name = f"{kind}!{len(panels) + 1}"
    panels[name] = config
    return name


def _recording(view: ReplayView, tracks: Sequence[Track], panels: dict[str, Json]) -> Json | str:
    """The split of one recording's panels, which are added to `panels`."""
    beside = [
        _add(panels, "Image", {"imageMode": {"imageTopic": t.topic}, "foxglovePanelTitle": t.topic})
        for t in tracks if t.schema == IMAGE
    ]  # fmt: skip
    beside += [_add(panels, "Plot", plot) for plot in _plots(tracks)]
    if not any(t.schema == SCENE for t in tracks):
        return _column(beside)
    # The panel of what lies in space: scenes shown, the same as points hidden
    centre, size = np.zeros(3), _SIZE
    if view.method is not None:
        nodes = view.method.scene.mesh.nodes
        low, high = nodes.min(axis=0), nodes.max(axis=0)
        centre[: len(low)] = (low + high) / 2
        size = float((high - low).max()) or _SIZE
    camera = {
        "perspective": True, "distance": _FAR * size, "phi": 60.0, "thetaOffset": 45.0,
        "target": centre.tolist(), "targetOffset": [0.0, 0.0, 0.0],
        "targetOrientation": [0.0, 0.0, 0.0, 1.0], "fovy": 45.0, "near": size / 100,
        "far": 100 * size,
    }  # fmt: skip
    topics = {t.topic: {"visible": t.schema == SCENE} for t in tracks if t.schema in (SCENE, CLOUD)}
    space = _add(panels, "3D", {
        "cameraState": camera, "followMode": "follow-none", "followTf": view.frame,
        "fixedFrame": view.frame, "scene": {}, "transforms": {}, "topics": topics,
        "layers": {}, "foxglovePanelTitle": _title(view),
    })  # fmt: skip
    if not beside:
        return space
    return {"first": space, "second": _column(beside), "direction": "row",
            "splitPercentage": _WIDE}  # fmt: skip


def _column(panels: Sequence[str]) -> Json | str:
    """Panels one below another, equally high."""
    first, *rest = panels
    if not rest:
        return first
    return {"first": first, "second": _column(rest), "direction": "column",
            "splitPercentage": 100 / len(panels)}  # fmt: skip


def _plots(tracks: Iterable[Track]) -> Iterable[Json]:
    """One plot a signal: what was measured, and the run's where it predicts it."""
    by_name: dict[str, list[Track]] = {}
    for track in tracks:
        if track.schema == SIGNAL:
            by_name.setdefault(track.topic.rpartition("/")[0], []).append(track)
    for name, found in by_name.items():
        title = f"{name.rpartition('/')[2]} / {found[0].unit}"
        yield {
            "foxglovePanelTitle": title, "paths": [p for track in found for p in _paths(track)],
            "xAxisVal": "timestamp", "isSynced": True, "showLegend": True,
            "legendDisplay": "floating", "showXAxisLabels": True, "showYAxisLabels": True,
            "yAxisLabel": title,
        }  # fmt: skip


def _paths(track: Track) -> Iterable[Json]:
    who = track.topic.rpartition("/")[2]
    rgba = COLOURS["simulated" if who == "simulated" else "measured"]
    colour = "#" + "".join(f"{round(255 * part):02x}" for part in (rgba.r, rgba.g, rgba.b))
    for part in range(track.width):
        label = who if track.width == 1 else f"{who} {part}"
        yield {"value": f"{track.topic}.values[{part}]", "enabled": True, "label": label,
               "timestampMethod": "receiveTime", "color": colour}  # fmt: skip
