"""The table of external simulators on the same recordings as ours.

OMP_NUM_THREADS=1 python benchmarks/external_table.py            prints it (some five minutes)
OMP_NUM_THREADS=1 python benchmarks/external_table.py --write    writes docs/explanation/results.md

Needs the recordings, FElupe, CalculiX and MuJoCo. All but rate and memory is the same everywhere.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from validate.compare.exhibit import Entry, TableCell, plain
from validate.compare.result import Result
from validate.datasets.home import data_path
from validate.numbers import significant, with_unit
from validate.pipeline import load, run_in_memory

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- external simulators: begin -->", "<!-- external simulators: end -->"
HEAD = (
    "experiment", "check", "method", "error E", "2 u_val", "margin", "acceptance", "validation",
    "rate, Hz", "memory, MB",
)  # fmt: skip
_OURS = "this one"


@dataclass(frozen=True)
class Judged:
    """An experiment with what is set, the methods that are run and the checks that are shown."""

    name: str
    methods: tuple[str, ...]
    checks: tuple[str, ...]
    called: str = ""
    values: Mapping[str, str] = field(default_factory=dict)


def judged() -> tuple[Judged, ...]:
    loaded = data_path("markers/silicone-beam", "beam_load52_V2_a.c3d", ROOT / "experiments")
    under = {"recording": str(loaded), "masses.load.mass": "52g"}
    beams = ("mixed", "still", "felupe", "calculix", "mujoco", "mujoco_45")
    cylinders = ("slip", "neo_slip", "svk_slip", "felupe", "calculix", "mujoco")
    rest, rings = "tip.vertical.max@settled", "ringing.frequency@swing"
    return (
        Judged("silicone_beam", beams, (rest,)),
        Judged("silicone_beam", beams, (rest, rings), "with 52 g", under),
        Judged("ecoflex_cylinder", cylinders, ("force.rms@10pct",)),
        Judged("fluid_phantom", ("p2_fluid", "felupe"), ()),
        Judged(
            "hanging_bar",
            ("quadratic", "hexahedra", "felupe", "calculix", "tetrahedra", "felupe_tetrahedra",
             "calculix_tetrahedra", "mujoco"),
            ("drop@all",),
        ),
    )  # fmt: skip


def run(one: Judged) -> Result:
    experiment = load(one.name)
    return run_in_memory(experiment, one.values, one.methods)


def rows_of(one: Judged, result: Result) -> list[list[str]]:
    """A row a method and check; a method that could not be run stands once, with the reason."""
    (table,) = (e.tables[0] for e in result.exhibits if e.anchor == "external_simulators")
    name = f"`{one.name}`" + (f" {one.called}" if one.called else "")
    shown = [r for check in one.checks for r in table.rows if plain(r[2]) == check]
    shown += [r for r in table.rows if plain(r[2]) == "-"]
    return [[name, *_cells(row)] for row in shown]


def _cells(row: tuple[Entry | TableCell, ...]) -> list[str]:
    label, program, check, error, _, _, accepted, validated, rate, memory, end = map(plain, row)
    who = str(label) if program in (_OURS, "-") else f"{label} ({program})"
    figures = [with_unit(c.value, c.unit) if isinstance(c, TableCell) else "-" for c in row[3:6]]
    if isinstance(error, float) and error == 0:
        figures[0] = "below noise"
    if check == "-":
        return ["-", who, "-", "-", "-", _short(str(end)), "-", "-", "-"]
    costs = [significant(x, 2) if isinstance(x, float) else "-" for x in (rate, memory)]
    return [str(check), who, *figures, str(accepted), str(validated), *costs]


def _short(end: str) -> str:
    """`cannot run` and the first part of the reason."""
    return end.partition(": ")[2].partition(";")[0]


def markdown(table: list[list[str]]) -> str:
    lines = [list(HEAD), ["---"] * len(HEAD), *table]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    text = markdown([row for one in judged() for row in rows_of(one, run(one))])
    print(text)
    if "--write" in sys.argv[1:]:
        page = ROOT / "docs" / "explanation" / "results.md"
        before, rest = page.read_text("utf-8").split(BEGIN)
        page.write_text(f"{before}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}", "utf-8")


if __name__ == "__main__":
    main()
