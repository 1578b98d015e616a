"""Reader of displacement fields exported by digital image correlation.

A row is a point of a grid and all rows are one instant. A recording has no stream for that: read
over time, the rows would be one point that jumps from place to place.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.recording.tables.vocabulary import plain, role_of_name

_BESIDE = r"(coord(inate)?s?|pos(ition)?|ref(erence)?|pixel|px)?"
_PLACE = re.compile(rf"{_BESIDE}(?P<axis>[xyz])[0c]?{_BESIDE}")
_COMPONENT = re.compile(r"(?P<u>[uvw])(px|pixel)?|u(?P<x>[xyz])")
_NAMED = re.compile(
    r"disp|deplacement|verschiebung|desplazamiento|spostamento|deslocamento|verplaatsing|"
    r"przemieszczenie|перемещени|位移|変位"
)
_STRAIN = re.compile(r"e(ps(ilon)?)?(xx|yy|zz|xy|yx|xz|zx|yz|zy|[123])|eps(ilon)?[xyz]")


@dataclass(frozen=True)
class FieldColumns:
    """The columns of a displacement field by their names without units: places, displacements
    and strains."""

    places: tuple[str, ...]
    displacements: tuple[str, ...]
    strains: tuple[str, ...]

    def refusal(self, held: str) -> str:
        """Return why `held` (as "240 rows") of these columns are not read, and what to do."""
        columns = ", ".join((*self.places, *self.displacements, *self.strains))
        return (
            f"{held} of {columns}: a field of displacements or strains at one instant, not the "
            "motion of one point; export chosen points over time, one row per instant, as time "
            "(s), "
            "p1_x (mm), p1_y (mm), p2_x (mm), p2_y (mm)"
        )


def field_columns(names: Sequence[str]) -> FieldColumns | None:
    """Return the columns x and y with displacements or strains beside them; None where there are
    none. A displacement is u and v together, or called so."""
    kinds = {name: _kind(name) for name in names}
    by = {kind: tuple(n for n, k in kinds.items() if k[:1] == kind) for kind in "pds"}
    axes, components = ({kinds[n][1:] for n in by[kind]} for kind in "pd")
    moved = {"x", "y"} <= components or "" in components
    if {"x", "y"} <= axes and (moved or by["s"]):
        return FieldColumns(by["p"], by["d"], by["s"])
    return None


def _kind(name: str) -> str:
    """p, d or s for a place, displacement or strain, then its axis; empty for another column."""
    text = "".join(re.findall(r"[^\W_]+", plain(name)))
    if found := _PLACE.fullmatch(text):
        return "p" + found["axis"]
    if found := _COMPONENT.fullmatch(text):
        return "d" + (found["x"] or "xyz"["uvw".index(found["u"])])
    if _NAMED.search(text):
        return "d"
    return "s" if _STRAIN.fullmatch(text) or role_of_name(name) == "strain" else ""


def is_grid(places: Floats) -> bool:
    """Return whether different places (n, 2 or more) fill a grid: every x with (nearly) every y."""
    x, y = (len(np.unique(places[:, i])) for i in (0, 1))
    different = len(np.unique(places[:, :2], axis=0)) == len(places)
    return different and min(x, y) > 2 and 9 <= x * y <= 1.5 * len(places)
