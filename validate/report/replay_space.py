"""Topics of a replay that lie in space: outlines, markers, the simulated surface, transforms.

Numbers (`validate.Contour`, `validate.Markers`) are those of the comparison, at the measured times
and at the loads; `.../scene` topics are to look at and add interpolated instants.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import matplotlib as mpl
import numpy as np

from validate.arrays import Floats
from validate.recording.mcap.schemas import CONTOUR, MARKERS, Json, contour_message, markers_message
from validate.recording.types import Markers
from validate.register.markers import MarkerObservation
from validate.report import foxglove, observed
from validate.report.foxglove import Rgba
from validate.report.foxglove_schemas import SCENE, TRANSFORMS
from validate.report.replay_signals import one_in, thinned
from validate.report.replay_view import Track, View, load_of, pose_records
from validate.report.skin import OUTSIDE, skins

Who = Literal["measured", "simulated"]
COLOURS: dict[Who, Rgba] = {  # both seen on dark and on light
    "measured": Rgba(0.902, 0.624, 0.0),
    "simulated": Rgba(0.337, 0.706, 0.914),
}
_TRIANGLES = 4000  # of the surface, at most
_SEE_THROUGH = 0.3  # opacity of the outside, so that the cavity is seen
_BALL = 0.015  # diameter of a marker over the size of their layout
_ONE_BALL = 0.002  # m: diameter of a marker that stands alone
_MARKER_FRAMES = 1500  # instants of measured markers, at most


def transforms(view: View, others: Sequence[Track]) -> list[Track]:
    """Image and marker frames in the scene's, once, at the first time of the `others`."""
    children = list[tuple[str, Floats]]()
    image, seen = observed.outline(view.registered), observed.markers(view.registered)
    if image is not None:
        children.append((view.local("image"), image.pose))
    recorded = _recorded(view)
    if recorded is not None and seen is not None:
        children.append((view.local(recorded.frame), seen.registration.transform.matrix))
    if not children:
        return []
    start = min(int(t.ns[0]) for t in others)

    def message(_: int) -> Json:
        return foxglove.frame_transforms(start, view.frame, children)

    return [Track(f"{view.prefix}/tf", TRANSFORMS, np.array([start]), message)]


# --- outlines ------------------------------------------------------------------------------------


def outlines(view: View) -> list[Track]:
    """All measured outlines; the simulated ones at the loads; both as lines, simulated moving."""
    seen = observed.outline(view.registered)
    if seen is None:
        return []
    words = ["as measured"] * len(seen.t)
    found = [
        _contours(view, "measured", seen.t, seen.outlines, seen.sd, seen.pose),
        _lines(view, "measured", seen.t, seen.outlines, words),
    ]
    if view.held():
        at, moving = view.held(), view.moving()
        judged = [seen.simulated(i.u) for i in at]
        drawn = [seen.simulated(i.u) for i in moving]
        words = [load_of(i) for i in moving]
        found += [
            _contours(view, "simulated", [i.t for i in at], judged, 0.0, seen.pose),
            _lines(view, "simulated", [i.t for i in moving], drawn, words),
        ]
    return found


def _contours(
    view: View, who: Who, t: Floats | list[float], points: Sequence[Floats], sd: float, pose: Floats
) -> Track:
    topic, frame = f"{view.prefix}/outline/{who}", view.frame
    ns = view.ns(t, topic)

    def message(i: int) -> Json:
        return contour_message(int(ns[i]), frame, points[i], sd)

    return Track(topic, CONTOUR, ns, message, records=pose_records(topic, pose))


def _lines(
    view: View, who: Who, t: Floats | list[float], points: Sequence[Floats], loads: Sequence[str]
) -> Track:
    topic, frame, name = f"{view.prefix}/outline/{who}/scene", view.local("image"), f"outline {who}"
    ns = view.ns(t, topic)

    def message(i: int) -> Json:
        line = foxglove.outline(int(ns[i]), frame, name, points[i], COLOURS[who], load=loads[i])
        return foxglove.scene_update(line)

    return Track(topic, SCENE, ns, message)


# --- markers -------------------------------------------------------------------------------------


