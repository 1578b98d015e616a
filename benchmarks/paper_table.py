"""The tables of docs/paper-00x.md: every number and picture of a paper, of stored runs.

validate run fluid_block fluid_phantom needle_pocket --out DIR
python benchmarks/paper_table.py DIR paper-000            prints it
python benchmarks/paper_table.py DIR paper-000 --write    puts it into the page

Rates are of the machine that ran; tests/docs/test_paper_page.py holds names, printed numbers and
claims to what the experiments declare today.
"""

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

PAGES = {
    "paper-000": ("fluid_block", "fluid_phantom", "needle_pocket"),
    "paper-001": ("kf_cube",),
    "paper-002": ("needle_block", "bending_rod"),
    "paper-003": ("ekf_cube", "ekf_liver", "ekf_cone", "haptic_liver"),
    "paper-004": ("async_line", "async_block"),
}
DOCS = Path(__file__).resolve().parents[1] / "docs"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
_NUMERALS = ("", "I", "II", "III", "IV", "V", "VI", "VII")
HEAD = ("paper", "what", "theirs", "ours", "verdict", "why", "experiment")


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


def table(folder: Path, page: str) -> str:
    """Markdown of all figures of the runs below `folder`, in the order of the paper."""
    rows = []
    for name in PAGES[page]:
        found = json.loads((folder / name / "results.json").read_text("utf-8"))
        rows += [row(p, name) for p in found["published"]]
    rows.sort(key=lambda r: place(r[0]))
    return "\n".join("| " + " | ".join(r) + " |" for r in (HEAD, ["---"] * len(HEAD), *rows))


def main() -> None:
    folder, page = Path(sys.argv[1]), sys.argv[2]
    made = table(folder, page)
    print(made)
    if "--write" in sys.argv[3:]:
        text = path(page).read_text("utf-8")
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        path(page).write_text(f"{before}{BEGIN}\n{made}\n{END}{after}", "utf-8")


if __name__ == "__main__":
    main()
