"""Rigid indenters and point tools: declared gap, position in touch with the body, a given path."""

from dataclasses import MISSING, dataclass, replace
from typing import Literal, Protocol

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.parameters import quantity, take_units
from validate.scene.mesh import Mesh
from validate.scene.places import Place, axis_of, kind_of, nodes_of

# --- Rigid bodies that a scene touches: a shape, how it moves, and Coulomb friction.
#
# A shape knows its signed distance and outward normal at any point, which is all that nodes
# against a rigid body need. All shapes are convex: a tangent plane never cuts them, on which the
# passivity of contact in dynamics rests.

INSIDE = 1e-6  # of the body's size: a node deeper than this at rest lies inside the rigid body


class Shape(Protocol):
    """A convex rigid body where it stands at rest; points (k, d) m."""

    def gap(self, x: Floats) -> Floats:
        """Signed distance (k,) m, negative inside."""
        ...

    def outward(self, x: Floats) -> Floats:
        """Unit normals (k, d) away from the rigid body."""
        ...

    def vectors(self) -> tuple[tuple[float, ...], ...]:
        """Return the shape's points and directions, whose length is the scene's dimension."""
        ...


@dataclass(frozen=True)
class RigidPlane:
    """The half-space behind `point` m; `normal` points out of it, towards the body."""

    point: tuple[float, ...] = quantity(MISSING, "m", "a point of the plane")
    normal: tuple[float, ...] = quantity(MISSING, "1", "out of it, towards the body")

    def __post_init__(self) -> None:
        take_units(self)
        _require_direction("a rigid plane's normal", self.normal)

    def gap(self, x: Floats) -> Floats:
        return np.asarray((x - np.array(self.point)) @ _unit(self.normal))

    def outward(self, x: Floats) -> Floats:
        return np.broadcast_to(_unit(self.normal), x.shape)

    def vectors(self) -> tuple[tuple[float, ...], ...]:
        return self.point, self.normal


@dataclass(frozen=True)
class RigidSphere:
    """A ball of `radius` m; in 2-D a disc."""

    centre: tuple[float, ...] = quantity(MISSING, "m", "its centre at rest")
    radius: float = quantity(MISSING, "m", "its radius")

    def __post_init__(self) -> None:
        take_units(self)
        _require_radius("sphere", self.radius)

    def gap(self, x: Floats) -> Floats:
        return np.asarray(np.linalg.norm(x - np.array(self.centre), axis=1) - self.radius)

    def outward(self, x: Floats) -> Floats:
        offset = x - np.array(self.centre)
        return np.asarray(offset / np.linalg.norm(offset, axis=1, keepdims=True))

    def vectors(self) -> tuple[tuple[float, ...], ...]:
        return (self.centre,)


@dataclass(frozen=True)
class RigidCylinder:
    """An endless round bar of `radius` m around the line through `point` m along `axis`."""

    point: tuple[float, ...] = quantity(MISSING, "m", "a point of its axis")
    axis: tuple[float, ...] = quantity(MISSING, "1", "direction of its axis")
    radius: float = quantity(MISSING, "m", "its radius")

    def __post_init__(self) -> None:
        take_units(self)
        _require_radius("cylinder", self.radius)
        _require_direction("a rigid cylinder's axis", self.axis)

    def gap(self, x: Floats) -> Floats:
        return np.asarray(np.linalg.norm(self._across(x), axis=1) - self.radius)

    def outward(self, x: Floats) -> Floats:
        across = self._across(x)
        return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))

    def _across(self, x: Floats) -> Floats:
        axis, offset = _unit(self.axis), x - np.array(self.point)
        return np.asarray(offset - np.outer(offset @ axis, axis))

    def vectors(self) -> tuple[tuple[float, ...], ...]:
        return self.point, self.axis


