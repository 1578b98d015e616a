"""The README's table: models of the fluid phantom side by side, from today's run.

python benchmarks/readme_table.py            prints it
python benchmarks/readme_table.py --write    puts it into README.md, with the picture
"""

import sys
from pathlib import Path

from validate.compare.result import MethodResult, Result
from validate.replay import compare, load

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- table: begin -->", "<!-- table: end -->"
HEAD = (
    "at 9 mm", "contour rms / max, mm", "markers in plane / vertical rms, mm",
    "plate force error, N", "pressure error, Pa", "volume error, %", "most updates a step",
    "rate, kHz",
)  # fmt: skip
PAPER = (
    "paper 000 (its own phantom)", "- / 0.41", "within about 1", "-", "not measured", "within 1",
    "1", "3 (2004)",
)  # fmt: skip


def rows(result: Result) -> list[list[str]]:
    """One row a method; the last column is a timing, all others are the same on every machine."""
    return [_row(method) for method in result.methods]


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


def markdown(table: list[list[str]]) -> str:
    lines = [list(HEAD), ["---"] * len(HEAD), *table, list(PAPER)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    result = compare(load(str(ROOT / "experiments" / "fluid_phantom.py")))
    text = markdown(rows(result))
    print(text)
    if "--write" in sys.argv[1:]:
        readme = ROOT / "README.md"
        before, rest = readme.read_text("utf-8").split(BEGIN)
        after = rest.split(END)[1]
        readme.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", "utf-8")


if __name__ == "__main__":
    main()
