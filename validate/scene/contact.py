"""Rigid bodies that a scene touches: a shape, how it moves, and Coulomb friction.

A shape knows its signed distance and outward normal at any point, which is all that nodes against a
rigid body need. All shapes are convex: a tangent plane never cuts them, on which the passivity of
contact in dynamics rests.
"""

from dataclasses import MISSING, dataclass
from typing import Protocol

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.parameters import quantity, take_units
from validate.scene.mesh import Mesh
from validate.scene.named_place import axis_of
from validate.scene.select import Place, nodes_of

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
        """The shape's points and directions, whose length is the scene's dimension."""
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
    """Raises `SceneError` for shapes of another dimension, a rigid body that starts inside, nodes
    that two contacts claim."""
    claimed: dict[int, str] = {}
    for part in contacts:
        for vector in (*part.shape.vectors(), part.direction or (0.0,) * mesh.dimension):
            if len(vector) != mesh.dimension:
                raise SceneError(
                    f"contact '{part.name}': {vector} in a scene of {mesh.dimension} dimensions"
                )
        nodes = nodes_of(mesh, part.facets)
        _require_outside(part, mesh.nodes[nodes], float(np.ptp(mesh.nodes, axis=0).max()))
        shared = [claimed[n] for n in nodes.tolist() if n in claimed]
        if shared:
            raise SceneError(
                f"contact '{part.name}' shares {len(shared)} nodes with '{shared[0]}'; a node "
                "can touch one rigid body: choose facets without common nodes"
            )
        claimed |= dict.fromkeys(nodes.tolist(), part.name)


def _require_outside(part: RigidContact, x: Floats, size: float) -> None:
    gaps = part.shape.gap(x)
    inside = gaps < -INSIDE * size
    if inside.any():
        deepest = int(np.argmin(gaps))
        at = ", ".join(f"{1e3 * c:.3g}" for c in x[deepest])
        raise SceneError(
            f"contact '{part.name}' starts inside the body: {int(inside.sum())} of {len(x)} "
            f"nodes, {-1e3 * gaps[deepest]:.3g} mm at ({at}) mm; move it out by this distance"
        )


def _unit(vector: tuple[float, ...]) -> Floats:
    return np.asarray(np.array(vector) / np.linalg.norm(vector))


def _require_direction(what: str, vector: tuple[float, ...]) -> None:
    if not (np.isfinite(vector).all() and np.linalg.norm(vector) > 0):
        raise SceneError(f"{what} {vector}: give a direction of finite length above 0")


def _require_radius(what: str, radius: float) -> None:
    if not (np.isfinite(radius) and radius > 0):
        raise SceneError(f"rigid {what} of radius {radius:g} m: a number above 0")
