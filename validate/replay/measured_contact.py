"""A rigid indenter on a measured body: where it starts, the mesh below it, a quarter of it."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError, UsageError
from validate.replay.contact_cards import Indenter
from validate.replay.measured_cards import MeasuredBody, SolidModel
from validate.replay.method import Method
from validate.scene.clustered import clustered_block
from validate.scene.contact import (
    RigidContact,
    RigidCylinder,
    RigidPlane,
    RigidPunch,
    RigidSphere,
    Shape,
)
from validate.scene.material import LawName
from validate.scene.mesh import Mesh
from validate.scene.named_place import axis_of
from validate.scene.scene import Support
from validate.scene.select import OnPlane, Place, nodes_of
from validate.solve.contact import ContactNewton

PRESSED = "moved"  # the indenter's name: its force is that of a moved place
_BONDED = 1e6  # a coefficient at which nothing that presses slips
_PER_REACH = 4.0  # cells along the radius of contact on the nominal mesh
_LEAST = 0.02  # cells are not clustered further
_ENDS = {"zmax": "-z", "zmin": "+z"}  # places that a quarter keeps, and the way towards them
_MIDDLE = 1e-6  # of the body's size: so far a tip lies from the axis of symmetry


def touching(label: str, law: LawName = "neo_hooke", order: Any = 1) -> Method:
    """Return a static model of the body in a law, pressed by a rigid indenter."""
    return Method(label, ContactNewton(), SolidModel(law, order))


def require_touching(p: MeasuredBody, unit: str) -> None:
    """Raises `UsageError` where an indenter is not moved by a displacement."""
    if unit != "m":
        raise UsageError(
            f"indenter.shape = {p.indenter.shape}: an indenter needs a displacement; set moved.by "
            f"to a signal in m ('{p.moved.by}' is not one)"
        )


def contact_of(p: MeasuredBody, mesh: Mesh, where: Place) -> RigidContact:
    """Return the indenter where it stands at the first instant.

    Along its way it is set back so that it touches the place after `indenter.gap`.
    """
    card, along = p.indenter, np.array(axis_of(p.moved.along))
    x = mesh.nodes[nodes_of(mesh, where)]
    tip = np.array(card.tip) if card.tip else _middle(p, mesh, where)
    depth, aside = _of_way(x - tip, along, card)
    under = aside < card.radius if card.shape != "plate" else np.ones(len(x), bool)
    if not under.any():
        at = ", ".join(f"{1e3 * c:.3g}" for c in tip)
        raise SceneError(
            f"indenter.tip = ({at}) mm: no node of moved.place = {p.moved.place} lies before the "
            f"{card.shape} of {1e3 * card.radius:.3g} mm; set indenter.tip or moved.place"
        )
    flat = card.shape in ("plate", "punch")
    reach = 0.0 if flat else np.sqrt(card.radius**2 - aside[under] ** 2)
    start = tip + along * (float((depth[under] - reach).min()) - max(card.gap, 0.0))
    friction = _BONDED if card.bonded else card.friction
    direction = tuple(along.tolist())
    return RigidContact(PRESSED, where, _shape(card, start, direction), direction, friction)


def _of_way(offset: Floats, along: Floats, card: Indenter) -> tuple[Floats, Floats]:
    """How far (n,) m offsets (n, 3) m lie along the way, and how far beside it: of a cylinder
    across its axis."""
    depth = offset @ along
    across = offset - np.outer(depth, along)
    if card.shape == "cylinder":
        axis = _axis(card, along)
        across = across - np.outer(across @ axis, axis)
    return depth, np.linalg.norm(across, axis=1)


def _axis(card: Indenter, along: Floats) -> Floats:
    axis = np.array(axis_of(card.axis))
    if abs(float(axis @ along)) > 1e-6:
        raise UsageError(
            f"indenter.axis = {card.axis}: a cylinder must lie across its direction of motion; "
            f"set indenter.axis=+x or +y or +z"
        )
    return axis


def _shape(card: Indenter, start: Floats, along: tuple[float, ...]) -> Shape:
    at = tuple(start.tolist())
    if card.shape == "plate":
        return RigidPlane(at, along)
    if card.shape == "punch":
        return RigidPunch(at, along, card.radius)
    if card.shape == "sphere":
        return RigidSphere(at, card.radius)
    return RigidCylinder(at, tuple(_axis(card, np.array(along)).tolist()), card.radius)


def _middle(p: MeasuredBody, mesh: Mesh, where: Place) -> Floats:
    """The middle of the place's extent; of a quarter, that of the whole body's."""
    x = mesh.nodes[nodes_of(mesh, where)]
    middle = (x.min(axis=0) + x.max(axis=0)) / 2
    if is_quarter(p):
        middle[:2] = _axis_of_body(p)
    return np.asarray(middle)


# --- mesh -----------------------------------------------------------------------------------------


def is_quarter(p: MeasuredBody) -> bool:
    """Whether two planes of symmetry leave a quarter: a block or cylinder that is pressed in its
    middle along z, held at its ends alone, of which nothing but the force is judged."""
    card, said = p.indenter, p.held
    if not card.there or p.body.file is not None or p.seen.markers or p.seen.outline:
        return False
    if p.moved.place not in _ENDS or p.moved.along != _ENDS[p.moved.place]:
        return False
    if not {said.all, said.z} <= {None, *_ENDS} or said.x or said.y or said.slides:
        return False
    if card.shape == "cylinder" and card.axis.lstrip("+-") not in ("x", "y"):
        return False
    off = np.abs(np.array(card.tip[:2]) - _axis_of_body(p)) if card.tip else np.zeros(2)
    return bool((off <= _MIDDLE * max(p.body.block or p.body.cylinder)).all())


def _axis_of_body(p: MeasuredBody) -> Floats:
    return np.array(p.body.block[:2]) / 2 if p.body.block else np.zeros(2)


def symmetry(p: MeasuredBody) -> tuple[Support, ...]:
    """Return the supports on the planes of symmetry of a quarter; none of a whole body."""
    if not is_quarter(p):
        return ()
    at = (*_axis_of_body(p).tolist(), 0.0)
    normals = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    return tuple(Support(OnPlane(at, n).faces, (c,)) for c, n in enumerate(normals))


@lru_cache(maxsize=8)
def pressed_mesh(p: MeasuredBody) -> Mesh:
    """Return the mesh of a block or cylinder below an indenter, with the facet set "surface".

    A block has hexahedra, clustered below the indenter; a cylinder tetrahedra, clustered if it is
    pressed on its axis. `body.divisions` are the cells of a quarter, where there is one.
    """
    mesh = _block(p) if p.body.block else _cylinder(p)
    return replace(mesh, facets={**mesh.facets, "surface": mesh.surface})


def _block(p: MeasuredBody) -> Mesh:
    size, quarter = p.body.block, is_quarter(p)
    low = (*(size[c] / 2 if quarter else 0.0 for c in (0, 1)), 0.0)
    tip = np.array(p.indenter.tip) if p.indenter.tip else _end(p, np.array(size))
    spans = tuple(b - a for a, b in zip(low, size, strict=True))
    share = _shares(p, spans, p.body.divisions)
    if p.indenter.shape == "cylinder":  # along its axis nothing is concentrated
        share = tuple(1.0 if a else s for a, s in zip(axis_of(p.indenter.axis), share, strict=True))
    mesh = clustered_block(low, size, p.body.divisions, tuple(tip.tolist()), share)
    return replace(mesh, facets={})  # its own sets would be named as sides of the whole body


def _end(p: MeasuredBody, size: Floats) -> Floats:
    """The middle of the side that is pressed."""
    along = np.array(axis_of(p.moved.along))
    return np.asarray(size / 2 * (1 - along))


def _cylinder(p: MeasuredBody) -> Mesh:
    diameter, height = p.body.cylinder
    radial, axial = p.body.divisions
    if not is_quarter(p):
        raise UsageError(
            "an indenter on a cylinder must press along -z on zmax (or +z on zmin) in its middle, "
            "with the body held at zmin and zmax only and only its force compared; otherwise give "
            "the body as a mesh file"
        )
    R = diameter / 2
    share = _shares(p, (R, height), (radial, axial))
    top = height if p.moved.place == "zmax" else 0.0
    mesh = clustered_block(
        (0.0,) * 3, (1.0, 1.0, height), (radial, radial, axial), (0.0, 0.0, top),
        (share[0], share[0], share[1]),
    )  # fmt: skip
    u, v, z = mesh.nodes.T
    nodes = np.stack([R * u * np.sqrt(1 - v**2 / 2), R * v * np.sqrt(1 - u**2 / 2), z], axis=1)
    return replace(mesh, nodes=nodes, facets={})


def _shares(p: MeasuredBody, spans: tuple[float, ...], cells: tuple[int, ...]) -> tuple[float, ...]:
    """Lengths of cells below the indenter over mean ones, those of the nominal mesh on all."""
    reach = p.indenter.reach
    if reach <= 0:
        return (1.0,) * len(spans)
    nominal = [p.body.cells * s / max(spans) for s in spans]
    return tuple(
        max(_LEAST, min(1.0, reach / _PER_REACH / (s / n)))
        for s, n in zip(spans, nominal, strict=True)
    )


def spans_of(p: MeasuredBody) -> tuple[float, ...]:
    """Return the lengths m that are divided into cells: those of a quarter, where there is one."""
    if p.body.block:
        by = 2 if is_quarter(p) else 1
        return (p.body.block[0] / by, p.body.block[1] / by, p.body.block[2])
    return (p.body.cylinder[0] / 2, p.body.cylinder[1])
