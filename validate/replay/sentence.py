"""The words that open a report and a terminal: what was judged by what, and what came of it."""

from collections import Counter
from collections.abc import Iterable

from validate.compare.overall import Overall, judge_all
from validate.compare.published import Published
from validate.compare.result import Kind, MethodResult
from validate.compare.verdict import Check, Verdict

_ALL_AGREE: dict[Kind, str] = {
    "measured": "predicts what was measured within the error of the comparison",
    "twin": "follows the twin, a recording of another model, within the error of the comparison",
    "same model": "agrees with a recording of its own model",
    "reference": "agrees with what others computed, within the error of the comparison",
}
_COUNTED: tuple[tuple[Verdict, str], ...] = (
    ("agrees", "agree"),
    ("differs", "differ"),
    ("cannot decide", "cannot be decided"),
    ("fitted", "fitted, no evidence"),
    ("repeats itself", "only repeat the model itself, no evidence"),
)
_NAMED = ("differs", "cannot decide")


def verdict_sentence(results: tuple[MethodResult, ...], kind: Kind, *, quick: bool) -> str:
    """What was decided, for how many comparisons, and what was not."""
    checked = [m for m in results if m.checks]
    if not checked:
        return "Nothing was decided: none of the accepted methods was run."
    parts = [_of(m, kind) for m in checked]
    ending = " (quick run: fewer comparisons, no published verdicts)" if quick else ""
    return (
        "; ".join(parts)
        + ending
        + "."
        + _corrected(judge_all([c for m in checked for c in m.checks]))
    )


def figures_sentence(published: tuple[Published, ...]) -> str:
    """Which printed figures do not stand, and that those of other data are not compared."""
    fallen = [p for p in published if p.fault]
    foreign = sum(bool(p.other) for p in published)
    told = [f" {len(fallen)} of {len(published)} printed figures do not stand ({_named(fallen)})."]
    told += [f" {foreign} of {len(published)} printed figures belong to other data: not compared."]
    return "".join(t for t, there in zip(told, (fallen, foreign), strict=True) if there)


def _of(method: MethodResult, kind: Kind) -> str:
    """One method: how many checks have which verdict."""
    checks = method.checks
    if all(c.verdict == "agrees" for c in checks):
        points = sum(c.count for c in checks)
        return (
            f"{method.called} {_ALL_AGREE[kind]}: {len(checks)} of {len(checks)} checks agree over "
            f"{points} compared values"
        )
    told = []
    for verdict, words in _COUNTED:
        found = [c for c in checks if c.verdict == verdict]
        if found:
            which = f" ({_named(found)})" if verdict in _NAMED else ""
            told.append(f"{len(found)} of {len(checks)} checks {words}{which}")
    return f"{method.called}: " + ", ".join(told)


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
            f" Corrected for {found.total} checks (Holm) none differs: by chance alone a perfect "
            "model shows as much."
        )
    return ""


def _named(found: Iterable[Check | Published]) -> str:
    return _listed([f.name for f in found])


def _listed(names: list[str]) -> str:
    shown = ", ".join(names[:4])
    return shown if len(names) <= 4 else f"{shown} and {len(names) - 4} others"
