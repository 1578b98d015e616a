"""The scene of a drawn body: methods at common instants with what was measured on them, and tools.

The page's view that turns (`page.html`) and the still pictures (`scenes.stills`) show it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.result import MethodResult, Result
from validate.fem.assembly.cell_fields import cell_fields
from validate.fem.assembly.locate import probe_rows
from validate.numbers import significant, spaced, with_unit
from validate.register.clocks import interpolated
from validate.register.markers.displacements import DisplacementObservation
from validate.register.outlines.sections import from_image
from validate.register.registration import Registered
from validate.report.scenes.body import (
    Camera,
    Tool,
    camera,
    drive_direction,
    opening_plane,
    tools_of,
)
from validate.report.sections.observations import (
    Held,
    drive,
    driven,
    finished,
    holds,
    markers_seen,
    outline_seen,
)
from validate.scene.scene import Scene
from validate.solve.types import Run

_MM = 1e3
MOST_METHODS = 4
_PARTICLES = 400  # of a field of measured displacements
_LASTS = 0.99  # of the first method's time: another one that ends before is not shown
_CELLS = 60_000  # elements beyond which strain and stress take longer than the rest of a report


@dataclass(frozen=True)
class SeenMarkers:
    """Markers at the instants, where they were measured and where the simulation has them,
    (f, k, 3) mm, NaN where one was not seen; `rest` (k, 3) mm. `inside`: particles in the body,
    which is seen through."""

    names: tuple[str, ...]
    rest: Floats
    measured: Floats
    simulated: Floats
    inside: bool = False

    @property
    def errors(self) -> Floats:
        """Distances (f, k) mm between both."""
        return np.asarray(np.linalg.norm(self.measured - self.simulated, axis=2))


@dataclass(frozen=True)
class ShownMethod:
    """A method at the instants: its output `frames` (f,) there, markers, at each instant the
    measured and simulated outline (p, 3) mm, and the probes of its scene, at rest (k, 3) mm and
    there (f, k, 3) mm."""

    result: MethodResult
    frames: Ints
    markers: SeenMarkers | None
    outlines: tuple[tuple[Floats, Floats], ...]
    probes: tuple[Floats, Floats] | None

    @property
    def nodes(self) -> Floats:
        """All nodes (n, 3) mm at rest."""
        return _MM * three(self.result.scene.mesh.nodes)

    def u(self, nodes: Ints | slice = slice(None)) -> Floats:
        """Displacements (f, n, 3) mm of nodes at the instants."""
        return _MM * three(self.result.run.u[self.frames][:, nodes])

    def on_mesh_of(self, other: "ShownMethod") -> bool:
        """Whether nodes are those of another method: displacements have a difference then."""
        one, two = self.result.scene.mesh.nodes, other.result.scene.mesh.nodes
        return one.shape == two.shape and bool(np.array_equal(one, two))


@dataclass(frozen=True)
class Opening:
    """The plane that opens a body with a cavity: what lies beyond `at` mm along `normal` (3,) is
    taken away; `words` name it."""

    normal: Floats
    at: float
    words: str


@dataclass(frozen=True)
class BodyScene:
    """Up to four methods at the instants `labels` and times `t` (f,) s; `part` says where symmetry
    leaves out the rest of the body, `left_out` which methods are not shown; `size` mm."""

    labels: tuple[str, ...]
    t: Floats
    methods: tuple[ShownMethod, ...]
    tools: tuple[Tool, ...]
    camera: Camera
    cut: Opening | None
    size: float
    flat: bool
    part: str
    left_out: tuple[str, ...]

    @property
    def worst(self) -> int:
        """The instant of the first method's largest displacement."""
        return int(np.argmax(np.abs(self.methods[0].u()).max(axis=(1, 2))))


def shown_methods(result: Result) -> tuple[MethodResult, ...]:
    """Methods of a body that finished, the accepted one first, up to `MOST_METHODS`; without those
    that only begin what the first one computes, as what is timed alone does."""
    bodies = _bodies(result)
    end = _LASTS * bodies[0].run.t[bodies[0].run.at[-1]] if bodies else 0.0
    return tuple(m for m in bodies if m.run.t[m.run.at[-1]] >= end)[:MOST_METHODS]


def _bodies(result: Result) -> list[MethodResult]:
    return [m for m in finished(result) if len(m.scene.mesh.cells) and len(m.run.u)]


