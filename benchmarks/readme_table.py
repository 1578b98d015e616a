"""Tables of README.md and docs/explanation/results.md, from today's runs: phantom and filters.

python benchmarks/readme_table.py            prints them (about three minutes)
python benchmarks/readme_table.py --write    puts them into the pages
"""

import sys
from collections.abc import Mapping
from pathlib import Path

from validate.compare.result import MethodResult, Result
from validate.pipeline import load, run_in_memory

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"
FILTERS_BEGIN, FILTERS_END = "<!-- filters: begin -->", "<!-- filters: end -->"
PRINTED_BEGIN, PRINTED_END = "<!-- printed: begin -->", "<!-- printed: end -->"
HEAD = (
    "at 9 mm", "contour rms / max, mm", "markers in plane / vertical rms, mm",
    "plate force error, N", "pressure error, Pa", "volume error, %", "most updates a step",
    "rate, kHz",
)  # fmt: skip
PAPER = (
    "paper 000 (its own phantom)", "- / 0.41", "within about 1", "-", "not measured", "within 1",
    "1", "3 (2004)",
)  # fmt: skip
FILTERS_HEAD = (
    "block of paper 001", "perfect model: measured node, %", "20 % too stiff: measured node, %",
    "2 mm below, %", "corner, %", "NIS per degree of freedom", "step over FEM step",
)  # fmt: skip
FILTERS = ("fem", "kf_printed", "kf_load", "load_scale", "kf_reduced")
PRINTED_HEAD = ("printed", "ours", "theirs", "verdict")
# The figures a reader asks for first; `validate check` has them all.
PRINTED = {
    "kf_cube": (
        "NRMSE at the observation point",
        "share of the measurement noise that remains",
        "share of the error that remains 2 mm below the measured node, model 20 % too stiff",
    ),
    "ekf_cube": ("time step", "ekf_held: node_A.rmse", "ekf_held: node_B.rmse"),
    "ekf_cone": ("ekf_held: node_A.rmse", "ekf_held: node_B.rmse"),
}


def rows(result: Result) -> list[list[str]]:
    """One row a method that was run; the last column is a timing, all others are the same on every
    machine."""
    return [_row(method) for method in result.methods if method.run.finished]


def _row(method: MethodResult) -> list[str]:
    s = {score.name: score.value for score in method.scores}
    rate = method.run.step_s.rate_hz / 1e3 if method.run.step_s else float("nan")
    mm = {name: f"{1e3 * value:.2f}" for name, value in s.items()}
    return [
        method.label + (" (accepted)" if method.accepted else ""),
        f"{mm['contour.rms@9mm']} / {mm['contour.max@9mm']}",
        f"{mm['marker.inplane.rms@9mm']} / {mm['marker.vertical.rms@9mm']}",
        f"{s['force.plate@9mm']:+.2f}",
        f"{s['pressure@9mm']:+.0f}",
        f"{100 * s['volume.relative_error@9mm'] + 0.0:.2f}".replace("-0.00", "0.00"),
        f"{s['updates.max']:.0f}",
        f"{rate:.0f}",
    ]


def filter_rows(result: Result) -> list[list[str]]:
    """One row a filter of `kf_cube`; the last column is a timing."""
    methods = {m.name: m for m in result.methods}
    base = _scores(methods["fem"])["step.p50"]
    return [_filter_row(methods[name], base) for name in FILTERS]


def _filter_row(method: MethodResult, base: float) -> list[str]:
    s = _scores(method)
    names = [f"{n}.nrmse@stiff_model" for n in ("node_A", "node_B", "corner")]
    nis = s.get("nis.per_dof@stiff_model")
    return [
        method.label,
        f"{100 * s['node_A.nrmse']:.2f}",
        *(f"{100 * s[name]:.2f}" for name in names),
        "-" if nis is None else f"{nis:.2f}",
        f"{s['step.p50'] / base:.1f}",
    ]


def _scores(method: MethodResult) -> dict[str, float]:
    return {score.name: score.value for score in method.scores}


def printed_rows(results: dict[str, Result]) -> list[list[str]]:
    """Printed figures beside ours, by experiment."""
    found = []
    for name, wanted in PRINTED.items():
        figures = {p.name: p for p in results[name].published}
        for figure in (figures[w] for w in wanted):
            factor, unit = {"m": (1e3, " mm"), "s": (1e3, " ms")}.get(figure.unit, (1.0, ""))
            ours, theirs = (
                "-" if v is None else f"{factor * v:.3g}{unit}"
                for v in (figure.ours, figure.theirs)
            )
            found.append([f"`{name}`: {figure.name}", ours, theirs, figure.line])
    return found


def markdown(head: tuple[str, ...], table: list[list[str]]) -> str:
    lines = [list(head), ["---"] * len(head), *table]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _result(name: str) -> Result:
    return run_in_memory(load(name))


def main() -> None:
    phantom, printed = _result("fluid_phantom"), {name: _result(name) for name in PRINTED}
    tables = {
        BEGIN: markdown(HEAD, [*rows(phantom), list(PAPER)]),
        FILTERS_BEGIN: markdown(FILTERS_HEAD, filter_rows(printed["kf_cube"])),
        PRINTED_BEGIN: markdown(PRINTED_HEAD, printed_rows(printed)),
    }
    print("\n\n".join(tables.values()))
    if "--write" in sys.argv[1:]:
        for page in (ROOT / "README.md", ROOT / "docs" / "explanation" / "results.md"):
            page.write_text(replaced(page.read_text("utf-8"), tables), "utf-8")


def replaced(text: str, tables: Mapping[str, str]) -> str:
    """The text of a page with those tables that it has between their marks."""
    for begin, table in tables.items():
        if begin in text:
            end = begin.replace("begin", "end")
            before, rest = text.split(begin)
            text = f"{before}{begin}\n{table}\n{end}{rest.split(end)[1]}"
    return text


if __name__ == "__main__":
    main()
