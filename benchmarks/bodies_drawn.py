"""Random bodies with known answers: one seed is one body, for our solver and for the other code.

Block, cylinder, cantilever and pad; bonded, slipping, pulled and bent. Lengths in m, E in Pa.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Kind = Literal["block", "cylinder", "cantilever", "pad"]
Support = Literal["bonded", "slipping", "pulled", "bent"]

SEEDS = range(200)
E = 20e3
KINDS: tuple[Kind, ...] = ("block", "cylinder", "cantilever", "pad")
SUPPORTS: tuple[Support, ...] = ("bonded", "slipping", "pulled", "bent")
RATIOS = (0.3, 0.4, 0.45, 0.49, 0.499, 0.4999)
MARKERS = 6


@dataclass(frozen=True)
class Drawn:
    """A body, its supports and its load.

    `size`: along x, y, z; of a cylinder diameter, diameter, height. `axis` is the long axis of a
    cantilever (x) and the upright one of the others (z). One end of it is held (or slides); the
    other end moves by `amount` m, or carries a uniform dead traction of `amount` Pa.

    bonded: the end moves along the axis and is held sideways. slipping: the same, and the lower end
    slides on a plate. pulled: traction along the axis. bent: traction across the axis; a bent pad
    moves across the axis instead, held in the other directions.

    `markers` (k, 3) are points on the surface; none where the force judges.
    """

    seed: int
    kind: Kind
    support: Support
    law: Literal["linear", "neo_hooke"]
    nu: float
    size: tuple[float, float, float]
    cells: int
    amount: float
    markers: tuple[tuple[float, ...], ...]

    @property
    def axis(self) -> int:
        return 0 if self.kind == "cantilever" else 2

    @property
    def across(self) -> int:
        """The direction of bending."""
        return 2 if self.kind == "cantilever" else 0

    @property
    def along(self) -> int:
        """The axis along which the moved end goes."""
        return self.across if self.support == "bent" else self.axis

    @property
    def moves(self) -> bool:
        """Whether a displacement loads the body; the force on it is then judged."""
        return not self.markers

    @property
    def section(self) -> float:
        """Area of the loaded end, m2."""
        x, y, z = self.size
        if self.kind == "cantilever":
            return y * z
        return float(np.pi / 4 * x * y) if self.kind == "cylinder" else x * y

    @property
    def title(self) -> str:
        return f"{self.kind}, {self.support}"


def drawn(seed: int) -> Drawn:
    """The body of this seed."""
    rng = np.random.default_rng(seed)
    kind = KINDS[rng.integers(4)]
    support = SUPPORTS[rng.integers(4)]
    law: Literal["linear", "neo_hooke"] = "linear" if rng.random() < 0.5 else "neo_hooke"
    nu = RATIOS[rng.integers(len(RATIOS))]
    size = _size(kind, rng)
    if (kind, support) == ("cylinder", "bent"):
        law = "linear"  # solved as one Fourier mode around the axis
    moves = support in ("bonded", "slipping") or (kind, support) == ("pad", "bent")
    cells = int(rng.integers(4, 9))
    if kind in ("block", "cylinder"):
        cells = 4 + (cells - 4) % 3  # 4 to 6: eight along every edge take minutes
    amount = _amount(kind, support, size, rng.uniform(0.02, 0.08))
    markers = () if moves else _markers(kind, size, rng)
    return Drawn(seed, kind, support, law, nu, size, cells, amount, markers)


def _size(kind: Kind, rng: np.random.Generator) -> tuple[float, float, float]:
    a, b, c = (float(x) for x in rng.uniform(1.0, 2.0, 3))
    unit = 0.02
    if kind == "block":
        size = (a, b, c)
    elif kind == "cylinder":
        size = (a, a, b)
    elif kind == "cantilever":
        size = (3.0 * a, 1.0, 0.5 + 0.5 * b)
    else:
        size = (1.5 + a, 1.5 + b, 0.3 + 0.2 * c)
    x, y, z = (round(unit * s, 4) for s in size)
    return x, y, z


def _amount(kind: Kind, support: Support, size: tuple[float, float, float], strain: float) -> float:
    """m along the axis in the positive direction, or Pa."""
    x, _, z = size
    if (kind, support) == ("pad", "bent"):
        return 2 * strain * z
    if support in ("bonded", "slipping"):
        # A slender column would buckle: it is stretched.
        return strain * x if kind == "cantilever" else -strain * z
    if support == "pulled":
        return E * strain
    length, height = (x, z) if kind == "cantilever" else (z, x)
    # Of the slope of a beam's end: traction = 2 E I slope / (L^2 A), I / A = h^2 / 12.
    return E * 2 * strain * height**2 / 12 / length**2 * 2


def _markers(
    kind: Kind, size: tuple[float, float, float], rng: np.random.Generator
) -> tuple[tuple[float, ...], ...]:
    """On the loaded end and, of bodies with flat sides, on one side."""
    at = rng.uniform(0.1, 0.9, (MARKERS, 3)) * np.array(size)
    if kind == "cylinder":
        r = size[0] / 2 * rng.uniform(0.2, 0.8, MARKERS)
        angle = rng.uniform(0, 2 * np.pi, MARKERS)
        at[:, 0], at[:, 1], at[:, 2] = r * np.cos(angle), r * np.sin(angle), size[2]
    else:
        end = 0 if kind == "cantilever" else 2
        at[::2, end] = size[end]
        at[1::2, 1] = size[1]
    return tuple(tuple(float(c) for c in point) for point in at)
