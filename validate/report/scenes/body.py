"""Geometry of a drawn body: deformed state, plates, cutting plane, camera, markers, outline."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.compare.result import MethodResult, Result
from validate.register.clocks import interpolated
from validate.register.outlines.plane import from_image
from validate.report.sections.observations import (
    Held,
    holds,
    markers_seen,
    outline,
    outline_seen,
    shown_method,
)
from validate.report.views.numbers import significant, spaced, with_unit
from validate.scene.contact import Shape
from validate.scene.mesh import Mesh
from validate.scene.meshless import AnyScene
from validate.scene.places import nodes_of
from validate.scene.scene import Scene, Weight

# --- From where a set of points is seen best: along the axis that it spreads over least.


def flattest(points: Floats) -> tuple[list[int], int | None]:
    """Return the two axes that points (k, d) spread over most, and the one across; None in 2-D."""
    spread = np.ptp(points, axis=0)
    across = int(np.argmin(spread)) if len(spread) == 3 else None
    return [i for i in range(len(spread)) if i != across], across


# -------------------------------------------------------------------------------------------------

_MM = 1e3


@dataclass(frozen=True)
class Plate:
    """A flat face pressed on, in rest position: centre (3,) mm, sizes (3,) mm, `shift` (3,) mm."""

    centre: Floats
    sizes: Floats
    shift: Floats


@dataclass(frozen=True)
class ShownIndenter:
    """A rigid body where it stands at rest, m, moved by `shift` (3,) mm; `extent` (3,) mm is that
    of what it may touch, by which endless shapes are cut."""

    shape: Shape
    shift: Floats
    extent: Floats


@dataclass(frozen=True)
class ShownMarkers:
    """Markers at the shown load, where they were measured and where the simulation has them: (k, 3)
    mm each, of those that were seen."""

    measured: Floats
    simulated: Floats

    @property
    def largest(self) -> float:
        """The largest distance between both, mm."""
        return float(np.linalg.norm(self.measured - self.simulated, axis=1).max())


@dataclass(frozen=True)
class ShownBody:
    """A mesh at rest with displacements u (n, 3) mm at `load`, opened by a plane or whole.

    The part on the side of `normal` (3,) beyond `origin` (3,) mm is taken away; None: whole; `cut`
    says where. `part` says when symmetry leaves out the rest of it. `up` (3,) is the camera's,
    `toward` (3,) where it is driven to; pressure Pa is None without a cavity, `pressures` its range
    Pa. `markers` and the closed line `outline` (k, 3) mm were measured at that load.
    """

    label: str
    part: str
    load: str
    mesh: Mesh
    u: Floats
    plates: tuple[Plate, ...]
    indenters: tuple[ShownIndenter, ...]
    cavity: str | None
    pressure: float | None
    pressures: tuple[float, float]
    origin: Floats
    normal: Floats | None
    cut: str
    up: Floats
    toward: Floats
    markers: ShownMarkers | None = None
    outline: Floats | None = None


def shown_body(result: Result) -> ShownBody | None:
    """Return the accepted method's body at its last load, or where a run over time moves it most.

    None in 2-D or when nothing finished.
    """
    method = shown_method(result)
    if method is None or len(method.run.u) == 0 or method.scene.mesh.dimension != 3:
        return None
    scene, run = method.scene, method.run
    cavity = scene.cavities[0] if scene.cavities else None
    trace = run.traces.get(f"{cavity.name}.pressure") if cavity else None
    frame, load, t = _frame(method)
    nodes = _MM * scene.mesh.nodes
    wall = nodes[scene.mesh.facet_nodes(cavity.facets)] if cavity else nodes
    toward = drive_direction(scene)
    normal, cut = opening_plane(result, toward) if cavity else (None, "")
    return ShownBody(
        label=method.label,
        part=f" One of {scene.copies} symmetric parts is drawn." if scene.copies > 1 else "",
        load=load,
        mesh=scene.mesh,
        u=_MM * run.u[frame],
        plates=plates_at(method, frame),
        indenters=indenters_at(method, frame),
        cavity=cavity.facets if cavity else None,
        pressure=float(trace.y[run.at[frame]]) if trace else None,
        pressures=(0.0, max(float(trace.y.max()), 1.0)) if trace else (0.0, 1.0),
        origin=0.5 * (wall.min(axis=0) + wall.max(axis=0)),
        normal=normal,
        cut=f"{cavity.name} in {cut}" if cavity else "",
        up=normal if normal is not None else -toward,
        toward=toward,
        markers=_markers(method, frame, t),
        outline=_outline(method, t),
    )


def _markers(method: MethodResult, frame: int, t: float) -> ShownMarkers | None:
    """The markers at t s, between two samples on the line between these; None without one there."""
    seen = markers_seen(method)
    if seen is None or seen.x.shape[2] != 3:
        return None
    flat, _ = interpolated(seen.t, seen.x.reshape(len(seen.t), -1), np.array([t]))
    measured = _MM * flat.reshape(-1, 3)
    simulated = _MM * seen.simulated(method.run.u[frame])
    there = np.isfinite(measured).all(axis=1) & np.isfinite(simulated).all(axis=1)
    return ShownMarkers(measured[there], simulated[there]) if there.any() else None


def _outline(method: MethodResult, t: float) -> Floats | None:
    """The measured outline nearest to t s in the scene's frame."""
    seen = outline_seen(method)
    return None if seen is None else _MM * from_image(seen.pose, seen.measured(t))


