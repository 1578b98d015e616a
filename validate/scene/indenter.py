"""A rigid indenter as it is declared: it stands where it touches the body after a gap."""

from dataclasses import MISSING, dataclass, replace
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.parameters import quantity, take_units
from validate.scene.contact import (
    RigidContact,
    RigidCylinder,
    RigidPlane,
    RigidPunch,
    RigidSphere,
    Shape,
)
from validate.scene.mesh import Mesh
from validate.scene.named_place import axis_of
from validate.scene.select import nodes_of

IndenterShape = Literal["plate", "sphere", "cylinder", "punch"]
ROUND = ("sphere", "cylinder", "punch")
_STICKS = 1e6  # a coefficient of friction at which nothing that presses slips


@dataclass(frozen=True)
class Indenter:
    """The shape of a `RigidContact` that is declared and not yet on a mesh.

    Along the contact's direction it is set back so that it touches the place after `gap`.
    """

    shape: IndenterShape = quantity(MISSING, "1", "rigid body that presses")
    radius: float = quantity(0.0, "m", "of a sphere, cylinder, or a punch's flat round end")
    axis: str = quantity("+y", "1", "direction of a cylinder's axis")
    tip: tuple[float, ...] = quantity(
        (), "m", "a point below the indenter's middle; none: the middle of the place"
    )
    gap: float = quantity(
        0.0, "m", "from the first instant to the first touch; below 0: it already presses"
    )
    bonded: bool = quantity(False, "1", "whether touching surfaces stick while pressed")

    def __post_init__(self) -> None:
        take_units(self)
        if self.shape in ROUND and not (np.isfinite(self.radius) and self.radius > 0):
            raise SceneError(
                f"radius = {self.radius:g} m: a {self.shape} needs a radius above 0, as "
                "--set contacts.NAME.shape.radius=5mm"
            )
        if len(self.tip) not in (0, 3):
            raise SceneError(f"tip = {self.tip} m: expected three lengths, or none")

    def on(self, contact: RigidContact, mesh: Mesh, middle: tuple[float, ...]) -> RigidContact:
        """The rigid body where it stands at the first instant.

        `middle`: x, y (m) of the body's axis, where the mesh is a part of it. Raises `SceneError`
        where no node of the place lies before the indenter.
        """
        if contact.direction is None:
            raise SceneError(f"contact '{contact.name}': an indenter needs a direction, as -z")
        along = np.array(contact.direction)
        x = mesh.nodes[nodes_of(mesh, contact.facets)]
        tip = np.array(self.tip) if self.tip else _middle_of(x, middle)
        depth, aside = self._way(x - tip, along)
        flat = self.shape in ("plate", "punch")
        under = aside < self.radius if self.shape != "plate" else np.ones(len(x), bool)
        if not under.any():
            at = ", ".join(f"{1e3 * c:.3g}" for c in tip)
            raise SceneError(
                f"contact '{contact.name}', tip = ({at}) mm: no node of its place lies before the "
                f"{self.shape} of {1e3 * self.radius:.3g} mm; set contacts.{contact.name}.shape.tip"
            )
        reach = 0.0 if flat else np.sqrt(self.radius**2 - aside[under] ** 2)
        start = tip + along * (float((depth[under] - reach).min()) - max(self.gap, 0.0))
        friction = _STICKS if self.bonded else contact.friction
        return replace(contact, shape=self._shape(start, along), friction=friction)

    def _way(self, offset: Floats, along: Floats) -> tuple[Floats, Floats]:
        """How far (n,) m offsets (n, 3) m lie along the way, and how far beside it: of a cylinder
        across its axis."""
        depth = offset @ along
        across = offset - np.outer(depth, along)
        if self.shape == "cylinder":
            axis = self._axis(along)
            across = across - np.outer(across @ axis, axis)
        return depth, np.linalg.norm(across, axis=1)

    def _axis(self, along: Floats) -> Floats:
        axis = np.array(axis_of(self.axis))
        if abs(float(axis @ along)) > 1e-6:
            raise SceneError(
                f"axis = {self.axis}: a cylinder must lie across its direction of motion; set its "
                "axis to +x, +y or +z"
            )
        return axis

    def _shape(self, start: Floats, along: Floats) -> Shape:
        at, way = tuple(start.tolist()), tuple(along.tolist())
        if self.shape == "plate":
            return RigidPlane(at, way)
        if self.shape == "punch":
            return RigidPunch(at, way, self.radius)
        if self.shape == "sphere":
            return RigidSphere(at, self.radius)
        return RigidCylinder(at, tuple(self._axis(along).tolist()), self.radius)


def standing(contact: RigidContact, mesh: Mesh, middle: tuple[float, ...] = ()) -> RigidContact:
    """A declared contact with its rigid body in place."""
    shape = contact.shape
    return shape.on(contact, mesh, middle) if isinstance(shape, Indenter) else contact


def _middle_of(x: Floats, axis: tuple[float, ...]) -> Floats:
    """The middle of the extent of a place's nodes x (n, 3) m; of a part, on the body's `axis`."""
    middle = (x.min(axis=0) + x.max(axis=0)) / 2
    middle[: len(axis)] = axis
    return np.asarray(middle)
