"""Parameters of a declared experiment: its recording, its scene, and further settings.

The scene's paths have no prefix (`material.E`, `body.cells`), nor have the settings' own.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from math import sqrt
from pathlib import Path
from typing import Any

from validate.display import Screen
from validate.errors import ComparisonError, UsageError
from validate.files import modified
from validate.parameters import describe, part, quantity, value_at, with_given
from validate.pipeline.experiment.variation import change_of
from validate.recording.types import Recording
from validate.register.registration import Registered, as_declared
from validate.scene.geometries.refinement import size_against
from validate.scene.geometries.specification import Geometry, MeshFile, cell_size
from validate.scene.laws import Coefficients
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh
from validate.scene.meshless import Meshless
from validate.scene.scene import Scene
from validate.twin.tracker import Camera, require_noise

# --- What the parameters of several experiments have in common: cards, and changes of them.


@dataclass(frozen=True)
class TimeSteps:
    """Time step s of the models, and how many of them a run takes."""

    dt: float = quantity(1e-3, "s", "time step")
    steps: int = quantity(1000, "1", "steps")


@dataclass(frozen=True)
class Meshes:
    """Meshes in addition to that of the body, for u_num."""

    finer: float = quantity(1.5, "1", "of a grid: how many times finer the finest mesh is")
    budget: bool = quantity(
        True, "1", "keep a first answer to about 30 s by fewer meshes; false: as --refine"
    )


@dataclass(frozen=True)
class TrackedTwin:
    """Settings of the twin behind a tracked recording; the models do not use them."""

    seed: int = quantity(1, "1", "seed of the noise")
    noise: float = quantity(1e-9, "m2", "variance of the white noise per component (.001 mm2)")
    stiffness: float = quantity(1.0, "1", "ratio of its modulus to that of the models")
    nu: float | None = quantity(None, "1", "its Poisson ratio; none: that of the models")
    every: int = quantity(1, "1", "steps between two samples of the tracker")
    missing: float = quantity(0.0, "1", "share of samples at which a marker is missing")

    def __post_init__(self) -> None:
        require_noise(self.noise)

    @property
    def camera(self) -> Camera:
        """The tracker; its registration rests on 10 000 looks at rest."""
        return Camera(sqrt(self.noise), self.every, self.missing, still=10_000)

    def true(self, material: Material) -> Material:
        """Return the models' material as the twin has it."""
        nu = material.nu if self.nu is None else self.nu
        return replace(material, E=self.stiffness * material.E, nu=nu)


def require_used(given: Coefficients, laws: set[LawName]) -> None:
    """Raise `UsageError` for coefficients of the material that the law of no method knows."""
    for f in fields(given):
        value = getattr(given, f.name)
        if value != f.default and all(getattr(given.known_to(w), f.name) != value for w in laws):
            raise UsageError(
                f"material.{f.name} = {value}: no method has a law with this parameter, only "
                f"{', '.join(sorted(laws))}; set methods.NAME.law"
            )


# -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tree:
    """`settings` are a dataclass of what no scene holds: a twin, a registration, a data folder.

    The scene may be one without a mesh (`scene.meshless`); there is none where all of it follows
    from the recording, and `build` makes it.
    """

    recording: str = quantity("", "1", "recording, from the experiment's folder")
    scene: Scene = part(None, "what is simulated")
    settings: Any = part(None, "of this experiment alone")

    def __repr__(self) -> str:
        return self._screen.text

    def _repr_html_(self) -> str:
        return self._screen.html

    @property
    def _screen(self) -> Screen:
        every = describe(self)
        rows = tuple((p.path, str(p.default), "" if p.unit == "1" else p.unit) for p in every)
        return Screen(f"{len(every)} parameters", (), ("path", "value", "unit"), rows)

    def with_scene(self, **changes: Any) -> "Tree":
        return replace(self, scene=replace(self.scene, **changes))

    def with_settings(self, **changes: Any) -> "Tree":
        return replace(self, settings=replace(self.settings, **changes))

    def given(self, values: Mapping[str, Any]) -> "Tree":
        """With other values by path; raises what `parameters.with_given` does."""
        changed: Tree = with_given(self, values)
        return changed


