"""Terminal output of a run: verdict, checks, identified values, ranking, next steps."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from validate.catalogue import experiment_files
from validate.commands.arguments import Detail
from validate.commands.display import print_views, relative, say, shown
from validate.commands.screen import (
    Passage,
    check_passages,
    cut,
    rows,
    sentences,
    show,
    width,
    worst_first,
)
from validate.compare.overall_verdict import correction
from validate.compare.result import KINDS, Result
from validate.numbers import at_load, duration, rate, with_unit
from validate.pipeline.calibration.fitted_moduli import sentence
from validate.pipeline.experiment.experiment import Experiment
from validate.report.sections.observations import timed
from validate.report.stored.store import check_members, document, figure_members
from validate.report.write import table_of
from validate.solve.types import Run

Json = Mapping[str, Any]
_FIRST = 6  # places of a ranking
_TRIED = {"m": "mm", "N": "N", "Pa": "Pa"}  # units of errors that `study choose` takes


def show_run(
    result: Result,
    name: str,
    page: Path,
    seconds: float,
    detail: Detail = "screen",
    stored: str = "",
) -> None:
    """Print the answer of a run on one screen; "full" adds every check and notice. `stored` says
    what of it was computed before."""
    verbose = detail == "full"
    ranking = _ranking(result)
    causes = "Likely causes: share of the squared error, next check"
    end = f"{seconds:.1f} s wall time{stored}; report: {relative(page)}"
    # What the recording is and what was chosen on it, where that limits what the verdict says
    texts = [] if result.kind == "measured" else [f"Recording: {KINDS[result.kind]}."]
    texts += [f"{m.name}: {m.chosen}." for m in result.methods if m.checks and m.chosen]
    moved = [f"the verdict changed: {m.words}" for m in result.moved] if result.expected else []
    findings = [f"{v.name} by {v.by}: {v.finding}" for v in result.identified_values if v.finding]
    warnings = dict.fromkeys((*moved, *result.warnings, *result.locking, *findings))
    # Name, value with half of its 95 % interval, and the method, a line each
    identified = []
    for v in result.identified_values:
        low, high = v.interval
        value, half = with_unit(v.value, v.unit, 4), with_unit((high - low) / 2, v.unit, 2)
        identified.append([v.name, f"{value} ± {half}", f"by {v.by}"])
    # Why methods did not finish; one line for those with the same reason
    ends: dict[str, list[str]] = {}
    for method in result.methods:
        if ended := next((r.outcome for r in method.runs if not r.finished), None):
            why = f"{ended.state} at step {ended.step}: {ended.why}"
            ends.setdefault(why, []).append(method.name)
    unfinished = [f"{', '.join(names)}: {why}" for why, names in ends.items()]
    # The likely causes of the first difference, with what would decide each
    cells: list[list[str]] = []
    if found := next((e for e in result.exhibits if e.anchor == "likely-causes"), None):
        every = found.tables[0].rows
        first = [r for r in every if r[:2] == every[0][:2]]
        cells = [[f"{r[2]}. {r[3]}", f"{float(str(r[4])):.0f} %", str(r[6])] for r in first]
    show(
        (
            sentences([headline(result)], None),
            sentences(texts, None),
            sentences((f"warning: {text}" for text in warnings), keep=2, most=4),
            *([] if verbose else check_passages(_checks(result))),
            sentences(unfinished, keep=2, most=4),
            Passage("Identified, with 95 % intervals", rows([""] * 3, identified), 1, 4),
            Passage(causes, () if verbose else rows([""] * 3, cells, soft=2), 2, 4),
            *([ranking] if ranking else []),
            figures_line([figure_members(p) for p in result.published], name),
            Passage("Next", () if verbose else tuple(_next(result, name))[:3]),
            Passage("", () if verbose else (end,)),
        ),
        detail,
    )
    if verbose:
        # Every check with both answers, every notice of a method, every printed figure
        print_views(
            table_of(result, document(result, ""), result.name), "checks", "published", "settings"
        )
        for method in result.methods:
            for words in dict.fromkeys(w for r in method.runs for w in r.said):
                say(f"{method.name}: {words}", indent="  ")
        for v in result.identified_values:
            say(f"{sentence(v)}.", indent="  ")
        say(f"\n{result.sentence}")
        say(end)


def called(experiment: Experiment) -> str:
    """What a command calls the experiment here: its name, or its file where that is not found."""
    path = experiment.path
    known = experiment_files(Path.cwd()).get(experiment.name)
    return experiment.name if path is None or known == path.resolve() else relative(path)


def headline(result: Result) -> str:
    """Return the verdict in one sentence: both answers, and the number of checks."""
    found = result.overall
    doubt = ", with warnings" if result.warnings and found.passed else ""
    required = len(found.met) + len(found.failed) + len(found.undecided)
    parts = [f"{len(found.met)} of {required} requirements are met"] if required else []
    if found.differs:
        names = {c.name for c in found.differs}
        parts.append(f"{len(names)} of {found.total} errors differ from zero")
    elif any(c.validation == "not distinguishable" for c in result.checks):
        tested = found.total if found.alone else 0
        more = correction(result.checks, tested)
        parts.append(f"no error is distinguishable from zero{more}")
    if not found.total:
        parts.append("no accepted method was run")
    elif found.absent:
        parts.append(f"{len(found.absent)} of {len(result.checks)} checks compared nothing")
    elif not found.evidence:
        parts.append("no check is evidence")
    quick = " (quick run)" if result.quick else ""
    return f"{result.name}: {found.word}{doubt}{quick}; {'; '.join(parts) or found.counted}."


def _checks(result: Result) -> list[Json]:
    return [{"method": m.name, **check_members(c)} for m in result.methods for c in m.checks]


# --- methods --------------------------------------------------------------------------------------


def _ranking(result: Result) -> Passage | None:
    """Methods by the error that decides, with their rates; None where fewer than two have it."""
    # The score that most methods share: of the worst check where two have it, else over time
    counts = Counter(s.name for m in result.methods for s in m.scores)
    worst = [c["name"] for c in worst_first(_checks(result))[:1]]
    over_time = [n for n in counts if n.endswith((".rmse", ".rms")) and "@" not in n]
    at_load_ = [n for n in counts if ".rms@" in n]
    sizes = {n: median(abs(s.value) for m in result.methods for s in m.scores if s.name == n)
             for n in over_time}  # fmt: skip
    over_time.sort(key=lambda n: (-counts[n], -sizes[n]))
    first = [*over_time, *worst] if _filters(result) else [*worst, *over_time]
    names = [*first, *sorted(at_load_, key=lambda n: -counts[n])]
    by = next((n for n in names if counts[n] > 1), None)
    if by is None:
        return None
    scored = [(m, s) for m in result.methods for s in m.scores if s.name == by]
    # Errors that differ by rounding alone are equal: the checked method stands first.
    scored.sort(key=lambda pair: (float(f"{abs(pair[1].value):.9g}"), not pair[0].accepted))
    places = list(enumerate(scored, 1))
    first = [p for p in places[:_FIRST] if not p[1][0].accepted]
    checked = [p for p in places if p[1][0].accepted]
    ordered = [*sorted((*first, *checked), key=lambda p: p[0])]
    ordered += [p for p in places if p not in ordered]
    cells = [
        [f"{i}. {m.name}{' (checked)' if m.accepted else ''}", shown(abs(s.value), s.unit),
         *_speed(m.run)]
        for i, (m, s) in ordered
    ]  # fmt: skip
    quantity, _, load = by.partition("@")
    where = f" {at_load(load)}" if load else ""
    against = scored[0][1].against
    if not against.startswith(("the ", "what ")):
        against = f"the {against}"
    title = cut(f"Methods by {quantity}{where}, against {against}", width())
    lines = rows(["", "error", "rate", "p99 of a step"], cells)
    return Passage(title, lines, 4, _FIRST + 1, "more methods: --verbose")


def _speed(run: Run) -> tuple[str, str]:
    times = timed(run)
    return (rate(times.rate_hz), duration(times.p99)) if times else ("–", "–")


# --- figures and next steps -----------------------------------------------------------------------


def figures_line(figures: Sequence[Json], name: str = "") -> Passage:
    """How many printed results have which verdict, in one sentence; none without any."""
    results = [f for f in figures if f["result"]]
    if not results:
        return sentences(())
    counts = Counter(str(f["verdict"]) for f in results)
    words = ", ".join(f"{n} {verdict}" for verdict, n in counts.most_common())
    more = f"; validate check {name}" if name else "."
    return sentences([f"Of {len(results)} printed figures: {words}{more}"], None)


def _next(result: Result, name: str) -> Iterator[str]:
    """Commands that would answer what this run leaves open."""
    found = result.overall
    steps: list[tuple[str, str]] = []
    if result.quick:
        steps.append((f"validate run {name}", "the full run"))
    if not found.passed and any(p.path == "mesh.budget" and p.default for p in result.parameters):
        steps.append((f"validate run {name} --refine", "finer meshes, more load steps"))
    if result.identified_values and not found.passed:
        steps.append((f"validate identify {name}", "identify uncertain parameters"))
    meshed = any(len(m.scene.mesh.nodes) for m in result.methods)
    if meshed and not found.passed:
        steps.append((f"validate study tradeoff {name}", "error of other solvers and meshes"))
    if _filters(result):
        steps.append((f"validate study filters {name}", "rank filter settings"))
    worst = next((c for c in found.met if c.limit and c.unit in _TRIED), None)
    if meshed and found.passed and worst:
        limit = with_unit(worst.limit, worst.unit).replace(" ", "")
        steps.append(
            (f"validate study choose {name} --error {limit} --rate 100Hz", "the cheapest method")
        )
    moving = any(material.rho for m in result.methods for material in m.scene.materials)
    if meshed and moving and any(len(m.run.t) > 10 for m in result.methods):
        steps.append((f"validate study stability {name}", "the largest stable step"))
    width = max((len(command) for command, _ in steps[:3]), default=0)
    for command, why in steps:
        yield f"  {command:<{width}}  {why}"


def _filters(result: Result) -> bool:
    return any("nis" in m.run.traces for m in result.methods)
