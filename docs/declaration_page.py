"""The classes of docs/reference/declaration.md, which a declared experiment is made of."""

import inspect
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from reference_page import BAR, prose, type_text

from validate.pipeline.experiment.declaration import classes

PARTS = {
    "pipeline": "Experiment",
    "scene": "Scene",
    "solve": "Solvers",
    "estimate": "Filters",
    "register": "Registration and sensors",
    "compare": "Checks",
}
RESULTS = {  # what a run makes: nobody declares them
    "Batch", "Change", "Check", "Effect", "Exhibit", "Handles", "Identified", "IdentifiedValue",
    "LawKind", "Lost", "MarkerObservation", "Measurements", "Mesh", "MovedVerdict", "Numerical",
    "Overall", "PointErrors", "Published", "Registered", "Registration", "Residual", "Rival",
    "RowBlock", "Score", "Screen", "Sensitivity", "SignalObservation", "Similarity", "Stack",
    "Together", "Told", "Truth", "_Interval",
}  # fmt: skip
HEAD = ("key", "type", "unit", "default", "meaning")


def page() -> str:
    """Return every class by part as Markdown: what it is, then its keys."""
    text = ""
    for part, title in PARTS.items():
        text += f"\n## {title}\n"
        text += "".join(_entry(kind) for kind in _of_part(classes(), part))
    return text


def _of_part(known: Mapping[str, type], part: str) -> list[type]:
    own = (kind for kind in known.values() if kind.__module__.startswith(f"validate.{part}."))
    kinds = [kind for kind in own if kind.__name__ not in RESULTS]
    return sorted(kinds, key=lambda kind: (kind.__name__ != "Experiment", kind.__name__))


def _entry(kind: type) -> str:
    doc = inspect.getdoc(kind) or ""
    generated = doc.startswith(f"{kind.__name__}(")  # by dataclasses
    return f"\n### {kind.__name__}\n\n{'' if generated else prose(doc)}\n\n{_table(kind)}\n"


def _table(kind: type) -> str:
    """Return the keys; a column that is empty for this class is left out."""
    rows = [_row(f) for f in fields(kind) if f.init]
    if not rows:
        return ""
    used = [i for i in range(len(HEAD)) if any(row[i] for row in rows)]
    lines = [[row[i] for i in used] for row in (HEAD, ["---"] * len(HEAD), *rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _row(key: Field[Any]) -> list[str]:
    unit = key.metadata.get("unit", "")
    cells = (
        f"`{key.name}`", f"`{type_text(key.type)}`", "" if unit == "1" else unit, _default(key),
        key.metadata.get("doc", ""),
    )  # fmt: skip
    return [cell.replace("|", BAR) for cell in cells]


def _default(key: Field[Any]) -> str:
    if key.default_factory is not MISSING:
        return "empty"
    if key.default is MISSING:
        return "required"
    if key.default in ("", (), None):
        return "none"
    if is_dataclass(key.default):
        return f"`{type(key.default).__name__}(...)`"
    name = getattr(key.default, "__name__", repr(key.default))
    return "none" if name.startswith("_") else f"`{name}`"
