"""The hanging bar that others solved: parameters, their solutions, scene and registration.

0.60 x 0.60 x 1.60 m, held at its top, compressible neo-Hooke; `drop` is how far its lowest point
sinks. Nothing was measured. The reference is what dolfinx's hexahedra tend to: of 6 x 6 x 16 and of
12 x 12 x 32 of them, extrapolated with every order from 1 to 2, since a held corner takes
displacements of linear cells somewhere between.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.datasets.home import found
from validate.parameters import quantity
from validate.recording.formats.npz_points import read_arrays
from validate.recording.types import Recording, Signal
from validate.register.observation import Deviation, Role, Selection, Simulated
from validate.register.registered import Registered
from validate.register.signals import SignalObservation
from validate.scene.box import grid
from validate.scene.laws import Coefficients
from validate.scene.material import Material
from validate.scene.mesh import Mesh, quadratic
from validate.scene.scene import Scene, Support, Weight
from validate.scene.select import OnPlane

FOLDER = "simulators/hanging-bar"
SOURCE = "AustrianTradingMachine/Newton 9e5d430 (MIT), run of 2026-06-30"
FINER = 43.82e-3  # m: its 12 x 12 x 32 hexahedra, as printed; the file has the coarser ones
_ORDERS = (1.0, 2.0)
_UP, _UNIT = 2, "m"
_ONCE = np.ones(1)


@dataclass(frozen=True)
class BarMaterial:
    mu: float = quantity(1e4, "Pa", "shear modulus")
    lam: float = quantity(5e4, "Pa", "Lame's first parameter")
    rho: float = quantity(100.0, "kg/m3", "density")

    @property
    def law(self) -> Material:
        """W = mu/2 (I1 - 3) - mu ln J + lambda/2 ln^2 J."""
        m, l = self.mu, self.lam
        E, nu = m * (3 * l + 2 * m) / (l + m), l / (2 * (l + m))
        coupled = Coefficients(volumetric="coupled")
        return Material(E, nu, "neo_hooke", self.rho, coefficients=coupled)

    @property
    def linear(self) -> Material:
        """The same moduli at small strain."""
        return replace(self.law, law="linear", coefficients=Coefficients())


@dataclass(frozen=True)
class BarGrid:
    across: int = quantity(4, "1", "cells across a quarter; three times as many along")
    grading: float = quantity(3.0, "1", "power that shrinks them towards the top and the sides")


@dataclass(frozen=True)
class HangingBar:
    material: BarMaterial = BarMaterial()
    mesh: BarGrid = BarGrid()
    width: float = quantity(0.6, "m", "of both sides")
    length: float = quantity(1.6, "m", "from the held top to the free end")
    gravity: float = quantity(9.80665, "m/s^2", "along the bar")
    data: str | None = quantity(None, "1", "folder of their solutions; none: VALIDATE_SHARED_DATA")


@dataclass(frozen=True)
class BarModel:
    """What a method's scene is built with."""

    cells: Literal["quarter", "tetrahedra", "hexahedra"] = quantity(
        "quarter", "1", "quadratic hexahedra of a quarter; their tetrahedra; hexahedra of the whole"
    )
    across: int = quantity(9, "1", "hexahedra across; 8/3 as many along")


def load(parameters: HangingBar, folder: Path) -> tuple[Recording, ...]:
    """The drop that their hexahedra tend to, its uncertainty as `sd`; and their tetrahedra's."""
    where = found(FOLDER, None, folder, parameters.data)
    source, hexa = read_arrays(where / "fem_result_hex.npz", _SHAPES)
    _, tets = read_arrays(where / "fem_result.npz", _SHAPES)
    coarse, solved = drop_of(hexa), drop_of(tets)
    low, high = sorted(FINER + (FINER - coarse) / (2**p - 1) for p in _ORDERS)
    value = Signal(_ONCE, np.array([[(low + high) / 2]]), _UNIT, (high - low) / 12**0.5, "bar")
    told = {"kind": "reference", "of": SOURCE, "tetrahedra": f"{1e3 * solved:.4f} mm"}
    made = {"provenance": told, "mesh": {"folder": str(where)}}
    return (Recording("dolfinx", source, 0, signals={"drop": value}, metadata=made),)


