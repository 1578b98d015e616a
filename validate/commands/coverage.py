"""`validate study coverage`: error rates of verdicts on a known truth."""

from validate.commands.arguments import FAILED, OK, pairs
from validate.commands.screen import Passage, rows, sentences
from validate.commands.study import StudyOptions, answer, noted, printed
from validate.library import studies
from validate.study.coverage import page as coverage_page
from validate.study.coverage.page import HEAD, interval, percent


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
