"""What a cell gave, and the folder that keeps it: one file a cell, so that a study can go on."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from uuid import uuid4

from validate.study.plan import Cell


@dataclass(frozen=True)
class CellResult:
    """Scores by name, one number per seed (SI, `units` by name); step_s s is the median step.

    `failed` is "" or why there is no score. `frozen` is the step from which a linear filter's
    gains repeat. `shared`: all seeds were run at once with one set of gains. `seconds` is what the
    whole cell took. `lasting` is False for a failure that another try may not have.
    """

    key: str
    scores: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    nis: float | None = None
    nis_dof: int = 0
    step_s: float | None = None
    setup_s: float | None = None
    steps: int = 0
    frozen: int | None = None
    shared: bool = False
    seconds: float = 0.0
    failed: str = ""
    lasting: bool = True


def write_cell(folder: Path, cell: Cell, result: CellResult) -> None:
    """Writes <key>.json whole or not at all."""
    content = {"method": cell.method, "values": cell.values, **asdict(result)}
    fresh = folder / f".{cell.key}.{uuid4().hex[:8]}"
    fresh.write_text(json.dumps(content, allow_nan=False, ensure_ascii=False), encoding="utf-8")
    fresh.replace(folder / f"{cell.key}.json")


def read_cells(folder: Path, cells: Iterable[Cell]) -> dict[str, CellResult]:
    """By key, those cells that were finished before; a damaged file counts as not finished."""
    found = {}
    for cell in cells:
        result = _read(folder / f"{cell.key}.json")
        if result is not None and result.key == cell.key:
            found[cell.key] = result
    return found


def _read(path: Path) -> CellResult | None:
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        del content["method"], content["values"]
        content["scores"] = {k: tuple(v) for k, v in content["scores"].items()}
        return CellResult(**content)
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None
