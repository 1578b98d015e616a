"""The checks: error against the uncertainty of the comparison, after ASME V&V 20."""

from validate.compare.exhibit import Emphasis, Exhibit, NumberTable, TableCell
from validate.compare.result import KINDS, Result
from validate.compare.verdict import Check
from validate.report.tables import unit_cell

_EMPHASIS: dict[str, Emphasis] = {
    "agrees": "good", "differs": "bad", "cannot decide": "open", "fitted": "", "repeats itself": "",
}  # fmt: skip
_HEADINGS = (
    "method", "check", "unit", "raw rms", "noise rms", "E", "2 u_val", "u_D", "u_num", "u_input",
    "limit", "values", "verdict", "why",
)  # fmt: skip
_BANDS = {
    "differs": ("bad", "Differs"),
    "agrees": ("good", "Agrees"),
    "undecided": ("open", "Undecided"),
    "no evidence": ("open", "No evidence"),
}


def band(result: Result) -> tuple[str, str]:
    """The colour class of the sentence and the word that says the same."""
    return _BANDS[result.overall.word]


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
        tuple((m.name, *_row(c)) for m in result.methods for c in m.checks),
    )
    checked = "; ".join(f"{m.name} ({m.label})" for m in result.methods if m.checks)
    words = f"Checked: {checked}. Other methods are rivals, shown for discrimination."
    found = result.overall
    corrected = (
        f"The recording is: {KINDS[result.kind]}. Verdict over all: {found.word}, "
        f"{found.counted}. Of many checks of a perfect model some differ by chance (4.6 % each): "
        f"corrected for {found.total} checks (Holm, 1979), {len(found.differs)} differ and "
        f"{len(found.alone)} differ alone only."
    )
    inputs = (f"Declared input range behind u_input: {text}" for text in result.inputs)
    return Exhibit("checks", "Checks", (words, corrected, *inputs), (table,))


def _row(check: Check) -> tuple[TableCell | int | str, ...]:
    E = _figures(check, check.value)
    if check.count and check.value == 0 < check.raw:
        E = (TableCell(0.0, check.unit, text="within noise"),)
    return (
        TableCell(check.name, emphasis="strong"),
        unit_cell(check.unit),
        *_figures(check, check.raw, check.noise),
        *E,
        *_figures(check, 2 * check.u_val, check.u_D, check.u_num, check.u_input),
        TableCell(check.limit, check.unit),
        check.count,
        TableCell(check.verdict, emphasis=_EMPHASIS[check.verdict]),
        check.why,
    )


def _figures(check: Check, *values: float) -> tuple[TableCell, ...]:
    """Numbers in the check's unit; none where nothing was compared."""
    return tuple(TableCell(v if check.count else None, check.unit) for v in values)
