"""The tables of the paper pages in docs/explanation, from stored runs: results, then settings.

validate run fluid_block fluid_phantom needle_pocket --out DIR
python benchmarks/paper_table.py DIR paper-000            prints it
python benchmarks/paper_table.py DIR paper-000 --write    puts it into the page

Rates are of the machine that ran; tests/docs/test_paper_page.py holds names, printed numbers and
claims to what the experiments declare today.
"""

import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

PAGES = {
    "paper-000": ("fluid_block", "fluid_phantom", "needle_pocket"),
    "paper-001": ("kf_cube",),
    "paper-002": ("needle_block", "bending_rod"),
    "paper-003": ("ekf_cube", "ekf_liver", "ekf_cone", "haptic_liver"),
    "paper-004": ("async_line", "async_block"),
}
DOCS = Path(__file__).resolve().parents[1] / "docs" / "explanation"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
_NUMERALS = ("", "I", "II", "III", "IV", "V", "VI", "VII")
HEAD = ("paper", "what", "theirs", "ours", "verdict", "why", "experiment")
SETTINGS_BEGIN, SETTINGS_END = "<!-- settings: begin -->", "<!-- settings: end -->"
SETTINGS_HEAD = ("why there is no comparison", "printed value", "experiment")


def path(page: str) -> Path:
    """The file of a page."""
    return DOCS / f"{page}.md"


def place(source: str) -> tuple[float, str]:
    """The first section that a source names, to read the paper from its top."""
    if source.startswith("abstract"):
        return 0.0, source
    found = re.search(r"sections? (?:(\d+(?:\.\d+)?)|([IVX]+)\b)", source)
    if not found:
        return 99.0, source
    return float(found[1] or _NUMERALS.index(found[2])), source


def shown(value: float | None, unit: str) -> str:
    """Four digits with the unit; "-" where nothing is printed."""
    return "-" if value is None else f"{value:.4g}" + ("" if unit == "1" else f" {unit}")


def row(figure: Mapping[str, Any], experiment: str) -> list[str]:
    """A row of a figure as results.json has it."""
    theirs, ours = (shown(figure[k], figure["unit"]) for k in ("theirs", "ours"))
    verdict, why = figure["verdict"], figure["reason"].replace("|", "/")
    return [figure["source"], figure["name"], theirs, ours, verdict, why, f"`{experiment}`"]


def entry(row: Sequence[str]) -> str:
    """A setting in one line: place, name, printed value, and ours where it is another one."""
    source, name, theirs, ours = row[:4]
    if name.startswith("Fig. "):
        source = source.split(", Fig")[0]
    value = "" if theirs == "-" else f": {theirs}"
    other = "" if ours in ("-", theirs) else f" (ours {ours})"
    return f"{source}: {name}{value}{other}"


def published(folder: Path, page: str) -> tuple[list[list[str]], list[list[str]]]:
    """Rows of printed results, and of settings, sketches and citations, in the paper's order."""
    found = [
        (figure["result"], row(figure, name))
        for name in PAGES[page]
        for figure in json.loads((folder / name / "results.json").read_text("utf-8"))["published"]
    ]
    found.sort(key=lambda pair: place(pair[1][0]))
    return [r for result, r in found if result], [r for result, r in found if not result]


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(r) + " |" for r in (head, ["---"] * len(head), *rows))


def by_reason(rows: Iterable[Sequence[str]]) -> list[list[str]]:
    """Settings of one reason and experiment in one row."""
    groups: dict[tuple[str, str], list[str]] = {}
    for r in rows:
        groups.setdefault((r[5], r[6]), []).append(entry(r))
    return [[why, "<br>".join(lines), name] for (why, name), lines in groups.items()]


def replaced(text: str, begin: str, end: str, made: str) -> str:
    """A page with the block between two marks replaced."""
    return f"{text.split(begin)[0]}{begin}\n{made}\n{end}{text.split(end)[1]}"


def main() -> None:
    folder, page = Path(sys.argv[1]), sys.argv[2]
    results, settings = published(folder, page)
    tables = markdown(HEAD, results), markdown(SETTINGS_HEAD, by_reason(settings))
    print("\n\n".join(tables))
    if "--write" in sys.argv[3:]:
        text = replaced(path(page).read_text("utf-8"), BEGIN, END, tables[0])
        path(page).write_text(replaced(text, SETTINGS_BEGIN, SETTINGS_END, tables[1]), "utf-8")


if __name__ == "__main__":
    main()
