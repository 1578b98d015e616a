"""What the discretisation leaves uncertain in one residual: u_num of ASME V&V 20, by its parts."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import hypot
from types import MappingProxyType


@dataclass(frozen=True)
class Numerical:
    """Standard uncertainties by what they come from ("mesh", "time step"), in the residual's unit.

    Infinite where the answers do not converge as they should: nothing bounds the error then.
    `words` say how each was found, or which mesh or step would decide. No parts: no discretisation.
    """

    parts: Mapping[str, float] = field(default_factory=dict)
    words: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", MappingProxyType(dict(self.parts)))

    @property
    def u(self) -> float:
        return hypot(*self.parts.values())