def body_scene(result: Result, most: int) -> BodyScene | None:
    """Return the scene at up to `most` instants of the first method: evenly, with the largest
    displacement; None where no method with a mesh finished.

    Others are shown at their own nearest output frames. Of several recordings the first is shown.
    """
    methods = shown_methods(result)
    if not methods:
        return None
    first, scene = methods[0], methods[0].scene
    names = {m.name for m in methods}
    # Labels and times of the output frames, loads by their names; of at most so many of them the
    # first, the last and evenly, with the one of the largest displacement
    run = first.run
    times = run.t[run.at]
    labels = [f"t = {significant(at)} s" for at in times.tolist()]
    if first.registered and first.registered[0].drives:
        unit, moved = drive(first.registered[0]).unit, driven(first.registered[0], times)
        driven_by = [with_unit(q, unit) for q in moved.tolist()]
        labels = [f"{q}, {at}" for q, at in zip(driven_by, labels, strict=True)]
    if first.registered:
        for i, instant in enumerate(held(first.registered[0], run)):
            if instant.hold is not None:
                times[i], labels[i] = instant.t, spaced(instant.hold.label)
    numbers = np.unique(np.linspace(0, len(run.u) - 1, min(len(run.u), most)).round().astype(int))
    largest = int(np.argmax(np.abs(run.u).max(axis=(1, 2))))
    if largest not in numbers:
        nearest = 1 + int(np.abs(numbers[1:-1] - largest).argmin()) if len(numbers) > 2 else -1
        numbers[nearest] = largest
        numbers = np.unique(numbers)
    t = times[numbers]
    toward = drive_direction(scene)
    shown = tuple(_shown(m, t, numbers) for m in methods)
    tools, cut = tools_of(first, numbers), None
    if scene.cavities and scene.mesh.dimension == 3:
        normal, words = opening_plane(result, toward)
        wall = _MM * scene.mesh.nodes[scene.mesh.facet_nodes(scene.cavities[0].facets)]
        middle = 0.5 * (wall.min(axis=0) + wall.max(axis=0))
        cut = Opening(normal, float(normal @ middle), words)
    seen = shown[0].markers
    held_by_camera = [
        shown[0].nodes, (shown[0].nodes + shown[0].u()).reshape(-1, 3),
        *([seen.measured.reshape(-1, 3)] if seen else []),
        *(tool.nodes for tool in tools if tool.plate),
    ]  # fmt: skip
    flat, normal_ = scene.mesh.dimension == 2, cut.normal if cut else None
    view = camera(np.vstack(held_by_camera), three(toward), normal_, flat)
    return BodyScene(
        tuple(labels[i] for i in numbers), t, shown, tools, view, cut,
        float(np.linalg.norm(np.ptp(shown[0].nodes, axis=0))), flat,
        f"One of {scene.copies} symmetric parts is drawn." if scene.copies > 1 else "",
        tuple(m.label for m in _bodies(result) if m.name not in names),
    )  # fmt: skip


def _shown(method: MethodResult, t: Floats, numbers: Ints) -> ShownMethod:
    scene, run = method.scene, method.run
    # Its output frames nearest to the instants shown: those of the same loads where it has them
    times = run.t[run.at]
    own = np.array([int(np.abs(times - at).argmin()) for at in t])
    if len(run.u) > numbers.max() and method.registered:
        instants = held(method.registered[0], run)
        if instants and instants[0].hold is not None:
            own = numbers
    seen, markers = markers_seen(method), None
    if seen is not None and seen.x.shape[2] == scene.mesh.dimension:
        flat, _ = interpolated(seen.t, seen.x.reshape(len(seen.t), -1), t)
        measured = flat.reshape(len(t), -1, seen.x.shape[2])
        simulated = np.array([seen.simulated(run.u[i]) for i in own])
        rest, measured, simulated = (_MM * three(x) for x in (seen.rest, measured, simulated))
        markers = SeenMarkers(tuple(seen.names), rest, measured, simulated)
    if markers is None and len(t) == 1 and method.registered:
        found = method.registered[0].of(DisplacementObservation)
        markers = _particles(found, run.u[own[0]])
    outline, outlines = outline_seen(method), tuple[tuple[Floats, Floats], ...]()
    if outline is not None and scene.mesh.dimension == 3:
        outlines = tuple(
            (_MM * from_image(outline.pose, outline.measured(at)),
             _MM * from_image(outline.pose, outline.simulated(run.u[i])))
            for at, i in zip(t.tolist(), own.tolist(), strict=True)
        )  # fmt: skip
    probes = None
    if scene.probes and len(scene.mesh.cells):
        rows = probe_rows(scene.mesh, scene.probes)
        at_rest = np.array([p.point for p in scene.probes])
        there = np.array([at_rest + rows.apply(run.u[i]) for i in own])
        probes = _MM * three(at_rest), _MM * three(there)
    return ShownMethod(method, own, markers, outlines, probes)


