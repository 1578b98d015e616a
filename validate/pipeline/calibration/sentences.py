"""Sentences on an identification: fitted values, uncertainty, unidentifiable parameters."""

from collections import Counter
from collections.abc import Iterable, Sequence

from validate.compare.result import MethodResult
from validate.compare.score import Score
from validate.identify.identification import Profiled
from validate.numbers import with_unit
from validate.parameters import describe
from validate.pipeline.calibration.calibration import Free
from validate.pipeline.calibration.problem import Calibrated

_AGAINST = "what calibrates"
_DIGITS = 4
_SHOWN = 4  # predictions in a sentence


def headlines(fitted: Sequence[Calibrated]) -> str:
    """Fitted on what; of several methods without their values, which stand below."""
    apart = [one for one in fitted if not one.problem.calibration.shared]
    methods = [one.problem.calibration.method for one in apart]
    if len(set(methods)) <= 1:
        return "; ".join(map(headline, fitted))
    on = " and ".join(dict.fromkeys(one.on for one in apart))
    shared = [headline(one) for one in fitted if one not in apart]
    return "; ".join([*shared, f"Fitted: {', '.join(methods)}, each by itself on {on}"])


def headline(one: Calibrated) -> str:
    """Fitted on what."""
    each = []
    for e in one.found.estimates:
        unit = unit_of(one, e.name)
        value, low, high = (with_unit(v, unit, _DIGITS) for v in (e.value, e.low, e.high))
        each.append(f"{e.name} = {value} (95 %: {low} to {high})")
    return f"Fitted: {', '.join(each)} with '{one.problem.calibration.method}' on {one.on}"


def unit_of(one: Calibrated, path: str) -> str:
    """Return the unit of what was identified."""
    return {p.path: p.unit for p in describe(one.problem.parts[0].parameters)}[path]


def fitted_sentence(opening: str, results: Sequence[MethodResult]) -> str:
    """Return what was fitted, and what is therefore predicted."""
    said = "; ".join(filter(None, (opening, predicted(results))))
    return f" {said[0].upper()}{said[1:]}."


def predicted(results: Sequence[MethodResult]) -> str:
    """Predicted what, within what: the accepted methods' checks that are evidence."""
    several = sum(bool(m.checks) for m in results) > 1
    found = [
        (c, f" by {m.name}" if several else "")
        for m in results for c in m.checks
        if c.count and (c.evidence or c.verdict == "undecided")
    ]  # fmt: skip
    if not found:
        return f"predicted: nothing, because {_no_evidence(results)}"
    each = []
    for c, by in found[:_SHOWN]:
        off, doubt = with_unit(abs(c.value), c.unit), with_unit(2 * c.u_val, c.unit)
        each.append(f"{c.name}{by} has an error of {off} (2 u_val {doubt})")
    more = f" and {len(found) - _SHOWN} others" if len(found) > _SHOWN else ""
    return f"predicted: {', '.join(each)}{more}"


def _no_evidence(results: Sequence[MethodResult]) -> str:
    """Why none of the checks is evidence: what they are, most of them first."""
    kinds = Counter(c.verdict if c.count else "no match" for m in results for c in m.checks)
    words = {"fitted": "were used for the fit", "same model": "only repeat the model"}
    each = (f"{n} of {kinds.total()} checks {words.get(kind, 'compared nothing')}"
            for kind, n in kinds.most_common())  # fmt: skip
    return ", ".join(each) or "nothing is checked"


def lines(one: Calibrated) -> tuple[str, ...]:
    """What is to be said of an identification: how sure it is, and what it is not."""
    found, p = one.found, len(one.found.space.ranges)
    misfit = (
        f"; the model leaves {found.misfit:.3g} times the variance of the noise; all intervals "
        f"are wider by a factor {found.misfit**0.5:.3g}"
        if found.misfit > 1
        else ""
    )
    how = (
        f"the residual is linear in it (checked at {found.best.evaluations} values), so the best "
        f"fit has a closed form"
        if found.linear
        else f"{found.found_again} of {len(found.fits)} starts ended at the best fit"
    )
    said = [
        f"{', '.join(found.space.names)}: {how} (chi-square {found.best.chi_square:.4g} over "
        f"{found.best.count} residuals less {p}){misfit}."
    ]
    pairs = zip(found.estimates, one.problem.free, strict=True)
    said += [f"{not_identified(one, e, free)}." for e, free in pairs if not e.identified]
    return tuple(said)


def not_identified(one: Calibrated, e: Profiled, free: Free) -> str:
    """Why, with its numbers, and the measurement that would help."""
    value, low, high = (
        with_unit(v, unit_of(one, e.name), _DIGITS) for v in (e.value, e.low, e.high)
    )
    return (
        f"{e.name} is not identifiable from {one.on}: {'; '.join(e.findings)} ({value}, 95 % {low} "
        f"to {high}); {helping(free)} would identify it"
    )


def helping(free: Free) -> str:
    """Return the measurement that would help."""
    return free.helps or "a measurement that depends on it and not on the others"


def scores(fitted: Iterable[Calibrated]) -> tuple[Score, ...]:
    """Every value with its interval, in SI."""
    found = []
    for one in fitted:
        for e in one.found.estimates:
            words = f"identified on {one.on}; 95 % profile interval {e.low:.6g} to {e.high:.6g}"
            found.append(
                Score(e.name, e.value, unit_of(one, e.name), one.found.best.count, _AGAINST, words)
            )
    return tuple(found)
