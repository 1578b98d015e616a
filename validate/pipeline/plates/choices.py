"""Settings of a body between plates or grips: uncertainties, strain windows, images."""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from validate.identify.modulus import stated_test
from validate.parameters import Ranges, quantity
from validate.pipeline.bodies.mesh import DIAMETER, HEIGHT, PLATES
from validate.pipeline.experiment.tree import Meshes
from validate.pipeline.plates.outline import PressedOutline
from validate.recording.tables.specimen_sizes import loaded_area
from validate.recording.types import Recording
from validate.scene.scene import Support

#: What a method changes of a declared scene where both plates, or grips, hold the body.
BONDED_PLATES: Mapping[str, Any] = MappingProxyType(
    {"supports": (Support(PLATES[0]), Support(PLATES[1], (0, 1)))}
)


def stated_sizes(recording: Recording) -> dict[str, float]:
    """What a recording's record `specimen` says of a cylinder, m, by path.

    Another cross-section has the diameter of the circle of its area.
    """
    found = _record(recording)
    area, sizes = loaded_area(found, stated_test(recording)), {}
    if "diameter_m" in found:
        sizes[DIAMETER] = found["diameter_m"]
    elif area is not None:
        sizes[DIAMETER] = 2 * math.sqrt(area / math.pi)
    if "height_m" in found:
        sizes[HEIGHT] = found["height_m"]
    return sizes


def recorded_sides(recording: Recording) -> dict[str, float]:
    """Return the sides m in a recording's record `specimen` by name: diameter, width, thickness,
    height."""
    names = ("diameter", "width", "thickness", "height")
    found = _record(recording)
    return {name: found[f"{name}_m"] for name in names if f"{name}_m" in found}


def _record(recording: Recording) -> dict[str, float]:
    """The numbers above zero of the record `specimen`."""
    numbers = {}
    for key, text in recording.metadata.get("specimen", {}).items():
        with suppress(ValueError):
            numbers[key] = float(text)
    return {k: v for k, v in numbers.items() if math.isfinite(v) and v > 0}


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
    """A test between plates or grips, besides its scene (`pipeline.plates.scene`)."""

    ranges: CompressionRanges = CompressionRanges()
    outline: PressedOutline = PressedOutline()
    fit_from: float = quantity(0.005, "1", "strain from which the modulus is fitted")
    fit_to: float = quantity(0.05, "1", "strain to which the modulus is fitted")
    limit: float = quantity(0.10, "1", "largest strain compared; linear laws hold to about 0.1")
    mesh: Meshes = Meshes()
    E_bonded: float | None = quantity(
        None, "Pa", "of models with bonded plates; none: material.E, or identified with them"
    )
    by_method: tuple[tuple[str, float, float], ...] = quantity(
        (), "1", "set by the run: modulus (Pa) and start of the load (m) of each model"
    )
