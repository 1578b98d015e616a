"""The body of a report's page that turns: surfaces, displacements and measured points as JSON.

`page.js` shows it by three.js. Numbers are little-endian arrays in base 64; lengths in mm.
"""

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.compare.result import MethodResult, Result
from validate.report.scenes.body_scene import (
    ShownMethod,
    body_scene,
    fields,
    shown_methods,
)
from validate.report.scenes.skin import SurfacePart, skins

_MOST_TRIANGLES = 6000  # of one method's surface
_MOST_FRAMES, _FEWEST_FRAMES = 24, 3
_BYTES = 450_000  # of all displacements and cell fields, before base 64
_STEPS = 32767  # of a displacement: it is stored as a share of the largest one


def body_view(result: Result) -> dict[str, Any] | None:
    """Return what `page.js` draws of up to four methods that finished, the accepted one first; None
    where none of them has a mesh.

    Methods are shown at the instants of the first one, each at its own nearest output frame. Of
    several recordings the first is shown.
    """
    surfaces = [_surface(m) for m in shown_methods(result)]
    if not surfaces:
        return None
    per_frame = sum(8 * len(np.unique(np.concatenate([p.nodes for p in s]))) + 1 for s in surfaces)
    scene = body_scene(result, int(np.clip(_BYTES / per_frame, _FEWEST_FRAMES, _MOST_FRAMES)))
    if scene is None:
        return None
    coloured = fields(scene.methods, range(len(scene.labels)))
    return {
        "labels": list(scene.labels),
        "size": scene.size,
        "flat": scene.flat,
        "camera": {name: np.ravel(value).tolist() for name, value in vars(scene.camera).items()},
        "part": scene.part,
        "left_out": list(scene.left_out),
        "methods": [_method(*of) for of in zip(scene.methods, surfaces, coloured, strict=True)],
        "tools": [
            {"nodes": _packed(t.nodes, "<f4"), "triangles": _packed(t.triangles, "<u4"),
             "shifts": _packed(t.shifts, "<f4")}
            for t in scene.tools
        ],
        "cut": scene.cut and {"normal": scene.cut.normal.tolist(), "at": scene.cut.at,
                              "words": scene.cut.words},
    }  # fmt: skip


def _surface(method: MethodResult) -> tuple[SurfacePart, ...]:
    """The parts that are drawn: outside and walls, or all triangles of a planar mesh."""
    mesh = method.scene.mesh
    if mesh.dimension == 3:
        return skins(method.scene, _MOST_TRIANGLES)
    nodes, local = np.unique(mesh.simplices, return_inverse=True)
    return (SurfacePart("body", nodes, local.reshape(-1, 3), len(mesh.simplices)),)


def _method(
    shown: ShownMethod, parts: Sequence[SurfacePart], coloured: Mapping[str, Floats]
) -> dict[str, Any]:
    nodes = np.unique(np.concatenate([part.nodes for part in parts]))
    seen = shown.markers
    return {
        "label": shown.result.label,
        "nodes": _packed(shown.nodes[nodes], "<f4"),
        "parts": [
            {"name": p.name, "triangles": _packed(np.searchsorted(nodes, p.nodes)[p.triangles],
                                                  "<u4")}
            for p in parts
        ],
        "u": _shares(shown.u(nodes)),
        "fields": {name: _shares(values[:, nodes]) for name, values in coloured.items()},
        "markers": seen and {
            "names": list(seen.names), "rest": _packed(seen.rest, "<f4"),
            "measured": _packed(seen.measured, "<f4"),
            "simulated": _packed(seen.simulated, "<f4"), "inside": seen.inside,
        },
        "probes": shown.probes and {
            "rest": _packed(shown.probes[0], "<f4"), "moved": _packed(shown.probes[1], "<f4"),
        },
        "outlines": [
            {"measured": _packed(measured, "<f4"), "simulated": _packed(simulated, "<f4")}
            for measured, simulated in shown.outlines
        ] or None,
    }  # fmt: skip


def _shares(values: Floats) -> Mapping[str, Any]:
    """Values as 16-bit shares of their largest size."""
    top = float(np.abs(values).max(initial=0.0)) or 1.0
    return {"top": top, "shares": _packed(np.round(values / top * _STEPS), "<i2")}


def _packed(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")
