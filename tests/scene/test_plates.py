"""Plates press along the axis that is declared: the same block turned gives the same force."""

import pytest

from validate.errors import SceneError
from validate.fem.system import build, responses
from validate.scene.inclusion import Block, Capsule, block_with_inclusion
from validate.scene.plates import Contact, Plates, between_plates
from validate.scene.scene import Material

SPHERE = Capsule((0.02, 0.02, 0.02), 0.006, 0.012)
CUBE = block_with_inclusion(Block(0.04, 0.04, 0.04), (7, 7, 7), SPHERE)


def force(plates: Plates, contact: Contact) -> float:
    scene = between_plates(CUBE, plates, Material(15e3, 0.45), contact, friction=1e5)
    return float(responses(build(scene)).reactions[0, 0])


@pytest.mark.parametrize("contact", ["slip", "partial", "bonded"])
def test_a_cube_with_a_sphere_is_as_stiff_along_every_axis(contact: Contact) -> None:
    """Kuhn's cells are the same along x, y and z; the plates may press from either side."""
    along_x = force(Plates("x0", "x1", floor="y0"), contact)
    assert along_x > 0
    for other in (Plates("z0", "z1", floor="y0"), Plates("y0", "y1", floor="z0")):
        assert force(other, contact) == pytest.approx(along_x, rel=1e-9)
    turned = force(Plates("x1", "x0", floor="y0"), contact)
    assert turned == pytest.approx(along_x, rel=0.02)


@pytest.mark.parametrize("plates", [("x0", "y1", "z0"), ("x0", "x1", "x0")])
def test_plates_that_do_not_face_each_other_are_refused(plates: tuple[str, str, str]) -> None:
    with pytest.raises(SceneError, match="two opposite faces and one beside them"):
        Plates(*plates)
