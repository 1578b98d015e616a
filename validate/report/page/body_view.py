"""The body of a report's page that turns: surfaces, displacements and measured points as JSON.

`page.js` shows it by three.js. Numbers are little-endian arrays in base 64; lengths in mm.
"""

import base64
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.result import MethodResult, Result
from validate.fem.assembly.cell_fields import cell_fields
from validate.register.clocks import interpolated
from validate.register.outlines.plane import from_image
from validate.report.charts.style import looks
from validate.report.scenes import gl
from validate.report.scenes.body import drive_direction, indenters_at, opening_plane, plates_at
from validate.report.scenes.loads import held
from validate.report.scenes.skin import SurfacePart, skins
from validate.report.sections.observations import (
    drive,
    driven,
    finished,
    markers_seen,
    outline_seen,
)
from validate.report.views.numbers import significant, spaced, with_unit
from validate.scene.scene import Scene

_MM = 1e3
_MOST_TRIANGLES = 6000  # of one method's surface
_MOST_FRAMES, _FEWEST_FRAMES = 24, 3
_MOST_METHODS = 4  # the accepted one first
_BYTES = 450_000  # of all displacements and cell fields, before base 64
_STEPS = 32767  # of a displacement: it is stored as a share of the largest one
_CELLS = 60_000  # elements beyond which strain and stress take longer than the rest of a report


@dataclass(frozen=True)
class _Frames:
    """Instants that are shown: their labels, times s, and the number of each output frame."""

    labels: tuple[str, ...]
    t: Floats
    numbers: Ints


def body_view(result: Result) -> dict[str, Any] | None:
    """Return what `page.js` draws of up to four methods that finished, the accepted one first; None
    where none of them has a mesh.

    Methods are shown at the instants of the first one, each at its own nearest output frame. Of
    several recordings the first is shown.
    """
    methods = [m for m in finished(result) if len(m.scene.mesh.cells) and len(m.run.u)]
    if not methods:
        return None
    shown = methods[:_MOST_METHODS]
    surfaces = [_surface(m) for m in shown]
    per_frame = sum(8 * len(np.unique(np.concatenate([p.nodes for p in s]))) + 1 for s in surfaces)
    most = int(np.clip(_BYTES / per_frame, _FEWEST_FRAMES, _MOST_FRAMES))
    frames = _frames(shown[0], most)
    colours = looks(result)
    scene = shown[0].scene
    size = float(np.linalg.norm(np.ptp(_MM * scene.mesh.nodes, axis=0)))
    view: dict[str, Any] = {
        "labels": list(frames.labels),
        "size": size,
        "flat": scene.mesh.dimension == 2,
        "down": _three(drive_direction(scene)[None])[0].tolist(),
        "part": f"One of {scene.copies} symmetric parts is drawn." if scene.copies > 1 else "",
        "left_out": [m.label for m in methods[_MOST_METHODS:]],
        "methods": [
            _method(m, parts, frames, colours[m.name].colour)
            for m, parts in zip(shown, surfaces, strict=True)
        ],
        "tools": list(_tools(shown[0], frames)),
    }
    if scene.cavities and scene.mesh.dimension == 3:
        normal, words = opening_plane(result, drive_direction(scene))
        wall = _MM * scene.mesh.nodes[scene.mesh.facet_nodes(scene.cavities[0].facets)]
        origin = 0.5 * (wall.min(axis=0) + wall.max(axis=0))
        view["cut"] = {"normal": normal.tolist(), "at": float(normal @ origin), "words": words}
    return view


def _surface(method: MethodResult) -> tuple[SurfacePart, ...]:
    """The parts that are drawn: outside and walls, or all triangles of a planar mesh."""
    mesh = method.scene.mesh
    if mesh.dimension == 3:
        return skins(method.scene, _MOST_TRIANGLES)
    nodes, local = np.unique(mesh.simplices, return_inverse=True)
    return (SurfacePart("body", nodes, local.reshape(-1, 3), len(mesh.simplices)),)


def _frames(method: MethodResult, most: int) -> _Frames:
    """At most so many output frames of the run, evenly, its loads by their names."""
    run = method.run
    times = run.t[run.at]
    labels = [f"t = {significant(t)} s" for t in times.tolist()]
    if method.registered and method.registered[0].drives:
        unit, moved = drive(method.registered[0]).unit, driven(method.registered[0], times)
        labels = [f"{with_unit(q, unit)}, {t}" for q, t in zip(moved.tolist(), labels, strict=True)]
    if method.registered:
        for i, instant in enumerate(held(method.registered[0], run)):
            if instant.hold is not None:
                times[i], labels[i] = instant.t, spaced(instant.hold.label)
    chosen = np.unique(np.linspace(0, len(run.u) - 1, min(len(run.u), most)).round().astype(int))
    return _Frames(tuple(labels[i] for i in chosen), times[chosen], chosen)


def _own_frames(method: MethodResult, frames: _Frames) -> Ints:
    """The numbers of the method's output frames nearest to the instants shown."""
    run = method.run
    if len(run.u) > frames.numbers.max() and method.registered:
        instants = held(method.registered[0], run)
        if instants and instants[0].hold is not None:
            return frames.numbers
    times = run.t[run.at]
    return np.array([int(np.abs(times - t).argmin()) for t in frames.t])


