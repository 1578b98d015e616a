"""`validate identify`: parameters with profile intervals, or why they are not identifiable."""

from pathlib import Path

from validate.cli.arguments import FAILED, OK, Detail, pairs
from validate.cli.chosen import ask_about
from validate.cli.display import shown
from validate.cli.screen import Passage, rows, sentences
from validate.cli.studying import StudyOptions, answer, running, written
from validate.replay.find import find
from validate.replay.named_run import differences, tag
from validate.replay.options import Options
from validate.study import identify_page
from validate.study.identify import STARTS, IdentifyStudy, identification
from validate.study.identify_exhibits import units

_HEAD = ("", "value", "95 % from", "to", "identified")


def identifying(
    name: str, common: StudyOptions, *, parameters: str, seeds: int | None, values: tuple[str, ...]
) -> int:
    """Identifies; 0 where everything that was asked for is identified, else 1."""
    experiment = find(name, Path.cwd(), common.named)
    wanted = tuple(p.strip() for p in parameters.split(",") if p.strip())
    given = pairs(values, "--set")
    ask_about(experiment, given)
    words, content = differences(experiment, Options(given, (), common.quick))
    words += [w.partition("=")[0] for w in wanted]
    words += ["seeds"] * (seeds not in (None, STARTS))
    place = f"identify{tag(words, [content, sorted(wanted), seeds])}"
    with running(experiment, place, "identification", common) as report:
        found = identification(
            experiment, given, wanted, starts=seeds, quick=common.quick, out=common.out,
            where=common.where, report=report,
        )  # fmt: skip
    page = written(experiment, identify_page.told(found), place, common)
    if not common.as_json:
        answer(_passages(found, common.detail), found.done, page, common.detail)
    return OK if found.identified else FAILED


def _passages(found: IdentifyStudy, detail: Detail) -> list[Passage]:
    """How many parameters are identified, why others are not, then every value."""
    estimates = [(one, e) for one in found.calibrated for e in one.found.estimates]
    known = sum(e.identified for _, e in estimates)
    quick = " (quick run)" if found.quick else ""
    first = f"{known} of {len(estimates)} parameters are identified{quick}."
    cells = []
    for one, e in sorted(estimates, key=lambda pair: pair[1].identified):
        method = one.problem.calibration.method
        name = e.name if e.name.startswith(method) else f"{e.name} ({method})"
        numbers = [shown(v, units(one)[e.name]) for v in (e.value, e.low, e.high)]
        cells.append([name, *numbers, "yes" if e.identified else "no"])
    passages = [
        sentences([first], None),
        sentences(identify_page.unidentified(found), 3, keep=3),
        Passage("Fitted values", rows(_HEAD, cells), 6),
    ]
    for one in found.calibrated if detail == "full" else ():
        names = one.found.space.names
        pairs_ = [
            f"{a} and {b} {one.found.correlations[i, j]:+.2f}"
            for i, a in enumerate(names) for j, b in enumerate(names) if i < j
        ]  # fmt: skip
        on = f"{one.problem.calibration.method} on {one.on}"
        words = f"{on}; correlations: {'; '.join(pairs_)}" if pairs_ else on
        passages.append(sentences([words]))
    return passages
