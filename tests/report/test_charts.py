"""Charts can be read: by colour, without colour, and on 400 pixels; see `chart_contract`."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from chart_contract import drawn_lines, faults
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.text import Text
from report_samples import sections_of, small_result
from tracking_samples import shown, tracking_result

from validate.compare.exhibit import Chart, Series
from validate.compare.result import Result
from validate.pipeline import load
from validate.pipeline.experiment.options import Options
from validate.pipeline.run.pipeline import compare
from validate.report.charts import chart as charts
from validate.report.charts.axes import TOGETHER, alone, beneath, floor_of, panel_labels, styled
from validate.report.charts.style import ACCEPTED, COLUMNS, MEASURED, PALETTE, WIDTH, painted
from validate.report.views.drawers import figure_of

X = np.linspace(0.0, 1.0, 50)
METHODS = 17


@pytest.fixture(scope="module")
def result() -> Result:
    return tracking_result()


@pytest.fixture(scope="module")
def many(result: Result) -> Result:
    """More methods than colours, with names as long as any."""
    one = result.methods[0]
    others = (
        replace(one, name=f"m{i}", label=f"explicit, consistent M, C = αM, variant {i}",
                accepted=False)
        for i in range(METHODS - 1)
    )  # fmt: skip
    return replace(result, methods=(one, *others))


def drawn(result: Result, chart: Chart) -> Figure:
    return painted(*charts.drawing(result, chart))


def chart(*series: Series, **more: object) -> Chart:
    return Chart("c", "c", "t / s", "u / mm", series, **more)  # type: ignore[arg-type]


def of_methods(result: Result, **more: object) -> Chart:
    lines = (Series(m.label, X, (i + 1) * (X + 0.1)) for i, m in enumerate(result.methods))
    return chart(Series("measured", X, X, "points"), Series("reference (twin)", X, X), *lines,
                 **more)  # fmt: skip


@pytest.mark.parametrize("number", [0, pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_chart_keeps_the_contract(result: Result, number: int) -> None:
    assert faults(drawn(result, shown()[0].charts[number])) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "log"), [(2, ""), (TOGETHER, "y"), (TOGETHER + 1, ""), (8, "y"), (9, "y")]
)
def test_any_number_of_methods_keeps_the_contract(many: Result, count: int, log: str) -> None:
    few = replace(many, methods=many.methods[:count])
    figure = drawn(few, of_methods(few, log=log))
    assert faults(figure) == []
    lines = [line for ax in figure.axes for line in drawn_lines(ax)]
    own = {str(line.get_label()) for line in lines} - {"reference (twin)"}
    assert own == {m.label for m in few.methods}


def test_lines_of_one_axes_differ_in_colour_and_without_it_in_dash(many: Result) -> None:
    """Over all figures two of these have one colour and two one dash, but not in one axes."""
    some = [many.methods[i] for i in (0, 2, 7, 13)]
    found = styled(many, [Series(m.label, X, X) for m in some])
    assert len({d.look.colour for d in found}) == len({str(d.look.dash) for d in found}) == 4


@pytest.mark.slow
def test_many_lines_have_axes_of_their_own(many: Result) -> None:
    """Their levels are named in the legend, and letters can be read on 400 pixels."""
    figure = drawn(many, of_methods(many, levels=(("one", 1.0), ("two", 2.0))))
    assert faults(figure) == []
    assert [t.get_text() for t in figure.legends[0].get_texts()][-2:] == ["one", "two"]
    titles = [ax.get_title(loc="left").replace("\n", " ") for ax in figure.axes]
    assert titles[:METHODS] == [m.label for m in many.methods]
    assert all(len(drawn_lines(ax)) == 4 for ax in figure.axes[:METHODS])  # reference and levels
    assert figure.get_figwidth() == WIDTH
    points = min(t.get_fontsize() for ax in figure.axes for t in ax.get_xticklabels())
    assert points / 72 * (370 / WIDTH) >= 7  # CSS pixels high, 370 wide


def test_lines_of_several_recordings_are_told_apart(result: Result) -> None:
    lines = [Series(m.label, X, X + i, of=f"log {i}") for m in result.methods[:2] for i in range(5)]
    figure = drawn(result, chart(*lines))
    assert faults(figure) == []
    assert len(figure.axes) == 2
    names = [t.get_text() for t in figure.legends[0].get_texts()]
    assert names == [f"log {i}" for i in range(5)]


@pytest.mark.slow
def test_zigzags_of_several_recordings_keep_their_dashes(result: Result) -> None:
    x, rng = np.linspace(0, 1, 1000), np.random.default_rng(0)
    lines = [
        Series(m.label, x, rng.standard_normal(1000), of=f"log {i}")
        for m in result.methods[:2]
        for i in range(3)
    ]
    for ax in drawn(result, chart(*lines)).axes:
        assert [line.get_linestyle() for line in ax.get_lines()] == ["-", "--", "--"]


def test_jagged_lines_have_axes_of_their_own(result: Result) -> None:
    x, rng = np.linspace(0, 1, 1000), np.random.default_rng(0)
    rough = [Series(name, x, rng.standard_normal(1000)) for name in ("a", "b")]
    assert panel_labels(chart(*rough)) == ("a", "b")
    swings = [Series(name, x, np.sin(f * x)) for name, f in (("a", 40.0), ("b", 30.0))]
    assert panel_labels(chart(*swings)) == ()
    smooth = [Series("first", x, x), Series("smooth", x, 2 * x), rough[0]]
    (ax,) = drawn(result, chart(*smooth)).axes
    assert [line.get_linestyle() for line in ax.get_lines()] == ["-", "--", "-"]


def test_points_of_more_kinds_than_colours_are_numbered(result: Result) -> None:
    kinds = [Series(f"s{i}", X[:3], X[:3] + i, "points") for i in range(len(PALETTE) + 2)]
    (ax,) = drawn(result, chart(*kinds)).axes
    assert len({str(line.get_marker()) for line in ax.get_lines()}) == len(kinds)


def test_methods_keep_their_colour_and_measured_points_are_black(result: Result) -> None:
    looks = {d.series.label: d.look.colour for d in styled(result, shown()[0].charts[0].series)}
    assert looks["Kalman filter"] == ACCEPTED
    assert looks["measured"] == MEASURED
    assert len({looks[k] for k in looks}) == len(looks)


def test_points_that_are_not_measured_are_not_black(result: Result) -> None:
    """One method's cells beside their Pareto front, which may be one of them."""
    cells, front = styled(result, [Series("kf", X, X, "points"), Series("front", X[:1], X[:1])])
    assert MEASURED not in {cells.look.colour, front.look.colour}
    assert cells.look.colour != front.look.colour


