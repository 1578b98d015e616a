"""What `validate new` computes again in each of these tests is computed once, or left out."""

import pickle
from collections.abc import Iterator
from hashlib import sha256
from typing import Any

import pytest

from validate.arrays import Floats
from validate.commands.questions import motion, new
from validate.fem import critical as modes
from validate.fem.critical import lowest
from validate.pipeline.bodies.first_modes import COUNT, first_frequencies
from validate.pipeline.bodies.own_body import with_law
from validate.pipeline.run.estimate import estimated
from validate.scene.scene import Scene

STIFF = (  # nothing moves fast
    "test_new.py", "test_new_body.py", "test_new_contact.py", "test_new_laws.py",
    "test_new_mesh.py",
)  # fmt: skip
_FOUND: dict[bytes, tuple[float, ...]] = {}
_MODES: dict[tuple[bytes, int], tuple[Floats, Floats]] = {}


@pytest.fixture(scope="module", autouse=True)
def _same_bodies_once(request: pytest.FixtureRequest) -> Iterator[None]:
    """A body's modes are a third of a command's time: they are high where nothing moves fast, else
    found once for one body. How long a first answer takes is not estimated."""

    def once(scene: Scene, count: int = COUNT) -> tuple[float, ...]:
        if request.path.name in STIFF:
            return (1e4,)
        body = pickle.dumps((with_law(scene, "linear"), count))
        if body not in _FOUND:
            _FOUND[body] = first_frequencies(scene, count)
        return _FOUND[body]

    def lowest_once(K: Any, M: Any, count: int) -> tuple[Floats, Floats]:
        matrices = sha256(pickle.dumps((K.data, K.indices, M.data))).digest()
        if (matrices, count) not in _MODES:
            _MODES[matrices, count] = lowest(K, M, count)
        squares, shapes = _MODES[matrices, count]
        return squares.copy(), shapes.copy()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(modes, "lowest", lowest_once)
        patch.setattr(motion, "first_frequencies", once)
        patch.setattr(new, "estimated", lambda path: None)
        yield


@pytest.fixture
def estimates(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a first answer takes is estimated, for a test that reads it."""
    monkeypatch.setattr(new, "estimated", estimated)
