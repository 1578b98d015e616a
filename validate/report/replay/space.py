"""Topics of a replay: outlines, markers, the surface, transforms; signals and images.

Numbers (`validate.Contour`, `validate.Markers`) are those of the comparison, at the measured times
and at the loads; `.../scene` and `.../points` are to look at and add interpolated instants: the
same as lines, spheres and a surface, and as points for viewers that draw no scenes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import matplotlib as mpl
import numpy as np

from validate.arrays import Floats
from validate.recording.images.image import encode_png
from validate.recording.mcap.protobuf_messages import protobuf_message
from validate.recording.mcap.schemas import (
    CALIBRATION,
    CALIBRATION_KEYS,
    CONTOUR,
    MARKERS,
    SIGNAL,
    Json,
    contour_message,
    markers_message,
    signal_message,
)
from validate.recording.types import Frames, Markers
from validate.report.replay import foxglove
from validate.report.replay.foxglove import CLOUD, IMAGE, SCENE, TRANSFORMS, Entity, Rgba, picture
from validate.report.replay.view import ReplayView, Track, load_of, pose_records
from validate.report.scenes.body import OUTSIDE, skins
from validate.report.sections import observations
from validate.report.sections.observations import holds
from validate.report.sections.observations import signals as scalar_signals

Who = Literal["measured", "simulated"]
Times = Floats | list[float]
COLOURS: dict[Who, Rgba] = {  # both seen on dark and on light
    "measured": Rgba(0.902, 0.624, 0.0),
    "simulated": Rgba(0.337, 0.706, 0.914),
}
_TRIANGLES = 4000  # of the surface, at most
_SEE_THROUGH = 0.3  # opacity of the outside, so that the cavity is seen
_BALL = 0.015  # diameter of a marker over the size of their layout
_ONE_BALL = 0.002  # m: diameter of a marker that stands alone
_MARKER_FRAMES = 1500  # instants of measured markers, at most


def transforms(view: ReplayView, others: Sequence[Track]) -> list[Track]:
    """Image and marker frames in the scene's, once, at the first time of the `others`."""
    children = list[tuple[str, Floats]]()
    image, seen = observations.outline(view.registered), observations.markers(view.registered)
    if image is not None:
        children.append((view.local("image"), image.pose))
    recorded = _recorded(view)
    if recorded is not None and seen is not None:
        children.append((view.local(recorded.frame), seen.registration.transform.matrix))
    if not children:
        return []
    start = min(int(t.ns[0]) for t in others)

    def message(_: int) -> bytes:
        return foxglove.frame_transforms(start, view.frame, children)

    return [Track(f"{view.prefix}/tf", TRANSFORMS, np.array([start]), message)]


# --- outlines and markers ------------------------------------------------------------------------


@dataclass(frozen=True)
class _Kind:
    """What becomes six topics: `t` (n,) s and the measured samples, and how a run is sampled.

    `number` makes the message of a sample from (ns, frame, sample, sd), `look` the entity that
    shows it from (ns, frame, name, sample, colour).
    """

    name: str
    schema: str
    t: Floats
    measured: Sequence[Floats]
    simulated: Callable[[Floats], Floats]
    sd: float
    number: Callable[[int, str, Floats, float], Json]
    look: Callable[..., Entity]
    frames: tuple[tuple[str, str], tuple[str, str]]  # measured, simulated; of numbers, to look at
    note: str = ""
    pose: Floats | None = None


def outlines(view: ReplayView) -> list[Track]:
    """All measured outlines; the simulated ones at the loads; both as lines, simulated moving."""
    seen = observations.outline(view.registered)
    if seen is None:
        return []
    frames = view.frame, view.local("image")
    kind = _Kind(
        "outline", CONTOUR, seen.t, seen.outlines, seen.simulated, seen.sd, contour_message,
        foxglove.outline, (frames, frames), pose=seen.pose,
    )  # fmt: skip
    return _tracks(view, kind)