def markers(view: View) -> list[Track]:
    """Measured markers in their own frame where it is known; the simulated ones in the scene's."""
    seen = observed.markers(view.registered)
    if seen is None:
        return []
    recorded = _recorded(view)
    frame = view.local(recorded.frame) if recorded else view.frame
    x, words = (recorded.x if recorded else seen.x), ["as measured"] * len(seen.t)
    every = one_in(len(seen.t), _MARKER_FRAMES // view.coarse)
    t, x, words = seen.t[::every], x[::every], words[::every]
    note = thinned(every, len(seen.t), "instants")
    found = [
        replace(_named(view, "measured", frame, t, x, seen), note=note),
        replace(_balls(view, "measured", frame, t, x, seen, words), note=note),
    ]
    if view.held():
        at, moving = view.held(), view.moving()
        judged = np.array([seen.simulated(i.u) for i in at])
        drawn = np.array([seen.simulated(i.u) for i in moving])
        words = [load_of(i) for i in moving]
        found += [
            _named(view, "simulated", view.frame, [i.t for i in at], judged, seen),
            _balls(view, "simulated", view.frame, [i.t for i in moving], drawn, seen, words),
        ]
    return found


def _recorded(view: View) -> Markers | None:
    """The markers as recorded, in their own frame; None when no shift and turn leads from it."""
    seen = observed.markers(view.registered)
    if seen is None or seen.registration.transform.s != 1.0:  # a transform of Foxglove has no scale
        return None
    for stream in view.recording.markers.values():
        if stream.names == seen.names and np.array_equal(stream.t, seen.t):
            return stream if stream.x.shape == seen.x.shape else None
    return None


def _named(
    view: View, who: Who, frame: str, t: Floats | list[float], x: Floats, seen: MarkerObservation
) -> Track:
    topic, sd = f"{view.prefix}/markers/{who}", seen.sd if who == "measured" else 0.0
    ns = view.ns(t, topic)

    def message(i: int) -> Json:
        return markers_message(int(ns[i]), frame, seen.names, x[i], sd)

    return Track(topic, MARKERS, ns, message)


def _balls(
    view: View,
    who: Who,
    frame: str,
    t: Floats | list[float],
    x: Floats,
    seen: MarkerObservation,
    loads: Sequence[str],
) -> Track:
    topic, name = f"{view.prefix}/markers/{who}/scene", f"markers {who}"
    ns, size = view.ns(t, topic), _BALL * float(np.ptp(seen.rest, axis=0).max()) or _ONE_BALL

    def message(i: int) -> Json:
        colour, load = COLOURS[who], loads[i]
        return foxglove.scene_update(
            foxglove.spheres(int(ns[i]), frame, name, x[i], size, colour, load=load)
        )

    return Track(topic, SCENE, ns, message)


# --- the simulated surface -----------------------------------------------------------------------


def surface(view: View) -> list[Track]:
    """Outside (see-through) and cavity walls, deformed; none without a run or of a 2-D mesh."""
    moving = view.moving()
    if view.method is None or not moving:
        return []
    scene, topic = view.method.scene, f"{view.prefix}/surface/simulated"
    parts = skins(scene, _TRIANGLES // view.coarse)
    if not parts:
        return []
    ns, frame = view.ns([i.t for i in moving], topic), view.frame
    top = max(float(np.linalg.norm(i.u, axis=1).max()) for i in moving)
    notes = {"colour": f"displacement, viridis from 0 to {1e3 * top:.3g} mm"}
    if scene.copies > 1:
        notes["part"] = f"one of {scene.copies} symmetric parts"

    def message(i: int) -> Json:
        u, said = moving[i].u, {"load": load_of(moving[i])} | notes
        return foxglove.scene_update(
            *(
                foxglove.surface(
                    int(ns[i]), frame, f"surface {part.name}",
                    scene.mesh.nodes[part.nodes] + u[part.nodes], part.triangles,
                    _shades(u[part.nodes], top, part.name), **said,
                )
                for part in parts
            )
        )  # fmt: skip

    drawn, whole = sum(len(p.triangles) for p in parts), sum(p.whole for p in parts)
    notes_of = [f"{drawn} of {whole} triangles"] if drawn < whole else []
    if len(moving) < len(view.held()):
        notes_of.append(f"{len(moving)} of {len(view.held())} output frames")
    return [Track(topic, SCENE, ns, message, ", ".join(notes_of))]


def _shades(u: Floats, top: float, part: str) -> Floats:
    """Colours (v, 4) of displacements (v, 3) m between 0 and `top` m."""
    size = np.linalg.norm(u, axis=1) / (top or 1.0)
    shades = np.asarray(mpl.colormaps["viridis"](size))
    shades[:, 3] = _SEE_THROUGH if part == OUTSIDE else 1.0
    return shades