def test_alone_the_judged_method_is_blue_and_another_is_not(result: Result) -> None:
    for label, judged in (("Kalman filter", True), ("open loop", False)):
        (found,) = alone(result, [Series(label, X, X)], label)
        assert (found.look.colour == ACCEPTED) == judged


def test_band_has_the_colour_of_its_line(result: Result) -> None:
    series = (
        Series("open loop ± 2 sd", X, X, "band", X + 1), Series("Kalman filter", X, X),
        Series("open loop", X, X),
    )  # fmt: skip
    band, _, line = styled(result, series)
    assert band.look.colour == line.look.colour


def test_names_of_levels_lie_beside_the_axes(result: Result) -> None:
    levels = (("30 Hz, visual", 1.0), ("the reference's own error", 1.05), ("none", 1.1))
    (ax,) = drawn(result, chart(Series("a", X, 2 * X), Series("b", X, X), levels=levels)).axes
    names = [t.get_window_extent() for t in ax.texts]
    assert len(names) == len(levels)
    assert all(n.x0 >= ax.get_window_extent().x1 for n in names)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["needle_block", "bending_rod"])
def test_charts_of_shipped_experiments_keep_the_contract(name: str) -> None:
    all_keep_the_contract(compare(load(name), Options({}, quick=True)))


@pytest.mark.slow
def test_charts_of_a_full_run_keep_the_contract(whole: Callable[[str], Result]) -> None:
    all_keep_the_contract(whole("ekf_cube"))


def all_keep_the_contract(found: Result) -> None:
    shown_charts = [c for e in sections_of(found) for c in e.charts]
    assert shown_charts
    wrong = {c.name: faults(drawn(found, c)) for c in shown_charts}
    assert not any(wrong.values()), wrong


# --- logarithmic axes ----------------------------------------------------------------------------


def test_rounding_is_named_and_not_drawn(result: Result) -> None:
    """Errors of 1e-16 of a displacement of 1 mm are the computer's arithmetic."""
    noise = 1e-16 * (1 + X)
    made = chart(Series("exact", X, noise), Series("a", X, 1e-3 * (1 + X)), log="y", scale=1.0)
    assert floor_of(made) == pytest.approx(1e-9)
    assert beneath(made) == ("exact",)
    (ax,) = drawn(result, made).axes
    assert ax.get_ylim()[0] >= 1e-9
    assert [t.get_text() for t in ax.texts] == ["below 1e−9 mm: exact"]
    assert (
        "Not drawn, as below 1e−9 mm, a billionth of the scale: exact"
        in charts.picture(result, made).caption
    )