@dataclass(frozen=True)
class RigidPunch:
    """The flat round end of `radius` m around `centre` m; `normal` points out of it.

    Its rim is a wall for nobody: nodes beyond the radius are not touched.
    """

    centre: tuple[float, ...] = quantity(MISSING, "m", "middle of its end at rest")
    normal: tuple[float, ...] = quantity(MISSING, "1", "out of it, towards the body")
    radius: float = quantity(MISSING, "m", "its radius")

    def __post_init__(self) -> None:
        take_units(self)
        _require_radius("punch", self.radius)
        _require_direction("a rigid punch's normal", self.normal)

    def gap(self, x: Floats) -> Floats:
        normal, offset = _unit(self.normal), x - np.array(self.centre)
        height = offset @ normal
        aside = np.linalg.norm(offset - np.outer(height, normal), axis=1)
        return np.where(aside <= self.radius * (1 + INSIDE), height, np.inf)

    def outward(self, x: Floats) -> Floats:
        return np.broadcast_to(_unit(self.normal), x.shape)

    def vectors(self) -> tuple[tuple[float, ...], ...]:
        return self.centre, self.normal


@dataclass(frozen=True)
class RigidContact:
    """A rigid body that nodes of `facets` may touch, with Coulomb's coefficient `friction`.

    With a `direction` (d,), a unit vector, a named input in m moves it; without one it stands
    still. It translates and does not turn.
    """

    name: str
    facets: Place = quantity(MISSING, "1", "faces that may touch it")
    shape: Shape = quantity(MISSING, "1", "its shape and place")
    direction: tuple[float, ...] | None = quantity(None, "1", "unit vector of its motion")
    friction: float = quantity(0.0, "1", "Coulomb's coefficient")

    def __post_init__(self) -> None:
        if isinstance(self.direction, str):
            object.__setattr__(self, "direction", axis_of(self.direction))
        take_units(self)
        if not (np.isfinite(self.friction) and self.friction >= 0):
            raise SceneError(
                f"contact '{self.name}': friction {self.friction:g}, expected 0 or more"
            )
        if self.direction is not None:
            length = float(np.linalg.norm(self.direction))
            if abs(length - 1) > 1e-9:
                raise SceneError(f"contact '{self.name}': direction of length {length:g}, needs 1")


def require_clear(contacts: tuple[RigidContact, ...], mesh: Mesh) -> None:
    """Raise `SceneError` for shapes of another dimension, a rigid body that starts inside, nodes
    that two contacts claim."""
    claimed: dict[int, str] = {}
    for part in contacts:
        for vector in (*part.shape.vectors(), part.direction or (0.0,) * mesh.dimension):
            if len(vector) != mesh.dimension:
                raise SceneError(
                    f"contact '{part.name}': {vector} in a scene of {mesh.dimension} dimensions"
                )
        nodes = nodes_of(mesh, part.facets)
        x = mesh.nodes[nodes]
        gaps = part.shape.gap(x)
        inside = gaps < -INSIDE * float(np.ptp(mesh.nodes, axis=0).max())
        if inside.any():
            deepest = int(np.argmin(gaps))
            at = ", ".join(f"{1e3 * c:.3g}" for c in x[deepest])
            raise SceneError(
                f"contact '{part.name}' starts inside the body: {int(inside.sum())} of {len(x)} "
                f"nodes, {-1e3 * gaps[deepest]:.3g} mm at ({at}) mm; move it out by this distance"
            )
        shared = [claimed[n] for n in nodes.tolist() if n in claimed]
        if shared:
            raise SceneError(
                f"contact '{part.name}' shares {len(shared)} nodes with '{shared[0]}'; a node "
                "can touch one rigid body: choose facets without common nodes"
            )
        claimed |= dict.fromkeys(nodes.tolist(), part.name)


def _unit(vector: tuple[float, ...]) -> Floats:
    return np.asarray(np.array(vector) / np.linalg.norm(vector))


