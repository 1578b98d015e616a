"""Three parameters of a static body of 5184 unknowns, ten starts, profiles: how many seconds.

OMP_NUM_THREADS=1 python benchmarks/identify.py [WORKERS]    local processes (default 2)

The body is `benchmarks/identified_block.py`, Mooney-Rivlin in three load steps. Wall time is that
of all cells with nothing kept from before; CPU time is that of the processes, which a busy machine
changes less. November 2026: 240 s of CPU time (two free cores: not measured); 638 s of wall time
where some twenty processes shared them.
"""

import resource
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from validate.engine.cell import Where
from validate.numbers import significant
from validate.pipeline.experiment.find import load_file
from validate.study.identify.study import IdentifyStudy, identification

BLOCK = Path(__file__).with_name("identified_block.py")
WANTED_S = 180.0


def timed(workers: int) -> tuple[IdentifyStudy, float]:
    """The identification and its wall time s."""
    with tempfile.TemporaryDirectory() as out:
        start = perf_counter()
        found = identification(
            load_file(BLOCK), out=Path(out), where=Where(workers),
            report=lambda done, total, what: print(f"  {what}", file=sys.stderr),
        )  # fmt: skip
        return found, perf_counter() - start


def main() -> None:
    workers = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    found, seconds = timed(workers)
    (one,) = found.calibrated
    for e in one.found.estimates:
        low, high = significant(e.low, 4), significant(e.high, 4)
        print(f"{e.name}: {significant(e.value, 4)}, 95 % {low} to {high} (SI)")
    calls = sum(f.evaluations for f in one.found.fits)
    print(f"{len(one.found.fits)} starts ({calls} evaluations), {len(one.found.sides)} sides")
    print(
        f"{seconds:.0f} s of wall time on {workers} workers, {WANTED_S:.0f} s wanted; {cpu():.0f}"
        " s of CPU time"
    )


def cpu() -> float:
    """CPU seconds of this process and of the workers that ended."""
    each = (resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(r.ru_utime + r.ru_stime for r in each)


if __name__ == "__main__":
    main()
