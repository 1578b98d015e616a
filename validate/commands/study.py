"""`validate study filters|stability|tradeoff|choose`: run a study and print its result."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.checksums import read_sealed
from validate.commands.arguments import FAILED, OK, Detail, command_line, pairs
from validate.commands.display import relative, say, table
from validate.commands.progress import progress
from validate.commands.screen import Passage, cut, rows, sentences, show
from validate.compare.exhibit import Entry, TableCell, plain
from validate.engine.cell import Where
from validate.engine.execution import Finished
from validate.library import studies
from validate.numbers import MISSING, significant
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.find import find
from validate.report.stored.folder import MARK
from validate.study.choose.exhibits import words
from validate.study.choose.study import error_of
from validate.study.coverage import page as coverage_page
from validate.study.coverage.page import HEAD, interval, percent
from validate.study.filters import page as filter_page
from validate.study.filters.page import chosen_line, ranking_table
from validate.study.filters.ranking import Ranking
from validate.study.filters.ranking import sentence as ending_words
from validate.study.filters.study import FilterStudy
from validate.study.stability import page as stability_page
from validate.study.sweep import named
from validate.study.tradeoff import page as trade_page

_SETTINGS = 30  # characters of the settings of a place
_RANKINGS = 2  # conditions whose rankings a screen shows


@dataclass(frozen=True)
class StudyOptions:
    """Options of every study: the folder of reports, where its cells run, how it prints, further
    folders of experiments."""

    out: Path | None
    quick: bool
    workers: int | None
    scheduler: str
    as_json: bool
    named: tuple[Path, ...] = ()
    detail: Detail = "screen"

    @property
    def settings(self) -> studies.StudySettings:
        where = Where(self.workers, self.scheduler)
        return studies.StudySettings(self.out, self.quick, where, command_line(), progress)

    def experiment(self, name: str) -> Experiment:
        return find(name, Path.cwd(), self.named)


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
    """Rank filters; 0."""
    with noted():
        done = studies.filters(
            common.experiment(name), common.settings, sweeps=sweeps, seeds=seeds,
            values=pairs(values, "--set"), methods=listed(methods), by=by,
            hold_out=listed(hold_out),
        )  # fmt: skip
    if printed(done.page, common):
        return OK
    found = done.found
    if common.detail == "full":
        # Every column of every ranking, as the report has them
        for ranking in found.rankings:
            made = ranking_table(found, ranking, "")
            cells = [[_text(v) for v in row] for row in made.rows]
            under = f" with {named(ranking.condition)}" if ranking.condition else ""
            table(f"Ranking by {found.by}{under}, all columns", made.headings, cells)
    # The best settings first, then the places of each condition
    passages = [
        sentences([filter_page.sentence(found)], None),
        sentences((b.line for b in found.best), None, keep=1, most=4),
    ]
    shown = found.rankings[: _RANKINGS if common.detail == "screen" else None]
    for ranking in shown:
        under = f" with {named(ranking.condition)}" if ranking.condition else ""
        passages.append(Passage(f"Ranking by {found.by}{under}", _places(ranking, found), 2, 11))
        notes: list[str] = []
        if len(found.plan.seeds) == 1:
            notes += [] if ranking.blocks is None else [ranking.blocks.words]
            notes += [] if ranking.nested is None else [chosen_line(ranking.nested, found)]
        passages.append(sentences(notes, None, keep=1))
    if left := len(found.rankings) - len(shown):
        passages.append(Passage("", (f"{left} more conditions: --verbose",)))
    if found.plan.single_words:
        passages.append(sentences([found.plan.single_words], None))
    passages.append(Passage("", ("!: NIS outside its 95 % band; *: on the Pareto front",)))
    failed = (
        f"failed: {cell.name} ({named(cell.values)}): {why}"
        for r in found.rankings for cell, why in r.failed
    )  # fmt: skip
    passages.append(sentences(failed, keep=1, most=4))
    answer(passages, found.done, done.page, common.detail)
    return OK


def stability_map(name: str, common: StudyOptions) -> int:
    """Map where schemes are stable; 0 where all claims hold, or where nothing steps in time."""
    with noted():
        done = studies.stability_map(common.experiment(name), common.settings)
    found, page = done.found, done.page
    if printed(page, common):
        return OK if found.passed else FAILED
    if found.map is None:
        sentence = read_sealed(page.parent / MARK)["sentence"]
        show([sentences([sentence, f"report: {relative(page)}"], None)], common.detail)
    else:
        quick = "QUICK: fewer points; " if found.map.quick else ""
        cells = [
            [p.name, _text(p.value), significant(p.limit), str(p.count),
             "holds" if p.holds else "FAILS"]
            for p in sorted(found.map.predictions, key=lambda p: p.holds)
        ]  # fmt: skip
        head = ["prediction", "worst / 1", "limit / 1", "count", "verdict"]
        passages = [
            sentences([f"{quick}{stability_page.sentence(found.map)}"], None),
            sentences([] if found.endings is None else [ending_words(found.endings)], None),
            Passage("Predictions against measured spectral radii", rows(head, cells), 3),
        ]
        answer(passages, found.map.done, page, common.detail)
    return OK if found.passed else FAILED


def tradeoff(name: str, common: StudyOptions, simulators: tuple[str, ...] = ()) -> int:
    """Measure error against time; 0."""
    with noted():
        done = studies.tradeoff(common.experiment(name), common.settings, simulators)
    if printed(done.page, common):
        return OK
    found = done.found
    passages = [sentences([trade_page.sentence(found)], None), _warned(found.locking)]
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
    answer(passages, found.done, done.page, common.detail)
    return OK


def choosing(name: str, common: StudyOptions, *, error: str, rate: str, declared_law: bool) -> int:
    """Run the pilots of all candidates; 0 when a method meets both, else 1."""
    with noted():
        done = studies.choice(
            common.experiment(name), common.settings, error=error, rate=rate,
            declared_law=declared_law,
        )  # fmt: skip
    choice = done.found
    if not printed(done.page, common):
        if common.detail == "full":
            facts = [[f.name, f.value, f.means] for f in choice.facts]
            table("Key figures of the scene", ("quantity", "value", "suggests"), facts)
            evidence = [[c.rung, c.evidence] for c in choice.ladder]
            table("Evidence", ("candidate", "evidence"), evidence)
            if choice.excluded:
                head = ("candidate", "cell", "at least / µs", "why")
                table("Excluded by a lower bound", head, [
                    [e.rung, e.candidate, _text(1e6 * e.bound), e.why] for e in choice.excluded
                ])  # fmt: skip
        # The answer, then what each candidate method reaches
        first, *others = words(choice)
        cells = []
        for c in choice.ladder:
            measured = None if c.best is None else error_of(c.best, choice.by)
            reached = _text(None if measured is None else choice.trade.scale * measured)
            cells.append([c.rung, reached, c.verdict])
        columns = ["", f"error / {choice.trade.shown_unit}", "verdict"]
        passages = [
            sentences([first], None),
            sentences(others, None, keep=4),
            _warned(choice.trade.locking),
            Passage("Candidate methods", rows(columns, cells), 4),
            sentences(choice.rejected, keep=1, most=4),
        ]
        answer(passages, choice.trade.done, done.page, common.detail)
    return OK if choice.pick is not None else FAILED


# --- what all do ----------------------------------------------------------------------------------


@contextmanager
def noted() -> Iterator[None]:
    """An interruption says that finished cells are kept."""
    try:
        yield
    except KeyboardInterrupt as interrupted:
        for note in getattr(interrupted, "__notes__", ()):
            say(note, error=True)
        raise


def listed(text: str) -> tuple[str, ...]:
    """Return the parts of `A,B`."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def printed(page: Path, common: StudyOptions) -> bool:
    """Print results.json where it is requested, and return whether it is."""
    if common.as_json:
        print((page.parent / MARK).read_text(encoding="utf-8"))
    return common.as_json


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