def _require_direction(what: str, vector: tuple[float, ...]) -> None:
    if not (np.isfinite(vector).all() and np.linalg.norm(vector) > 0):
        raise SceneError(f"{what} {vector}: give a direction of finite length above 0")


def _require_radius(what: str, radius: float) -> None:
    if not (np.isfinite(radius) and radius > 0):
        raise SceneError(f"rigid {what} of radius {radius:g} m: a number above 0")


# -------------------------------------------------------------------------------------------------

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
        """Return the rigid body where it stands at the first instant.

        `middle`: x, y (m) of the body's axis, where the mesh is a part of it. Raises `SceneError`
        where no node of the place lies before the indenter.
        """
        if contact.direction is None:
            raise SceneError(f"contact '{contact.name}': an indenter needs a direction, as -z")
        along = np.array(contact.direction)
        x = mesh.nodes[nodes_of(mesh, contact.facets)]
        tip = np.array(self.tip) if self.tip else _middle_of(x, middle)
        # How far (n,) m offsets (n, 3) m lie along the way, and how far beside it: of a cylinder
        # across its axis.
        offset = x - tip
        depth = offset @ along
        across = offset - np.outer(depth, along)
        if self.shape == "cylinder":
            axis = self._axis(along)
            across = across - np.outer(across @ axis, axis)
        aside = np.linalg.norm(across, axis=1)
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
    """Return a declared contact with its rigid body in place."""
    shape = contact.shape
    return shape.on(contact, mesh, middle) if isinstance(shape, Indenter) else contact


def _middle_of(x: Floats, axis: tuple[float, ...]) -> Floats:
    """The middle of the extent of a place's nodes x (n, 3) m; of a part, on the body's `axis`."""
    middle = (x.min(axis=0) + x.max(axis=0)) / 2
    middle[: len(axis)] = axis
    return np.asarray(middle)


# --- point tool: tip of a needle with a given path, and the surface that it may touch ------------

_UNIT = 1e-9


@dataclass(frozen=True)
class Needle:
    """A tip that stands at `tip` m at rest, outside the body, and points along the unit `axis`.

    Inputs `<name>.x`, `.y`(, `.z`) in m move it. It touches `facets`, and nothing else.
    """

    name: str
    facets: Place = quantity(MISSING, "1", "what it may touch")
    tip: tuple[float, ...] = quantity(MISSING, "m", "place of the tip at rest")
    axis: tuple[float, ...] = quantity(MISSING, "1", "unit vector that it points along")

    def __post_init__(self) -> None:
        if isinstance(self.axis, str):
            object.__setattr__(self, "axis", axis_of(self.axis)[: len(self.tip)])
        take_units(self)
        if not np.isfinite((*self.tip, *self.axis)).all():
            raise SceneError(
                f"needle '{self.name}': tip {self.tip} m, axis {self.axis}: expected finite numbers"
            )
        length = float(np.linalg.norm(self.axis))
        if abs(length - 1) > _UNIT:
            raise SceneError(f"needle '{self.name}': axis of length {length:g}, needs 1")

    @property
    def inputs(self) -> tuple[str, ...]:
        return tuple(f"{self.name}.{axis}" for axis in "xyz"[: len(self.tip)])


def require_usable(tools: tuple[Needle, ...], mesh: Mesh) -> None:
    """Raise `SceneError` for needles of another dimension, more than one, or on no faces."""
    if len(tools) > 1:
        raise SceneError(f"{len(tools)} needles: expected one")
    for tool in tools:
        if len(tool.tip) != mesh.dimension or len(tool.axis) != mesh.dimension:
            raise SceneError(
                f"needle '{tool.name}': tip {tool.tip} in a scene of {mesh.dimension} dimensions"
            )
        nodes_of(mesh, tool.facets)
        if kind_of(tool.facets) != "faces":
            raise SceneError(f"needle '{tool.name}' touches {kind_of(tool.facets)}: choose faces")
