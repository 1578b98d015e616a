"""Verdict in words: over all checks, as declared, with the basis of u_input (ASME V&V 20)."""

from collections.abc import Mapping

from validate.compare.effects import Joint
from validate.compare.exhibit import Exhibit, TableCell
from validate.compare.result import KINDS, Result
from validate.report.export.tables import unit_cell
from validate.report.views.view_filling import Shown, sized, table

_BEYOND = 25.0  # %: a difference that a dozen draws of a linear model hardly show
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
    """Return the colour class of the sentence and the word that says the same."""
    colour, word = _BANDS[result.overall.word]
    return (
        ("open", f"{word}, with warnings")
        if result.warnings and colour == "good"
        else (colour, word)
    )


def verdicts(result: Result) -> Exhibit | None:
    """Return the verdict over all checks in words, and where the ranges behind u_input come from;
    None where there is no check."""
    if not result.checks:
        return None
    checked = "; ".join(f"{m.name}: {m.called}" for m in result.methods if m.checks)
    found = result.overall
    # What the experiment declares of its verdicts, and which moved
    declared = []
    for e in result.expected:
        check = "every check" if e.check == "*" else e.check
        declared.append(f"Expected: {check} of {e.method} is {e.verdict}: {e.why}.")
    declared += [f"Moved: {m.words}." for m in result.moved if result.expected]
    words = (
        f"Checked: {checked}. The other methods are candidates, listed for comparison.",
        f"The recording is: {KINDS[result.kind]}. Verdict over all: {found.word}, "
        f"{found.counted}. {found.corrections}",
        *declared,
    )
    # Where the ranges behind u_input come from, and what first order leaves out of it
    tables = []
    if result.inputs:
        title = "Uncertain inputs of u_input; a range that was not measured is marked."
        columns = {"input": "name", "range": "range", "source": "source"}
        tables.append(table("inputs", title, result.inputs, columns, folded=True))
    if result.joint:
        title = (
            "u_input to first order, one input at a time, and by draws of all inputs together "
            "(Latin hypercube of uniform ranges; rms distance from the simulated value). Checks "
            "use first order."
        )
        tables.append(table("joint_inputs", title, result.joint, _JOINT, folded=True))
    return Exhibit("checks", "Checks", words, tuple(tables))


def found_besides(result: Result) -> Exhibit:
    """What identification says in words, and the experiment's notes."""
    words = (f"{v.name} by {v.by}: {v.finding}." for v in result.identified_values if v.finding)
    return Exhibit("identified", "Identified parameters and notes", (*words, *result.notes))


def _difference(found: Joint) -> TableCell:
    beyond = found.percent is not None and abs(found.percent) > _BEYOND
    return TableCell(found.percent, emphasis="open" if beyond else "")


_JOINT: Mapping[str, Shown] = {
    "quantity": lambda j: TableCell(j.name, emphasis="strong"),
    "unit": lambda j: unit_cell(j.unit), "first order": sized("first_order"),
    "sampled": sized("sampled"), "difference / %": _difference, "draws": "draws",
}  # fmt: skip
