"""Positions from a recorded path, each when its time has come."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from validate.arrays import Floats


@dataclass(frozen=True)
class RecordedPath:
    """t (nt,) s, places x (nt, d) m."""

    kind: ClassVar[str] = "path"

    t: Floats
    x: Floats

    @property
    def rate(self) -> float:
        """Samples a second, by the median step."""
        return float(1 / np.median(np.diff(self.t)))

    @property
    def findings(self) -> Mapping[str, int]:
        return {}

    def due(self, k: int) -> float | None:
        """When tick k is due, s after the start; None after the last."""
        return float(self.t[k] - self.t[0]) if k < len(self.t) else None

    def after(self, k: int, now: float) -> int:
        """The next one: no sample of a recorded path is left out."""
        return k + 1

    def place(self, k: int, now: float) -> Floats | None:
        return np.asarray(self.x[k])

    def give(self, force: Floats, flags: int) -> None:
        pass

    def close(self) -> None:
        pass
