"""What the parameters of several experiments have in common: cards, and changes of them."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from math import sqrt
from pathlib import Path
from typing import Any

from validate.errors import UsageError
from validate.parameters import quantity
from validate.recording.readers import read_recording
from validate.recording.types import Recording
from validate.replay.experiment import CORNER_ORDER, Change, MeshLadder
from validate.scene.laws import Coefficients
from validate.scene.material import LawName, Material
from validate.scene.plates import plates_of_share, rubbing_share
from validate.scene.similar_grids import member
from validate.twin.tracked import Camera, require_noise


@dataclass(frozen=True)
class DampedTissue:
    """A linear material with Rayleigh damping, of the models."""

    E: float = quantity(10e3, "Pa", "Young's modulus")
    nu: float = quantity(0.47, "1", "Poisson ratio")
    rho: float = quantity(1000.0, "kg/m3", "density")
    mass_damping: float = quantity(0.0, "1/s", "Rayleigh alpha")
    stiffness_damping: float = quantity(0.0, "s", "Rayleigh beta")

    @property
    def material(self) -> Material:
        return Material(
            self.E, self.nu, "linear", self.rho, self.mass_damping, self.stiffness_damping
        )


@dataclass(frozen=True)
class TimeSteps:
    dt: float = quantity(1e-3, "s", "time step")
    steps: int = quantity(1000, "1", "steps")


@dataclass(frozen=True)
class TrackedTwin:
    """What made a tracked recording; the models do not know it."""

    seed: int = quantity(1, "1", "seed of the noise")
    noise: float = quantity(1e-9, "m2", "variance of the white noise per component (.001 mm2)")
    stiffness: float = quantity(1.0, "1", "ratio of its modulus to that of the models")
    nu: float | None = quantity(None, "1", "its Poisson ratio; none: that of the models")
    every: int = quantity(1, "1", "steps between two samples of the tracker")
    missing: float = quantity(0.0, "1", "share of samples at which a marker is missing")

    def __post_init__(self) -> None:
        require_noise(self.noise)

    @property
    def camera(self) -> Camera:
        """The tracker; its registration rests on 10 000 looks at rest."""
        return Camera(sqrt(self.noise), self.every, self.missing, still=10_000)

    def true(self, material: Material) -> Material:
        """The models' material as the twin has it."""
        nu = material.nu if self.nu is None else self.nu
        return replace(material, E=self.stiffness * material.E, nu=nu)


def shipped(parameters: Any, folder: Path) -> tuple[Recording, ...]:
    """The one recording whose path the parameters give."""
    return (read_recording(Path(parameters.recording)),)


def beside(parameters: Any, folder: Path) -> tuple[Recording, ...]:
    """The one recording that lies beside the experiment's own file, under the name it gives."""
    return (read_recording(folder / parameters.recording),)


def rubbed(p: Any, z: float) -> Any:
    """A block whose plates rub by z `ranges.friction` more; what lies beyond slipping or bonded is
    mirrored back."""
    E, apart = p.material.E, p.block.size.size_x
    share = abs(rubbing_share(p.plates, p.friction, E, apart) + z * p.ranges.friction)
    plates, friction = plates_of_share(min(share, 2 - share), E, apart)
    return replace(p, plates=plates, friction=friction)


@dataclass(frozen=True)
class QuarterGrid:
    """A quarter of a round body."""

    radial: int = quantity(6, "1", "cells from axis to rim")
    axial: int = quantity(8, "1", "cells along the axis")
    grading: float = quantity(2.0, "1", "above 1: smaller cells towards rim and plates")
    finer: float = quantity(1.3, "1", "how many times finer the finest mesh is, for u_num")


def scaled(share: float | None, *counts: str) -> Change:
    """The similar mesh with about `share` of the cells along every edge (none: its own `finer`), in
    the fields `counts`."""

    def change(p: Any) -> Any:
        by = p.mesh.finer if share is None else share
        cells = member([getattr(p.mesh, k) for k in counts], by)
        return replace(p, mesh=replace(p.mesh, **dict(zip(counts, cells, strict=True))))

    return change


def quarter_meshes(size: Callable[[Any], float]) -> MeshLadder:
    """Meshes of a quarter of a round body of `size` (m), the finest `finer` times as fine.

    The corners of bonded plates limit the order.
    """
    levels = [scaled(share, "radial", "axial") for share in (0.5, 0.75, None)]

    def cell(p: Any) -> float:
        cells: int = p.mesh.radial**2 * p.mesh.axial
        return float(size(p) / cells ** (1 / 3))

    return MeshLadder(tuple(levels), cell, CORNER_ORDER)


def require_used(given: Coefficients, laws: set[LawName]) -> None:
    """Raises `UsageError` for coefficients of the material that the law of no method knows."""
    for f in fields(given):
        value = getattr(given, f.name)
        if value != f.default and all(getattr(given.known_to(w), f.name) != value for w in laws):
            raise UsageError(
                f"material.{f.name} = {value}: no method has a law with this parameter, only "
                f"{', '.join(sorted(laws))}; set methods.NAME.law"
            )