def _method(
    method: MethodResult, parts: Sequence[SurfacePart], frames: _Frames, colour: str
) -> dict[str, Any]:
    scene, run = method.scene, method.run
    nodes = np.unique(np.concatenate([part.nodes for part in parts]))
    own = _own_frames(method, frames)
    u = _MM * _three(run.u[own][:, nodes])
    found: dict[str, Any] = {
        "name": method.name,
        "label": method.label,
        "colour": colour,
        "nodes": _packed(_MM * _three(scene.mesh.nodes[nodes]), "<f4"),
        "parts": [
            {"name": p.name, "triangles": _packed(np.searchsorted(nodes, p.nodes)[p.triangles],
                                                  "<u4")}
            for p in parts
        ],
        "whole": sum(p.whole for p in parts),
        "u": _shares(u),
        "fields": _fields(method, nodes, own),
    }  # fmt: skip
    seen = markers_seen(method)
    if seen is not None and seen.x.shape[2] == scene.mesh.dimension:
        flat, _ = interpolated(seen.t, seen.x.reshape(len(seen.t), -1), frames.t)
        measured = flat.reshape(len(frames.t), -1, seen.x.shape[2])
        simulated = np.array([seen.simulated(run.u[i]) for i in own])
        found["markers"] = {
            "names": list(seen.names),
            "rest": _packed(_MM * _three(seen.rest), "<f4"),
            "measured": _packed(_MM * _three(measured), "<f4"),
            "simulated": _packed(_MM * _three(simulated), "<f4"),
        }
    outline = outline_seen(method)
    if outline is not None and scene.mesh.dimension == 3:
        found["outlines"] = [
            {
                "measured": _packed(_MM * from_image(outline.pose, outline.measured(t)), "<f4"),
                "simulated": _packed(
                    _MM * from_image(outline.pose, outline.simulated(run.u[i])), "<f4"
                ),
            }
            for t, i in zip(frames.t.tolist(), own.tolist(), strict=True)
        ]
    return found


def _fields(method: MethodResult, nodes: Ints, own: Ints) -> dict[str, Any]:
    """Largest principal strain and von Mises stress of elements, averaged at the drawn nodes."""
    scene, run = method.scene, method.run
    if not isinstance(scene, Scene) or len(scene.mesh.cells) > _CELLS:
        return {}
    strains, stresses = [], []
    for i in own:
        fields = cell_fields(scene, run.u[i])
        strains.append(np.linalg.eigvalsh(fields.strain)[:, -1])
        stresses.append(fields.von_mises)
    found = {"largest principal strain / %": _at_nodes(scene, nodes, 100 * np.array(strains))}
    if all(s is not None for s in stresses):
        pascal = _at_nodes(scene, nodes, np.array(stresses, dtype=np.float64))
        kilo = np.abs(pascal).max(initial=0.0) >= 1e3
        unit, size = ("kPa", 1e-3) if kilo else ("Pa", 1.0)
        found[f"von Mises stress / {unit}"] = size * pascal
    return {name: _shares(values) for name, values in found.items()}


def _at_nodes(scene: Scene, nodes: Ints, values: Floats) -> Floats:
    """Means (f, v) at nodes of the values (f, e) of the elements around them."""
    cells = scene.mesh.cells
    flat, per_cell = cells.ravel(), cells.shape[1]
    n = len(scene.mesh.nodes)
    count = np.maximum(np.bincount(flat, minlength=n), 1)
    means = [np.bincount(flat, np.repeat(v, per_cell), minlength=n) / count for v in values]
    return np.array(means)[:, nodes]


def _tools(method: MethodResult, frames: _Frames) -> Iterator[dict[str, Any]]:
    """Plates and rigid indenters: a surface at rest and its shift at each instant."""
    if method.scene.mesh.dimension != 3:
        return
    by_frame = [plates_at(method, int(i)) for i in frames.numbers]
    for number, plate in enumerate(by_frame[0]):
        shifts = np.array([plates[number].shift for plates in by_frame])
        corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
        box = _tool(plate.centre + 0.5 * plate.sizes * corners, np.array(_BOX), shifts)
        yield {**box, "plate": True}
    if not gl.available():
        return
    from validate.report.scenes.renders import drawn_indenter  # vtk reads its window class first

    tools = [indenters_at(method, int(i)) for i in frames.numbers]
    for number, indenter in enumerate(tools[0]):
        solid: Any = drawn_indenter(indenter).triangulate()
        triangles = np.asarray(solid.faces).reshape(-1, 4)[:, 1:]
        yield _tool(np.asarray(solid.points), triangles, np.array([t[number].shift for t in tools]))


_BOX = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
        [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip


def _tool(nodes: Floats, triangles: Ints, shifts: Floats) -> dict[str, Any]:
    return {"nodes": _packed(nodes, "<f4"), "triangles": _packed(triangles, "<u4"),
            "shifts": _packed(shifts, "<f4")}  # fmt: skip


def _three(x: Floats) -> Floats:
    """Vectors (..., 3) of (..., d): a plane lies in space at z = 0."""
    return np.pad(x, [*([(0, 0)] * (x.ndim - 1)), (0, 3 - x.shape[-1])])


def _shares(values: Floats) -> Mapping[str, Any]:
    """Values as 16-bit shares of their largest size."""
    top = float(np.abs(values).max(initial=0.0)) or 1.0
    return {"top": top, "shares": _packed(np.round(values / top * _STEPS), "<i2")}


def _packed(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
