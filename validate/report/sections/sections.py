"""Order of the report's sections: views of the long table, and parts drawn from the result."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

from validate.compare.effects import Joint
from validate.compare.exhibit import Exhibit, NumberTable, TableCell
from validate.compare.result import KINDS, Result
from validate.errors import ComparisonError
from validate.identify.recorded_motion import RecordedMotion, motion_in
from validate.numbers import with_unit
from validate.recording.types import Recording
from validate.report.export.tables import unit_cell
from validate.report.long_table import LongTable
from validate.report.scenes.bodies import body
from validate.report.scenes.markers import markers
from validate.report.scenes.outlines import outlines
from validate.report.sections.observations import discrimination, drive
from validate.report.sections.provenance import parameters, recording
from validate.report.sections.registration import registration
from validate.report.views.standard import VIEWS
from validate.report.views.view_filling import Shown, filled, filled_views, sized, table

# --- verdict in words: over all checks, as declared, with the basis of u_input (ASME V&V 20) ---

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
    words = (
        f"Checked: {checked}. The other methods are candidates, listed for comparison.",
        f"The recording is: {KINDS[result.kind]}. Verdict over all: {found.word}, "
        f"{found.counted}. {found.corrections}",
        *_as_declared(result),
    )
    return Exhibit("checks", "Checks", words, tuple(_inputs(result)))


def found_besides(result: Result) -> Exhibit:
    """What identification says in words, and the experiment's notes."""
    words = (f"{v.name} by {v.by}: {v.finding}." for v in result.identified_values if v.finding)
    return Exhibit("identified", "Identified parameters and notes", (*words, *result.notes))


def _as_declared(result: Result) -> Iterator[str]:
    """What the experiment declares of its verdicts, and which moved."""
    for e in result.expected:
        check = "every check" if e.check == "*" else e.check
        yield f"Expected: {check} of {e.method} is {e.verdict}: {e.why}."
    yield from (f"Moved: {m.words}." for m in result.moved if result.expected)


def _inputs(result: Result) -> Iterator[NumberTable]:
    """Where the ranges behind u_input come from, and what first order leaves out of it."""
    if result.inputs:
        title = "Uncertain inputs of u_input; a range that was not measured is marked."
        columns = {"input": "name", "range": "range", "source": "source"}
        yield table("inputs", title, result.inputs, columns, folded=True)
    if result.joint:
        yield table(
            "joint_inputs",
            "u_input to first order, one input at a time, and by draws of all inputs together "
            "(Latin hypercube of uniform ranges; rms distance from the simulated value). Checks "
            "use first order.",
            result.joint, _JOINT, folded=True,
        )  # fmt: skip


def _difference(found: Joint) -> TableCell:
    beyond = found.percent is not None and abs(found.percent) > _BEYOND
    return TableCell(found.percent, emphasis="open" if beyond else "")


_JOINT: Mapping[str, Shown] = {
    "quantity": lambda j: TableCell(j.name, emphasis="strong"),
    "unit": lambda j: unit_cell(j.unit), "first order": sized("first_order"),
    "sampled": sized("sampled"), "difference / %": _difference, "draws": "draws",
}  # fmt: skip


# --- order of the report's sections: views of the long table, and parts drawn from the result ---

Made = Callable[[Result], Exhibit | None]


@dataclass(frozen=True)
class Section:
    """A part of the page: views by their names, before what `also` makes of the result.

    Views are shown where `when` says so.
    """

    anchor: str
    title: str
    views: tuple[str, ...] = ()
    also: Made | None = None
    when: Callable[[Result], bool] = lambda result: True


def _over_displacement(result: Result) -> bool:
    """Whether displacements drive: then what was measured is drawn over them."""
    return bool(result.registered) and all(drive(r).unit == "m" for r in result.registered)


SECTIONS: tuple[Section, ...] = (
    Section("checks", "Checks", ("limits", "checks"), verdicts, lambda r: bool(r.checks)),
    Section("outlines", "Outlines", also=outlines),
    Section("markers", "Markers", also=markers),
    Section("curves", "Load and displacement", ("curve", "difference"), None, _over_displacement),
    Section("methods", "Models side by side", ("methods", "speeds", "errors", "errors_of_truth")),
    Section(
        "discrimination",
        "Which effects this recording can distinguish",
        ("effects", "budget"),
        discrimination,
    ),
    Section("published", "Published figures", ("published", "settings")),
    Section("identified", "Identified parameters and notes", ("identified",), found_besides),
    Section("scores", "All scores", ("scores", "scores_by_load")),
    Section("body", "The simulated body", also=body),
    Section("registration", "Registration", also=registration),
    Section("recording", "Recording", also=recording),
    Section("parameters", "Parameters and environment", also=parameters),
)


