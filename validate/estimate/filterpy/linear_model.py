"""Linear model of a filterpy filter, in the notation of filterpy."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import ComparisonError


@dataclass(frozen=True)
class LinearModel:
    """x' = F x + B f + w, z = H x + r with covariances Q of w and R of r; first x0, P0.

    F, Q, P0 (n, n), B (n, l), H (m, n), R (m, m), x0 (n,); f (l,) are the inputs of the step's
    end in N. Letters are filterpy's: F is the transition here. Raises `ComparisonError` for shapes
    that do not fit each other, and for covariances that are not symmetric.
    """

    F: Floats
    B: Floats
    H: Floats
    Q: Floats
    R: Floats
    x0: Floats
    P0: Floats

    def __post_init__(self) -> None:
        n, m = len(self.F), len(self.H)
        shapes = {"F": (n, n), "B": (n, None), "H": (m, n), "Q": (n, n), "R": (m, m)}
        for name, shape in (shapes | {"x0": (n,), "P0": (n, n)}).items():
            value = checked(getattr(self, name), f"model {name}", shape, error=ComparisonError)
            object.__setattr__(self, name, value)
        for name in ("Q", "R", "P0"):
            require_symmetric(getattr(self, name), f"model {name}")

    @property
    def size(self) -> int:
        return len(self.F)


def require_symmetric(P: Floats, name: str) -> None:
    """Raise `ComparisonError` when P differs from its transpose by more than rounding."""
    off, scale = float(np.abs(P - P.T).max()), float(np.abs(P).max())
    if off > 1e-9 * scale:
        raise ComparisonError(f"{name}: differs from its transpose by {off:.1e} of {scale:.1e}")