_SHAPES: Mapping[str, tuple[int | None, ...]] = {"rest_q": (None, 3), "final_q": (None, 3)}


def drop_of(solution: Mapping[str, Floats]) -> float:
    """The largest drop m of a solution of theirs."""
    return float((solution["rest_q"] - solution["final_q"])[:, _UP].max())


def build(recording: Recording | None, parameters: HangingBar, model: BarModel) -> Scene:
    if model.cells == "quarter":
        return hung(parameters, quarter(parameters), (Support("x0", (0,)), Support("y0", (1,))))
    if model.cells == "hexahedra":
        return hung(parameters, hexahedra(parameters, model.across))
    assert recording is not None
    return hung(parameters, _tetrahedra(recording.record("mesh")["folder"]))


def hung(p: HangingBar, mesh: Mesh, sides: tuple[Support, ...] = ()) -> Scene:
    """A bar, or the quarter of it that `sides` make."""
    top = OnPlane((0.0, 0.0, p.length), (0.0, 0.0, 1.0)).faces
    return Scene(
        mesh, p.material.law, (Support(top, (0, 1, 2)), *sides),
        loads=(Weight("gravity", (0.0, 0.0, -1.0)),), copies=4 if sides else 1,
    )  # fmt: skip


def hexahedra(p: HangingBar, across: int) -> Mesh:
    return grid((p.width, p.width, p.length), (across, across, round(8 * across / 3)))


@lru_cache(maxsize=2)
def _tetrahedra(folder: str) -> Mesh:
    shapes: dict[str, tuple[int | None, ...]] = {"rest_q": (None, 3), "tet_indices": (None, 4)}
    _, arrays = read_arrays(Path(folder) / "mesh.npz", shapes)
    return Mesh(arrays["rest_q"], arrays["tet_indices"].astype(np.int64), "tet4")


def quarter(p: HangingBar) -> Mesh:
    """A quarter with its axis at x = y = 0: the held edge bends most, and cells are small there."""
    n, size = p.mesh.across, np.array([p.width / 2, p.width / 2, p.length])
    even = grid((size[0], size[1], size[2]), (n, n, 3 * n))
    graded = size * (1 - (1 - even.nodes / size) ** p.mesh.grading)
    return quadratic(replace(even, nodes=graded))


@dataclass(frozen=True)
class Drop:
    """The largest drop m of any node, against `value` m with its standard uncertainty `sd` m."""

    value: float
    sd: float
    t: Floats
    name: str = "drop"
    role: Role = "validates"

    @property
    def units(self) -> Mapping[str, str]:
        return {self.name: _UNIT}

    def rows(self) -> None:
        return None

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return ()

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        if not len(run.u):
            return ()
        ours = sunk(run)
        words = "largest drop of a node less what finer and finer hexahedra of dolfinx tend to"
        off = np.array([[ours - self.value]])
        return (Deviation(self.name, off, _UNIT, self.sd, 0.0, words, ours, self.value,
                          scale=self.value),)  # fmt: skip


def sunk(run: Simulated) -> float:
    """The largest drop m at a run's end."""
    return float(-run.u[-1][:, _UP].min())


def place(recording: Recording, parameters: HangingBar, scene: Scene) -> Registered:
    drop = recording.signal("drop", _UNIT)
    pull = SignalObservation("gravity", "drives", drop.t, np.array([[parameters.gravity]]),
                             "m/s^2", 0.0)  # fmt: skip
    return Registered((pull, Drop(float(drop.y[0, 0]), drop.sd, drop.t)), timed=False)
