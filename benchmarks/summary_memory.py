"""Peak memory and time of `validate summary` over a synthetic store of many runs.

python benchmarks/summary_memory.py [RUNS] [--points 2000] [--form parquet|csv|json] [--most 300]

Every run has its own recording and specimen, 300 scores, 4 checks and so many compared points.
`json`: runs of a version without a table, whose results.json holds 1 MB. Exit code 1 where the
command takes more than `--most` MB.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import click

from validate.report.export import parquet
from validate.report.export.table_file import write_long_table
from validate.report.long_table import POINT, LongRow, LongTable, long_table
from validate.report.stored.folder import MARK
from validate.report.stored.json_values import write_json

_CHECKS, _SCORES = 4, 300
_TEXT = "x" * 1000


def document(number: int) -> dict[str, Any]:
    """The content of a run's results.json; predictions are off by up to 20 %."""
    measured = 10.0 + number % 7
    simulated = measured * (0.9 + 0.3 * (number % 11) / 10)
    checks = [
        {
            "name": f"force.rms@{i}mm", "value": simulated - measured, "limit": 2.0, "u_val": 0.5,
            "u_D": 0.3, "u_num": 0.1, "u_input": 0.4, "unit": "N", "count": 200, "raw": 1.0,
            "noise": 0.1, "validation": "not distinguishable", "acceptance": "good enough",
            "verdict": "good enough", "why": "|E| is 1.0 u_val", "kind": "force",
            "size": {"measured": measured, "simulated": simulated, "u": 0.3},
        }
        for i in range(1, _CHECKS + 1)
    ]  # fmt: skip
    scores = [
        {"name": f"marker_{i}.rms@9mm", "value": 1e-4 * i, "unit": "m", "count": 200,
         "against": "measured recording", "definition": "root mean square over the points"}
        for i in range(_SCORES)
    ]  # fmt: skip
    name = f"run_{number:05d}"
    return {
        "experiment": name, "kind": "measured", "created": "2026-11-01T12:00:00+00:00",
        "quick": False, "warnings": [], "changed": [],
        "inputs": [{"path": f"{name}.csv", "sha256": f"{number:064x}"}],
        "parameters": {f"part.{i}": {"value": float(i), "unit": "Pa"} for i in range(60)},
        "methods": [{"name": "fem", "accepted": True, "scores": scores, "checks": checks}],
        "domain": [{"recording": name, "specimen": name, "strain": 0.1, "rate": 0.01,
                    "sides": [0.03, 0.05]}],
    }  # fmt: skip


def store(folder: Path, runs: int, points: int, form: str) -> None:
    """Write so many runs."""
    parquet.available = lambda: form == "parquet"
    some = [LongRow(part=POINT, method="fem", quantity="force", point=i, axis="1", value=i / 7)
            for i in range(points)]  # fmt: skip
    for number in range(runs):
        content = document(number)
        place = folder / content["experiment"]
        place.mkdir()
        if form == "json":
            write_json(content | {"exhibits": [_TEXT] * 900}, place / MARK)
            continue
        table = long_table(content, place.name)
        write_long_table(LongTable(table.head, (*table.rows, *some)), place)
        (place / MARK).write_text("{}", "utf-8")  # never read


@click.command(help=__doc__)
@click.argument("runs", default=10_000)
@click.option("--points", default=2000, help="Compared points of a run.")
@click.option("--form", type=click.Choice(["parquet", "csv", "json"]), default="parquet")
@click.option("--most", default=300, help="MB of the whole command.")
def main(runs: int, points: int, form: str, most: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        store(Path(folder), runs, points, form)
        size = sum(f.stat().st_size for f in Path(folder).rglob("*") if f.is_file()) / 1e6
        start = time.perf_counter()
        command = [sys.executable, "-m", "validate", "summary", "--out", folder]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        seconds = time.perf_counter() - start
        page = (Path(folder) / "summary" / "report.html").stat().st_size / 1e6
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    click.echo(done.stdout.splitlines()[0])
    click.echo(json.dumps({
        "runs": runs, "form": form, "store_MB": round(size), "peak_MB": round(peak),
        "seconds": round(seconds, 1), "page_MB": round(page, 1),
    }))  # fmt: skip
    sys.exit(peak > most)


if __name__ == "__main__":
    main()