def beside(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """Return the one recording that the tree names, from the experiment's folder or the current
    one."""
    from validate.recording.readers import read_recording  # all formats: only where needed

    own = folder / tree.recording
    return (read_recording(own if own.exists() else Path(tree.recording)),)


def placed_by_names(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """Return the recording by the names of the scene's inputs (see `as_declared`)."""
    return as_declared(recording, scene)


@dataclass(frozen=True)
class Built:
    """Makes the scene of a method, with its changes by path, on the mesh of its body.

    Mesh files are found from the `folder`. See `pipeline.experiment.variation`.
    """

    folder: Path = field(default=Path(), compare=False)

    def __call__(
        self, recording: Recording | None, tree: Tree, changes: Mapping[str, Any] | None = None
    ) -> Scene:
        changed = changed_by(tree, changes or {})
        scene: Any = changed.scene
        if not isinstance(scene, Meshless):
            scene = scene.resolved(mesh_of(recording, changed, self.folder))
        built: Scene = scene
        return built


def changed_by(tree: Tree, changes: Mapping[str, Any]) -> Tree:
    """Return the tree with a method's changes by path; its law keeps what it knows of the
    coefficients.

    Raises `UsageError` where a change follows a value that stands open.
    """
    law = changes.get("material.law")
    if law and not follows(law):
        tree = tree.with_scene(material=tree.scene.material.of_law(law))
    changed: Tree = change_of(changes)(tree)
    return changed


def valued(tree: Tree, changes: Mapping[str, Any], given: Collection[str]) -> dict[str, Any]:
    """Return a method's changes with the texts of the paths `given` as values; what follows another
    parameter, or is a factor or a step, does so later.

    Raises what `changed_by` does for a path or a value; what stands open may be followed.
    """
    own = {path: value for path, value in changes.items() if not follows(value)}
    changed = changed_by(tree, own)
    for value in changes.values():
        if follows(value):
            value_at(tree, value[3:])
    fixed = [path for path in given if path in own and own[path][:2] not in ("x ", "+ ", "- ")]
    return {**changes, **{path: value_at(changed, path)[0] for path in fixed}}


def follows(value: Any) -> bool:
    """Return whether a change takes another parameter's value: "as PATH"."""
    return isinstance(value, str) and value.startswith("as ")


@dataclass(frozen=True)
class CellSize:
    """The edge m of a cube as large as a mean cell of the declared body."""

    folder: Path = field(default=Path(), compare=False)

    def __call__(self, tree: Tree) -> float:
        """A body whose mesh follows from a recording says its own.

        Cells of a file that were filled anew have another shape: their nodes are counted.
        """
        own: float | None = getattr(tree.scene.body, "cell_size", None)
        if own is not None:
            return own
        if not isinstance(tree.scene.body, MeshFile):
            return cell_size(mesh_of(None, tree, self.folder))
        plain = replace(tree.scene.body, element="linear")
        file = mesh_of(None, tree.with_scene(body=replace(plain, halvings=0)), self.folder)
        if plain.halvings >= 0:
            return float(cell_size(file) / 2**plain.halvings)
        anew = mesh_of(None, tree.with_scene(body=plain), self.folder)
        return cell_size(file) * size_against(file, anew)


@dataclass(frozen=True)
class ScaledBody:
    """The declared body with about `share` of the cells along every edge, similar to it."""

    share: float

    def __call__(self, tree: Tree) -> Tree:
        return tree.with_scene(body=tree.scene.body.scaled(self.share))


def mesh_of(recording: Recording | None, tree: Tree, folder: Path) -> Mesh:
    """Return the mesh of the declared body. Raises `ComparisonError` where it follows from a
    recording and there is none."""
    body = tree.scene.body
    if isinstance(body, Mesh):
        return body
    if isinstance(body, Geometry):
        file = getattr(body, "file", "")
        return _meshed(body, folder.resolve(), modified(folder / file) if file else 0)
    if recording is None:
        raise ComparisonError("the mesh of this body follows from a recording; give one")
    mesh: Mesh = body(recording, tree)
    return mesh


@lru_cache(maxsize=8)
def _meshed(body: Geometry, folder: Path, changed: int) -> Mesh:
    """The mesh of a geometry; a file is read again where it has `changed`."""
    return body.resolved(folder)
