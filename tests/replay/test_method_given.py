"""What an experiment gives its methods, and what a wider specimen means."""

import pytest

from validate.compare.verdict import Accept
from validate.errors import UsageError
from validate.parameters import with_values
from validate.recording.types import Recording, Source
from validate.replay.compression import compression, pressed
from validate.replay.compression_cards import Compression, CompressionRanges, Gel, Specimen
from validate.replay.method import Method
from validate.scene.laws import Coefficients
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


def test_coefficients_reach_the_methods_whose_law_knows_them() -> None:
    bare = Compression(specimen=Specimen(diameter=0.03, height=0.02), material=Gel(E=10e3))
    card = with_values(bare, {"material.C01": "500"})
    methods = {"slip": pressed("slip"), "soft": pressed("mooney", law="mooney_rivlin")}
    made = compression("c", "", "", card, methods, ("slip",), (Accept("force", 1.0, ""),))
    recording = Recording("r", Source("x", "", 0, "x"), 0)
    scenes = {n: made.build(recording, card, m.scene) for n, m in methods.items()}
    assert scenes["soft"].material.coefficients.C01 == 500.0
    assert scenes["slip"].material.coefficients == Coefficients()
    assert made.identify is not None
    assert made.identify((), card, methods).parameters == card
    with pytest.raises(UsageError, match=r"material.C01 = 500.0: no method .* only linear; set"):
        made.identify((), card, {"slip": methods["slip"]})
