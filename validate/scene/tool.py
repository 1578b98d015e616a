"""Point tool: tip of a needle with a given path, and the surface that it may touch."""

from dataclasses import MISSING, dataclass

import numpy as np

from validate.errors import SceneError
from validate.parameters import quantity, take_units
from validate.scene.mesh import Mesh
from validate.scene.places import Place, axis_of, kind_of, nodes_of

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
