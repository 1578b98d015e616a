"""The table of measured experiments: fitted on what, predicted what, within what.

python benchmarks/measured_table.py            prints it (some ten minutes; needs the recordings)
python benchmarks/measured_table.py --write    puts it into docs/explanation/results.md
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from validate.compare.result import Result
from validate.compare.verdict import Check
from validate.datasets.home import data_path
from validate.numbers import with_unit
from validate.pipeline import load, run_in_memory

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
HEAD = (
    "experiment", "fitted on", "predicted", "error E", "2 u_val", "margin", "acceptance",
    "validation",
)  # fmt: skip
_SHOWN = 3  # kinds of quantity of an experiment, of each the check that is furthest off


@dataclass(frozen=True)
class Measured:
    """An experiment with what was set, what its model was fitted on, and the method that is shown
    (none: the first accepted)."""

    name: str
    fitted: str
    values: Mapping[str, str] = field(default_factory=dict)
    method: str = ""


def rows_of(one: Measured) -> list[list[str]]:
    """A row a check that is evidence or undecided, furthest off first."""
    experiment = load(one.name)
    result = run_in_memory(experiment, one.values)
    return [
        [_called(one) if i == 0 else "", one.fitted if i == 0 else "", *_cells(c)]
        for i, c in enumerate(_told(result, one.method))
    ]


def _called(one: Measured) -> str:
    more = f", {', '.join(f'{k} {v}' for k, v in one.values.items() if k != 'recording')}"
    return f"`{one.name}`{more if len(more) > 2 else ''}"


def _told(result: Result, method: str) -> list[Check]:
    accepted = [m for m in result.methods if m.checks and method in ("", m.name)]
    checks = [c for c in accepted[0].checks if c.count and c.verdict != "fitted"]
    checks.sort(key=lambda c: -abs(c.value) / (c.u_val or 1.0))
    first = {c.name.split(".")[0]: c for c in reversed(checks)}  # the furthest off of every kind
    return [c for c in checks if c in first.values()][:_SHOWN]


def _cells(c: Check) -> tuple[str, ...]:
    error = with_unit(c.value, c.unit) if c.value else "below noise"
    doubt, margin = (with_unit(n, c.unit) for n in (2 * c.u_val, c.margin))
    return (c.name, error, doubt, margin, c.acceptance, c.validation)


def measured() -> tuple[Measured, ...]:
    """The experiments on recordings made by others, as they ship and the beam's loaded case."""
    loaded = data_path("markers/silicone-beam", "beam_load52_V2_a.c3d", ROOT / "experiments")
    under = {"recording": str(loaded), "masses.load.mass": "52g"}
    return (
        Measured("stylus_phantom", "the other landmarks"),
        Measured("ultrasound_disk", "the centre, image by image"),
        Measured("ecoflex_cylinder", "the first 5 % of strain of the same logs"),
        Measured("silicone_beam", "its own ring-down; modulus declared by others"),
        Measured("silicone_beam", "ring-down under gravity alone", under),
        Measured("multimode", "uniaxial tension"),
        Measured("rubber_strip", "steps up to 6 %", method="neo_coupled"),
        Measured("gel_indentation", "the lower box"),
        Measured("skin_pads", "force to 4 mm"),
    )


def main() -> None:
    lines = [list(HEAD), ["---"] * len(HEAD)]
    for one in measured():
        lines += rows_of(one)
    table = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    print(table)
    if "--write" in sys.argv[1:]:
        page = ROOT / "docs" / "explanation" / "results.md"
        before, rest = page.read_text("utf-8").split(BEGIN)
        page.write_text(f"{before}{BEGIN}\n{table}\n{END}{rest.split(END)[1]}", "utf-8")


if __name__ == "__main__":
    main()
