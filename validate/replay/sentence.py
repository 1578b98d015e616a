"""The one sentence that opens a report."""

from validate.compare.result import MethodResult


def verdict_sentence(results: tuple[MethodResult, ...], *, quick: bool) -> str:
    """What was decided, for how many comparisons, and what was not."""
    checked = [m for m in results if m.checks]
    if not checked:
        return "Nothing was decided: none of the accepted methods was run."
    parts = [_of(m) for m in checked]
    ending = " (quick run: fewer comparisons, no published verdicts)" if quick else ""
    return "; ".join(parts) + ending + "."


def _of(method: MethodResult) -> str:
    count = len(method.checks)
    held = [c for c in method.checks if c.holds]
    points = sum(c.count for c in method.checks)
    if len(held) == count:
        return (
            f"{method.label} predicts what was measured within the error of the comparison: "
            f"{count} of {count} checks agree over {points} compared values"
        )
    differs = [c.name for c in method.checks if c.verdict == "differs"]
    open_ = [c.name for c in method.checks if c.verdict == "cannot decide"]
    told = [f"{len(held)} of {count} checks agree"]
    if differs:
        told.append(f"{len(differs)} differ ({_named(differs)})")
    if open_:
        told.append(f"{len(open_)} cannot be decided ({_named(open_)})")
    return f"{method.label}: " + ", ".join(told)


def _named(names: list[str]) -> str:
    shown = ", ".join(names[:4])
    return shown if len(names) <= 4 else f"{shown} and {len(names) - 4} others"
