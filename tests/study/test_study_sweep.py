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
        ("a=1,1", "stands twice"),
        ("a=log:0:1:5", "above 0"),
        ("a=log:1:2", "FIRST:LAST:COUNT"),
        ("a=lin:0:1:1", "2 to"),
        ("a=lin:0:inf:3", "2 to"),
        ("a=lin:0:1:9999999999", "2 to"),
    ],
)
def test_what_is_no_sweep_is_refused(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        axis(text)


def test_a_path_is_swept_once() -> None:
    with pytest.raises(UsageError, match="swept twice"):
        axes(["a=1,2", "a=3,4"])
