"""A scene that does not deform: named points of a rigid body, placed by its pose."""

from dataclasses import dataclass

from validate.arrays import Floats, checked
from validate.errors import SceneError
from validate.scene.meshless import Meshless

POSE = 6  # numbers of a pose: a rotation vector (rad), then a translation (m)


@dataclass(frozen=True)
class RigidBody(Meshless):
    """points (k, 3) m by `names` in the body's own frame; a step is given T_frame_from_body."""

    names: tuple[str, ...]
    points: Floats

    def __post_init__(self) -> None:
        k = len(self.names)
        if not k or len(set(self.names)) != k:
            raise SceneError(f"rigid body: {k} names, {len(set(self.names))} different ones")
        points = checked(self.points, "rigid body [m]", (k, 3), error=SceneError)
        object.__setattr__(self, "points", points)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what a step is given: as `Scene.inputs`."""
        return tuple(f"{part}.{axis}" for part in ("rotation", "translation") for axis in "xyz")