def _places(ranking: Ranking, found: FilterStudy) -> tuple[str, ...]:
    """Place, settings where any were swept, error with its interval, NIS ("!" outside of its 95 %
    band), times of a step, and "*" on the Pareto front."""
    swept = any(r.cell.settings for r in ranking.rows)
    made = ranking_table(found, ranking, "")
    head = ["", *(["settings"] if swept else []), made.headings[3], "± 95 %", "NIS", "p50 / ms",
            "p99 / ms", "front"]  # fmt: skip
    cells = []
    for entries in made.rows:
        place, method, settings, mean, half = (_text(v) for v in entries[:5])
        nis, consistent, p50, p99, front = (_text(entries[i]) for i in (9, 10, 12, 13, 15))
        mark = "" if consistent in (MISSING, "consistent") else " !"
        own = [cut(settings, _SETTINGS)] if swept else []
        cells.append([f"{place}. {method}", *own, mean, half, nis + mark, p50, p99,
                      "*" if front == "front" else ""])  # fmt: skip
    return rows(head, cells)


def _text(entry: Entry | TableCell) -> str:
    value = plain(entry)
    if value is None:
        return MISSING
    return significant(value) if isinstance(value, float) else str(value)


def _warned(texts: Sequence[str]) -> Passage:
    return sentences((f"warning: {text}" for text in texts), keep=2, most=4)


def covering(
    name: str, common: StudyOptions, *, draws: int | None, noise: float, values: tuple[str, ...]
) -> int:
    """Compute verdicts on drawn recordings of a perfect model; 0 where every check holds."""
    with noted():
        done = studies.coverage_of_verdicts(
            common.experiment(name), common.settings, draws=draws, noise=noise,
            values=pairs(values, "--set"),
        )  # fmt: skip
    if not printed(done.page, common):
        cells = [
            [f"{q.method}: {q.stated.name}", percent(q.share), interval(q.share), q.finding.word]
            for q in done.found.quantities
        ]
        cells += [
            [f"{t.method}: all {t.checks} (Holm)", percent(t.share), interval(t.share),
             "holds" if t.holds else "too narrow"]
            for t in done.found.together
        ]  # fmt: skip
        quick = "QUICK: fewer draws; " if done.found.quick else ""
        notes = [
            f"{q.stated.name} ({q.method}): {q.finding.word}: {q.finding.words}"
            for q in done.found.quantities if q.finding.words
        ]  # fmt: skip
        title = "Verdicts on a perfect model"
        answer(
            [
                sentences([f"{quick}{coverage_page.sentence(done.found)}"], None),
                Passage(title, rows(["", *HEAD, "finding"], cells), 4),
                sentences(notes, keep=2, most=6),
            ],
            done.found.done,
            done.page,
            common.detail,
        )
    return OK if done.found.passed else FAILED
