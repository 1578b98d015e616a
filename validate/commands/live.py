"""`validate live`: a model in real time, driven by a tool."""

import json
import shlex
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np

from validate.catalogue import reports_of
from validate.commands.arguments import complain, pairs
from validate.commands.display import relative, say, table
from validate.commands.run import ask_about
from validate.errors import UsageError
from validate.pipeline.experiment.find import find
from validate.pipeline.experiment.options import Options
from validate.pipeline.live import Listener, LiveRun, Prepared, live, prepared, written
from validate.pipeline.live import realtime as scheduled
from validate.pipeline.live.listener import RESYNC
from validate.places import try_file
from validate.recording.mcap.write import write_recording
from validate.solve.haptic.rates import TickTimes


def run(
    name: str,
    *,
    named: tuple[Path, ...],
    values: tuple[str, ...],
    method: str,
    seconds: float | None,
    listen: int | None,
    realtime: bool,
    out: Path | None,
    as_json: bool,
) -> int:
    """Runs, tells of its ticks and writes what it did; 0 whenever it ran."""
    if seconds is not None and not 0 < seconds < np.inf:
        raise UsageError(f"--seconds {seconds:g}: expected a number above 0")
    experiment = find(name, Path.cwd(), named)
    options = Options(pairs(values, "--set"))
    ask_about(experiment, options.values)
    file = out or reports_of(experiment.path, None) / f"{experiment.name}-live.mcap"
    file.parent.mkdir(parents=True, exist_ok=True)
    try_file(file)
    made = prepared(experiment, options, method)
    for finding in made.findings:
        complain(f"the path: {finding}")
    start = time.time_ns()
    with scheduled(wanted=realtime):
        done = _lived(made, seconds, listen)
    # What is told, SI
    said: dict[str, Any] = {
        "experiment": made.experiment.name, "method": made.method, "source": done.kind,
        "rate_hz": done.rate, "ticks": done.ticks, "missed": done.missed,
        "answered": len(done.t), "findings": dict(sorted(done.findings.items())),
        "force_limit": made.stepper.limit, "times": {}, "recording": None,
    }  # fmt: skip
    groups = {"due to force": done.late, "work": done.work,
              "work, changes of contact": done.work[done.changed > 0]}  # fmt: skip
    names = (*(f"p{100 * q:g}" for q in TickTimes.shares), "max")
    said["times"] = {
        what: dict(zip(names, TickTimes(v).quantiles, strict=True)) | {"n": len(v)}
        for what, v in groups.items() if len(v)
    }  # fmt: skip
    said["largest_force"] = float(np.linalg.norm(done.F, axis=1).max()) if len(done.F) else None
    said["realtime"] = realtime
    if len(done.t):
        write_recording(written(done, made, start), file)
        said["recording"] = str(file)
        given = (*values, f"recording={relative(file)}")
        said["replay"] = shlex.join(
            ["validate", "run", name, *(w for v in given for w in ("--set", v))]
        )
    if as_json:
        print(json.dumps(said, indent=1, ensure_ascii=False))
    else:
        share = 100 * done.missed / done.ticks if done.ticks else 0.0
        say(f"{said['experiment']}, {said['method']}: {done.ticks} ticks at {done.rate:.4g} Hz, "
            f"{done.missed} missed ({share:.3g} %), {said['answered']} answered")  # fmt: skip
        rows = [[k, str(int(v["n"])), *(f"{1e6 * v[q]:.0f}" for q in v if q != "n")]
                for k, v in said["times"].items()]  # fmt: skip
        heads = ["microseconds", "n", *(f"{100 * q:g} %" for q in TickTimes.shares), "longest"]
        table("Times of a tick", heads, rows)
        if jumps := said["findings"].get("resynchronised"):
            complain(
                f"resynchronised {jumps} times, each after {RESYNC} late or out-of-order packets "
                "in a row: the clock jumped, or the device restarted"
            )
        if said["findings"]:
            table(
                "Found", ["what", "count"], [[k, str(v)] for k, v in said["findings"].items() if v]
            )
        if said["recording"]:
            say(f"\nwritten: {relative(file)}; replay it with `{said['replay']}`")
        else:
            say("\nno packet was answered, so there is no recording")
    return 0


def _lived(made: Prepared, seconds: float | None, listen: int | None) -> LiveRun:
    if listen is None:
        return made.path.live(made.stepper, seconds)
    with closing(Listener(*made.reach, made.stepper.rate, listen)) as source:
        host, port = source.address
        complain(f"listens on {host} port {port} (UDP), see docs/how-to/live.md; Ctrl-C ends it")
        return live(made.stepper, source, seconds)
