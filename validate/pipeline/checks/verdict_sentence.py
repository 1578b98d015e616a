"""Verdict sentence of a report and of the terminal."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from validate.compare.overall_verdict import Overall, correction, judge_all
from validate.compare.published import Published
from validate.compare.result import Kind, MethodResult
from validate.compare.verdict import Check
from validate.numbers import with_unit

_AGAINST: dict[Kind, str] = {
    "measured": "the measurement",
    "twin": "a twin, a recording of another model",
    "same law, finer mesh": "the same law on a finer mesh",
    "same model": "a recording of the same model",
    "reference": "the result of third-party code",
}
Answer = Callable[[Check], str]
# How each answer is counted, and whether its checks are named.
_ACCEPTANCE = {
    "good enough": ("good enough", False),
    "not good enough": ("not good enough", True),
    "undecided": ("undecided", True),
    "nothing compared": ("compared nothing", True),
}
_VALIDATION = {
    "differs": ("differ from zero", True),
    "not distinguishable": ("not distinguishable from zero", False),
    "no answer": ("without a bound of the numerical error", True),
    "nothing compared": ("compared nothing", True),
    "fitted": ("fitted, no evidence", False),
    "same model": ("of the same model, no evidence", False),
}


def verdict_sentence(results: tuple[MethodResult, ...], kind: Kind, *, quick: bool) -> str:
    """Return the verdict in words: number of decided and of undecided comparisons."""
    checked = [m for m in results if m.checks]
    if not checked:
        return "Nothing was compared: none of the accepted methods was run."
    parts = [_of(m, kind) for m in checked]
    ending = " (quick run: fewer comparisons, no published verdicts)" if quick else ""
    found = judge_all([c for m in checked for c in m.checks])
    return "; ".join(parts) + ending + "." + _closest(checked) + _corrected(found)


def figures_sentence(published: tuple[Published, ...]) -> str:
    """Which printed figures do not stand, and that those of other data are not compared."""
    fallen = [p for p in published if p.fault]
    foreign = sum(bool(p.other) for p in published)
    told = [f" {len(fallen)} of {len(published)} printed figures do not hold ({_named(fallen)})."]
    told += [f" {foreign} of {len(published)} printed figures belong to other data: not compared."]
    return "".join(t for t, there in zip(told, (fallen, foreign), strict=True) if there)


def _of(method: MethodResult, kind: Kind) -> str:
    """One method: how many checks have which answer to both questions. A requirement on data that
    calibrated or made the model is none that could be met."""
    required = [c for c in method.checks if c.acceptance in _ACCEPTANCE]
    told = []
    if required:
        told.append(_counted(required, lambda c: c.acceptance, _ACCEPTANCE, "requirements"))
    answered = [c for c in method.checks if c.evidence or c.acceptance == "undecided"]
    rest = [c for c in method.checks if c not in required]
    if answered or rest:
        told.append(_counted(answered + [c for c in rest if c not in answered],
                             lambda c: c.validation, _VALIDATION, "checks"))  # fmt: skip
    return f"{method.called} against {_AGAINST[kind]}: " + "; ".join(told)


def _counted(
    checks: Sequence[Check], answer: Answer, words: dict[str, tuple[str, bool]], what: str
) -> str:
    found = []
    for key, (text, named) in words.items():
        there = [c for c in checks if answer(c) == key]
        if there:
            which = f" ({_named(there)})" if named else ""
            more = correction(there) if answer(there[0]) == "not distinguishable" else ""
            found.append(f"{len(there)} of {len(checks)} {what} {text}{which}{more}")
    return ", ".join(found)


def _closest(methods: Sequence[MethodResult]) -> str:
    """The smallest margin of all requirements that are met."""
    met = [c for m in methods for c in m.checks if c.acceptance == "good enough"]
    if not met:
        return ""
    worst = min(met, key=lambda c: (c.margin or 0.0) / (c.limit or 1.0))
    share = 100 * (worst.margin or 0.0) / (worst.limit or 1.0)
    margin, limit = with_unit(worst.margin, worst.unit), with_unit(worst.limit, worst.unit)
    return f" Smallest margin: {margin} of {limit} ({share:.0f} % of the limit), {worst.name}."


def _corrected(found: Overall) -> str:
    """What the correction for many checks changes; nothing where none differs."""
    if found.differs:
        names = Counter(c.name for c in found.differs)
        each = [f"{name} ({n} methods)" if n > 1 else name for name, n in names.items()]
        return (
            f" Corrected for {found.total} checks (Holm), {len(names)} still differ: "
            f"{_listed(each)}."
        )
    if found.alone:
        return (
            f" Corrected for {found.total} checks (Holm), none differs: chance alone explains "
            f"such differences."
        )
    return ""


def _named(found: Iterable[Check | Published]) -> str:
    return _listed([f.name for f in found])


def _listed(names: list[str]) -> str:
    shown = ", ".join(names[:4])
    return shown if len(names) <= 4 else f"{shown} and {len(names) - 4} others"
