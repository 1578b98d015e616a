"""What `validate new` computes again in each of these tests is computed once, or left out."""

import pickle
from collections.abc import Iterator

import pytest

from validate.commands.questions import motion, new
from validate.pipeline.bodies.first_modes import COUNT, first_frequencies
from validate.pipeline.bodies.own_body import with_law
from validate.scene.scene import Scene

ESTIMATED = ("test_new_mesh.py", "test_new_slender.py")  # they read what a first answer takes
STIFF = (  # nothing moves fast
    "test_new.py", "test_new_body.py", "test_new_contact.py", "test_new_laws.py",
    "test_new_mesh.py",
)  # fmt: skip
_FOUND: dict[bytes, tuple[float, ...]] = {}


@pytest.fixture(scope="module", autouse=True)
def _same_bodies_once(request: pytest.FixtureRequest) -> Iterator[None]:
    """A body's modes are a third of a command's time: they are high where nothing moves fast, else
    found once for one body. How long a first answer takes is estimated where a test reads it."""

    def once(scene: Scene, count: int = COUNT) -> tuple[float, ...]:
        if request.path.name in STIFF:
            return (1e4,)
        body = pickle.dumps((with_law(scene, "linear"), count))
        if body not in _FOUND:
            _FOUND[body] = first_frequencies(scene, count)
        return _FOUND[body]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(motion, "first_frequencies", once)
        if request.path.name not in ESTIMATED:
            patch.setattr(new, "estimated", lambda path: None)
        yield
