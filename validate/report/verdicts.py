"""The checks: error against the uncertainty of the comparison, after ASME V&V 20."""

from validate.compare.exhibit import Emphasis, Exhibit, NumberTable, TableCell
from validate.compare.result import Result
from validate.compare.verdict import Check
from validate.report.tables import unit_cell

_EMPHASIS: dict[str, Emphasis] = {"agrees": "good", "differs": "bad", "cannot decide": "open"}
_HEADINGS = (
    "method", "check", "unit", "E", "2 u_val", "u_D", "u_num", "u_input", "limit", "values",
    "verdict", "why",
)  # fmt: skip


def band(result: Result) -> tuple[str, str]:
    """The colour class of the sentence and the word that says the same."""
    if any(c.verdict == "differs" for c in result.checks):
        return "bad", "Differs"
    if result.passed:
        return "good", "Agrees"
    return "open", "Undecided"


def checks(result: Result) -> Exhibit | None:
    """Every check of the accepted methods; None when there is none."""
    if not result.checks:
        return None
    table = NumberTable(
        "checks",
        "E = simulation less measurement; for many points the part of the rms that noise does not "
        "explain. u_val² = u_D² (measurement) + u_num² (mesh) + u_input² (declared ranges, and "
        "what a filter claims of its own error), standard uncertainties. "
        "Agrees: |E| ≤ 2 u_val ≤ limit. Differs: |E| > 2 u_val. Cannot "
        "decide: 2 u_val exceeds the limit.",
        _HEADINGS,
        tuple((m.name, *_row(c)) for m in result.methods for c in m.checks),
    )
    checked = "; ".join(f"{m.name} ({m.label})" for m in result.methods if m.checks)
    words = f"Checked: {checked}. Other methods are rivals, shown for discrimination."
    inputs = (f"Declared input range behind u_input: {text}" for text in result.inputs)
    return Exhibit("checks", "Checks", (words, *inputs), (table,))


def _row(check: Check) -> tuple[TableCell | int | str, ...]:
    parts = (check.value, 2 * check.u_val, check.u_D, check.u_num, check.u_input)
    figures = (TableCell(v if check.count else None, check.unit) for v in parts)
    return (
        TableCell(check.name, emphasis="strong"),
        unit_cell(check.unit),
        *figures,
        TableCell(check.limit, check.unit),
        check.count,
        TableCell(check.verdict, emphasis=_EMPHASIS[check.verdict]),
        check.why,
    )