def _particles(found: Sequence[DisplacementObservation], u: Floats) -> SeenMarkers | None:
    """Points of measured displacements at one instant, every so many; None without any."""
    if not found:
        return None
    rest = np.vstack([o.points for o in found])
    measured = rest + np.vstack([o.u for o in found])
    simulated = rest + np.vstack([o.simulated(u) for o in found])
    names = [f"{o.name} {i}" for o in found for i in range(len(o.points))]
    every = slice(None, None, -(-len(rest) // _PARTICLES))
    rest, measured, simulated = (_MM * three(x[every]) for x in (rest, measured, simulated))
    return SeenMarkers(tuple(names[every]), rest, measured[None], simulated[None], inside=True)


def fields(methods: Sequence[ShownMethod], at: Sequence[int]) -> list[Mapping[str, Floats]]:
    """Return for each method by name and unit the largest principal strain and the von Mises stress
    of its elements, averaged at all nodes (f, n), at instants of these numbers."""
    found = [_strain_and_stress(m, m.frames[list(at)]) for m in methods]
    top = max((np.abs(s).max(initial=0.0) for _, s in found if s is not None), default=0.0)
    unit, size = ("kPa", 1e-3) if top >= 1e3 else ("Pa", 1.0)
    named = ("largest principal strain / %", 100.0), (f"von Mises stress / {unit}", size)
    return [
        {name: by * v for (name, by), v in zip(named, values, strict=True) if v is not None}
        for values in found
    ]


def _strain_and_stress(
    shown: ShownMethod, frames: Ints
) -> tuple[Floats, Floats | None] | tuple[None, None]:
    """Both (f, n) at the nodes, the stress in Pa; None where a scene has none, or many cells."""
    scene, run = shown.result.scene, shown.result.run
    if not isinstance(scene, Scene) or len(scene.mesh.cells) > _CELLS:
        return None, None
    found = [cell_fields(scene, run.u[i]) for i in frames]
    strain = np.array([np.linalg.eigvalsh(f.strain)[:, -1] for f in found])
    stress = [f.von_mises for f in found if f.von_mises is not None]
    known = len(stress) == len(found)
    return _at_nodes(scene, strain), _at_nodes(scene, np.array(stress)) if known else None


def _at_nodes(scene: Scene, values: Floats) -> Floats:
    """Means (f, n) at nodes of the values (f, e) of the elements around them."""
    cells, n = scene.mesh.cells, len(scene.mesh.nodes)
    flat, per_cell = cells.ravel(), cells.shape[1]
    count = np.maximum(np.bincount(flat, minlength=n), 1)
    return np.array(
        [np.bincount(flat, np.repeat(v, per_cell), minlength=n) / count for v in values]
    )


def three(x: Floats) -> Floats:
    """Return vectors (..., 3) of (..., d): a plane lies in space at z = 0."""
    return np.pad(x, [*([(0, 0)] * (x.ndim - 1)), (0, 3 - x.shape[-1])])


# --- displacements between output frames: interpolation of a run at its load steps ---------------

HOW = "between the loads interpolated linearly in the drive"


@dataclass(frozen=True)
class Instant:
    """Displacements u (n, d) m at time t s and drive in SI `unit`; `hold` None: none of the loads.

    `computed` is False where it was interpolated.
    """

    t: float
    drive: float
    unit: str
    u: Floats
    hold: Held | None
    computed: bool = True


def held(registered: Registered, run: Run) -> tuple[Instant, ...]:
    """Return the instants that the run computed, in order of time."""
    if not holds(registered):
        times = run.t[run.at]
        rows = zip(times.tolist(), driven(registered, times).tolist(), run.u, strict=True)
        return tuple(Instant(t, q, drive(registered).unit, u, None) for t, q, u in rows)
    pairs = zip(holds(registered), run.u, strict=False)  # a run that ended early has fewer
    return tuple(Instant(h.t, h.drive, h.unit, u, h) for h, u in pairs)


def at_times(registered: Registered, run: Run, times: Floats) -> tuple[Instant, ...]:
    """Instants at the loads and at those of `times` (k,) s that lie between them, in order.

    Of a run over time the frames nearest to `times`, none interpolated.
    """
    known = held(registered, run)
    if known and not holds(registered):
        at = np.array([i.t for i in known])
        return tuple(known[i] for i in np.unique([np.abs(at - t).argmin() for t in times]))
    found = list(known)
    for a, b in pairwise(known):
        inside = times[(times > a.t) & (times < b.t)]
        pairs = zip(inside.tolist(), driven(registered, inside).tolist(), strict=True)
        found += [_between(a, b, *pair) for pair in pairs]
    return tuple(sorted(found, key=lambda i: i.t))


def _between(a: Instant, b: Instant, t: float, q: float) -> Instant:
    way = b.drive - a.drive
    share = (q - a.drive) / way if way else 0.0
    share = float(np.clip(share, 0.0, 1.0))
    q = a.drive + share * way
    return Instant(t, q, a.unit, a.u + share * (b.u - a.u), None, computed=False)
