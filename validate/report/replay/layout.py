"""replay.layout.json: panels of a replay for Foxglove or Lichtblick.

The form is that in which both export a layout: panels by id, and a tree of splits. One recording:
its bodies, outlines and markers beside its images and one plot a signal, measured and simulated;
several: a tab each.
"""

import json
from collections.abc import Iterable, Sequence

import numpy as np

from validate.arrays import Floats
from validate.recording.mcap.schemas import SIGNAL, Json
from validate.report.replay.foxglove import CLOUD, IMAGE, SCENE, Rgba
from validate.report.replay.space import COLOURS
from validate.report.replay.view import ReplayView, Track

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
    beside = [_add(panels, "Image", _image(t)) for t in tracks if t.schema == IMAGE]
    beside += [_add(panels, "Plot", plot) for plot in _plots(tracks)]
    if not any(t.schema == SCENE for t in tracks):
        return _column(beside)
    space = _add(panels, "3D", _space(view, tracks))
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


def _image(track: Track) -> Json:
    return {"imageMode": {"imageTopic": track.topic}, "foxglovePanelTitle": track.topic}


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
    colour = COLOURS["simulated" if who == "simulated" else "measured"]
    for part in range(track.width):
        label = who if track.width == 1 else f"{who} {part}"
        yield {"value": f"{track.topic}.values[{part}]", "enabled": True, "label": label,
               "timestampMethod": "receiveTime", "color": _hex(colour)}  # fmt: skip


def _hex(colour: Rgba) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in (colour.r, colour.g, colour.b))


def _space(view: ReplayView, tracks: Sequence[Track]) -> Json:
    """The panel of what lies in space: scenes shown, the same as points hidden."""
    centre, size = _body(view)
    camera = {
        "perspective": True, "distance": _FAR * size, "phi": 60.0, "thetaOffset": 45.0,
        "target": centre.tolist(), "targetOffset": [0.0, 0.0, 0.0],
        "targetOrientation": [0.0, 0.0, 0.0, 1.0], "fovy": 45.0, "near": size / 100,
        "far": 100 * size,
    }  # fmt: skip
    topics = {t.topic: {"visible": t.schema == SCENE} for t in tracks if t.schema in (SCENE, CLOUD)}
    return {"cameraState": camera, "followMode": "follow-none", "followTf": view.frame,
            "fixedFrame": view.frame, "scene": {}, "transforms": {}, "topics": topics,
            "layers": {}, "foxglovePanelTitle": _title(view)}  # fmt: skip


def _body(view: ReplayView) -> tuple[Floats, float]:
    """Centre m (3,) and size m of the body; the origin where no method has one."""
    if view.method is None:
        return np.zeros(3), _SIZE
    nodes = view.method.scene.mesh.nodes
    low, high = nodes.min(axis=0), nodes.max(axis=0)
    centre = np.zeros(3)
    centre[: len(low)] = (low + high) / 2
    return centre, float((high - low).max()) or _SIZE
