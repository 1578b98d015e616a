"""Page of all printed figures: what was printed, our number, the verdict and its reason."""

import logging
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from validate.checksums import read_sealed
from validate.compare.exhibit import Exhibit, Intervals, NumberTable, TableCell
from validate.errors import RecordingError
from validate.numbers import with_unit
from validate.report.long_table import long_table
from validate.report.stored.folder import MARK
from validate.report.views.standard import view_of
from validate.report.views.view_filling import filled
from validate.study.loose_page import write_loose

Json = dict[str, Any]
LOG = logging.getLogger(__name__)
FOLDER = "published"
_ACROSS = "our number minus the printed one, over the tolerance"
_ORDER = ("reproduced", "not reproduced", "not reproducible as printed", "not comparable")


def write_published(reports: Path, checked: Sequence[Json]) -> Path | None:
    """Write the page beside the reports, and return its path; None where no figure is declared.

    `checked` are experiments with name, title, source, time and printed figures as in results.json.
    Those that an earlier page holds and that were not checked now stay, with their time. Raises
    what `replace_folder` does.
    """
    found = {c["experiment"]: c for c in (*_earlier(reports), *checked) if c["published"]}
    if not found:
        return None
    entries = [found[name] for name in sorted(found)]
    results = [p for c in entries for p in c["published"] if p["result"]]
    fallen = [p for p in results if p["fault"]]
    moved = f"; {len(fallen)} no longer hold" if fallen else ""
    sentence = f"{len(results)} printed results of {len(entries)} experiments: {_counted(results)}"
    told = ("published", "Printed figures, and ours", "validate check", f"{sentence}{moved}.")
    stored = {n for n in found if (reports / n / "report.html").is_file()}
    links = {n: f"../{n}/report.html" if n in stored else "" for n in found}
    rows = tuple(
        (
            TableCell(c["experiment"], emphasis="strong", link=links[c["experiment"]]),
            c["source"],
            TableCell(_counted(p for p in c["published"] if p["result"])),
            TableCell("holds" if c["holds"] else "does not hold",
                      emphasis="good" if c["holds"] else "bad"),
            c["checked"][:16].replace("T", " "),
        )
        for c in entries
    )  # fmt: skip
    summary = NumberTable(
        "experiments", "Experiments with printed figures",
        ("experiment", "source", "printed results", "declared verdicts", "checked, UTC"), rows,
        "A result counts as reproduced within the tolerance that the experiment declares, at most "
        "a tenth of the printed number. Settings, sketches and citations are not counted.",
    )  # fmt: skip
    # Every figure with two numbers and a tolerance: their difference over it.
    lines = [(c["experiment"], p) for c in entries for p in c["published"]
             if p["result"] and None not in (p["ours"], p["theirs"], p["tolerance"])
             and p["tolerance"] > 0]  # fmt: skip
    figures = [p for _, p in lines]
    differences = Intervals(
        "figures", "Our number minus the printed one",
        tuple(f"{name}: {p['name']}" for name, p in lines),
        np.array([p["ours"] - p["theirs"] for p in figures]),
        np.zeros(len(figures)),
        np.array([p["tolerance"] for p in figures]),
        tuple(f"{with_unit(p['ours'], p['unit'])}, printed {with_unit(p['theirs'], p['unit'])}"
              for p in figures),
        tuple(p["verdict"] for p in figures),
        "Only figures with a printed number, a value of ours and a tolerance.",
        across=_ACROSS,
    )  # fmt: skip
    exhibits = (Exhibit("figures", "All experiments", (), (summary,),
                        intervals=(differences,) if lines else ()),
                *map(_section, entries))  # fmt: skip
    document = {"page": FOLDER, "experiments": entries}
    return write_loose(told, exhibits, document, reports / FOLDER, "Checked")


def _earlier(reports: Path) -> list[Json]:
    file = reports / FOLDER / MARK
    try:
        content = read_sealed(file) if file.is_file() else {}
    except RecordingError as error:
        LOG.warning("%s; figures of earlier checks are left out", error)
        return []
    return list(content["experiments"]) if content.get("page") == FOLDER else []


def _counted(results: Iterable[Json]) -> str:
    """How many figures have which verdict, the better ones first."""
    counts = Counter(str(p["verdict"]) for p in results)
    order = sorted(counts, key=lambda v: (_ORDER.index(v) if v in _ORDER else len(_ORDER), v))
    return ", ".join(f"{counts[v]} {v}" for v in order) or "none"


def _section(entry: Json) -> Exhibit:
    """The printed figures of an experiment, as its own report shows them."""
    name = entry["experiment"]
    table = long_table({"methods": (), **entry}, name)
    shown = [filled(view_of(view), table) for view in ("published", "settings")]
    return Exhibit(name, f"{name}: {entry['title']}", (f"Source: {entry['source']}.",),
                   tuple(replace(t, below="reason" if "reason" in t.headings else t.below)
                         for view in shown for t in view.tables))  # fmt: skip