def _frame(method: MethodResult) -> tuple[int, str, float]:
    """The last load; of a run over time the frame with the largest displacement. With its time."""
    run = method.run
    loads = holds(method.registered[0]) if method.registered else ()
    if loads:
        frame = min(len(loads), len(run.u)) - 1
        return frame, _load(loads[frame]), loads[frame].t
    largest = int(np.argmax(np.abs(run.u).max(axis=(1, 2))))
    t = float(run.t[run.at[largest]])
    return largest, f"t = {significant(t)} s", t


def _load(hold: Held) -> str:
    """The load in words; a label without a number is replaced by the drive's."""
    return spaced(hold.label) if hold.label[0].isdigit() else with_unit(hold.drive, hold.unit)


def drive_direction(scene: AnyScene) -> Floats:
    """Where the body is driven or pressed to, else where its weight pulls; without either the last
    axis is drawn upward."""
    tools = scene.contacts if isinstance(scene, Scene) else ()
    pressed = [tool.direction for tool in tools if tool.direction is not None]
    weights = [load.direction for load in scene.loads if isinstance(load, Weight)]
    drives = [drive.direction for drive in scene.drives]
    return np.array([*drives, *pressed, *weights, (0.0, 0.0, -1.0)][0])


def opening_plane(result: Result, toward: Floats) -> tuple[Floats, str]:
    """The normal of the plane that opens the body, its largest part positive, and the plane in
    words: that of the images, without any one along the drive."""
    seen = outline(result.registered[0]) if result.registered else None
    if seen is None:
        return np.roll(np.abs(toward), 1), "a plane along the drive"
    normal = seen.pose[:3, 2]
    return np.asarray(normal * np.sign(normal[np.argmax(np.abs(normal))])), "the image plane"


def indenters_at(method: MethodResult, frame: int) -> tuple[ShownIndenter, ...]:
    scene, run = method.scene, method.run
    if not isinstance(scene, Scene):
        return ()
    found = []
    for tool in scene.contacts:
        touched = _MM * scene.mesh.nodes[nodes_of(scene.mesh, tool.facets)]
        shift, travel = np.zeros(3), run.traces.get(f"{tool.name}.displacement")
        if tool.direction is not None and travel is not None:
            shift = _MM * float(travel.y[run.at[frame]]) * np.array(tool.direction)
        found.append(ShownIndenter(tool.shape, shift, np.ptp(touched, axis=0)))
    return tuple(found)


def plates_at(method: MethodResult, frame: int) -> tuple[Plate, ...]:
    """Flat facet sets across the first drive: the driven one and the held ones."""
    scene = method.scene
    drive = scene.drives[0] if scene.drives else None
    travelled = method.run.traces.get(f"{drive.name}.displacement") if drive else None
    if drive is None or travelled is None or drive.follows or drive.shape:
        return ()
    axis = int(np.argmax(np.abs(drive.direction)))
    travel = travelled.y[method.run.at[frame]]
    moved = {drive.facets: _MM * float(travel) * np.array(drive.direction)}
    held = dict.fromkeys(s.facets for s in scene.supports if axis in s.components)
    found = []
    for name in {**moved, **held}:
        nodes = _MM * scene.mesh.nodes[nodes_of(scene.mesh, name)]
        low, high = nodes.min(axis=0), nodes.max(axis=0)
        if high[axis] - low[axis] < 1e-6:
            shift = moved.get(name, np.zeros(3))
            found.append(_plate(low, high, axis, scene.mesh, shift))
    return tuple(found)


def _plate(low: Floats, high: Floats, axis: int, mesh: Mesh, shift: Floats) -> Plate:
    middle = 0.5 * _MM * (mesh.nodes[:, axis].min() + mesh.nodes[:, axis].max())
    sizes = (high - low) * 1.12
    thick = 0.04 * float((high - low).max())
    sizes[axis] = thick
    centre = 0.5 * (low + high)
    centre[axis] += 0.55 * thick * np.sign(low[axis] - middle)
    return Plate(centre, sizes, shift)
