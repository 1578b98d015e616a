"""Results of a coverage study: of every check, of all together, and of wrong models."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import rms
from validate.compare.coverage import (
    FALSE_ACCEPTANCE,
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
from validate.engine.cell import Record
from validate.study.coverage.bench import ExactReading, Stated
from validate.study.coverage.cell import PERFECT, Draws, Given, Judged
from validate.study.coverage.plan import World


@dataclass(frozen=True)
class Quantity:
    """One check of a method: how often the perfect model differs, and by which term.

    `undecided`: of the perfect model's acceptance; `rejected`: not good enough though perfect.
    `false_good` and `false_bad`: answers about models whose error is the limit; None without one.

    `off` is the largest error of the linear response, in the check's unit; None: solved whole.
    """

    method: str
    stated: Stated
    share: Share
    undecided: Share
    rejected: Share
    false_good: Share | None
    false_bad: Share | None
    terms: tuple[Term, ...]
    finding: Finding
    judged: Judged
    spread: float
    u_val: float | None
    off: float | None

    @property
    def holds(self) -> bool:
        false = [s for s in (self.rejected, self.false_good, self.false_bad) if s is not None]
        return self.finding.word in ("holds", "blunt", "no evidence") and all(
            s.value <= FALSE_ACCEPTANCE for s in false
        )


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
        tuple(v for p in parts for v in p.validations),
        tuple(v for p in parts for v in p.acceptances),
    )


def quantity(given: Given, stated: Stated, records: Sequence[Draws], whole: bool) -> Quantity:
    """One check over all draws; `whole`: each was solved."""
    judged = _joined(records, PERFECT, stated.name)
    n = len(judged.validations)
    share = Share(judged.validations.count("differs"), n)
    undecided, rejected = (
        Share(judged.acceptances.count(word), n) for word in ("undecided", "not good enough")
    )
    at_limit = [a for r in records for a in r.at_limit.get(stated.name, ())]
    false_good, false_bad = (
        Share(at_limit.count(word), len(at_limit)) if at_limit else None
        for word in ("good enough", "not good enough")
    )
    terms = tuple(_terms_shown(given, stated, records, judged))
    known = [u for u in judged.u_val if u is not None]
    errors = np.array([e for e in judged.E if e is not None])
    off = {k: v for r in records for k, v in r.off.items()}
    return Quantity(
        given.method, stated, share, undecided, rejected, false_good, false_bad, terms,
        _finding(stated, share, terms), judged,
        float(np.sqrt(np.mean(errors**2))) if len(errors) else 0.0,
        float(np.median(known)) if known else None,
        off.get(stated.name) if given.steps and not whole else None,
    )  # fmt: skip


def _finding(stated: Stated, share: Share, terms: tuple[Term, ...]) -> Finding:
    if stated.fitted:
        return Finding("no evidence", None, stated.fitted)
    if None in stated.numerical.values():
        return Finding("no answer", None, f"nothing bounds u_num: {stated.words}")
    return find_fault(share, terms)


def _terms_shown(
    given: Given, stated: Stated, records: Sequence[Draws], judged: Judged
) -> Iterator[Term]:
    measured = np.array([e for r in records for e in r.measured[stated.name]])
    u_D = float(np.median(judged.u_D)) if stated.measurement is None else stated.measurement
    own = rms(stated.inputs[OWN_COVARIANCE]) if OWN_COVARIANCE in stated.inputs else None
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
        yield term(f"u_input ({name})", rms(stated.inputs.get(name, (0.0,))), errors)


def together(given: Given, records: Sequence[Draws]) -> JointShare:
    """Return the verdict over all checks of a method."""
    differing = [d for r in records for d in r.overall[PERFECT]]
    return JointShare(given.method, Share(sum(differing), len(differing)), len(given.stated))


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
            all_of = [d for r in records for d in r.overall[world.label]]
            yield Power(given.method, None, path, by, Share(sum(all_of), len(all_of)))
            for name in names:
                verdicts = _joined(records, world.label, name).validations
                share = Share(verdicts.count("differs"), len(verdicts))
                yield Power(given.method, name, path, by, share)
