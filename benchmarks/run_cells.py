"""What a run costs: with one and two workers, again, and stopped half-way and gone on.

python benchmarks/run_cells.py [NAME ...] [--before PROJECT]

Wall time of whole commands in s, start of Python and report included, and as a share of one worker;
each kind takes its turn. `--before`: a clone of an older version with its own .venv, as one more
kind. Steps beside are the median over methods of p50 with two workers over p50 with one.
"""

import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from time import perf_counter, sleep

import click

NAMES = ("fluid_phantom", "silicone_beam")


def command(name: str, out: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "validate", "run", name, "--out", str(out), *more]


def timed(arguments: list[str], folder: Path = Path()) -> float:
    start = perf_counter()
    done = subprocess.run(arguments, cwd=folder, capture_output=True, text=True)
    if done.returncode > 1:
        raise click.ClickException(done.stderr)
    return perf_counter() - start


def stopped(arguments: list[str], seconds: float) -> float:
    """Ctrl-C after so long."""
    start = perf_counter()
    running = subprocess.Popen(
        arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    sleep(seconds)
    running.send_signal(signal.SIGINT)
    running.wait()
    return perf_counter() - start


def steps(out: Path) -> dict[str, float]:
    """Median seconds of a step by method."""
    (file,) = out.glob("*/results.json")
    methods = json.loads(file.read_text("utf-8"))["methods"]
    return {m["name"]: m["step_s"]["p50"] for m in methods if m["step_s"]}


def rows(name: str, root: Path, before: Path | None) -> Iterator[tuple[str, float]]:
    if before:
        program = str(before / ".venv" / "bin" / "validate")
        yield "before", timed([program, "run", name, "--out", str(root / "before")], before)
    yield "1 worker", (one := timed(command(name, root / "1", "--workers", "1")))
    yield "2 workers", timed(command(name, root / "2", "--workers", "2"))
    yield "again, unchanged", timed(command(name, root / "2", "--workers", "2"))
    half = command(name, root / "half", "--workers", "2")
    yield "stopped", stopped(half, 0.35 * one)
    yield "gone on", timed(half)


@click.command(help=(__doc__ or "").splitlines()[0])
@click.argument("names", nargs=-1)
@click.option("--before", type=click.Path(path_type=Path))
def main(names: tuple[str, ...], before: Path | None) -> None:
    model = [line.partition(": ")[2] for line in Path("/proc/cpuinfo").read_text().splitlines()
             if line.startswith("model name")]  # fmt: skip
    click.echo(f"{(model or [platform.processor()])[0]}, {os.cpu_count()} cores")
    for name in names or NAMES:
        root = Path(tempfile.mkdtemp(prefix="run-cells-"))
        found = dict(rows(name, root, before))
        base = found.get("before", found["1 worker"])
        for kind, seconds in found.items():
            click.echo(f"{name:16} {kind:18} {seconds:7.1f} s {100 * seconds / base:5.0f} %")
        one, two = steps(root / "1"), steps(root / "2")
        beside = median(two[m] / one[m] for m in one if m in two)
        click.echo(f"{name:16} steps beside        {beside:.2f}")
        shutil.rmtree(root)


if __name__ == "__main__":
    main()
