"""Rectangular sheet with two pads that pull or hold it, in 2-D.

    Sheet("100 mm", "50 mm", pad_length="8 mm", pad_width="8 mm", gap="30 mm")

Its middle is the origin, x goes from pad to pad. `left_pad` and `right_pad` are places of it, the
points under a pad, beside the facet sets x0, x1, y0 and y1 of its sides.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError
from validate.parameters import known, quantity, take_units
from validate.scene.geometries.box import box, member
from validate.scene.mesh import Mesh
from validate.scene.places import InBox, Place

_GROWTH = 2.0  # logarithm of how much larger cells at the sides are than at the pads
_TOUCH = 1e-7  # m


@dataclass(frozen=True)
class Sheet:
    """Quadratic triangles with the edges of the pads among their lines, larger outside.

    Sizes may stay open (None) until a recording states them. Resolving raises `UsageError` for a
    sheet that ends within its pads.
    """

    length: float | None = quantity(None, "m", "of what is simulated, along the pull", asked=True)
    width: float | None = quantity(None, "m", "of what is simulated, across it", asked=True)
    pad_length: float | None = quantity(None, "m", "of a pad along the pull", asked=True)
    pad_width: float | None = quantity(None, "m", "of a pad across it", asked=True)
    gap: float | None = quantity(None, "m", "between the pads at rest", asked=True)
    cells: int = quantity(2, "1", "across half of a pad's width")

    def __post_init__(self) -> None:
        take_units(self)

    @property
    def places(self) -> Mapping[str, Place]:
        """The points under the two pads."""
        low, high, half = self._pad_lines()
        left = InBox((-high - _TOUCH, -half - _TOUCH), (-low + _TOUCH, half + _TOUCH))
        right = InBox((low - _TOUCH, -half - _TOUCH), (high + _TOUCH, half + _TOUCH))
        return {"left_pad": left.points, "right_pad": right.points}

    def resolved(self, folder: Path) -> Mesh:
        low, high, half = self._pad_lines()
        ends = known(self.length, "body.length") / 2, known(self.width, "body.width") / 2
        if ends[0] <= high or ends[1] <= half or min(low, half) <= 0:
            raise UsageError(
                f"a sheet of {2e3 * ends[0]:g} x {2e3 * ends[1]:g} mm with pads that end "
                f"{1e3 * high:g} mm from its middle and are {2e3 * half:g} mm wide: it must reach "
                "beyond them"
            )
        x = _mirrored(self._even(0.0, low), self._even(low, high), self._growing(high, ends[0]))
        y = _mirrored(self._even(0.0, half), self._growing(half, ends[1]))
        flat = box((1.0, 1.0), (len(x) - 1, len(y) - 1))
        column, row = (
            np.rint(flat.nodes[:, c] * (len(a) - 1)).astype(int) for c, a in enumerate((x, y))
        )
        nodes = np.stack([x[column], y[row]], axis=1)
        return Mesh(nodes, flat.cells, "tri3", flat.facets).quadratic()

    def scaled(self, share: float) -> "Sheet":
        return replace(self, cells=member((self.cells,), share)[0])

    def _pad_lines(self) -> tuple[float, float, float]:
        """Where a pad begins and ends along the pull, and its half width, m from the middle."""
        low = known(self.gap, "body.gap") / 2
        high = low + known(self.pad_length, "body.pad_length")
        return low, high, known(self.pad_width, "body.pad_width") / 2

    def _count(self, length: float) -> int:
        """Cells in a length m, in proportion to those of half a pad: every mesh is a part of a
        finer one."""
        return self.cells * max(1, round(length / self._pad_lines()[2]))

    def _even(self, a: float, b: float) -> Floats:
        return np.linspace(a, b, self._count(b - a) + 1)

    def _growing(self, a: float, b: float) -> Floats:
        """From a to b m in cells that begin as large as those inside."""
        count = self._count((b - a) * _GROWTH / float(np.expm1(_GROWTH)))
        s = np.linspace(0.0, 1.0, count + 1)
        return np.asarray(a + (b - a) * np.expm1(_GROWTH * s) / np.expm1(_GROWTH))


def _mirrored(*parts: Floats) -> Floats:
    """Lines from the middle outwards, and their mirror images."""
    half = np.unique(np.concatenate(parts))
    return np.concatenate([-half[:0:-1], half])
