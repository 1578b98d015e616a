"""Effects against noise: separations by hand, who sees them, which sensor would."""

from dataclasses import replace

import numpy as np
import pytest

from validate.compare.effects import TELLS_APART, Sensor, effect
from validate.compare.exhibit import NumberTable, TableCell
from validate.compare.residual import Residual
from validate.errors import ComparisonError


def residual(
    quantity: str, values: list[list[float]], sd: float, systematic: float = 0.0
) -> Residual:
    return Residual(quantity, "9mm", np.array(values), sd, systematic, "m", "")


def pair(one: Residual, change: list[list[float]]) -> tuple[dict[str, Residual], ...]:
    """Two models against the same measurement: residuals that differ by `change`."""
    return {one.name: one}, {one.name: replace(one, values=one.values + np.array(change))}


def test_separation_of_three_points_by_hand() -> None:
    """rms sqrt(50/3) over sqrt(2 (4/3 + 1) + 3): what three points average away, and what not."""
    one, other = pair(
        residual("marker", [[9.0, 9], [8, 8], [7, 7]], 2.0, 1.0), [[3.0, 4], [0, 0], [0, -5]]
    )
    found = effect("friction", "", one, other, {"marker@9mm": np.sqrt(3.0)}, ())
    (change,) = found.changes
    assert change.name == "marker@9mm"
    assert change.unit == "m"
    assert change.rms == pytest.approx(np.sqrt(50 / 3))
    assert change.max == pytest.approx(5.0)
    assert change.separation == pytest.approx(np.sqrt(50 / 3) / np.sqrt(2 * (4 / 3 + 1) + 3))


@pytest.mark.parametrize(("change", "seen"), [(2.01, True), (1.99, False), (-2.01, True)])
def test_sensor_sees_an_effect_above_two_standard_deviations(change: float, seen: bool) -> None:
    assert TELLS_APART == 2.0
    one, other = pair(residual("pressure", [[5.0]], 1.0), [[change]])
    assert effect("fluid", "", one, other, {}, ()).seen_by == (("pressure@9mm",) if seen else ())


def test_more_points_see_more_and_shared_errors_do_not_average() -> None:
    small = [[0.5]] * 100
    one, other = pair(residual("contour", [[0.0]] * 100, 1.0), small)
    assert effect("e", "", one, other, {}, ()).changes[0].separation == pytest.approx(5.0)
    shared = effect("e", "", one, other, {"contour@9mm": 1.0}, ()).changes[0].separation
    assert shared == pytest.approx(0.5 / np.sqrt(1.01))


def test_quantity_without_sensor_is_not_seen_but_would_be() -> None:
    one, other = pair(residual("pressure", [[5.0]], 0.0), [[100.0]])
    sensors = (
        Sensor("transducer", "pressure", 10.0),
        Sensor("gauge", "pressure", 60.0),
        Sensor("load cell", "force.plate", 0.01),
    )
    found = effect("fluid", "no fluid", one, other, {}, sensors)
    assert found.seen_by == ()
    assert effect("fluid", "", one, other, {"pressure@9mm": 1.0}, ()).seen_by == ()
    assert found.would_see == ("transducer",)
    assert found.changes[0].separation == 0.0
    assert (found.name, found.doc) == ("fluid", "no fluid")


def test_sensor_is_named_once_for_several_loads() -> None:
    loads = [replace(residual("pressure", [[0.0]], 0.0), load=d) for d in ("3mm", "9mm")]
    one = {r.name: r for r in loads}
    other = {r.name: replace(r, values=r.values + 50) for r in loads}
    found = effect("e", "", one, other, {}, (Sensor("transducer", "pressure", 10.0),))
    assert found.would_see == ("transducer",)
    assert [c.name for c in found.changes] == ["pressure@3mm", "pressure@9mm"]


def test_the_same_model_twice_has_no_effect() -> None:
    one, other = pair(residual("contour", [[1.0], [2.0]], 0.5), [[0.0], [0.0]])
    found = effect("none", "", one, other, {}, (Sensor("s", "contour", 1e-9),))
    assert found.changes[0].separation == 0.0
    assert found.seen_by == found.would_see == ()


def test_a_number_that_is_not_finite_is_no_entry() -> None:
    assert [TableCell(v).value for v in (float("nan"), float("inf"), 2.0)] == [None, None, 2.0]
    with pytest.raises(ComparisonError, match="table 't': no heading 'why' to stand"):
        NumberTable("t", "a title", ("E", "u"), ((1.0, 2.0),), below="why")
    with pytest.raises(ComparisonError, match="table 't': a row of 1 under 2 headings"):
        NumberTable("t", "a title", ("E", "u"), ((1.0,),))
    with pytest.raises(ComparisonError, match="table 'a title': a number"):
        NumberTable("", "a title", ("E", "u"), (("a", float("nan")),))
