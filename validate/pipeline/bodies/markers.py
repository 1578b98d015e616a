"""Markers of a measured body in its own frame: by their layout, or as recorded there."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import ComparisonError, RecordingError, RegistrationError, UsageError
from validate.pipeline.experiment.tree import Tree
from validate.recording.readers import recognised
from validate.recording.types import Markers, Recording
from validate.register.clocks import clock_sd
from validate.register.markers.displacements import noise, rested
from validate.register.markers.markers import MarkerObservation, vector
from validate.register.markers.measures import FEWEST
from validate.register.markers.quality import MarkerFit, as_declared
from validate.register.observation import nearest_sample
from validate.register.outlines.outlines import OutlineObservation, enclosed
from validate.register.outlines.sections import SurfaceSampler, section
from validate.scene.mesh import Mesh
from validate.scene.places import pose_of
from validate.scene.scene import Scene

# --- Outlines of a measured body: where their images lie in its frame, and what they are held
# to.

_PARTS = 4  # of a facet's edge


def observed_outline(
    recording: Recording, p: Tree, mesh: Mesh, rest: float
) -> tuple[OutlineObservation, tuple[str, ...]]:
    """Outlines against the section of the deformed surface with the images' plane, and what was
    fitted of their pose. Raises `RegistrationError` for a body of bricks, `UsageError` for a pose
    that is none."""
    topic = str(p.settings.seen.outline)
    contours = recording.contour(topic)
    if mesh.bricks:
        raise RegistrationError(
            f"outlines need triangular facets, but the body has {mesh.kind}: give a body of "
            f"tetrahedra"
        )
    mesh.facet_nodes(p.settings.seen.surface)
    wall = SurfaceSampler.of_cavity(mesh, p.settings.seen.surface, None, _PARTS)
    said: tuple[str, ...] = ()
    if p.settings.seen.pose == "declared":
        contours = replace(contours, pose=_pose(p, p.settings.seen.origin))
    if p.settings.seen.pose == "fitted":
        # The images through the body's middle, the outline's centroid at rest on the section's
        low, high = wall.rest.min(axis=0), wall.rest.max(axis=0)
        pose = _pose(p, tuple(((low + high) / 2).tolist()))
        still = contours.outlines[nearest_sample(contours.t, rest, "outlines")]
        shown = section(wall.rest, wall.triangles, pose)
        off = enclosed(shown)[1] - enclosed(still)[1]
        pose[:3, 3] += pose[:3, :2] @ off
        contours = replace(contours, pose=pose)
        at = ", ".join(f"{1e3 * x:.2f}" for x in contours.pose[:3, 3])
        said = (
            f"Images of '{topic}': their origin at ({at}) mm was fitted: the outline at rest has "
            f"the centroid of the body's section. Its position at rest is not evidence.",
        )
    sd_t = clock_sd(recording, topic)
    return OutlineObservation.of(contours, wall, rest, name=topic, sd_t=sd_t), said


def _pose(p: Tree, origin: tuple[float, ...]) -> Floats:
    return pose_of(origin, p.settings.seen.image_x, p.settings.seen.image_y)


# -------------------------------------------------------------------------------------------------

AS_SEEN = "as seen"
BodyAt = tuple[Mesh, Path]  # the body's mesh, and the experiment's folder


def registered(recording: Recording, p: Tree, at: BodyAt) -> MarkerObservation:
    """Markers in the body's frame: their layout's, or the one they were recorded in."""
    mesh, folder = at
    topic = markers_topic(recording, p)
    markers, _, _ = rested(recording.marker(topic), p.settings.seen.still)
    if p.settings.seen.layout == AS_SEEN:
        # The frame they were recorded in is the body's: one marker is enough, as nothing is fitted
        markers = replace(markers, sd=noise(markers))
        if p.settings.seen.registration != MarkerFit():
            raise UsageError(
                f"seen.registration needs a fit, but seen.layout = '{AS_SEEN}' fits nothing; name "
                f"a layout, or leave seen.registration out"
            )
        rest = markers.x[0]
        return MarkerObservation.of(
            markers, dict(zip(markers.names, rest, strict=True)), mesh, name=topic, stands=np.inf,
            sd_t=clock_sd(recording, topic),
            registration=as_declared(markers.names, rest, markers.sd),
        )  # fmt: skip
    layout = layout_of(recording, p.settings.seen.layout, folder)
    kept = [i for i, n in enumerate(markers.names) if n in layout]
    if not kept:
        raise RegistrationError(
            f"seen.layout = {p.settings.seen.layout} has {listed_names(layout)}; the recording has "
            f"{listed_names(markers.names)}: no name occurs in both; spell them as recorded"
        )
    if len(kept) < FEWEST:
        raise RegistrationError(
            f"seen.layout = {p.settings.seen.layout}: {len(kept)} of its markers are visible at "
            f"rest; a registration with a residual needs {FEWEST}. Fewer are enough if they were "
            f"recorded in the body's frame: seen.layout = '{AS_SEEN}'"
        )
    markers = replace(
        markers, names=tuple(markers.names[i] for i in kept), x=markers.x[:, kept],
        sd=noise(markers),
    )  # fmt: skip
    return MarkerObservation.of(
        markers, layout, mesh, how=p.settings.seen.registration, name=topic, stands=np.inf,
        sd_t=clock_sd(recording, topic),
    )  # fmt: skip


def compared_markers(recording: Recording, p: Tree, at: BodyAt) -> MarkerObservation:
    """Return the registered markers but those that move the body.

    Raises `ComparisonError` where none is left, and as `registered` does.
    """
    whole = registered(recording, p, at)
    driving = leading(p.scene)
    kept = [i for i, name in enumerate(whole.names) if name not in driving]
    if not kept:
        raise ComparisonError("every marker moves the body: no marker is left to compare")
    return replace(
        whole, names=tuple(whole.names[i] for i in kept), x=whole.x[:, kept],
        rest=whole.rest[kept], tre=whole.tre[kept],
    )  # fmt: skip


def leading(scene: Scene) -> tuple[str, ...]:
    """Return the markers that move the body."""
    return tuple(name for part in scene.tracked for name in part.labels)


def listed_names(names: Iterable[str]) -> str:
    found = [repr(name) for name in names]
    return ", ".join(found[:6]) + (f" and {len(found) - 6} more" if len(found) > 6 else "")


def layout_of(recording: Recording, text: str, folder: Path) -> dict[str, Floats]:
    """Return the places (3,) m of markers in the body's frame: of the record "marker_layout", or of
    the points of a file of landmarks. Raises `RecordingError` for a file without points."""
    if text == "recorded":
        record = recording.record("marker_layout")
        return {name: vector(at, f"marker_layout '{name}'") for name, at in record.items()}
    path = folder / text
    points = _points_in(path)
    if not points:
        raise RecordingError(f"{path.name}: no points; a layout is a file of landmarks, as FCSV")
    first = next(iter(points.values()))
    return dict(zip(first.names, first.x[0], strict=True))


def _points_in(path: Path) -> Mapping[str, Markers]:
    try:
        return recognised(path).read(path, {}).markers
    except UsageError as error:
        why = str(error).split("; give it")[0]
        raise UsageError(
            f"seen.layout: {why}; a layout must be complete: the columns of a table are name, x "
            f"(mm), y (mm), z (mm)"
        ) from None


def markers_topic(recording: Recording, p: Tree) -> str:
    """Return the markers' topic, where it is not said the only one."""
    if p.settings.seen.markers:
        return str(p.settings.seen.markers)
    if len(recording.markers) != 1:
        raise UsageError(f"seen.markers is not set; expected one of {sorted(recording.markers)}")
    return next(iter(recording.markers))
