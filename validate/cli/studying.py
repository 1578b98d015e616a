"""`validate study filters|stability|tradeoff|choose`: runs, writes the folder, prints."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.cli.arguments import FAILED, OK, command_line, pairs
from validate.cli.chosen import ask_about
from validate.cli.display import fits, relative, say, table, warn
from validate.cli.progress import progress
from validate.errors import UsageError
from validate.replay.experiment import Experiment
from validate.replay.find import find, sources_of
from validate.replay.named_run import differences, tag
from validate.replay.options import Options, Report
from validate.report.folder import locked, try_results
from validate.report.made import made
from validate.report.numbers import MISSING, significant
from validate.study import filter_page, stability_page, still_page, trade_page
from validate.study.choose import Choice, choose, error_of, wanted
from validate.study.choose_effects import stored_effects
from validate.study.choose_exhibits import words
from validate.study.chosen_exhibits import chosen_line
from validate.study.climb import Climb
from validate.study.engine import CELLS, Finished, study_folder
from validate.study.filter_exhibits import ranking_head, ranking_row
from validate.study.filter_stability import filter_endings, with_endings
from validate.study.filter_stability import sentence as ending_words
from validate.study.filters import FilterStudy, study
from validate.study.gain import GainMap, gain_map
from validate.study.job import Where
from validate.study.ranking import Ranking
from validate.study.stability import Stability, stability
from validate.study.study_page import Findings, write_study
from validate.study.sweep import named
from validate.study.trade import Trade, again, trade

_PLACES = 10  # of every ranking on the terminal
# Columns of a ranking, and of one where those have no room: the report has all.
_COLUMNS = (0, 1, 2, 3, 4, 8, 9, 10, 11, 12, 13, 15)
_FEWER = (0, 1, 2, 3, 4, 8, 12, 13)
_FEW = (0, 1, 2, 3, 8, 12, 13)


@dataclass(frozen=True)
class StudyOptions:
    """What every study is told: where its folder lies, where its cells run, how it prints, which
    folders of experiments the user named."""

    out: Path | None
    quick: bool
    workers: int | None
    scheduler: str
    as_json: bool
    named: tuple[Path, ...] = ()

    @property
    def where(self) -> Where:
        return Where(self.workers, self.scheduler)


def filters(
    name: str,
    common: StudyOptions,
    *,
    sweeps: tuple[str, ...],
    seeds: str,
    values: tuple[str, ...],
    methods: str,
    by: str,
    hold_out: str,
) -> int:
    """Ranks filters; 0."""
    experiment = find(name, Path.cwd(), common.named)
    chosen = tuple(m.strip() for m in methods.split(",") if m.strip())
    given = pairs(values, "--set")
    ask_about(experiment, given)
    words, content = differences(experiment, Options(given, chosen, common.quick))
    words += [text.partition("=")[0].strip() for text in sweeps]
    words += ["seeds"] * bool(seeds) + [by] * bool(by) + ["hold_out"] * bool(hold_out)
    kept = tuple(m.strip() for m in hold_out.split(",") if m.strip())
    place = f"filters{tag(words, [content, sorted(sweeps), seeds, by, kept])}"
    with running(experiment, place, "filters", common) as report:
        found = study(
            experiment, sweeps, methods=chosen, values=given,
            seeds=seeds_of(seeds) if seeds else None, by=by, hold_out=kept,
            quick=common.quick, out=common.out, where=common.where, report=report,
        )  # fmt: skip
    page = written(experiment, filter_page.findings(found), place, common)
    if not common.as_json:
        _show_filters(found)
        end(found.done, page)
    return OK


def stability_map(name: str, common: StudyOptions) -> int:
    """Maps where schemes are stable; 0 where all claims hold, or where nothing steps in time."""
    experiment = find(name, Path.cwd(), common.named)
    place = f"stability{_quick(common)}"
    with running(experiment, place, "stability", common) as report:
        found = stability(
            experiment, quick=common.quick, out=common.out, where=common.where, report=report
        )
        still = None
        if found is None:
            still = gain_map(experiment, out=common.out, where=common.where, report=report)
        endings = filter_endings(
            experiment, quick=common.quick, out=common.out, where=common.where, report=report
        )
    if found is None:
        return _still(experiment, still, place, common)
    told = stability_page.told(found)
    if endings is not None:
        told = with_endings(told, endings)
    page = written(experiment, told, place, common)
    if not common.as_json:
        _show_stability(found)
        if endings is not None:
            say(ending_words(endings))
        end(found.done, page)
    return OK if found.passed and not (endings and endings.bugs) else FAILED


def _still(experiment: Experiment, still: GainMap | None, place: str, common: StudyOptions) -> int:
    """A static experiment: the gain of its loop, or that nothing is stepped."""
    told = (
        still_page.told_nothing(experiment, common.quick)
        if still is None
        else still_page.told_gain(still, common.quick)
    )
    page = written(experiment, told, place, common)
    if not common.as_json:
        say(f"{told.sentence}\nreport: {relative(page)}")
    return FAILED if told.passed is False else OK


def tradeoff(name: str, common: StudyOptions, guests: tuple[str, ...] = ()) -> int:
    """Measures error against time; 0."""
    experiment = find(name, Path.cwd(), common.named)
    words = ["quick"] * common.quick + ["guest"] * bool(guests)
    place = f"tradeoff{tag(words, [common.quick, guests] if guests else common.quick)}"
    with running(experiment, place, "pilot runs", common) as report:
        found = trade(
            experiment, quick=common.quick, guests=guests, out=common.out, where=common.where,
            report=report,
        )  # fmt: skip
    page = written(experiment, trade_page.told(found), place, common)
    if not common.as_json:
        _show_trade(found)
        end(found.done, page)
    return OK


def choosing(name: str, common: StudyOptions, *, error: str, rate: str, declared_law: bool) -> int:
    """Runs the pilots of all candidates; 0 when a method meets both, else 1."""
    want = wanted(error, rate)
    experiment = find(name, Path.cwd(), common.named)
    words = ["quick"] * common.quick + [error, rate] + ["declared_law"] * declared_law
    place = f"choose{tag(words, [common.quick, want, declared_law])}"
    with running(experiment, place, "pilot runs", common) as report:
        effects = stored_effects(experiment, common.out)
        climb = Climb(
            experiment, unit=want.unit, effects=effects, declared_law=declared_law,
            quick=common.quick, out=common.out, where=common.where, report=report,
        )  # fmt: skip
        choice = choose(
            climb, want, declared_law,
            lambda trade, row, dt: again(trade, row, dt, common.out, common.where), effects,
        )  # fmt: skip
    page = written(experiment, trade_page.told_choice(choice), place, common)
    if not common.as_json:
        _show_choice(choice)
        end(choice.trade.done, page)
    return OK if choice.pick is not None else FAILED


def seeds_of(text: str) -> int | tuple[int, ...]:
    """`50`: so many; `3,7,9`: these."""
    try:
        numbers = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--seeds {text}: a number, or seeds between commas") from None
    return numbers if len(numbers) > 1 else numbers[0]


# --- what all do ----------------------------------------------------------------------------------


def _quick(common: StudyOptions) -> str:
    """A quick study has a folder of its own."""
    return tag(["quick"] * common.quick, common.quick)


@contextmanager
def running(
    experiment: Experiment, place: str, title: str, common: StudyOptions
) -> Iterator[Report]:
    """A progress bar, once the place was tried; an interruption says that cells are kept."""
    folder = study_folder(experiment, place, common.out)
    try:
        with locked(folder):
            try_results(folder, (CELLS,))
            with progress(f"{experiment.name}: {title}") as report:
                yield report
    except KeyboardInterrupt:
        kind = place.partition("+")[0].replace("choose", "tradeoff")  # whose cells it climbs over
        cells = study_folder(experiment, kind, common.out) / CELLS
        kept = sum(1 for _ in cells.glob("*.json"))
        say(f"{kept} finished cells are kept; the same command goes on from there", error=True)
        raise


def written(experiment: Experiment, told: Findings, place: str, common: StudyOptions) -> Path:
    """The page's path; prints results.json where that is asked for."""
    by = made(command_line(), sources_of(experiment.path) if experiment.path else ())
    page = write_study(experiment, told, study_folder(experiment, place, common.out), by)
    if common.as_json:
        print((page.parent / "results.json").read_text(encoding="utf-8"))
    return page


