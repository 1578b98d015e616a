"""`validate study filters|stability|tradeoff|choose`: runs, writes the folder, prints."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.cli.arguments import FAILED, OK, Detail, command_line, pairs
from validate.cli.chosen import ask_about
from validate.cli.display import relative, say, table
from validate.cli.progress import progress
from validate.cli.screen import Passage, cut, rows, sentences, show
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

_SETTINGS = 30  # characters of the settings of a place
_RANKINGS = 2  # conditions whose rankings a screen shows


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
    detail: Detail = "screen"

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
        if common.detail == "full":
            _filters_in_full(found)
        answer(_filter_passages(found, common.detail), found.done, page, common.detail)
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
        ended = "" if endings is None else ending_words(endings)
        answer(_stability_passages(found, ended), found.done, page, common.detail)
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
        show([sentences([told.sentence, f"report: {relative(page)}"], None)], common.detail)
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
        answer(_trade_passages(found), found.done, page, common.detail)
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
        if common.detail == "full":
            _choice_in_full(choice)
        answer(_choice_passages(choice), choice.trade.done, page, common.detail)
    return OK if choice.pick is not None else FAILED


def seeds_of(text: str) -> int | tuple[int, ...]:
    """`50`: so many; `3,7,9`: these."""
    try:
        numbers = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise UsageError(
            f"--seeds {text}: expected a number of seeds, or seeds separated by commas"
        ) from None
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
        say(f"{kept} finished cells are kept; the same command resumes from there", error=True)
        raise


def written(experiment: Experiment, told: Findings, place: str, common: StudyOptions) -> Path:
    """The page's path; prints results.json where that is asked for."""
    by = made(command_line(), sources_of(experiment.path) if experiment.path else ())
    page = write_study(experiment, told, study_folder(experiment, place, common.out), by)
    if common.as_json:
        print((page.parent / "results.json").read_text(encoding="utf-8"))
    return page


def answer(passages: Sequence[Passage], done: Finished[Any], page: Path, detail: Detail) -> None:
    """Print a study on one screen, with the count of its cells and the place of its report."""
    where = f" on {done.workers}" if done.workers else ""
    ends = (
        f"{len(done.records)} cells, {done.reused} of them from an earlier run; "
        f"{done.seconds:.1f} s"
        f"{where}; report: {relative(page)}"
    )
    show([*passages, sentences([ends], None)], detail)


# --- terminals ------------------------------------------------------------------------------------


def _filter_passages(found: FilterStudy, detail: Detail) -> list[Passage]:
    """The best settings first, then the places of each condition."""
    passages = [
        sentences([filter_page.sentence(found)], None),
        sentences((b.line for b in found.best), None, keep=1, most=4),
    ]
    for ranking in found.rankings:
        under = f" with {named(ranking.condition)}" if ranking.condition else ""
        title = f"Ranking by {found.by}{under}"
        passages.append(Passage(title, _places(ranking, found), 2, 11))
        notes: list[str] = []
        if len(found.plan.seeds) == 1:
            notes += [] if ranking.blocks is None else [ranking.blocks.words]
            notes += [] if ranking.nested is None else [chosen_line(ranking.nested, found)]
        passages.append(sentences(notes, None, keep=1))
    if detail == "screen" and len(found.rankings) > _RANKINGS:
        left = len(found.rankings) - _RANKINGS
        passages = [
            *passages[: 2 + 2 * _RANKINGS],
            Passage("", (f"{left} more conditions: --verbose",)),
        ]
    if found.plan.single_words:
        passages.append(sentences([found.plan.single_words], None))
    passages.append(Passage("", ("!: NIS outside its 95 % band; *: on the Pareto front",)))
    failed = (
        f"failed: {cell.name} ({named(cell.values)}): {why}"
        for r in found.rankings for cell, why in r.failed
    )  # fmt: skip
    return [*passages, sentences(failed, keep=1, most=4)]


