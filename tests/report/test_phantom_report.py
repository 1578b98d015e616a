"""The fluid phantom through the whole pipeline, cheapest methods: outlines and markers drawn."""

from dataclasses import replace

import jsonschema
import pytest
from report_samples import CHECK, sections_of

from validate.compare.result import Result
from validate.register.outlines.outlines import normal_distances
from validate.report.exhibits import DrawnExhibit, draw_all
from validate.report.export.tables import shown as read
from validate.report.sections.observations import outline_seen
from validate.report.sections.sections import SECTIONS
from validate.report.stored.store import document, schema

pytestmark = [pytest.mark.xdist_group("two methods of the phantom"), pytest.mark.slow]


@pytest.fixture(scope="module")
def sections(result: Result) -> dict[str, DrawnExhibit]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VALIDATE_NO_GL", "1")
        drawn = draw_all(result, sections_of(result))
    return {d.exhibit.anchor: d for d in drawn if d.shown}


def test_all_sections_that_apply(result: Result, sections: dict[str, DrawnExhibit]) -> None:
    left_out = {s.anchor for s in SECTIONS} - set(sections) - {"published"}
    assert left_out == {"checks"}
    assert ("published" in sections) == bool(result.published)


def test_pictures_of_the_paper(sections: dict[str, DrawnExhibit]) -> None:
    names = {p.name for s in sections.values() for p in s.pictures}
    assert names == {
        "outlines", "chart_outline_errors", "markers", "markers_across",
        "errors_over_noise",
        "chart_curve_force_plate", "chart_difference_force_plate", "chart_curve_pressure",
        "chart_difference_pressure", "chart_curve_inclusion_volume_ratio", "body", "registration",
    }  # fmt: skip


def test_top_left_is_the_score(result: Result, sections: dict[str, DrawnExhibit]) -> None:
    (table,) = sections["outlines"].exhibit.tables
    shown = {read(row[0]): read(row[-1]) for row in table.rows}
    scores = {s.name: s.value for s in result.methods[0].scores}
    simulated = 1e3 * scores["contour.top_left.simulated@9mm"]
    assert float(shown["P1 with fluid"]) == pytest.approx(simulated, abs=0.005)
    measured = 1e3 * scores["contour.top_left.measured@9mm"]
    assert float(shown["measured"]) == pytest.approx(measured, abs=0.005)


def test_the_outline_drawn_is_the_one_that_was_judged(result: Result) -> None:
    for method in result.methods:
        seen = outline_seen(method)
        assert seen is not None
        drawn = normal_distances(seen.simulated(method.run.u[-1]), seen.outlines[-1])
        assert drawn == pytest.approx(method.residuals["contour@9mm"].values[:, 0], abs=1e-12)


def test_results_validate(result: Result) -> None:
    checked = replace(result.methods[0], accepted=True, checks=(CHECK,))
    content = document(replace(result, methods=(checked,)), "2026-11-21T04:00:00Z")
    jsonschema.Draft202012Validator(schema()).validate(content)
    assert content["inputs"][0]["path"] == "fluid_phantom.mcap"
    assert len(content["inputs"][0]["sha256"]) == 64
