"""A trade made rung by rung, from the cheapest methods on: a choice stops where it has enough."""

from collections.abc import Iterator
from pathlib import Path

from validate.replay.experiment import Experiment
from validate.replay.ladder import RUNGS, Rung, Trial
from validate.replay.ladder_default import trial_of
from validate.replay.options import Report
from validate.study.engine import CELLS, Finished, finish, study_folder
from validate.study.job import Where, job_of
from validate.study.trade import KIND, Trade, plan_of, trade_cells, traded
from validate.study.trade_cell import Measured, TradeCell


def rungs(
    experiment: Experiment,
    *,
    declared_law: bool = False,
    quick: bool = False,
    out: Path | None = None,
    where: Where | None = None,
    report: Report | None = None,
) -> Iterator[tuple[Rung, Trade]]:
    """The ladder from its cheapest rung on, each with a trade of all cells up to it.

    Nothing of a rung runs before it is asked for. `declared_law`: solvers at large strain are left
    out. As `trade` otherwise.
    """
    trial, job = trial_of(experiment, quick), job_of(experiment, quick=quick)
    cells, folder = trade_cells(trial, job), study_folder(experiment, KIND, out) / CELLS
    ran = waiting = tuple(c for c in cells if c.part != "solver")  # what errors are taken from
    done = Finished[Measured]({}, 0, 0.0, "")
    for rung in RUNGS:
        mine = [c for c in cells if c.part == "solver" and _on(trial, c, rung, declared_law)]
        if not mine:
            continue
        now = (*waiting, *mine)
        done = done.and_also(finish(plan_of(job, now), folder, where, _above(rung, report)))
        ran, waiting = (*ran, *mine), ()
        yield rung, traded(experiment, trial, ran, done, quick)


def _on(trial: Trial, cell: TradeCell, rung: Rung, declared_law: bool) -> bool:
    solver = trial.solver(cell.solver)
    return solver.rung == rung and not (declared_law and solver.law != "linear")


def _above(rung: Rung, report: Report | None) -> Report | None:
    """Progress that names the rung."""
    if report is None:
        return None
    return lambda done, total, text: report(done, total, f"rung '{rung}': {text}")
