"""Response columns of the phantom and of a block with two cavities."""

import pytest
from phantoms import grid_mesh, phantom_responses

from validate.fem.system import Responses, build
from validate.scene.material import Material
from validate.scene.scene import Cavity, Drive, Scene, Support


@pytest.fixture(scope="module")
def phantom() -> Responses:
    return phantom_responses()


@pytest.fixture(scope="module")
def two_cavities() -> Responses:
    """A block with a thin septum between two boxes of fluid, pressed from x1."""
    mesh = grid_mesh(
        (10, 5, 5),
        (0.06, 0.03, 0.03),
        (
            (slice(2, 4), slice(1, 3), slice(1, 3)),
            (slice(5, 8), slice(1, 3), slice(1, 3)),
        ),
    )
    supports = (Support("x0", (0, 1, 2)),)
    drives = (Drive("stage", "x1", (-1.0, 0.0, 0.0)),)
    cavities = (Cavity("left", "hole0"), Cavity("right", "hole1"))
    return Responses.of(build(Scene(mesh, Material(1e4, 0.4), supports, (), drives, cavities)))
