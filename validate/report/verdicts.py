"""The checks: error against the uncertainty of the comparison, after ASME V&V 20."""

from collections.abc import Iterator

from validate.compare.exhibit import Emphasis, Exhibit, NumberTable, TableCell
from validate.compare.inputs import Joint
from validate.compare.result import KINDS, Result
from validate.compare.verdict import Check
from validate.report.tables import unit_cell

_EMPHASIS: dict[str, Emphasis] = {
    "agrees": "good", "differs": "bad", "cannot decide": "open", "fitted": "", "repeats itself": "",
}  # fmt: skip
_BEYOND = 25.0  # %: a difference that a dozen draws of a linear model hardly show
_HEADINGS = (
    "method", "check", "verdict", "unit", "E", "2 u_val", "limit", "raw rms", "noise rms", "u_D",
    "u_num", "u_input", "values", "why",
)  # fmt: skip
_BANDS = {
    "differs": ("bad", "Differs"),
    "agrees": ("good", "Agrees"),
    "undecided": ("open", "Undecided"),
    "no evidence": ("open", "No evidence"),
}


def band(result: Result) -> tuple[str, str]:
    """The colour class of the sentence and the word that says the same."""
    colour, word = _BANDS[result.overall.word]
    if result.fallen and result.overall.word != "differs":
        return "bad", "A printed figure does not stand"
    return ("open", f"{word}, in doubt") if result.warnings and colour == "good" else (colour, word)


def checks(result: Result) -> Exhibit | None:
    """Every check of the accepted methods; None when there is none."""
    if not result.checks:
        return None
    table = NumberTable(
        "checks",
        "E = simulation less measurement; for many points the part of the raw rms that noise does "
        "not explain, with the sign of the mean where there is one. u_val² = u_D² (measurement) + "
        "u_num² (mesh) + u_input² (declared ranges, and "
        "what a filter claims of its own error), standard uncertainties. "
        "Agrees: |E| ≤ 2 u_val ≤ limit. Differs: |E| > 2 u_val. Cannot "
        "decide: 2 u_val exceeds the limit. Fitted: the data served to identify; repeats itself: "
        "recording and model are one; neither is evidence.",
        _HEADINGS,
        tuple((m.name, *_row(c), m.why(c)) for m in result.methods for c in m.checks),
        below="why",
    )
    checked = "; ".join(f"{m.name} ({m.called})" for m in result.methods if m.checks)
    words = f"Checked: {checked}. Other methods are rivals, shown for discrimination."
    found = result.overall
    corrected = (
        f"The recording is: {KINDS[result.kind]}. Verdict over all: {found.word}, "
        f"{found.counted}. Of many checks of a perfect model some differ by chance (4.6 % each): "
        f"corrected for {found.total} checks (Holm, 1979), {len(found.differs)} differ and "
        f"{len(found.alone)} differ alone only."
    )
    return Exhibit("checks", "Checks", (words, corrected), (table, *_inputs(result)))


def _inputs(result: Result) -> Iterator[NumberTable]:
    """Where the ranges behind u_input come from, and what first order leaves out of it."""
    if result.inputs:
        rows = tuple((i.name, i.range, i.source) for i in result.inputs)
        title = "Uncertain inputs behind u_input; a range that nobody measured says so."
        yield NumberTable("inputs", title, ("input", "range", "source"), rows)
    if result.joint:
        yield NumberTable(
            "joint_inputs",
            "u_input by first order, one input at a time, beside draws of all inputs at once "
            "(Latin hypercube of uniform ranges; rms distance from what was simulated). Checks use "
            "first order.",
            ("quantity", "unit", "first order", "sampled", "difference / %", "draws"),
            tuple(_joint(j) for j in result.joint),
        )


def _joint(found: Joint) -> tuple[TableCell | int, ...]:
    percent = found.percent
    beyond = percent is not None and abs(percent) > _BEYOND
    return (
        TableCell(found.name, emphasis="strong"),
        unit_cell(found.unit),
        TableCell(found.first_order, found.unit),
        TableCell(found.sampled, found.unit),
        TableCell(percent, emphasis="open" if beyond else ""),
        found.draws,
    )


def _row(check: Check) -> tuple[TableCell | int | str, ...]:
    E = _figures(check, check.value)
    if check.count and check.value == 0 < check.raw:
        E = (TableCell(0.0, check.unit, text="within noise"),)
    return (
        TableCell(check.name, emphasis="strong"),
        TableCell(check.verdict, emphasis=_EMPHASIS[check.verdict]),
        unit_cell(check.unit),
        *E,
        *_figures(check, 2 * check.u_val),
        TableCell(check.limit, check.unit),
        *_figures(check, check.raw, check.noise, check.u_D, check.u_num, check.u_input),
        check.count,
    )


def _figures(check: Check, *values: float) -> tuple[TableCell, ...]:
    """Numbers in the check's unit; none where nothing was compared."""
    return tuple(TableCell(v if check.count else None, check.unit) for v in values)
