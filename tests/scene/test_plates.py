"""A block between plates: what is held follows the faces and directions that are declared."""

import numpy as np
import pytest

from validate.fem.system import build
from validate.scene.box import box
from validate.scene.material import Material
from validate.scene.plates import Contact, Plates, between_plates
from validate.scene.scene import Drive, Scene, Support

ALONG_X = Plates(Drive("press", "x1", (-1.0, 0.0, 0.0)), "x0", Support("y0", (1,)))
ALONG_Z = Plates(Drive("press", "z0", (0.0, 0.0, 1.0)), "z1", Support("x1", (0,)))


def scene(plates: Plates, contact: Contact, size: tuple[float, float, float]) -> Scene:
    return between_plates(box(size, (2, 2, 2)), Material(1e4, 0.3), contact, plates, friction=1e5)


@pytest.mark.parametrize("contact", ["slip", "partial", "bonded"])
def test_every_contact_leaves_a_definite_body(contact: Contact) -> None:
    for plates in (ALONG_X, ALONG_Z):
        build(scene(plates, contact, (1.0, 0.8, 0.6))).factor()


def test_slipping_plates_hold_their_own_direction_alone() -> None:
    found = scene(ALONG_Z, "slip", (1.0, 0.8, 0.6))
    assert found.supports == (Support("z1", (2,)), Support("x1", (0,)))
    assert found.pins[0].components == (1,)
    assert found.pins[0].point == (0.0, 0.4, 0.0)


def test_bonded_plates_hold_everything_and_partial_ones_by_springs() -> None:
    bonded = scene(ALONG_X, "bonded", (1.0, 0.8, 0.6))
    assert Support("x0", (0, 1, 2)) in bonded.supports
    assert Support("x1", (1, 2)) in bonded.supports
    rubbing = scene(ALONG_X, "partial", (1.0, 0.8, 0.6)).foundations
    assert [(f.facets, f.components, f.stiffness) for f in rubbing] == [
        ("x0", (1, 2), 1e5),
        ("x1", (1, 2), 1e5),
    ]


def test_the_axes_may_be_named_anew() -> None:
    """The same block turned, x y z to z x y with both faces exchanged: the same force."""
    forces = []
    for plates, size in ((ALONG_X, (0.6, 1.0, 0.8)), (ALONG_Z, (1.0, 0.8, 0.6))):
        system = build(scene(plates, "slip", size))
        u = system.moves[:, 0].copy()
        u[system.free] = system.factor().solve(-(system.K @ u)[system.free])
        forces.append(float(system.moves[:, 0] @ (system.K @ u)))
    assert forces[0] == pytest.approx(forces[1], rel=1e-9)
    assert np.isclose(forces[0], 1e4 * 0.8 / 0.6)
