"""The grammar of sweeps: values, grids, refusals."""

import pytest

from validate.errors import UsageError
from validate.study.sweep import Axis, axes, axis, grid


def test_logarithmic_and_linear_axes_hit_both_ends() -> None:
    assert axis("twin.noise=log:1e-6:1e-1:6").values == (
        "1e-06", "1e-05", "0.0001", "0.001", "0.01", "0.1",
    )  # fmt: skip
    assert axis("methods.kf.Q=lin:1:2:3") == Axis("methods.kf.Q", ("1", "1.5", "2"))


def test_listed_values_stay_as_written() -> None:
    assert axis("methods.kf.rule = average, backward_euler").values == ("average", "backward_euler")


def test_values_carry_units_and_are_numbers_in_the_first_one() -> None:
    listed = axis("material.E=10kPa,20kPa,0.05MPa")
    assert listed.values == ("10kPa", "20kPa", "0.05MPa")
    assert (listed.numbers, listed.label) == ((10.0, 20.0, 50.0), "material.E / kPa")
    spaced = axis("methods.kf.Q=log:1e-6mm2:1e-4mm2:3")
    assert spaced.values == ("1e-06mm2", "1e-05mm2", "0.0001mm2")
    assert axis("a=lin:1kPa:3000Pa:3").numbers == (1.0, 2.0, 3.0)
    assert axis("a=10kPa,20").numbers is None  # a bare number is SI: not the same axis
    assert axis("a=20,10kPa").numbers is None
    assert axis("a=10kPa,5mm").numbers is None
    assert (axis("a=1,2").numbers, axis("a=1,2").label) == ((1.0, 2.0), "a")


def test_several_axes_make_a_grid_with_the_last_fastest() -> None:
    rows = grid(axes(["a=1,2", "b=x,y"]))
    assert [tuple(r.values()) for r in rows] == [("1", "x"), ("1", "y"), ("2", "x"), ("2", "y")]
    assert grid(()) == ({},)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("twin.noise", "expected PATH"),
        ("=1,2", "expected PATH"),
        ("a=1,,2", "empty value"),
        ("a=1,1", "is given twice"),
        ("a=log:0:1:5", "above 0"),
        ("a=log:1:2", "FIRST:LAST:COUNT"),
        ("a=lin:0:1:1", "2 to"),
        ("a=lin:0:inf:3", "expected FIRST and LAST as numbers"),
        ("a=log:1kPa:5:3", "with the same unit"),
        ("a=log:1kPa:5mm:3", "with the same unit"),
        ("a=lin:0:1:9999999999", "2 to"),
    ],
)
def test_what_is_no_sweep_is_refused(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        axis(text)


def test_a_path_is_swept_once() -> None:
    with pytest.raises(UsageError, match="swept twice"):
        axes(["a=1,2", "a=3,4"])
