"""`validate study filters`."""

from pathlib import Path

from validate.cli.display import console, progress, relative, table
from validate.cli.main import pairs
from validate.errors import UsageError
from validate.replay.find import find
from validate.report.numbers import MISSING, significant
from validate.study.exhibits import RANKING, ranking_row
from validate.study.filters import Study, cells_folder, study, study_folder
from validate.study.ranking import Ranking
from validate.study.stored_study import sentence, write_study
from validate.study.wording import named

_PLACES = 10  # of every ranking on the terminal
_COLUMNS = ("place", "method", "settings", "error / mm", "± 95 % / mm", "interval overlaps",
            "against #1", "NIS per dof / 1", "filter is", "step / ms",
            "gains repeat from step")  # fmt: skip


def filters(
    name: str,
    *,
    sweeps: tuple[str, ...],
    seeds: str,
    values: tuple[str, ...],
    methods: str,
    by: str,
    quick: bool,
    out: Path | None,
    workers: int | None,
    scheduler: str,
    as_json: bool,
) -> None:
    """Runs the study, writes its folder and prints the rankings."""
    experiment = find(name, Path.cwd())
    wanted = tuple(m.strip() for m in methods.split(",") if m.strip())
    settings, wanted_seeds = pairs(values, "--set"), seeds_of(seeds)
    try:
        with progress(f"{experiment.name}: study filters") as report:
            found = study(
                experiment, sweeps, methods=wanted, values=settings, seeds=wanted_seeds, by=by,
                quick=quick, out=out, workers=workers, scheduler=scheduler, report=report,
            )  # fmt: skip
    except KeyboardInterrupt:
        kept = sum(1 for _ in cells_folder(experiment, out).glob("*.json"))
        screen = console(error=True)
        screen.print(f"{kept} finished cells are kept; the same command goes on from there")
        raise
    page = write_study(found, study_folder(experiment, out))
    if as_json:
        print((page.parent / "results.json").read_text(encoding="utf-8"))
    else:
        _show(found, page)


def seeds_of(text: str) -> int | tuple[int, ...]:
    """`50`: so many; `3,7,9`: these."""
    try:
        numbers = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--seeds {text}: a number, or seeds between commas") from None
    return numbers if len(numbers) > 1 else numbers[0]


def _show(found: Study, page: Path) -> None:
    screen = console()
    for ranking in found.rankings:
        under = f" with {named(ranking.condition)}" if ranking.condition else ""
        screen.print(table(f"Ranking by {found.by}{under}", _COLUMNS, _rows(ranking)))
    for method, where, why in _failures(found):
        screen.print(f"failed: {method} ({where}): {why}", soft_wrap=True)
    cells, took = len(found.results), f"{found.seconds:.1f} s on {found.workers}"
    screen.print(f"\n{sentence(found)}", soft_wrap=True)
    for best in found.best:
        screen.print(best.line, soft_wrap=True)
    screen.print(
        f"{cells} cells, {found.reused} of them finished before; {took}; report: {relative(page)}",
        soft_wrap=True,
    )


def _rows(ranking: Ranking) -> list[list[str]]:
    pick = [RANKING.index(c) for c in _COLUMNS]
    shown = []
    for r in ranking.rows[:_PLACES]:
        row = ranking_row(r)
        shown.append([_text(row[i]) for i in pick])
    return shown


def _text(value: float | int | str | None) -> str:
    if value is None:
        return MISSING
    return significant(value) if isinstance(value, float) else str(value)


def _failures(found: Study) -> list[tuple[str, str, str]]:
    rows = [(c, why) for r in found.rankings for c, why in r.failed]
    return [(c.method, named(c.values), why) for c, why in rows[:_PLACES]]
