"""Does a ranking without truth pick a good filter? Every case of three twins, two noise seeds each.

python benchmarks/filter_rankings.py [NAME ...] [--seeds 301,302] [--workers N]

Seeds 301 and 302 were named before the first run; 11 and 12 were used to develop the score. Prints
one row a recording: the setting of least error at what was withheld, its true error, and the least
true error of all settings.
"""

import argparse
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from validate.engine.cell import Where
from validate.pipeline.experiment.find import find
from validate.study.filters.ranking import TruthPick
from validate.study.filters.study import study
from validate.study.sweep import named

SEEDS = (301, 302)
ROOT = Path(__file__).parents[1]


@dataclass(frozen=True)
class Candidates:
    """Methods and sweeps that are ranked on an experiment and its cases."""

    methods: tuple[str, ...]
    sweeps: tuple[str, ...]


CANDIDATES = {
    "kf_cube": Candidates(
        ("kf_printed", "kf_load", "kf_reduced", "kf_gated", "load_scale", "roukf", "roukf_tied",
         "enkf"),
        ("methods.kf_load.Q=1e-12,1e-11,1e-10,1e-9,1e-8",
         "methods.kf_reduced.load_walk=0.001,0.01,0.1,1",
         "methods.kf_printed.Q=1e-11,1e-10,1e-9,1e-8",
         "case=recorded,stiff_model,soft_model,layer,inclusion,nu,sparse,outliers,late"),
    ),
    "ekf_cube": Candidates(
        ("ekf_held", "ekf_node", "ekf_companion", "reduced_modes", "reduced_pod", "roukf", "enkf"),
        ("methods.reduced_modes.load_walk=0.03,0.3,3,30",
         "methods.reduced_pod.load_walk=0.03,0.3,3,30",
         "case=recorded,stiff_model,stiff_model_200Hz,nu"),
    ),
    "ekf_cone": Candidates(
        ("ekf_held", "ekf_companion", "reduced_modes", "reduced_pod"),
        ("methods.reduced_modes.load_walk=0.1,1,10,100",
         "methods.reduced_pod.load_walk=0.1,1,10,100",
         "case=recorded,small"),
    ),
}  # fmt: skip


def picks(
    name: str, seeds: tuple[int, ...], out: Path, workers: int | None = 0
) -> tuple[TruthPick, ...]:
    """Of every case and seed of an experiment."""
    of = CANDIDATES[name]
    found = study(
        find(name, ROOT), of.sweeps, methods=of.methods, seeds=seeds, out=out, where=Where(workers)
    )
    return found.picks


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(CANDIDATES))
    parser.add_argument("--seeds", default=",".join(map(str, SEEDS)))
    parser.add_argument("--workers", type=int)
    given = parser.parse_args()
    seeds = tuple(int(s) for s in given.seeds.split(","))
    found: list[tuple[str, TruthPick]] = []
    print("experiment case seed | picked, true error / mm | best, true error / mm | ratio")
    with tempfile.TemporaryDirectory() as folder:
        for name in given.names:
            for p in picks(name, seeds, Path(folder), given.workers):
                found.append((name, p))
                picked, best = (
                    f"{c.method} {named(c.settings)} {1e3 * e:.4f}"
                    for c, e in ((p.cell, p.error), (p.best, p.least))
                )
                print(f"{name} {named(p.condition)} {p.seed} | {picked} | {best} | {p.ratio:.2f}")
    near = sum(p.near for _, p in found)
    print(f"within 10 % of the best true error: {near} of {len(found)} ({near / len(found):.0%})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
