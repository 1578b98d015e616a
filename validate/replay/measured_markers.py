"""A measured body's markers in its own frame: by their layout, or as they were recorded there."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, RegistrationError, UsageError
from validate.recording.readers import recognised
from validate.recording.types import Recording
from validate.register.clock import clock_sd
from validate.register.from_rest import noise, rested
from validate.register.markers import MarkerObservation, observe_markers, vector
from validate.register.two_step import fit_plane
from validate.replay.measured_cards import MeasuredBody
from validate.scene.mesh import Mesh

AS_SEEN = "as seen"
BodyAt = tuple[Mesh, Path]  # the body's mesh, and the experiment's folder


def registered(recording: Recording, p: MeasuredBody, at: BodyAt) -> MarkerObservation:
    """Markers in the body's frame: their layout's, or the one they were recorded in."""
    mesh, folder = at
    topic = markers_topic(recording, p)
    markers, _, _ = rested(recording.marker(topic), p.seen.still)
    layout = dict(zip(markers.names, markers.x[0], strict=True))
    if p.seen.layout != AS_SEEN:
        layout = layout_of(recording, p.seen.layout, folder)
    kept = [i for i, n in enumerate(markers.names) if n in layout]
    if not kept:
        raise RegistrationError(
            f"seen.layout = {p.seen.layout} has {listed_names(layout)}; the recording has "
            f"{listed_names(markers.names)}: no marker's name is in both; spell them as recorded"
        )
    markers = replace(
        markers, names=tuple(markers.names[i] for i in kept), x=markers.x[:, kept],
        sd=noise(markers),
    )  # fmt: skip
    same = _side(markers.x[0]) if p.seen.layout == AS_SEEN else None
    return observe_markers(
        markers, layout, mesh, how=p.seen.registration, up=same, name=topic, stands=np.inf,
        sd_t=clock_sd(recording, topic),
    )  # fmt: skip


def listed_names(names: Iterable[str]) -> str:
    found = [repr(name) for name in names]
    return ", ".join(found[:6]) + (f" and {len(found) - 6} more" if len(found) > 6 else "")


def _side(x: Floats) -> tuple[Floats, Floats] | None:
    """The normal of planar markers (k, 3) m, which are in one frame twice: it tells them from their
    mirror image. None for others, whose shape does."""
    try:
        normal = fit_plane(x).axes[:, 2]
    except RegistrationError:
        return None
    return normal, normal


def layout_of(recording: Recording, text: str, folder: Path) -> dict[str, Floats]:
    """Places (3,) m of markers in the body's frame: of the record "marker_layout", or of the points
    of a file of landmarks. Raises `RecordingError` for a file without points."""
    if text == "recorded":
        record = recording.record("marker_layout")
        return {name: vector(at, f"marker_layout '{name}'") for name, at in record.items()}
    path = folder / text
    points = recognised(path).read(path, {}).markers
    if not points:
        raise RecordingError(f"{path.name}: no points; a layout is a file of landmarks, as FCSV")
    first = next(iter(points.values()))
    return dict(zip(first.names, first.x[0], strict=True))


def markers_topic(recording: Recording, p: MeasuredBody) -> str:
    """The markers' topic, where it is not said the only one."""
    if p.seen.markers:
        return p.seen.markers
    if len(recording.markers) != 1:
        raise UsageError(f"seen.markers is not set; one of {sorted(recording.markers)}")
    return next(iter(recording.markers))