@dataclass(frozen=True)
class Begun:
    """A section whose views are filled; called with the result it is whole, or None without any
    content. Workers call it: `also` draws."""

    anchor: str
    title: str
    views: tuple[Exhibit, ...]
    also: Made | None

    def __call__(self, result: Result) -> Exhibit | None:
        joined: Any = dict.fromkeys(_LISTS, ())
        for part in (*self.views, self.also(result) if self.also else None):
            for name in _LISTS if part is not None else ():
                joined[name] += getattr(part, name)
        return Exhibit(self.anchor, self.title, **joined) if any(joined.values()) else None


def parts(result: Result, table: Callable[[], LongTable]) -> Iterator[tuple[int, Begun | Exhibit]]:
    """Yield the sections, and the experiment's own exhibits and views after the compared pictures,
    with the views that plug-ins and scripts added; each with its place on the page.

    The body takes longest to draw and comes first, before the long table is asked for.
    """
    order = sorted(enumerate(SECTIONS), key=lambda at: at[1].anchor != "body")
    known = {view.name: view for view in VIEWS}
    for place, s in order:
        views = s.views if s.when(result) else ()
        filled_ = tuple(filled(known[name], table()) for name in views)
        yield place, Begun(s.anchor, s.title, filled_, s.also)
        if s.anchor == "curves":
            own = filled_views(table(), (*result.views, *VIEWS.further), standard=False)
            shown = (e for _, e in own if any(getattr(e, n) for n in _LISTS))
            yield from ((place, exhibit) for exhibit in (*result.exhibits, *shown))


_LISTS = tuple(f.name for f in fields(Exhibit) if f.name not in ("anchor", "title"))


# --- recorded motion in words: largest motion, distance, speed, and intervals at rest ------------

_LINES = 6

_STEADY = 0.9  # of the whole change: from first to last sample


def rests(shown: RecordedMotion) -> str:
    """Return when it is at rest."""
    first = "in motion from the first sample on"
    if shown.rests_until is not None:
        first = f"at rest until {shown.rests_until:.3g} s"
    if shown.rests_from is None:
        return f"{first}, not at rest at the end"
    return f"{first}, at rest from {shown.rests_from:.3g} s to the end"


def _rhythm(shown: RecordedMotion) -> str:
    """Return the main frequency, or why there is none: a steady change has noise alone beside."""
    if not shown.resolution:
        return "too few samples for a spectrum"
    if abs(shown.drift) > _STEADY * shown.size:
        return "changing steadily"
    if shown.frequency < shown.resolution:
        return f"slower than {shown.resolution:.2g} Hz"
    return f"mostly at {shown.frequency:.3g} Hz (resolved to {shown.resolution:.2g} Hz)"


def motion_words(shown: RecordedMotion) -> str:
    """Return the facts in one sentence."""
    along = ", ".join(f"{x:+.2f}" for x in shown.direction)
    way = f" along ({along})" if len(shown.direction) > 1 else ""
    return (
        f"'{shown.marker}' {'moves' if shown.unit == 'm' else 'changes'} most, "
        f"{with_unit(shown.size, shown.unit)} peak to peak{way}, "
        f"{_rhythm(shown)}; {rests(shown)}; "
        f"{with_unit(shown.drift, shown.unit, 2)} from first to last sample; "
        f"{shown.rate:.4g} samples a second, {shown.gaps} gaps (longest {shown.gap:.3g} s), "
        f"{100 * shown.missing:.2g} % missing"
    )


def motion_lines(recording: Recording) -> tuple[str, ...]:
    """Return a line for each stream that moves, markers first: at most six."""
    ordered = {**recording.markers, **recording.contours, **recording.signals}
    lines = []
    for topic, stream in ordered.items():
        try:
            found = motion_in(topic, stream)
        except ComparisonError:  # it stands still
            continue
        lines.append(f"motion of {topic}: {motion_words(found)}")
    more = len(lines) - _LINES
    return (*lines[:_LINES], *([f"and {more} more streams that move"] if more > 0 else []))
