"""`validate summary`: bias and scatter over all stored runs."""

import json
from pathlib import Path

from validate.catalogue import reports_of
from validate.commands.display import relative, say, table
from validate.study.stored_runs.summary import (
    COVERED,
    STATED,
    OfKind,
    document,
    row,
    sentence,
    summary,
    write_summary,
)

_FOLDER = "summary"


def show(out: Path | None, *, as_json: bool) -> None:
    """Prints bias and scatter by what was measured, and draws a page beside the reports."""
    reports = reports_of(None, out)
    found = summary(reports)
    if as_json:
        print(json.dumps(document(found), allow_nan=False, ensure_ascii=False, indent=1))
        return
    say(sentence(found), "bold")
    _print("Measured recordings", found.kinds)
    if found.twins:
        _print("Twins (simulated recordings, no measurement)", found.twins)
    counted = f"{len(found.taken)} of {len(found.runs)} stored runs count"
    whys = [f"{r.folder}: {r.why}" for r in found.runs if r.why]
    say(f"\n{counted}" + (":" if whys else ""))
    for why in whys:
        say(f"  {why}", indent="    ")
    page = write_summary(found, reports / _FOLDER)
    say(f"page: {relative(page)}")


def _print(title: str, kinds: tuple[OfKind, ...]) -> None:
    rows = [row(kind) for kind in kinds]
    table(title, STATED, [texts[: len(STATED)] for texts in rows])
    for kind, texts in zip(kinds, rows, strict=True):
        shown = []  # a text below "name / unit" as people read it
        for heading, text in zip(COVERED, texts[len(STATED) :], strict=True):
            name, _, unit = heading.partition(" / ")
            shown += [f"{name} {text} {unit}".strip()] if text != "–" else []
        say(f"  {kind.kind}: {', '.join(shown)}", indent="    ")
        if kind.why:
            say(f"  {kind.kind}: {kind.why}", indent="    ")