def end(done: Finished[Any], page: Path) -> None:
    where = f" on {done.workers}" if done.workers else ""
    say(
        f"{len(done.records)} cells, {done.reused} of them finished before; {done.seconds:.1f} s"
        f"{where}; report: {relative(page)}"
    )


# --- terminals ------------------------------------------------------------------------------------


def _show_filters(found: FilterStudy) -> None:
    for ranking in found.rankings:
        under = f" with {named(ranking.condition)}" if ranking.condition else ""
        head = ranking_head(found.unit)
        for pick in (_COLUMNS, _FEWER, _FEW):
            columns = tuple(head[i] for i in pick)
            rows = _places(ranking, pick, found.by)
            if fits(columns, rows):
                break
        table(f"Ranking by {found.by}{under}", columns, rows)
        if len(found.plan.seeds) == 1 and ranking.blocks is not None:
            say(f"{ranking.blocks.words}", indent="  ")
        if ranking.nested is not None and len(found.plan.seeds) == 1:
            say(chosen_line(ranking.nested, found), indent="  ")
    if found.plan.single_words:
        say(found.plan.single_words, indent="  ")
    failed = [pair for r in found.rankings for pair in r.failed]
    for cell, why in failed[:_PLACES]:
        say(f"failed: {cell.name} ({named(cell.values)}): {why}", indent="  ")
    say(f"\n{filter_page.sentence(found)}")
    for best in found.best:
        say(best.line, indent="  ")


