"""`validate study coverage`: how often our own verdicts are wrong; runs, writes, prints."""

from pathlib import Path

from validate.cli.arguments import FAILED, OK, pairs
from validate.cli.chosen import ask_about
from validate.cli.screen import Passage, rows, sentences
from validate.cli.studying import StudyOptions, answer, running, written
from validate.replay.find import find
from validate.replay.named_run import differences, tag
from validate.replay.options import Options
from validate.study import coverage_page
from validate.study.coverage import Coverage, coverage
from validate.study.coverage_exhibits import HEAD, interval, percent, share_row
from validate.study.coverage_plan import DRAWS


def covering(
    name: str, common: StudyOptions, *, draws: int | None, noise: float, values: tuple[str, ...]
) -> int:
    """Judges drawn recordings of a perfect model; 0 where every check holds."""
    experiment = find(name, Path.cwd(), common.named)
    given = pairs(values, "--set")
    ask_about(experiment, given)
    words, content = differences(experiment, Options(given, (), common.quick))
    words += ["draws"] * (draws not in (None, DRAWS)) + ["noise"] * (noise != 1)
    place = f"coverage{tag(words, [content, draws, noise])}"
    with running(experiment, place, "coverage", common) as report:
        found = coverage(
            experiment, draws=draws, noise=noise, values=given, quick=common.quick,
            out=common.out, where=common.where, report=report,
        )  # fmt: skip
    page = written(experiment, coverage_page.told(found), place, common)
    if not common.as_json:
        answer(_passages(found), found.done, page, common.detail)
    return OK if found.passed else FAILED


def _passages(found: Coverage) -> list[Passage]:
    """Whether the verdicts are right as often as they say, then every quantity."""
    cells = [
        [f"{row[0]}: {row[1]}", row[2], row[3], row[-1]] for row in map(share_row, found.quantities)
    ]
    cells += [
        [f"{t.method}: all {t.checks} (Holm)", percent(t.share), interval(t.share),
         "holds" if t.holds else "too narrow"]
        for t in found.together
    ]  # fmt: skip
    quick = "QUICK: fewer draws; " if found.quick else ""
    notes = [
        f"{q.stated.name} ({q.method}): {q.finding.word}: {q.finding.words}"
        for q in found.quantities if q.finding.words
    ]  # fmt: skip
    title = "Verdicts on a perfect model"
    return [
        sentences([f"{quick}{coverage_page.sentence(found)}"], None),
        Passage(title, rows(["", *HEAD[2:4], "finding"], cells), 4),
        sentences(notes, keep=2, most=6),
    ]
