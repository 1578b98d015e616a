"""What a user decides of a body between two plates, or between grips: its sizes, material, mesh,
declared uncertainties, windows of strain, and what images show of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from validate.identify.modulus import CylinderSize, TestKind, stated_test
from validate.parameters import Ranges, known, part, quantity
from validate.recording.exports.geometry import loaded_area
from validate.recording.types import Recording
from validate.replay.mesh_sizes import sizes_of_file
from validate.replay.pressed_outline import PressedOutline
from validate.scene.laws import Coefficients
from validate.scene.material import LawName
from validate.scene.plates import Contact


def size_of(diameter: float | None, height: float | None) -> CylinderSize:
    """The cylinder of a card; raises `UsageError` while a size is not set."""
    return CylinderSize(known(diameter, "specimen.diameter"), known(height, "specimen.height"))


def stated_sizes(recording: Recording) -> dict[str, float]:
    """What a recording's record `specimen` says of a cylinder, m, by parameter.

    Another cross-section has the diameter of the circle of its area.
    """
    found = _record(recording)
    area, sizes = loaded_area(found, stated_test(recording)), {}
    if "diameter_m" in found:
        sizes["specimen.diameter"] = found["diameter_m"]
    elif area is not None:
        sizes["specimen.diameter"] = 2 * math.sqrt(area / math.pi)
    if "height_m" in found:
        sizes["specimen.height"] = found["height_m"]
    return sizes


def recorded_sides(recording: Recording) -> dict[str, float]:
    """Return the sides m in a recording's record `specimen` by name: diameter, width, thickness,
    height."""
    names = ("diameter", "width", "thickness", "height")
    found = _record(recording)
    return {name: found[f"{name}_m"] for name in names if f"{name}_m" in found}


def _record(recording: Recording) -> dict[str, float]:
    """The numbers above zero of the record `specimen`."""
    said = {k: _above_zero(v) for k, v in recording.metadata.get("specimen", {}).items()}
    return {k: v for k, v in said.items() if v is not None}


def _above_zero(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) and value > 0 else None


@dataclass(frozen=True)
class Specimen:
    """A cylinder; or the body of a mesh file of linear tetrahedra, axis z, with the facet sets
    "lower_plate" and "upper_plate", whose equivalent diameter is then that of equal area."""

    diameter: float | None = quantity(None, "m", "diameter; none: the recording's", asked=True)
    height: float | None = quantity(None, "m", "height; none: the recording's", asked=True)
    mesh: str | None = quantity(None, "1", "mesh file (npz, inp, msh, vtu); none: a cylinder")
    mesh_unit: str | None = quantity(None, "1", "unit of lengths in a mesh file other than npz")
    fluid: str | None = quantity(None, "1", "facet set around a fluid inside; none: no fluid")

    @property
    def size(self) -> CylinderSize:
        """Raises `UsageError` while a size is not set."""
        return size_of(self.diameter, self.height)


@dataclass(frozen=True)
class Gel:
    E: float | None = quantity(None, "Pa", "Young's modulus; none: identified, slipping plates")
    E_bonded: float | None = quantity(
        None, "Pa", "of models with bonded plates; none: E, or identified with bonded plates"
    )
    nu: float = quantity(0.499, "1", "Poisson ratio, nearly incompressible")
    by_method: tuple[tuple[str, float, float], ...] = quantity(
        (), "1", "set by the run: modulus (Pa) and start of the load (m) of each model"
    )
    coefficients: Coefficients = part(Coefficients(), "further parameters of the models' laws")


@dataclass(frozen=True)
class CylinderGrid:
    radial: int = quantity(4, "1", "elements from axis to rim")
    axial: int = quantity(4, "1", "elements along the axis")
    finer: float = quantity(1.5, "1", "how many times finer the finest mesh is, for u_num")
    halvings: int = quantity(
        0, "1", "of a mesh file: times its cells' edges are cut in half; -1: filled anew, coarser"
    )
    budget: bool = quantity(
        True, "1", "of a mesh file: keep a first answer to about 30 s; false: as --refine"
    )


@dataclass(frozen=True)
class CompressionRanges(Ranges):
    E: float = quantity(0.05, "1", "relative, of a given modulus")
    diameter: float = quantity(0.005, "1", "relative, of the diameter")
    height: float = quantity(0.005, "1", "relative, of the height; of outlines or an identified E")
    nu: float = quantity(0.01, "1", "of the Poisson ratio; of outlines or an identified E")
    friction: float = quantity(
        0.05, "1", "of an identified E: share of the way from slipping to bonded ends, or back"
    )
    load: float = quantity(0.005, "1", "relative, of the load cell's scale; of an identified E")


@dataclass(frozen=True)
class Compression:
    """Everything a user decides of a compression test; `recording` lies beside the file."""

    recording: str = quantity("", "1", "MCAP file, from the experiment's folder")
    test: TestKind = quantity("compression", "1", "whether the upper plate presses or pulls")
    specimen: Specimen = Specimen()
    material: Gel = Gel()
    mesh: CylinderGrid = CylinderGrid()
    ranges: CompressionRanges = CompressionRanges()
    outline: PressedOutline = PressedOutline()
    fit_from: float = quantity(0.005, "1", "strain from which the modulus is fitted")
    fit_to: float = quantity(0.05, "1", "strain to which the modulus is fitted")
    limit: float = quantity(0.10, "1", "largest strain compared; linear laws hold to about 0.1")

    def stated_by_files(self) -> Mapping[str, float]:
        """Return the sizes m that a mesh file holds, by parameter; none of a cylinder.

        Raises what reading the file does.
        """
        body = self.specimen
        if body.mesh is None or None not in (body.diameter, body.height):
            return {}
        return sizes_of_file(body.mesh, body.mesh_unit)


@dataclass(frozen=True)
class Pressed:
    """What a method's scene is built with."""

    plates: Contact = quantity("slip", "1", "contact of both plates")
    law: LawName = quantity("linear", "1", "linear, or the law at large strain")
    order: Literal[1, 2] = quantity(2, "1", "element order; 1 means nodal mean dilatation")
