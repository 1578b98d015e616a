"""What an experiment gives its methods, and what a wider specimen means."""

import pytest

from validate.compare.verdict import Accept
from validate.replay.compression import Compression, CompressionRanges, Gel, compression, pressed
from validate.replay.method import Method
from validate.solve.newmark import Newmark


@pytest.mark.parametrize("stride", [1, 3])
def test_a_long_step_is_so_many_of_the_recordings(stride: int) -> None:
    assert Method("m", Newmark(), stride=stride).given({"dt": 0.01}).dt == stride * 0.01


def test_a_wider_specimen_is_as_much_stiffer_as_its_area_is_larger() -> None:
    card = Compression(material=Gel(E=10e3), ranges=CompressionRanges(diameter=0.1))
    methods = {"slip": pressed("slip")}
    made = compression("c", "", "", card, methods, ("slip",), (Accept("force", 1.0, ""),))
    assert made.uncertainty is not None
    inputs = {i.name: i.by(1.0)(card).material.E for i in made.uncertainty.inputs}
    assert inputs["diameter"] == pytest.approx(10e3 * 1.1**2)
    assert inputs["modulus"] == pytest.approx(10e3 * 1.05)
