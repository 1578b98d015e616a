"""Order of the report's sections: views of the long table, and parts drawn from the result."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from typing import Any

from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.report.long_table import LongTable
from validate.report.scenes.bodies import body
from validate.report.scenes.markers import markers
from validate.report.scenes.outlines import outlines
from validate.report.sections.discrimination import discrimination
from validate.report.sections.observations import drive
from validate.report.sections.provenance import parameters, recording
from validate.report.sections.registration import registration
from validate.report.sections.verdicts import found_besides, verdicts
from validate.report.views.standard import VIEWS
from validate.report.views.view_filling import filled, filled_views

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