def _places(ranking: Ranking, pick: Sequence[int], by: str) -> list[list[str]]:
    rows = [ranking_row(r, by) for r in ranking.rows[:_PLACES]]
    return [[_text(row[i]) for i in pick] for row in rows]


def _text(value: float | int | str | None) -> str:
    if value is None:
        return MISSING
    return significant(value) if isinstance(value, float) else str(value)


def _show_stability(found: Stability) -> None:
    rows = [
        [p.name, _text(p.value), significant(p.limit), str(p.count),
         "holds" if p.holds else "FAILS"]
        for p in found.predictions
    ]  # fmt: skip
    head = ("prediction", "worst / 1", "limit / 1", "count", "verdict")
    table("Predictions against measured radii", head, rows)
    quick = "QUICK: fewer points; " if found.quick else ""
    say(f"\n{quick}{stability_page.sentence(found)}")


def _show_trade(found: Trade) -> None:
    head = ("solver", "element", "mesh", "error / mm", "time / us")
    for by, title in (("error", "Pareto front, declared law"), ("total", "with the law's share")):
        rows = [
            [r.solver.name, r.element, str(r.level), significant(1e3 * float(getattr(r, by))),
             significant(1e6 * (r.time_s or 0.0))]
            for r in found.front(by).rows
        ]  # fmt: skip
        table(title, head, rows)
    for by in ("error", "total"):
        if off := found.front(by).dominated:
            say(f"dominated ({by}): {'; '.join(off)}", indent="  ")
    for warning in found.locking:
        warn(warning)
    say(f"\n{trade_page.sentence(found)}")


def _show_choice(choice: Choice) -> None:
    for warning in choice.trade.locking:
        warn(warning)
    rows = [[f.name, f.value, f.means] for f in choice.facts]
    table("The scene's own numbers", ("what", "value", "asks for"), rows)
    rows, scale = [], choice.trade.scale
    for c in choice.ladder:
        error = None if c.best is None else error_of(c.best, choice.by)
        rows.append(
            [c.rung, c.verdict, _text(None if error is None else scale * error), c.evidence]
        )
    head = ("rung", "verdict", f"error / {choice.trade.shown_unit}", "evidence")
    table("The ladder", head, rows)
    if choice.excluded:
        rows = [[e.rung, e.candidate, _text(1e6 * e.bound), e.why] for e in choice.excluded]
        table("Left out by a bound", ("rung", "candidate", "at least / us", "why"), rows)
    say("")
    for line in (*choice.rejected, *words(choice)):
        say(line, indent="  ")
