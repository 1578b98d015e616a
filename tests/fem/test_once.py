"""What is kept with a system stays with that system."""

from dataclasses import replace

from phantoms import grid_mesh

from validate.fem.system import build, once
from validate.scene.material import Material
from validate.scene.scene import Scene, Support


def test_made_once_for_each_key_and_system() -> None:
    system = build(Scene(grid_mesh((2, 2, 2)), Material(1e4, 0.3), (Support("z0", (0, 1, 2)),)))
    made: list[str] = []

    def make(name: str) -> list[str]:
        made.append(name)
        return [name]

    first = once(system, "a", lambda: make("a"))
    assert once(system, "a", lambda: make("again")) is first
    assert once(system, ("a", 2), lambda: make("b")) == ["b"]
    assert once(replace(system), "a", lambda: make("copy")) == ["copy"]
    assert made == ["a", "b", "copy"]
