"""The table of docs/paper-000.md: every number and picture of paper 000, from stored runs.

validate run fluid_block fluid_phantom needle_pocket --out DIR
python benchmarks/paper_table.py DIR            prints it
python benchmarks/paper_table.py DIR --write    puts it into the page

Rates are of the machine that ran; tests/docs/test_paper_page.py holds names, printed numbers and
claims to what the experiments declare today.
"""

import json
import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

EXPERIMENTS = ("fluid_block", "fluid_phantom", "needle_pocket")
PAGE = Path(__file__).resolve().parents[1] / "docs" / "paper-000.md"
BEGIN, END = "<!-- figures: begin -->", "<!-- figures: end -->"
HEAD = ("paper", "what", "theirs", "ours", "verdict", "why", "experiment")


def place(source: str) -> tuple[float, str]:
    """The first section that a source names, to read the paper from its top."""
    found = re.search(r"sections? (\d+(?:\.\d+)?)", source)
    return (float(found[1]) if found else 99.0), source


def shown(value: float | None, unit: str) -> str:
    """Four digits with the unit; "-" where nothing is printed."""
    return "-" if value is None else f"{value:.4g}" + ("" if unit == "1" else f" {unit}")


def row(figure: Mapping[str, Any], experiment: str) -> list[str]:
    """A row of a figure as results.json has it."""
    theirs, ours = (shown(figure[k], figure["unit"]) for k in ("theirs", "ours"))
    verdict, why = figure["verdict"], figure["reason"].replace("|", "/")
    return [figure["source"], figure["name"], theirs, ours, verdict, why, f"`{experiment}`"]


def table(folder: Path) -> str:
    """Markdown of all figures of the runs below `folder`, in the order of the paper."""
    rows = []
    for name in EXPERIMENTS:
        found = json.loads((folder / name / "results.json").read_text("utf-8"))
        rows += [row(p, name) for p in found["published"]]
    rows.sort(key=lambda r: place(r[0]))
    return "\n".join("| " + " | ".join(r) + " |" for r in (HEAD, ["---"] * len(HEAD), *rows))


def main() -> None:
    made = table(Path(sys.argv[1]))
    print(made)
    if "--write" in sys.argv[2:]:
        text = PAGE.read_text("utf-8")
        before, after = text.split(BEGIN)[0], text.split(END)[1]
        PAGE.write_text(f"{before}{BEGIN}\n{made}\n{END}{after}", "utf-8")


if __name__ == "__main__":
    main()
