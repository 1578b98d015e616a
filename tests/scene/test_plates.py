"""A block between plates: what is held follows the faces and directions that are declared."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from validate.errors import SceneError
from validate.fem.system import build
from validate.scene.geometries.box import box
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Contact, Drive, Foundation, Pin, Scene, Support

ALONG_X = Scene(
    Box((1.0, 0.8, 0.6), (2, 2, 2)),
    Material(1e4, 0.3),
    (Support("x0", (0,)), Support("y0", (1,))),
    (Pin(middle_of="x0 & y0", components=(2,)),),
    (Drive("press", "x1", "-x"),),  # type: ignore[arg-type]
    foundations=(Foundation("x0 + x1", (1, 2), 1e5, "slip", "plates"),),
)
ALONG_Z = replace(
    ALONG_X,
    supports=(Support("z1", (2,)), Support("x1", (0,))),
    pins=(Pin(middle_of="z1 & x1", components=(1,)),),
    drives=(Drive("press", "z0", "+z"),),  # type: ignore[arg-type]
    foundations=(Foundation("z0 + z1", (0, 1), 1e5, "slip", "plates"),),
)


def scene(declared: Scene, contact: Contact, size: tuple[float, float, float]) -> Scene:
    body = replace(declared.body, size=size)
    (plates,) = declared.foundations
    asked = replace(declared, body=body, foundations=(replace(plates, contact=contact),))
    return asked.resolved(body.resolved(Path()))


@pytest.mark.parametrize("contact", ["slip", "partial", "bonded"])
def test_every_contact_leaves_a_definite_body(contact: Contact) -> None:
    for declared in (ALONG_X, ALONG_Z):
        build(scene(declared, contact, (1.0, 0.8, 0.6))).factor()


def test_slipping_plates_hold_their_own_direction_alone() -> None:
    found = scene(ALONG_Z, "slip", (1.0, 0.8, 0.6))
    assert found.supports == (Support("z1", (2,)), Support("x1", (0,)))
    assert found.pins == (Pin((1.0, 0.4, 0.6), (1,)),)


def test_the_middle_of_a_place_follows_the_bodys_size() -> None:
    for width in (0.6, 0.8):
        assert scene(ALONG_X, "slip", (1.0, 0.8, width)).pins[0].point == (0.0, 0.0, width / 2)


def test_a_pin_is_at_one_place_which_a_mesh_knows() -> None:
    for given in ({}, {"point": (0.0, 0.0, 0.0), "middle_of": "x0"}):
        with pytest.raises(SceneError, match=r"pin at .*, in the middle of '.*'"):
            Pin(**given)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="middle of 'x0' is of a declared scene"):
        Scene(box((1.0, 1.0, 1.0), (1, 1, 1)), Material(1.0, 0.3), pins=(Pin(middle_of="x0"),))


def test_bonded_plates_hold_everything_and_partial_ones_by_springs() -> None:
    bonded = scene(ALONG_X, "bonded", (1.0, 0.8, 0.6))
    assert {Support("x0", (1, 2)), Support("x1", (1, 2))} < set(bonded.supports)
    rubbing = scene(ALONG_X, "partial", (1.0, 0.8, 0.6)).foundations
    assert [(f.facets, f.components, f.stiffness) for f in rubbing] == [
        ("x0", (1, 2), 1e5),
        ("x1", (1, 2), 1e5),
    ]


def test_the_axes_may_be_named_anew() -> None:
    """The same block turned, x y z to z x y with both faces exchanged: the same force."""
    forces = []
    for declared, size in ((ALONG_X, (0.6, 1.0, 0.8)), (ALONG_Z, (1.0, 0.8, 0.6))):
        system = build(scene(declared, "slip", size))
        u = system.moves[:, 0].copy()
        u[system.free] = system.factor().solve(-(system.K @ u)[system.free])
        forces.append(float(system.moves[:, 0] @ (system.K @ u)))
    assert forces[0] == pytest.approx(forces[1], rel=1e-9)
    assert np.isclose(forces[0], 1e4 * 0.8 / 0.6)
