"""The scene: a mesh, what it is made of, how it is held and driven, and the fluid in it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.errors import SceneError
from validate.scene.mesh import Mesh

Dilatation = Literal["pointwise", "nodal_mean"]
LawName = Literal["linear", "svk", "neo_hooke"]


@dataclass(frozen=True)
class Material:
    """Isotropic elasticity: E Pa, nu -, and the law at large strain (`fem.laws`).

    Every law has this E and nu at small strain, which is all that the linear schemes use.
    """

    E: float
    nu: float
    law: LawName = "linear"

    def __post_init__(self) -> None:
        if not (np.isfinite(self.E) and self.E > 0):
            raise SceneError(f"modulus E = {self.E:g} Pa: it must be positive")
        if not -1 < self.nu < 0.5:
            raise SceneError(
                f"Poisson ratio nu = {self.nu:g}: displacement elements need -1 < nu < 0.5 "
                "(1/(1 - 2 nu) is infinite at 0.5); use at most 0.4999"
            )

    @property
    def shear_modulus(self) -> float:
        """mu Pa."""
        return self.E / (2 * (1 + self.nu))

    @property
    def bulk_modulus(self) -> float:
        """kappa Pa."""
        return self.E / (3 * (1 - 2 * self.nu))


@dataclass(frozen=True)
class Support:
    """Displacement components held at zero on a facet set."""

    facets: str
    components: tuple[int, ...]


@dataclass(frozen=True)
class Pin:
    """One node, the nearest to `point` m, held in some components."""

    point: tuple[float, ...]
    components: tuple[int, ...]


@dataclass(frozen=True)
class Drive:
    """A facet set moved along `direction` (d,), a unit vector along an axis, by a named input in m.

    The reported force is that on the plate against the motion: compression positive.
    """

    name: str
    facets: str
    direction: tuple[float, ...]


@dataclass(frozen=True)
class Foundation:
    """Springs from a facet set to the ground along some components: stiffness N/m^3.

    Zero lets the facets slip, infinity would bond them; what lies between is partial friction.
    """

    facets: str
    components: tuple[int, ...]
    stiffness: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.stiffness) and self.stiffness >= 0):
            raise SceneError(f"foundation stiffness {self.stiffness:g} N/m3: a number >= 0")


@dataclass(frozen=True)
class Membrane:
    """A taut elastic sheet glued to a facet set: thickness m."""

    facets: str
    thickness: float
    material: Material

    def __post_init__(self) -> None:
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise SceneError(f"membrane thickness {self.thickness:g} m: a number above 0")


@dataclass(frozen=True)
class Cavity:
    """A closed facet set filled with fluid at one gauge pressure Pa."""

    name: str
    facets: str


@dataclass(frozen=True)
class Scene:
    """What is simulated. Parts that are absent cost nothing.

    `copies`: planes of symmetry leave this many equal parts, of which the mesh is one; the force
    of a drive is that on the whole body.
    """

    mesh: Mesh
    material: Material
    supports: tuple[Support, ...] = ()
    pins: tuple[Pin, ...] = ()
    drives: tuple[Drive, ...] = ()
    cavities: tuple[Cavity, ...] = ()
    dilatation: Dilatation = "pointwise"
    copies: int = 1
    foundations: tuple[Foundation, ...] = ()
    membranes: tuple[Membrane, ...] = ()

    def __post_init__(self) -> None:
        if self.dilatation == "nodal_mean" and self.mesh.order != 1:
            raise SceneError("nodal mean dilatation is for linear elements; use order 1")
        if self.mesh.dimension == 2 and (
            self.dilatation == "nodal_mean" or self.foundations or self.membranes
        ):
            raise SceneError("mean dilatation, foundations and membranes are for 3-D meshes")
        if self.copies < 1:
            raise SceneError(f"{self.copies} copies of the mesh: at least 1")
        named = [s.facets for s in self.supports]
        named += [f.facets for f in self.foundations] + [m.facets for m in self.membranes]
        named += [d.facets for d in self.drives] + [c.facets for c in self.cavities]
        for facets in named:
            self.mesh.facet_nodes(facets)
