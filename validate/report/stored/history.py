"""History of a report folder: a line of JSON for every replaced run.

The line is what the run's long table says in short, so that a folder of any age has a history. A
run is carried over unless all that made it (code, files, parameters) is equal.
"""

import json
import logging
from pathlib import Path
from typing import Any

from validate.checksums import sealed, unsealed
from validate.errors import RecordingError
from validate.files import json_value
from validate.report.export.table_file import stored_table
from validate.report.long_table import LongTable, checks_of, long_table
from validate.report.stored.folder import MARK
from validate.report.stored.json_values import Json

LINES = "history.jsonl"
LOG = logging.getLogger(__name__)
_WHOLE = (
    "experiment", "created", "sentence", "passed", "quick", "kind", "overall", "parameters",
    "changed", "made",
)  # fmt: skip
_CHECK = ("method", "name", "value", "raw", "limit", "u_val", "u_num", "unit", "count", "verdict",
          "validation", "margin")  # fmt: skip


def line_of(table: LongTable) -> Json:
    """Return a run in short; raises `KeyError` or `TypeError` for what is no table of a run."""
    head = table.head
    return {
        **{key: head[key] for key in _WHOLE if key in head},
        "inputs": [{"path": i["path"], "sha256": i["sha256"]} for i in head["inputs"]],
        "methods": [m["name"] for m in head["methods"]],
        "checks": [{key: c[key] for key in _CHECK} for c in checks_of(table.rows)],
        "identified": [
            {"name": row.name, "value": row.value, "unit": row.unit}
            for row in table.where(part="identified").rows
        ],
    }


def carried(folder: Path, content: Json) -> list[str]:
    """Return the lines of the folder that the run `content` is about to replace, that of its run
    last."""
    lines = _texts(folder)
    old = current(folder)
    if old is not None:
        before, now = _maker(old), _maker(line_of(long_table(content, folder.name)))
        if not before[0] or before != now:  # something that made the two runs differs
            replaced_line = sealed({**old, "replaced": content["created"]})
            lines.append(json.dumps(replaced_line, ensure_ascii=False, allow_nan=False))
    return lines


def write_lines(lines: list[str], folder: Path) -> None:
    """Nothing where there are none."""
    if lines:
        (folder / LINES).write_text("\n".join(lines) + "\n", encoding="utf-8")


def replaced(folder: Path, created: str) -> Json | None:
    """Return the run that gave way to the one created then; None where that replaced none, or its
    like."""
    lines = _texts(folder)
    last = unsealed(json_value(lines[-1])) if lines else {}
    return last if last.get("replaced") == created else None


def lines_of(folder: Path) -> list[Json]:
    """Every run that a report folder knows of, the current one last; of a line that does not fit
    its seal only a warning is left."""
    found: list[Json] = []
    for number, text in enumerate(_texts(folder), start=1):
        try:
            found.append(unsealed(json_value(text)))
        except ValueError as error:
            LOG.warning(f"{folder.name}/{LINES}, line {number}: ignored ({error})")
    now = current(folder)
    return [*found, *([] if now is None else [now])]


def current(folder: Path) -> Json | None:
    """Return the line of the run that lies there; None for a folder without one, or, with a
    warning, one that is not believed."""
    if not (folder / MARK).exists():
        return None
    try:
        return line_of(stored_table(folder, part=("check", "check.*", "identified")))
    except (KeyError, TypeError, AttributeError):
        return None
    except RecordingError as error:
        LOG.warning(str(error))
        return None


def _texts(folder: Path) -> list[str]:
    try:
        text = (folder / LINES).read_text(encoding="utf-8")
    except OSError:
        return []
    return [line for line in text.splitlines() if line.strip()]


def _maker(line: Json) -> tuple[Any, ...]:
    made = line.get("made") or {}
    rest = (line.get(key) for key in ("inputs", "parameters", "quick", "methods"))
    # Through JSON: a file that was read again has lists where this run has tuples.
    return made.get("code_sha256"), json.dumps([made.get("files"), *rest], sort_keys=True)
