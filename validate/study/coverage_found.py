"""What the draws of a coverage study say of every check, of all together, and of wrong models."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validate.compare.coverage import (
    MEASUREMENT,
    MOST,
    Finding,
    Share,
    Term,
    find_fault,
    reach,
    term,
)
from validate.compare.verdict import OWN_COVARIANCE
from validate.study.coverage_bench import ExactReading, Stated
from validate.study.coverage_cell import PERFECT, Draws, Given, Judged
from validate.study.coverage_plan import World
from validate.study.store import Record


@dataclass(frozen=True)
class Quantity:
    """One check of a method: how often the perfect model differs, and by which term.

    `off` is the largest error of the linear response, in the check's unit; None: solved whole.
    """

    method: str
    stated: Stated
    share: Share
    undecided: Share
    terms: tuple[Term, ...]
    finding: Finding
    judged: Judged
    spread: float
    u_val: float | None
    off: float | None

    @property
    def holds(self) -> bool:
        return self.finding.word in ("holds", "blunt", "no evidence")


@dataclass(frozen=True)
class Power:
    """How often a check (None: all together) calls a model different whose parameter is wrong;
    `why` there is no share."""

    method: str
    name: str | None
    path: str
    by: float
    share: Share | None
    why: str = ""


@dataclass(frozen=True)
class JointShare:
    """A method's verdict over all its checks, corrected for their number."""

    method: str
    share: Share
    undecided: Share
    checks: int

    @property
    def holds(self) -> bool:
        """Holm's correction keeps the share at most, not at, its level."""
        return self.share.value <= MOST


def _joined(records: Sequence[Draws], label: str, name: str) -> Judged:
    parts = [r.worlds[label][name] for r in records]
    return Judged(
        tuple(e for p in parts for e in p.E),
        tuple(u for p in parts for u in p.u_D),
        tuple(u for p in parts for u in p.u_val),
        tuple(v for p in parts for v in p.verdicts),
    )


def quantity(given: Given, stated: Stated, records: Sequence[Draws], whole: bool) -> Quantity:
    """One check over all draws; `whole`: each was solved."""
    judged = _joined(records, PERFECT, stated.name)
    n = len(judged.verdicts)
    share = Share(judged.verdicts.count("differs"), n)
    undecided = Share(judged.verdicts.count("cannot decide"), n)
    terms = tuple(_terms_shown(given, stated, records, judged))
    known = [u for u in judged.u_val if u is not None]
    errors = np.array([e for e in judged.E if e is not None])
    off = {k: v for r in records for k, v in r.off.items()}
    return Quantity(
        given.method, stated, share, undecided, terms,
        _finding(stated, share, undecided, terms), judged,
        float(np.sqrt(np.mean(errors**2))) if len(errors) else 0.0,
        float(np.median(known)) if known else None,
        off.get(stated.name) if given.steps and not whole else None,
    )  # fmt: skip


def _finding(stated: Stated, share: Share, undecided: Share, terms: tuple[Term, ...]) -> Finding:
    if stated.fitted:
        return Finding("no evidence", None, stated.fitted)
    if undecided.number == undecided.count and None in stated.numerical.values():
        return Finding("cannot decide", None, f"nothing bounds u_num: {stated.words}")
    return find_fault(share, terms)


def _terms_shown(
    given: Given, stated: Stated, records: Sequence[Draws], judged: Judged
) -> Iterator[Term]:
    measured = np.array([e for r in records for e in r.measured[stated.name]])
    u_D, own = float(np.median(judged.u_D)), stated.inputs.get(OWN_COVARIANCE)
    shown = reach(measured)
    if own is None:
        yield term(MEASUREMENT, u_D, measured, "measurement")
    else:  # a filter's error and the measurement's are seen together only
        rest = float(np.sqrt(max(shown**2 - u_D**2, 0.0)))
        yield Term(MEASUREMENT, u_D, min(shown, u_D), min(shown, u_D), "measurement")
        yield Term(OWN_COVARIANCE, own, rest, rest, "filter")
    for part, u in stated.numerical.items():
        yield Term(f"u_num ({part})", u or 0.0, 0.0, 0.0, "numerical")
    alone = {k: v for r in records for k, v in r.alone.items()}
    for i, (name, by_check) in enumerate(alone.items()):
        plus, minus = (*by_check.get(stated.name, ()), 0.0, 0.0)[:2]
        z = given.z[:, i]
        errors = np.where(z > 0, z * plus, -z * minus)
        yield term(f"u_input ({name})", stated.inputs.get(name, 0.0), errors)


def together(given: Given, records: Sequence[Draws]) -> JointShare:
    """The verdict over all checks of a method."""
    words = [w for r in records for w in r.overall[PERFECT]]
    differs, undecided = (Share(words.count(w), len(words)) for w in ("differs", "undecided"))
    return JointShare(given.method, differs, undecided, len(given.stated))


def power(
    given: Given,
    records: Sequence[Draws],
    wrong: Mapping[tuple[str, float], World],
    mistaken: Mapping[World, Record[ExactReading]],
) -> Iterator[Power]:
    """All checks together, then each; those that are evidence."""
    names = [s.name for s in given.stated if not s.fitted]
    for (path, by), world in wrong.items():
        record = mistaken[world]
        if record.value is None:
            yield Power(given.method, None, path, by, None, record.why)
        elif world.label in given.wrong:
            words = [w for r in records for w in r.overall[world.label]]
            yield Power(given.method, None, path, by, Share(words.count("differs"), len(words)))
            for name in names:
                verdicts = _joined(records, world.label, name).verdicts
                share = Share(verdicts.count("differs"), len(verdicts))
                yield Power(given.method, name, path, by, share)
