"""Force and displacement from stress, strain or stretch, by declared specimen sizes.

With the length L and the area A of the specimen before the test, and the stretch s = 1 + e of an
engineering strain e: displacement e L, force (engineering stress) A. A true strain is ln s; a true
stress is that on the area that is left, A / s where the volume stays, which is assumed and said.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.tables.columns import (
    MissingColumnError,
    Pick,
    Said,
    columns_called,
    needed_pick,
    picked,
    said_pick,
    unnamed_column,
)
from validate.recording.tables.direction import Kind, excursion
from validate.recording.tables.geometry import loaded_area
from validate.recording.tables.table import Column, Table
from validate.recording.tables.vocabulary import (
    ENGINEERING,
    TRUE,
    holds,
    of_the_deformed,
    role_of_name,
)
from validate.units import si_factor, split

MEASURES = ("engineering", "true")
_FROM = {"displacement": ("strain", "stretch"), "force": ("stress",)}
_LENGTH = "the gauge length of the strain, as --map length=20mm"
_AREA = "the specimen's loaded area, as --map area=314mm2"
_LONGEST = 20.0  # no rubber is stretched so far: per cent that are called numbers


@dataclass(frozen=True)
class Sizes:
    """Area m2 and length m before the test, each with who said so; None: not known."""

    area: float | None
    length: float | None
    measure: str | None
    words: Mapping[str, str]


@dataclass(frozen=True)
class Sized:
    """Force or displacement made of a derived column, and the words on how."""

    pick: Pick
    words: str
    kind: Kind | None = None  # what a stretch says of the test


def sizes_of(mapping: Mapping[str, str], specimen: Mapping[str, float], kind: Kind | None) -> Sizes:
    """Return the user's sizes, else the header's: its area, and in compression its height.

    A header's length is not taken: that of a whole specimen is not the one strain is measured on.
    Raises `UsageError` for a size without a unit and a measure that is neither.
    """
    said = {k: _size(k, mapping[k]) for k in ("area", "length") if k in mapping}
    measure = mapping.get("measure")
    if measure not in (None, *MEASURES):
        raise UsageError(f"--map measure={measure}: expected one of {', '.join(MEASURES)}")
    pressed = kind is not None and kind.name == "compression"
    told = {
        "area": loaded_area(specimen, kind.name if kind else ""),
        "length": specimen.get("height_m") if pressed else None,
    }
    found = {k: said.get(k, told[k]) for k in told}
    words = {k: "given" if k in said else "from the header" for k in told}
    return Sizes(found["area"], found["length"], measure, words)


def with_sizes(specimen: Mapping[str, float], mapping: Mapping[str, str]) -> dict[str, float]:
    """Return the header's sizes and those that the user gives, who is believed."""
    names = {"area": "area_m2", "length": "height_m"}  # a header's length is the whole specimen's
    return {**specimen, **{names[k]: _size(k, mapping[k]) for k in names if k in mapping}}


def _size(key: str, text: str) -> float:
    found = split(text)
    example = {"area": "314mm2", "length": "20mm"}[key]
    if found is None or not found[1] or not 0 < found[0] < np.inf:
        raise UsageError(f"--map {key}={text}: expected a size above 0 with a unit, as {example}")
    try:
        return found[0] * si_factor(found[1], key)
    except RecordingError as error:
        raise UsageError(f"--map {key}={text}: {error}") from error


def is_derived(role: str, table: Table, said: Mapping[str, Said]) -> bool:
    """Return whether a force or displacement has to be made of stress, strain or stretch."""
    sources = _FROM.get(role, ())
    own = role in said or bool(columns_called(role, table))
    return not own and any(s in said or _candidates(s, table) for s in sources)


def derived(
    role: str, table: Table, said: Mapping[str, Said], sizes: Sizes, kind: Kind | None
) -> Sized:
    """Displacement or force by a size; raises `MissingColumnError` naming all that is asked."""
    if role == "displacement":
        return _displacement(table, said, sizes, kind)
    missing = () if sizes.area else (_AREA,)
    try:
        stress = _source("stress", table, said)
    except RecordingError as error:
        raise MissingColumnError(str(error), missing) from error
    measure, asked = _measure(stress, sizes)
    asked += missing
    unnamed = unnamed_column("force", table)
    _refuse_unsaid(f"no force, but stress '{stress.column.label}'{unnamed}", asked)
    assert sizes.area is not None
    nominal, words = stress.values, f"{measure} stress '{stress.column.label}'"
    if measure == "true":
        nominal = nominal / _stretch(table, said, sizes, kind)
        words += " over the stretch (constant volume assumed)"
    words = f"force = {words} x area {sizes.area:.6g} m2 ({sizes.words['area']})"
    return Sized(_made(stress, "force", nominal * sizes.area, sizes.area), words)


def _displacement(table: Table, said: Mapping[str, Said], sizes: Sizes, kind: Kind | None) -> Sized:
    missing = () if sizes.length else (_LENGTH,)
    try:
        source = _elongation(table, said)
    except RecordingError as error:
        raise MissingColumnError(str(error), missing) from error
    measure, asked = ("", []) if source.role == "stretch" else _measure(source, sizes)
    asked += missing
    unnamed = unnamed_column("displacement", table)
    _refuse_unsaid(f"no displacement, but {source.role} '{source.column.label}'{unnamed}", asked)
    assert sizes.length is not None
    what = f"{measure} strain" if measure else "(stretch - 1) of"
    words = f"displacement = {what} '{source.column.label}' x length {sizes.length:.6g} m"
    shown = _shown_by_stretch(source) if source.role == "stretch" else None
    _refuse_other(kind, shown, source)
    elongation = _relative(source, measure, kind or shown)
    made = _made(source, "displacement", elongation * sizes.length, sizes.length)
    return Sized(made, f"{words} ({sizes.words['length']})", shown)


