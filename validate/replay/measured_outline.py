"""Outlines of a measured body: where their images lie in its frame, and what they are held to."""

from dataclasses import replace

from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.recording.types import Contours, Recording
from validate.register.clock import clock_sd
from validate.register.observation import nearest_sample
from validate.register.outline_geometry import enclosed
from validate.register.outlines import OutlineObservation, observe_outlines
from validate.register.plane import SurfaceSampler, cavity_sampler, section
from validate.replay.tree import Tree
from validate.scene.mesh import Mesh
from validate.scene.named_place import pose_of

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
    wall = cavity_sampler(mesh, p.settings.seen.surface, None, _PARTS)
    said: tuple[str, ...] = ()
    if p.settings.seen.pose == "declared":
        contours = replace(contours, pose=_pose(p, p.settings.seen.origin))
    if p.settings.seen.pose == "fitted":
        contours = replace(contours, pose=_fitted(p, contours, wall, rest))
        at = ", ".join(f"{1e3 * x:.2f}" for x in contours.pose[:3, 3])
        said = (
            f"Images of '{topic}': their origin at ({at}) mm was fitted: the outline at rest has "
            f"the centroid of the body's section. Its position at rest is not evidence.",
        )
    sd_t = clock_sd(recording, topic)
    return observe_outlines(contours, wall, rest, name=topic, sd_t=sd_t), said


def _pose(p: Tree, origin: tuple[float, ...]) -> Floats:
    return pose_of(origin, p.settings.seen.image_x, p.settings.seen.image_y)


def _fitted(p: Tree, contours: Contours, wall: SurfaceSampler, rest: float) -> Floats:
    """The images through the body's middle, the outline's centroid at rest on the section's."""
    low, high = wall.rest.min(axis=0), wall.rest.max(axis=0)
    pose = _pose(p, tuple(((low + high) / 2).tolist()))
    still = contours.outlines[nearest_sample(contours.t, rest, "outlines")]
    shown = section(wall.rest, wall.triangles, pose)
    off = enclosed(shown)[1] - enclosed(still)[1]
    pose[:3, 3] += pose[:3, :2] @ off
    return pose
