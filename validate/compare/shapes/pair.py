"""Pair of displacement fields on one mesh, the input of metrics of two runs."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from validate.arrays import Floats, checked
from validate.compare.shapes.boundary import (
    Boundary,
    Soundness,
    deformed_boundary,
    require_upright,
    soundness,
)
from validate.errors import ComparisonError
from validate.fem.assembly.assemble import stiffness
from validate.fem.assembly.locate import barycentric_rows
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

# Nodes nearer to the mesh than this share of its size lie on it: rounding of coordinates.
ON_THE_MESH = 1e-9
MOST_OUTSIDE = 0.5  # a larger share of nodes outside means another frame or other units


@dataclass(frozen=True)
class Field:
    """A displacement field u (n, d) m on its mesh, and whose it is.

    Raises `ComparisonError` for a wrong shape, a value that is not finite and a mesh that is
    inverted at rest.
    """

    mesh: Mesh
    u: Floats
    name: str

    def __post_init__(self) -> None:
        shape = self.mesh.nodes.shape
        u = checked(self.u, f"displacement of {self.name} [m]", shape, error=ComparisonError)
        require_upright(self.mesh, self.name)
        object.__setattr__(self, "u", u)

    @cached_property
    def boundary(self) -> Boundary:
        """Where the field puts the body's boundary."""
        return deformed_boundary(self.mesh, self.mesh.nodes + self.u)

    @cached_property
    def soundness(self) -> Soundness:
        """Inverted cells, the volume enclosed and crossings of the deformed body."""
        return soundness(self.mesh, self.u, self.boundary)


@dataclass(frozen=True)
class Common:
    """The mesh both fields are carried onto; a scene on it gives densities and moduli.

    Kept over the frames of a run, it assembles K once.
    """

    mesh: Mesh
    scene: Scene | None = None

    @cached_property
    def K(self) -> sparse.csr_array:
        """Stiffness (N, N) N/m; raises `ComparisonError` without a scene, which has the moduli."""
        if self.scene is None:
            raise ComparisonError(
                "the energy norm needs moduli: give the scene of the common mesh as `onto`"
            )
        return stiffness(self.scene)

    @cached_property
    def density(self) -> Floats:
        """Density (e,) kg/m3 of every cell; 1 where no scene declares all of them."""
        materials = (
            (self.scene.material, *(r.material for r in self.scene.regions)) if (self.scene) else ()
        )
        if self.scene is None or any(m.rho is None for m in materials):
            return np.ones(len(self.mesh.cells))
        return self.scene.per_cell(lambda m: m.rho or 0.0)


@dataclass(frozen=True)
class FieldPair:
    """`one` against `other` (the reference), both carried onto a common mesh.

    u_one, u_other (n, d) m at the nodes of `on`; `outside` (k,) m holds how far every carried node
    lay from the mesh it was read from (0 within it).
    """

    one: Field
    other: Field
    common: Common
    u_one: Floats
    u_other: Floats
    outside: Floats

    @property
    def on(self) -> Mesh:
        return self.common.mesh

    @property
    def difference(self) -> Floats:
        """u' - u (n, d) m."""
        return np.asarray(self.u_one - self.u_other)

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the mesh, m."""
        return float(np.linalg.norm(np.ptp(self.on.nodes, axis=0)))

    @property
    def swapped(self) -> "FieldPair":
        """The same pair with the other field as reference."""
        return FieldPair(self.other, self.one, self.common, self.u_other, self.u_one, self.outside)

    @property
    def against(self) -> str:
        return self.other.name

    @property
    def units(self) -> Mapping[str, object]:
        return {"dimension": self.on.dimension}

    @property
    def where(self) -> str:
        """Onto which mesh, and how many nodes lay outside."""
        words = f"on a mesh of {len(self.on.nodes)} nodes ({self.on.kind})"
        if len(self.outside) == 0:
            return words
        return f"{words}, {count_outside(self)} of {len(self.outside)} carried nodes outside"


def pair(one: Field, other: Field, onto: Mesh | Scene | Common | None = None) -> FieldPair:
    """Both fields on one mesh: `onto`, or else the mesh of `other`, the reference.

    A field on another mesh is interpolated at the nodes of `onto`; a node outside that mesh reads
    the nearest point of the nearest cell and is counted. Raises `ComparisonError` for different
    dimensions and when more than half the nodes lie outside.
    """
    if isinstance(onto, Common):
        common = onto
    elif isinstance(onto, Scene):
        common = Common(onto.mesh, onto)
    else:
        common = Common(other.mesh if onto is None else onto)
    on = common.mesh
    require_upright(on, "the common mesh")
    dimensions = (one.mesh.dimension, other.mesh.dimension, on.dimension)
    if len(set(dimensions)) > 1:
        raise ComparisonError(
            f"{one.name} is {dimensions[0]}-D, {other.name} {dimensions[1]}-D and the common mesh "
            f"{dimensions[2]}-D; compare fields of one dimension"
        )
    u_one, away_one = _carried(one, on)
    u_other, away_other = _carried(other, on)
    outside = np.concatenate([away_one, away_other])
    return FieldPair(one, other, common, u_one, u_other, outside)


def same_mesh(one: Mesh, other: Mesh) -> bool:
    """Return whether both have the same nodes and cells, so that fields need no interpolation."""
    return one is other or (
        one.kind == other.kind
        and np.array_equal(one.nodes, other.nodes)
        and np.array_equal(one.cells, other.cells)
    )


def count_outside(pair: FieldPair) -> int:
    return int((pair.outside > ON_THE_MESH * pair.size).sum())


def _carried(field: Field, on: Mesh) -> tuple[Floats, Floats]:
    if same_mesh(field.mesh, on):
        return field.u, np.zeros(0)
    rows = barycentric_rows(field.mesh, on.nodes)
    away = np.linalg.norm(np.ptp(on.nodes, axis=0)) * ON_THE_MESH
    far = int((rows.outside > away).sum())
    if far > MOST_OUTSIDE * len(on.nodes):
        raise ComparisonError(
            f"{far} of {len(on.nodes)} nodes lie outside the mesh of {field.name}, up to "
            f"{1e3 * rows.outside.max():.3g} mm; check the frame and the units"
        )
    return rows.apply(field.u), rows.outside
