"""`validate identify`: parameters with profile intervals, or why they are not identifiable."""

from pathlib import Path

from validate.cli.arguments import FAILED, OK, pairs
from validate.cli.chosen import ask_about
from validate.cli.display import say, shown, table, warn
from validate.cli.studying import StudyOptions, end, running, written
from validate.replay.find import find
from validate.replay.named_run import differences, tag
from validate.replay.options import Options
from validate.study import identify_page
from validate.study.identify import STARTS, IdentifyStudy, identification
from validate.study.identify_exhibits import units, verdict

_HEAD = ("parameter", "value", "95 % from", "to", "verdict")


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
        _show(found)
        end(found.done, page)
    return OK if found.identified else FAILED


def _show(found: IdentifyStudy) -> None:
    for one in found.calibrated:
        known = units(one)
        rows = [
            [e.name, *(shown(v, known[e.name]) for v in (e.value, e.low, e.high)), verdict(e)]
            for e in one.found.estimates
        ]
        table(f"Fitted with {one.problem.calibration.method} on {one.on}", _HEAD, rows)
        names = one.found.space.names
        pairs_ = [
            f"{a} and {b} {one.found.correlations[i, j]:+.2f}"
            for i, a in enumerate(names) for j, b in enumerate(names) if i < j
        ]  # fmt: skip
        if pairs_:
            say(f"correlations: {'; '.join(pairs_)}", indent="  ")
    say(f"\n{identify_page.sentence(found)}")
    for line in identify_page.unidentified(found):
        warn(line)
