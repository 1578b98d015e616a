"""How large something was, measured and simulated: by hand, and with noise that is known."""

import numpy as np
import pytest

from validate.arrays import Floats
from validate.compare.bias import Size, kind_of, size_of
from validate.compare.residual import Residual


def residual(simulated: Floats, measured: Floats, sd: float = 0.0, **more: float) -> Residual:
    off = np.array(simulated) - np.array(measured)
    return Residual(
        "tip", "52g", off, sd, more.get("systematic", 0.0), "m", "", reference=np.array(measured)
    )


def test_a_field_by_hand() -> None:
    measured = np.array([[3.0, 0.0], [0.0, 4.0]])
    assert size_of(residual(1.1 * measured, measured)) == Size(
        pytest.approx(np.sqrt(12.5)), pytest.approx(1.1 * np.sqrt(12.5)), 0.0
    )
    across = measured + [[0.0, 5.0], [5.0, 0.0]]
    size = size_of(residual(across, measured))  # what lies across is no part of the size
    assert size is not None
    assert size.simulated == pytest.approx(size.measured)
    other_way = size_of(residual(-0.5 * measured, measured))
    assert other_way is not None
    assert other_way.simulated == pytest.approx(-0.5 * other_way.measured)


def test_one_number_is_as_it_is_and_its_sign_is_the_measured_one() -> None:
    found = Residual("force", "3mm", np.array([[-0.5]]), 0.1, 0.2, "N", "", -4.5, -4.0)
    assert size_of(found) == Size(4.0, 4.5, pytest.approx(np.hypot(0.1, 0.2)))


def test_what_has_no_zero_or_is_all_noise_has_no_size() -> None:
    off = np.array([[1e-4], [2e-4]])
    assert size_of(Residual("contour", "9mm", off, 1e-4, 0.0, "m", "")) is None
    assert size_of(residual(off, off, sd=1e-3)) is None
    assert size_of(residual(0 * off, 0 * off)) is None


def test_noise_moves_neither_size_and_u_is_its_spread() -> None:
    rng = np.random.default_rng(1)
    truth, sd = rng.normal(size=(40, 3)), 0.2
    draws = 4000
    found = [
        size_of(residual(1.2 * truth, truth + sd * n, sd)) for n in rng.normal(size=(draws, 40, 3))
    ]
    ratio = np.array([s.simulated / s.measured for s in found if s])
    assert len(ratio) == draws
    u = np.array([s.u / s.measured for s in found if s])
    assert ratio.mean() == pytest.approx(1.2, abs=0.006)  # with its noise left in: 1.15
    assert ratio.std() == pytest.approx(1.2 * u.mean(), rel=0.1)


@pytest.mark.parametrize(
    ("quantity", "unit", "kind"),
    [
        ("force", "N", "force"), ("force.plate", "N", "force"), ("pressure", "Pa", "pressure"),
        ("tip.vertical", "m", "displacement"), ("contour.material", "m", "position"),
        ("nominal_stress", "Pa", "stress"), ("free_stretch", "1", "stretch"),
        ("stretch", "m", "displacement"),
        ("ringing", "Hz", "frequency"), ("volume.relative_error", "1", ""),
    ],
)  # fmt: skip
def test_what_a_quantity_is_called(quantity: str, unit: str, kind: str) -> None:
    assert kind_of(quantity, unit) == kind
