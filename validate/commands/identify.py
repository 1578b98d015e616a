"""`validate identify`: parameters with profile intervals, and their identifiability."""

from validate.commands.arguments import FAILED, OK, pairs
from validate.commands.display import shown
from validate.commands.screen import Passage, rows, sentences
from validate.commands.study import StudyOptions, answer, listed, noted, printed
from validate.library import studies
from validate.study.identify import study as identify_page
from validate.study.identify.study import units

_HEAD = ("", "value", "95 % from", "to", "identified")


def identifying(
    name: str, common: StudyOptions, *, parameters: str, seeds: int | None, values: tuple[str, ...]
) -> int:
    """Identify parameters; 0 where every requested one is identified, else 1."""
    with noted():
        done = studies.identified(
            common.experiment(name), common.settings, parameters=listed(parameters),
            starts=seeds, values=pairs(values, "--set"),
        )  # fmt: skip
    if not printed(done.page, common):
        estimates = [(one, e) for one in done.found.calibrated for e in one.found.estimates]
        known = sum(e.identified for _, e in estimates)
        quick = " (quick run)" if done.found.quick else ""
        first = f"{known} of {len(estimates)} parameters are identified{quick}."
        cells = []
        for one, e in sorted(estimates, key=lambda pair: pair[1].identified):
            method = one.problem.calibration.method
            name = e.name if e.name.startswith(method) else f"{e.name} ({method})"
            numbers = [shown(v, units(one)[e.name]) for v in (e.value, e.low, e.high)]
            cells.append([name, *numbers, "yes" if e.identified else "no"])
        passages = [
            sentences([first], None),
            sentences(identify_page.unidentified(done.found), 3, keep=3),
            Passage("Fitted values", rows(_HEAD, cells), 6),
        ]
        for one in done.found.calibrated if common.detail == "full" else ():
            names = one.found.space.names
            pairs_ = [
                f"{a} and {b} {one.found.correlations[i, j]:+.2f}"
                for i, a in enumerate(names) for j, b in enumerate(names) if i < j
            ]  # fmt: skip
            on = f"{one.problem.calibration.method} on {one.on}"
            words = f"{on}; correlations: {'; '.join(pairs_)}" if pairs_ else on
            passages.append(sentences([words]))
        answer(passages, done.found.done, done.page, common.detail)
    return OK if done.found.identified else FAILED
