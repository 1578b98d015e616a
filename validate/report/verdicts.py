"""The checks: error against the uncertainty of the comparison, after ASME V&V 20."""

from validate.compare.result import Result
from validate.compare.verdict import Check
from validate.report.numbers import shown_unit, text
from validate.report.page import Cell, Items, Mark, Paragraph, Section, Table, cells, section

_MARKS: dict[str, Mark] = {"agrees": "good", "differs": "bad", "cannot decide": "open"}
_SIGNS = {"agrees": "✓", "differs": "✗", "cannot decide": "?"}


def band(result: Result) -> tuple[str, str]:
    """The colour class of the sentence and the word that says the same."""
    if any(c.verdict == "differs" for c in result.checks):
        return "bad", "Differs"
    if result.passed:
        return "good", "Agrees"
    return "open", "Undecided"


def checks(result: Result) -> Section | None:
    """Every check of the accepted methods; None when there is none."""
    if not result.checks:
        return None
    rows = tuple((Cell(m.name), *_row(c)) for m in result.methods for c in m.checks)
    table = Table(
        "E = simulation less measurement; for many points the part of the rms that noise does not "
        "explain. u_val² = u_D² (measurement) + u_num² (mesh) + u_input² (declared ranges, and "
        "what a filter claims of its own error), standard uncertainties. "
        "Agrees: |E| ≤ 2 u_val ≤ limit. Differs: |E| > 2 u_val. Cannot "
        "decide: 2 u_val exceeds the limit.",
        ("method", "check", "unit", "E", "2\u00a0u_val", "u_D", "u_num", "u_input", "limit",
         "values", "verdict", "why"),
        rows,
        words=(0, 1, 2, 10, 11),
    )  # fmt: skip
    methods = "; ".join(f"{m.name} ({m.label})" for m in result.methods if m.checks)
    return section(
        "checks",
        "Checks",
        Paragraph(f"Checked: {methods}. Other methods are rivals, shown for discrimination."),
        table,
        Paragraph("Declared input ranges behind u_input:") if result.inputs else None,
        Items(result.inputs) if result.inputs else None,
    )


def _row(check: Check) -> tuple[Cell, ...]:
    if check.count == 0:
        figures = cells(*["–"] * 5)
    else:
        figures = cells(
            text(check.value, check.unit),
            text(2 * check.u_val, check.unit),
            *(text(u, check.unit) for u in (check.u_D, check.u_num, check.u_input)),
        )
    return (
        Cell(check.name, "strong"),
        Cell(shown_unit(check.unit)),
        *figures,
        Cell(text(check.limit, check.unit)),
        Cell(str(check.count)),
        Cell(f"{_SIGNS[check.verdict]} {check.verdict}", _MARKS[check.verdict]),
        Cell(check.why),
    )
