"""The checks: error against the uncertainty of the comparison, after ASME V&V 20."""

from collections.abc import Iterator

from validate.compare.exhibit import Emphasis, Exhibit, NumberTable, TableCell
from validate.compare.inputs import Joint
from validate.compare.result import KINDS, Result
from validate.compare.verdict import Check
from validate.report.tables import unit_cell

_EMPHASIS: dict[str, Emphasis] = {
    "good enough": "good", "not good enough": "bad", "undecided": "open", "differs": "bad",
    "not distinguishable": "good", "no answer": "open", "nothing compared": "bad",
    "no requirement": "", "fitted": "", "same model": "",
}  # fmt: skip
_BEYOND = 25.0  # %: a difference that a dozen draws of a linear model hardly show
_HEADINGS = (
    "method", "check", "acceptance", "validation", "unit", "E", "2 u_val", "limit", "margin",
    "raw rms", "noise rms", "u_D", "u_num", "u_input", "values", "why",
)  # fmt: skip
_BANDS = {
    "good enough": ("good", "Good enough"),
    "not good enough": ("bad", "Not good enough"),
    "undecided": ("open", "Undecided"),
    "not distinguishable": ("good", "Not distinguishable"),
    "differs": ("bad", "Differs"),
    "no evidence": ("open", "No evidence"),
    "nothing compared": ("bad", "Nothing compared"),
}


def band(result: Result) -> tuple[str, str]:
    """The colour class of the sentence and the word that says the same."""
    colour, word = _BANDS[result.overall.word]
    return (
        ("open", f"{word}, with warnings")
        if result.warnings and colour == "good"
        else (colour, word)
    )


def checks(result: Result) -> Exhibit | None:
    """Every check of the accepted methods; None when there is none."""
    if not result.checks:
        return None
    table = NumberTable(
        "checks",
        "E = simulation minus measurement. max: the point with the largest |E| + 2 u_val; rms: "
        "the rms error, noise removed. u_val² = u_D² (measurement) + "
        "u_num² (mesh, step) + u_input² (declared ranges, and a filter's claimed error), standard "
        "uncertainties. Acceptance: E ± 2 u_val against the limit; good enough "
        "inside, not good enough outside, undecided where it straddles. Validation: differs where "
        "E ± 2 u_val excludes zero. Margin: limit minus (|E| + 2 u_val). Fitted (data used for "
        "identification) and same model (recording made by the model) are not evidence.",
        _HEADINGS,
        tuple(
            (m.name, *_row(c), f"{m.why(c)}. Limit: {c.requirement}.")
            for m in result.methods
            for c in m.checks
        ),
        below="why",
    )
    checked = "; ".join(f"{m.name} ({m.called})" for m in result.methods if m.checks)
    words = f"Checked: {checked}. The other methods are candidates, listed for comparison."
    found = result.overall
    corrected = (
        f"The recording is: {KINDS[result.kind]}. Verdict over all: {found.word}, "
        f"{found.counted}. {found.corrections}"
    )
    return Exhibit(
        "checks", "Checks", (words, corrected, *_as_declared(result)),
        (table, *_inputs(result)),
    )  # fmt: skip


def _as_declared(result: Result) -> Iterator[str]:
    """What the experiment declares of its verdicts, and which moved."""
    for e in result.expected:
        yield f"Expected: {e.check} of {e.method} is {e.verdict}, because of {e.why}."
    yield from (f"Moved: {m.words}." for m in result.moved if result.expected)


def _inputs(result: Result) -> Iterator[NumberTable]:
    """Where the ranges behind u_input come from, and what first order leaves out of it."""
    if result.inputs:
        rows = tuple((i.name, i.range, i.source) for i in result.inputs)
        title = "Uncertain inputs of u_input; a range that was not measured is marked."
        yield NumberTable("inputs", title, ("input", "range", "source"), rows)
    if result.joint:
        yield NumberTable(
            "joint_inputs",
            "u_input to first order, one input at a time, and by draws of all inputs together "
            "(Latin hypercube of uniform ranges; rms distance from the simulated value). Checks "
            "use first order.",
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
        E = (TableCell(0.0, check.unit, text="below noise"),)
    limit = TableCell(check.limit, check.unit, text="" if check.limit else "none")
    return (
        TableCell(check.name, emphasis="strong"),
        TableCell(check.acceptance, emphasis=_EMPHASIS[check.acceptance]),
        TableCell(check.validation, emphasis=_emphasis(check)),
        unit_cell(check.unit),
        *E,
        *_figures(check, 2 * check.u_val),
        limit,
        TableCell(check.margin, check.unit),
        *_figures(check, check.raw, check.noise, check.u_D, check.u_num, check.u_input),
        check.count,
    )


def _emphasis(check: Check) -> Emphasis:
    """Validation is coloured where it decides: where nothing is required."""
    return _EMPHASIS[check.validation] if check.acceptance == "no requirement" else ""


def _figures(check: Check, *values: float) -> tuple[TableCell, ...]:
    """Numbers in the check's unit; none where nothing was compared."""
    return tuple(TableCell(v if check.count else None, check.unit) for v in values)