def test_a_chart_of_rounding_alone_draws_no_structure(result: Result) -> None:
    made = chart(Series("a", X, 1e-16 * (1 + X)), Series("b", X, 1e-15 * X), log="y", scale=1.0)
    (ax,) = drawn(result, made).axes
    assert all(np.isnan(line.get_ydata()).all() for line in ax.get_lines())


def test_a_constant_is_a_level_line(result: Result) -> None:
    """Volume over rest volume, 1 but for the last digits."""
    noisy = 1 + 1e-12 * np.sin(9 * X)
    figure = drawn(result, chart(Series("a", X, noisy), Series("b", X, 0 * X + 1)))
    assert faults(figure) == []
    low, high = figure.axes[0].get_ylim()
    assert (low, high) == pytest.approx((0.99, 1.01), rel=1e-6)
    assert figure.axes[0].yaxis.get_offset_text().get_text() == ""


def test_dips_through_zero_are_cut_and_points_are_not(result: Result) -> None:
    x = np.linspace(0, 1, 1001)
    wave = Series("a", x, np.abs(np.sin(9 * x)))
    (ax,) = drawn(result, chart(wave, log="y")).axes
    assert 1e-3 < ax.get_ylim()[0] < 0.1
    (ax,) = drawn(result, chart(wave, Series("p", x[:2], x[:2] + 1e-5, "points"), log="y")).axes
    assert ax.get_ylim()[0] < 1e-5


def test_a_log_axis_leaves_out_what_is_not_positive(result: Result) -> None:
    x = np.array([0.0, 1.0, 10.0])
    made = chart(Series("a", x, x - 1), Series("b", x, x),
                 levels=(("none", 0.0), ("one", 1.0)), log="xy")  # fmt: skip
    (ax,) = drawn(result, made).axes
    assert ax.get_xlim()[0] > 0
    assert ax.get_ylim()[0] > 0
    assert [t.get_text() for t in ax.texts] == ["one"]


@pytest.mark.slow
@pytest.mark.parametrize("top", [1.1, 2.0, 4.0, 30.0, 1e3, 1e7])
@pytest.mark.parametrize("low", [3e-7, 0.08, 40.0])
def test_ticks_of_any_range_can_be_read(result: Result, low: float, top: float) -> None:
    values = low * np.geomspace(1.0, top, 5)
    made = chart(Series("a", values, values), Series("b", values, 1.01 * values), log="xy")
    figure = drawn(result, made)
    assert faults(figure) == []
    assert len([t for t in figure.axes[0].get_yticks() if low <= t <= low * top]) >= 1


@pytest.mark.slow
@pytest.mark.parametrize("noise", [1e-3, 0.05, 20.0])
def test_axes_of_both_signs_have_readable_ticks(result: Result, noise: float) -> None:
    lines = [Series(f"s{i}", X, (i - 3) * 7 * noise * X) for i in range(8)]
    assert faults(drawn(result, chart(*lines[:3], linear=noise))) == []
    assert faults(drawn(result, chart(*lines, linear=noise))) == []
    far = Series("far", X, 1e5 * noise * (X - 0.5))
    assert faults(drawn(result, chart(far, *lines, linear=noise))) == []


# --- print ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("column", COLUMNS)
def test_a_chart_for_a_column_of_print_is_as_wide_and_legible(column: str) -> None:
    lines = tuple(Series(f"a method with quite a long name, {i}", X, X + i) for i in range(4))
    chart = Chart(
        "c", "A title of several words that needs a line of its own", "t / s", "u / mm", lines
    )
    figure = figure_of(chart, small_result(), column)
    assert figure.get_size_inches()[0] == pytest.approx(COLUMNS[column][0] / 25.4)
    assert faults(figure) == []
    sizes = [float(t.get_fontsize()) for t in figure.findobj(Text) if t.get_text()]
    assert 6.5 <= min(sizes) < 9.5


# Machado, Oliveira and Fernandes (2009): linear RGB as seen without one kind of cones.
BLIND = {
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


@pytest.mark.parametrize("kind", BLIND)
def test_first_lines_are_told_apart_by_colour_blind_readers(kind: str) -> None:
    """The measured one and the first four methods; later ones have dashes of their own, too."""
    colours = np.array([to_rgb(c) for c in (MEASURED, *PALETTE[:4])])
    seen = np.clip(colours**2.2 @ np.array(BLIND[kind]).T, 0, 1) ** (1 / 2.2)
    apart = np.linalg.norm(seen[:, None] - seen[None], axis=2)
    assert apart[np.triu_indices(len(seen), 1)].min() > 0.1
