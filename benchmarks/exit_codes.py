"""Every shipped experiment ends with the exit code of its row in docs/reference/experiments.md.

    .venv/bin/python benchmarks/exit_codes.py [NAME ...]

Runs each whole (`validate run NAME`), one after the other, and prints its exit code, the stated one
and its wall time. Exit code 1 where one differs. An experiment whose recording is absent ends with
2 and counts as not run. The whole takes about an hour on two cores.
"""

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ABSENT = "validate data get"
LONG = 180.0  # s: longer ones are listed with their time


def stated(page: str) -> dict[str, int]:
    """Exit code by experiment, of the table below "## Experiments"."""
    table = page.partition("\n## Experiments\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `(\w+)` \|.*\| (\d) \|$", table, re.M)
    return {name: int(code) for name, code in rows}


def main(names: list[str]) -> int:
    wanted = stated((ROOT / "docs" / "reference" / "experiments.md").read_text("utf-8"))
    wrong = 0
    for name in names or list(wanted):
        start = time.monotonic()
        with tempfile.TemporaryDirectory() as out:
            done = subprocess.run(
                [sys.executable, "-P", "-m", "validate", "run", name, "--out", out],
                cwd=ROOT, capture_output=True, text=True, check=False,
            )  # fmt: skip
        seconds = time.monotonic() - start
        absent = done.returncode == 2 and ABSENT in done.stderr
        fits = absent or done.returncode == wanted.get(name)
        wrong += not fits
        words = (
            "its recording is absent" if absent else "" if fits else f"stated {wanted.get(name)}"
        )
        long = f"  over three minutes: {seconds / 60:.1f} min" if seconds > LONG else ""
        print(f"{name:22} {done.returncode}  {seconds:6.0f} s  {words}{long}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