def require_left(sized: Sized, closing: Floats, length: float) -> None:
    """Raise `RecordingError` where nothing is left of the specimen (closing, length in m)."""
    most = float(np.max(closing)) / length
    if most >= 1:
        label = sized.pick.column.label
        raise RecordingError(
            f"'{label}' presses the specimen by {100 * most:.4g} % of its length; if it is in per "
            f"cent, give --map 'strain={label}:%', if it is a true strain --map measure=true"
        )


def _source(role: str, table: Table, said: Mapping[str, Said]) -> Pick:
    if role in said:
        if said[role].sign is not None:
            raise UsageError(
                f"--map {role}: no sign is allowed; give --map test=compression or test=tension"
            )
        return said_pick(role, table, said[role])
    found = _candidates(role, table)
    engineering = [c for c in found if holds(c.name, ENGINEERING)]
    found = engineering if len(engineering) == 1 else found
    if len(found) != 1:
        labels = ", ".join(repr(c.label) for c in found) or "none"
        raise MissingColumnError(
            f"{len(found)} columns may be {role}: {labels}; choose with --map {role}=COLUMN"
        )
    column = found[0]
    if role == "stretch" and not column.unit:
        column = replace(column, unit="1")
    return picked(role, column, table, None)


def _candidates(role: str, table: Table) -> list[Column]:
    """Columns of engineering or unsaid measure, else those of true stress or strain."""
    true = [c for c in table.columns if role_of_name(of_the_deformed(c.name)) == role]
    return columns_called(role, table) or [c for c in true if any(c.cells)]


def _elongation(table: Table, said: Mapping[str, Said]) -> Pick:
    stretched = "stretch" in said or not (
        "strain" in said or _candidates("strain", table)
    )  # a strain goes first
    return _source("stretch" if stretched else "strain", table, said)


def _measure(pick: Pick, sizes: Sizes) -> tuple[str, list[str]]:
    """Engineering or true, by the column's name, else as said; and what has to be asked."""
    name = pick.column.name
    by_name = "true" if holds(name, TRUE) else "engineering" if holds(name, ENGINEERING) else None
    if by_name and sizes.measure not in (None, by_name):
        raise UsageError(
            f"--map measure={sizes.measure}: '{pick.column.label}' names {by_name} itself; leave "
            f"the option out"
        )
    ask = "the measure of stress and strain, as --map measure=engineering (undeformed body)"
    found = by_name or sizes.measure
    return found or "", [] if found else [f"{ask}, or measure=true"]


def _stretch(table: Table, said: Mapping[str, Said], sizes: Sizes, kind: Kind | None) -> Floats:
    """Stretch (n,) for a true stress: by strain or stretch, else by displacement over length."""
    if not ({"strain", "stretch"} & set(said) or _strained(table)):
        moved = needed_pick("displacement", table, said.get("displacement"))
        if sizes.length is None:
            raise MissingColumnError("true stress and the current area", (_LENGTH,))
        return 1 + _signed((moved.values - moved.values[0]) / sizes.length, kind, moved)
    source = _elongation(table, said)
    shown = _shown_by_stretch(source) if source.role == "stretch" else None
    measure, asked = ("", []) if source.role == "stretch" else _measure(source, sizes)
    _refuse_unsaid("true stress", asked)
    return np.asarray(1 + _signed(_relative(source, measure, kind or shown), kind or shown, source))


def _strained(table: Table) -> bool:
    return any(_candidates(role, table) for role in ("strain", "stretch"))


def _relative(source: Pick, measure: str, kind: Kind | None) -> Floats:
    """Change of length over length (n,), with the sign that the table gives it."""
    if source.role == "stretch":
        if source.values.min() <= 0 or source.values.max() > _LONGEST:
            raise RecordingError(
                f"'{source.column.label}' from {source.values.min():.4g} to "
                f"{source.values.max():.4g}: a stretch is 1 at rest and above 0; if it is a "
                f"strain, give --map 'strain={source.column.label}:%' (or :1)"
            )
        return source.values - 1
    if measure == "true":
        return np.asarray(np.expm1(_signed(source.values, kind, source)))
    return source.values


def _signed(x: Floats, kind: Kind | None, source: Pick) -> Floats:
    """Longer positive: by the kind of test, else a strain that goes negative is compression."""
    way = excursion(x)
    if kind is None and way >= 0:
        raise MissingColumnError(
            f"'{source.column.label}' does not show whether the specimen is pressed or pulled; a "
            f"true measure needs it"
        )
    longer = kind is not None and kind.name == "tension"
    return x * (way or 1) if longer else -x * (way or 1)


def _shown_by_stretch(source: Pick) -> Kind | None:
    way = excursion(source.values)
    if way == 0:
        return None
    name = f"'{source.column.label}'"
    return (
        Kind("tension", f"{name} goes above 1") if way > 0
        else Kind("compression", f"{name} goes below 1")
    )  # fmt: skip


def _refuse_other(kind: Kind | None, shown: Kind | None, source: Pick) -> None:
    if kind and shown and kind.name != shown.name:
        raise RecordingError(
            f"a {kind.name} test ({kind.why}), but {shown.why}; give --map test={shown.name}, or "
            f"if it is not a stretch, --map 'strain={source.column.label}:%' (or :1)"
        )


def _refuse_unsaid(what: str, asked: list[str]) -> None:
    if asked:
        raise MissingColumnError(what, tuple(asked))


def _made(source: Pick, role: str, values: Floats, size: float) -> Pick:
    return Pick(role, source.column, source.unit, source.factor * size, values, source.said)