def _places(ranking: Ranking, found: FilterStudy) -> tuple[str, ...]:
    """Place, settings where any were swept, error with its interval, NIS ("!" outside of its 95 %
    band), times of a step, and "*" on the Pareto front."""
    swept = any(r.cell.settings for r in ranking.rows)
    error = ranking_head(found.unit)[3]
    head = ["", *(["settings"] if swept else []), error, "± 95 %", "NIS", "p50 / ms", "p99 / ms",
            "front"]  # fmt: skip
    cells = []
    for row in ranking.rows:
        entries = ranking_row(row, found.by)
        place, method, settings, mean, half = (_text(v) for v in entries[:5])
        nis, consistent, p50, p99, front = (_text(entries[i]) for i in (9, 10, 12, 13, 15))
        mark = "" if consistent in (MISSING, "consistent") else " !"
        own = [cut(settings, _SETTINGS)] if swept else []
        cells.append([f"{place}. {method}", *own, mean, half, nis + mark, p50, p99,
                      "*" if front == "front" else ""])  # fmt: skip
    return rows(head, cells)


def _filters_in_full(found: FilterStudy) -> None:
    """Every column of every ranking, as the report has them."""
    for ranking in found.rankings:
        cells = [[_text(v) for v in ranking_row(r, found.by)] for r in ranking.rows]
        under = f" with {named(ranking.condition)}" if ranking.condition else ""
        table(f"Ranking by {found.by}{under}, all columns", ranking_head(found.unit), cells)


def _text(value: float | int | str | None) -> str:
    if value is None:
        return MISSING
    return significant(value) if isinstance(value, float) else str(value)


def _stability_passages(found: Stability, endings: str) -> list[Passage]:
    quick = "QUICK: fewer points; " if found.quick else ""
    cells = [
        [p.name, _text(p.value), significant(p.limit), str(p.count),
         "holds" if p.holds else "FAILS"]
        for p in sorted(found.predictions, key=lambda p: p.holds)
    ]  # fmt: skip
    head = ["prediction", "worst / 1", "limit / 1", "count", "verdict"]
    return [
        sentences([f"{quick}{stability_page.sentence(found)}"], None),
        sentences([endings] if endings else [], None),
        Passage("Predictions against measured spectral radii", rows(head, cells), 3),
    ]


def _trade_passages(found: Trade) -> list[Passage]:
    passages = [
        sentences([trade_page.sentence(found)], None),
        _warned(found.locking),
    ]
    head = ["", "element", "mesh", f"error / {found.shown_unit}", "time / µs"]
    for by, title in (("error", "Pareto front, declared law"), ("total", "with the law's share")):
        cells = [
            [r.solver.name, r.element, str(r.level),
             significant(found.scale * float(getattr(r, by))),
             significant(1e6 * (r.time_s or 0.0))]
            for r in found.front(by).rows
        ]  # fmt: skip
        dominated = found.front(by).dominated
        text = [f"dominated ({by}): {'; '.join(dominated)}"] if dominated else []
        passages += [Passage(title, rows(head, cells), 3), sentences(text)]
    return passages


def _choice_passages(choice: Choice) -> list[Passage]:
    """The answer, then what each candidate method reaches."""
    first, *others = words(choice)
    cells = []
    for c in choice.ladder:
        error = None if c.best is None else error_of(c.best, choice.by)
        reached = _text(None if error is None else choice.trade.scale * error)
        cells.append([c.rung, reached, c.verdict])
    head = ["", f"error / {choice.trade.shown_unit}", "verdict"]
    ladder = rows(head, cells)
    return [
        sentences([first], None),
        sentences(others, None, keep=4),
        _warned(choice.trade.locking),
        Passage("Candidate methods", ladder, 4),
        sentences(choice.rejected, keep=1, most=4),
    ]


def _choice_in_full(choice: Choice) -> None:
    facts = [[f.name, f.value, f.means] for f in choice.facts]
    table("Key figures of the scene", ("quantity", "value", "suggests"), facts)
    evidence = [[c.rung, c.evidence] for c in choice.ladder]
    table("Evidence", ("candidate", "evidence"), evidence)
    if choice.excluded:
        cells = [[e.rung, e.candidate, _text(1e6 * e.bound), e.why] for e in choice.excluded]
        table("Excluded by a lower bound", ("candidate", "cell", "at least / µs", "why"), cells)


def _warned(texts: Sequence[str]) -> Passage:
    return sentences((f"warning: {text}" for text in texts), keep=2, most=4)