def markers(view: ReplayView) -> list[Track]:
    """Measured markers in their own frame where it is known; the simulated ones in the scene's."""
    seen = observations.markers(view.registered)
    if seen is None:
        return []
    recorded, names = _recorded(view), seen.names
    own = view.local(recorded.frame) if recorded else view.frame
    every = one_in(len(seen.t), _MARKER_FRAMES // view.coarse)
    x = (recorded.x if recorded else seen.x)[::every]
    size = _BALL * float(np.ptp(seen.rest, axis=0).max()) or _ONE_BALL
    kind = _Kind(
        "markers", MARKERS, seen.t[::every], list(x), seen.simulated, seen.sd,
        lambda ns, frame, x, sd: markers_message(ns, frame, names, x, sd),
        partial(foxglove.spheres, diameter=size), ((own, own), (view.frame, view.frame)),
        thinned(every, len(seen.t), "instants"),
    )  # fmt: skip
    return _tracks(view, kind)


def _tracks(view: ReplayView, kind: _Kind) -> list[Track]:
    """Measured samples as numbers and to look at; simulated ones at the loads, and moving."""
    (numbers, look), (simulated, moving) = kind.frames
    words = ["as measured"] * len(kind.t)
    found = [
        _numbers(view, kind, "measured", numbers, kind.t, kind.measured),
        *_looks(view, kind, "measured", look, kind.t, kind.measured, words),
    ]
    if at := view.held():
        between = view.moving()
        judged, drawn = ([kind.simulated(i.u) for i in instants] for instants in (at, between))
        words = [load_of(i) for i in between]
        found += [
            _numbers(view, kind, "simulated", simulated, [i.t for i in at], judged),
            *_looks(view, kind, "simulated", moving, [i.t for i in between], drawn, words),
        ]
    return found


def _numbers(
    view: ReplayView, kind: _Kind, who: Who, frame: str, t: Times, x: Sequence[Floats]
) -> Track:
    topic, known = f"/{kind.name}/{who}", who == "measured"
    sd, note = (kind.sd, kind.note) if known else (0.0, "")
    records = () if kind.pose is None else pose_records(view.prefix + topic, kind.pose)

    def message(ns: int, i: int) -> bytes:
        return protobuf_message(kind.schema, kind.number(ns, frame, x[i], sd))

    return view.track(topic, kind.schema, t, message, note, records)


def _looks(
    view: ReplayView,
    kind: _Kind,
    who: Who,
    frame: str,
    t: Times,
    x: Sequence[Floats],
    loads: list[str],
) -> list[Track]:
    name, colour = f"{kind.name} {who}", COLOURS[who]
    note = kind.note if who == "measured" else ""
    shade = np.array([[colour.r, colour.g, colour.b, colour.a]])

    def scene(ns: int, i: int) -> bytes:
        return foxglove.scene_update(kind.look(ns, frame, name, x[i], colour, load=loads[i]))

    def points(ns: int, i: int) -> bytes:
        return foxglove.cloud(ns, frame, x[i], shade)

    topic = f"/{kind.name}/{who}"
    return [
        view.track(f"{topic}/scene", SCENE, t, scene, note),
        view.track(f"{topic}/points", CLOUD, t, points, note),
    ]


def _recorded(view: ReplayView) -> Markers | None:
    """The markers as recorded, in their own frame; None when no shift and turn leads from it."""
    seen = observations.markers(view.registered)
    if seen is None or seen.registration.transform.s != 1.0:  # a transform of Foxglove has no scale
        return None
    for stream in view.recording.markers.values():
        if stream.names == seen.names and np.array_equal(stream.t, seen.t):
            return stream if stream.x.shape == seen.x.shape else None
    return None


# --- the simulated surface -----------------------------------------------------------------------


def surface(view: ReplayView) -> list[Track]:
    """Outside (see-through) and cavity walls, deformed; none without a run or of a 2-D mesh."""
    moving = view.moving()
    parts = skins(view.method.scene, _TRIANGLES // view.coarse) if view.method and moving else ()
    if view.method is None or not parts:
        return []
    scene, top = view.method.scene, max(float(np.linalg.norm(i.u, axis=1).max()) for i in moving)
    notes = {"colour": f"displacement, viridis from 0 to {1e3 * top:.3g} mm"}
    if scene.copies > 1:
        notes["part"] = f"one of {scene.copies} symmetric parts"

    def scenes(ns: int, i: int) -> bytes:
        u, said = moving[i].u, {"load": load_of(moving[i])} | notes
        return foxglove.scene_update(
            *(
                foxglove.surface(
                    ns, view.frame, f"surface {part.name}",
                    scene.mesh.nodes[part.nodes] + u[part.nodes], part.triangles,
                    _shades(u[part.nodes], top, part.name), **said,
                )
                for part in parts
            )
        )  # fmt: skip

    shown = np.unique(np.concatenate([part.nodes for part in parts]))

    def points(ns: int, i: int) -> bytes:
        u = moving[i].u[shown]
        return foxglove.cloud(ns, view.frame, scene.mesh.nodes[shown] + u, _shades(u, top))

    left_out = []
    drawn, whole = sum(len(p.triangles) for p in parts), sum(p.whole for p in parts)
    if drawn < whole:
        left_out.append(f"{drawn} of {whole} triangles")
    if len(moving) < (frames := len(view.held())):
        left_out.append(f"{len(moving)} of {frames} output frames")
    note, t = ", ".join(left_out), [i.t for i in moving]
    return [
        view.track("/surface/simulated/scene", SCENE, t, scenes, note),
        view.track("/surface/simulated/points", CLOUD, t, points, note),
    ]


def _shades(u: Floats, top: float, part: str = "") -> Floats:
    """Colours (v, 4) of displacements (v, 3) m between 0 and `top` m."""
    size = np.linalg.norm(u, axis=1) / (top or 1.0)
    shades = np.asarray(mpl.colormaps["viridis"](size))
    shades[:, 3] = _SEE_THROUGH if part == OUTSIDE else 1.0
    return shades


# --- topics of a replay over time: signals and images --------------------------------------------

_SAMPLES = 4000  # messages of one signal, at most
_IMAGE_BYTES = 1_500_000  # of one stream of images, about


def signals(view: ReplayView) -> list[Track]:
    """What drives as measured; every signal as compared, and the run's trace that predicts it."""
    drives, seen = view.registered.drives, scalar_signals(view.registered)
    # "force.plate" is "force" when nothing else is a force, else "force/plate"
    quantities = [*(d.name.strip("/") for d in drives), *(s.quantity for s in seen)]
    first = [q.split(".")[0] for q in quantities]
    names = [
        f if first.count(f) == 1 else q.replace(".", "/")
        for f, q in zip(first, quantities, strict=True)
    ]
    found = [
        replace(
            _signal(view, f"/{name}/measured", s.t, s.y, s.unit, s.sd), given=s.role == "drives"
        )
        for s, name in zip((*drives, *seen), names, strict=True)
    ]
    for s, name in zip(seen, names[len(drives) :], strict=True):
        if view.run is not None and s.trace in view.run.traces:
            trace, t = view.run.traces[s.trace], view.run.t
            simulated = f"/{name}/simulated"
            found.append(_signal(view, simulated, t, trace.y[:, None], trace.unit, 0.0))
    return found


def _signal(view: ReplayView, topic: str, t: Floats, y: Floats, unit: str, sd: float) -> Track:
    every = one_in(len(t), _SAMPLES // view.coarse)
    kept, frame, note = y[::every], view.drive_frame, thinned(every, len(t), "samples")

    def message(ns: int, i: int) -> bytes:
        return protobuf_message(SIGNAL, signal_message(ns, frame, unit, kept[i], sd))

    track = view.track(topic, SIGNAL, t[::every], message, note)
    return replace(track, unit=unit, width=y.shape[1])


def images(view: ReplayView) -> list[Track]:
    """Every stream of images, thinned to a size in bytes; with calibration and pose."""
    streams = view.recording.frames
    several = len(streams) > 1
    return [
        _images(view, f"/image/{topic.strip('/')}/measured" if several else "/image/measured", f)
        for topic, f in streams.items()
    ]


def _images(view: ReplayView, topic: str, frames: Frames) -> Track:
    size = max(1, len(encode_png(frames.images[0])))
    every = one_in(len(frames.t), _IMAGE_BYTES // view.coarse // size)
    at_loads = {int(np.abs(frames.t - hold.t).argmin()) for hold in holds(view.registered)}
    kept = sorted({*range(0, len(frames.t), every), *at_loads})
    scales = zip(CALIBRATION_KEYS, frames.m_per_px, strict=True)
    named = view.prefix + topic
    calibration = (CALIBRATION + named, {key: repr(scale) for key, scale in scales})
    return view.track(
        topic, IMAGE, frames.t[kept],
        lambda ns, i: picture(ns, frames.frame, encode_png(frames.images[kept[i]])),
        thinned(every, len(frames.t), "images, and those at the loads"),
        (*pose_records(named, frames.pose), calibration),
    )  # fmt: skip


def one_in(count: int, most: int) -> int:
    """Return the step that leaves at most `most` of `count`."""
    return max(1, -(-count // max(1, most)))


def thinned(every: int, count: int, what: str) -> str:
    """Return the share of kept samples in words, "one in 3"; empty for all of them."""
    return f"one in {every} of {count} {what}" if every > 1 else ""
