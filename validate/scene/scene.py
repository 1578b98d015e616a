"""Scene: a body, its material, supports, drives, loads and the fluid in it.

Declared, it is the parameter tree of an experiment: its body is a geometry
(`scene.geometries.specification`), its places are words (`scene.places`). What is simulated is
`resolved` on a mesh of the body.
"""

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, replace
from functools import cached_property
from hashlib import sha256
from typing import Any, Literal, TypeVar

import numpy as np

from validate.arrays import Floats, checked
from validate.display import brief
from validate.errors import SceneError
from validate.parameters import known, quantity, take_units
from validate.scene.contact import Needle, RigidContact, require_clear, require_usable, standing
from validate.scene.material import Material, Region
from validate.scene.mesh import Mesh
from validate.scene.places import (
    Place,
    axis_of,
    box_of,
    kind_of,
    nodes_of,
    place_of,
    resting_points,
)
from validate.units import SYMBOLIC

# --- prescribed displacements of nodes that follow tracked points as a rigid body ----------------

_AXES = "xyz"
_NOTHING = 1e-9  # singular value, of the largest, that points do not determine


@dataclass(frozen=True)
class Prescribed:
    """A set of nodes that follows `points` (label and place m), whose displacements are inputs.

    It moves by the small rigid motion nearest to what was tracked (3 points, 2 in 2-D). Declared,
    points may be `labels` alone: where they are, the recording says. Raises `SceneError` for points
    that do not determine the motion.
    """

    name: str
    facets: Place = quantity(MISSING, "1", "what follows the points")
    points: tuple[tuple[str, tuple[float, ...]], ...] = ()
    labels: tuple[str, ...] = quantity((), "1", "names of the points, where the recording has them")

    def __post_init__(self) -> None:
        if self.labels and not self.points:
            return
        labels = [label for label, _ in self.points]
        if not labels or len(set(labels)) < len(labels):
            raise SceneError(
                f"'{self.name}': {len(labels)} tracked points; expected one label for each"
            )
        sizes = {len(place) for _, place in self.points}
        if sizes not in ({2}, {3}):
            raise SceneError(f"'{self.name}': tracked points of {sorted(sizes)} coordinates")
        checked(self.places, f"points of '{self.name}' [m]", (None, None), error=SceneError)
        self.columns(self.places)

    @cached_property
    def places(self) -> Floats:
        """(p, d) m."""
        return np.array([place for _, place in self.points], dtype=np.float64)

    @property
    def inputs(self) -> tuple[str, ...]:
        """`<name>.<label>.<axis>` (p d,)."""
        axes = _AXES[: self.places.shape[1]]
        return tuple(f"{self.name}.{label}.{axis}" for label, _ in self.points for axis in axes)

    def columns(self, x: Floats) -> Floats:
        """Displacements (k d, p d) m of nodes at x (k, d) m per metre of every input."""
        d = x.shape[1]
        if d != self.places.shape[1]:
            raise SceneError(
                f"'{self.name}': points of {self.places.shape[1]} coordinates in {d} dimensions"
            )
        at = self._motions()
        sizes = np.linalg.svd(at, compute_uv=False)
        found = int((sizes > _NOTHING * sizes.max()).sum())
        if found < at.shape[1]:
            raise SceneError(
                f"'{self.name}': {len(self.points)} tracked points determine {found} of the "
                f"{at.shape[1]} numbers of a rigid motion; track more points, not in one line"
            )
        return np.asarray(_rigid(x, self.places) @ np.linalg.pinv(at))

    def deviations(self, sd: float) -> Floats:
        """Deviations (6 or 3, p d) m of one standard deviation each, whose outer products add up to
        what the set follows of `sd` m of every coordinate.

        What the points' noise has beyond its rigid motions moves nothing.
        """
        motions, _ = np.linalg.qr(self._motions())
        return np.asarray(sd * motions.T)

    def _motions(self) -> Floats:
        """Displacements (p d, 6 or 3) m of the points in every rigid motion."""
        return _rigid(self.places, self.places)


def _rigid(x: Floats, around: Floats) -> Floats:
    """Motions (k d, 3 or 6): translations and small rotations about the middle of the points."""
    k, d = x.shape
    middle, size = around.mean(axis=0), max(float(np.ptp(around, axis=0).max()), 1e-300)
    y = (x - middle) / size
    planes = [(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]
    motions = np.zeros((k, d, d + len(planes)))
    for c in range(d):
        motions[:, c, c] = 1.0
    for r, (i, j) in enumerate(planes):
        motions[:, i, d + r], motions[:, j, d + r] = -y[:, j], y[:, i]
    return motions.reshape(k * d, -1)


# --- scene: a body, its material, supports, drives, loads and the fluid in it --------------------

Dilatation = Literal["pointwise", "nodal_mean", "mixed", "by_element"]
PlaneState = Literal["strain", "stress"]
Contact = Literal["slip", "partial", "bonded"]


@dataclass(frozen=True)
class Support:
    """Displacement components held at zero on a facet set, or on faces, edges or points.

    What `rests` on a slippery plate is held normal to it; its middle stays there and cannot turn.
    """

    facets: Place = quantity(MISSING, "1", "where the body is held")
    components: tuple[int, ...] = quantity((0, 1, 2), "1", "0, 1, 2: held along x, y, z")
    rests: bool = quantity(False, "1", "whether its middle stays, on a slippery plate")

    def pins(self, mesh: Mesh) -> "tuple[Pin, ...]":
        """What keeps the body from sliding off and turning; raises `SceneError` where no node is
        near the middle of the place."""
        if not self.rests:
            return ()
        if len(self.components) != 1:
            raise SceneError(f"a body rests on {self.facets} along one axis, not {self.components}")
        one, other = (c for c in range(3) if c not in self.components)
        x = mesh.nodes[nodes_of(mesh, self.facets)]
        place = self.facets if isinstance(self.facets, str) else "the place it rests on"
        middle, beside = resting_points(x, one, other, place)
        return Pin(tuple(middle), (one, other)), Pin(tuple(beside), (other,))


@dataclass(frozen=True)
class Pin:
    """One node, the nearest to `point` m, held in some components.

    Declared, it may be the one nearest to the middle of a place instead: of a body whose sizes are
    open, or change.
    """

    point: tuple[float, ...] = quantity((), "m", "near the pinned node")
    components: tuple[int, ...] = quantity((0, 1, 2), "1", "0, 1, 2: held along x, y, z")
    middle_of: str = quantity("", "1", "instead of a point: place whose middle is pinned")

    def __post_init__(self) -> None:
        take_units(self)
        if bool(self.point) == bool(self.middle_of):
            raise SceneError(
                f"pin at {self.point or 'no point'}, in the middle of '{self.middle_of}': expected "
                "one of the two"
            )

    def placed(self, mesh: Mesh, places: Mapping[str, Place]) -> "Pin":
        """At a point."""
        if not self.middle_of:
            return self
        named = _placed(Support(self.middle_of), mesh, places).facets
        x = mesh.nodes[nodes_of(mesh, named)]
        return Pin(tuple((0.5 * (x.min(axis=0) + x.max(axis=0))).tolist()), self.components)


@dataclass(frozen=True, eq=False)
class DriveShape:
    """Displacements `u` (k, d) of a drive's nodes, in their order, per metre of its input."""

    u: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", checked(self.u, "shape of a drive", (None, None),
                                              error=SceneError))  # fmt: skip

    def __repr__(self) -> str:
        """Whole: what is kept by its text must not be another shape's."""
        return f"DriveShape({sha256(self.u.tobytes()).hexdigest()})"


@dataclass(frozen=True)
class Drive:
    """A facet set moved along `direction` (d,), a unit vector along an axis, by a named input in m.

    The reported force is that on the driver against the motion: compression positive. With `point`
    m only the set's node nearest to it moves, as under a needle. `speeds`: the true velocity of a
    motion that is planned piecewise linear, (from t s, m/s) in rising order, each valid from its
    instant on; what dynamic schemes read whose drive rates are "given". With a `shape` every node
    moves by its own displacement, and `direction` is only the axis that charts follow.
    """

    name: str
    facets: Place = quantity(MISSING, "1", "where it moves the body")
    direction: tuple[float, ...] = quantity(MISSING, "1", "unit vector of the motion")
    point: tuple[float, ...] | None = quantity(None, "m", "only the node nearest to it moves")
    speeds: tuple[tuple[float, float], ...] = ()
    #: The set of tracked points that makes this drive, and which of its inputs it is.
    follows: tuple[Prescribed, int] | None = None
    shape: DriveShape | None = None
    value: float | None = quantity(None, "m", "its input, where no recording gives it")

    def __post_init__(self) -> None:
        _take_direction(self)
        take_units(self)
        starts = [t for t, _ in self.speeds]
        if not all(np.isfinite(v) for _, v in self.speeds) or starts != sorted(starts):
            raise SceneError(f"drive '{self.name}': expected finite speeds and increasing times")


@dataclass(frozen=True)
class Load:
    """A force on a facet set along `direction` (d,), a unit vector, by a named input in N.

    `spread`: "consistent" takes the input as the total force of a uniform traction, "nodal" as a
    total split equally over the set's nodes, "per_node" as the force on each of its nodes. The
    direction is dead: it does not turn with the body. In 2-D N per metre of thickness. On edges a
    consistent load is uniform along them, on points it is split equally.
    """

    name: str
    facets: Place = quantity(MISSING, "1", "where it acts")
    direction: tuple[float, ...] = quantity(MISSING, "1", "unit vector of the force")
    spread: Literal["consistent", "nodal", "per_node"] = quantity(
        "consistent", "1", "how the input is spread over the place"
    )
    value: float | None = quantity(None, "N", "its input, where no recording gives it")

    def __post_init__(self) -> None:
        _take_direction(self)
        take_units(self)
        length = float(np.linalg.norm(self.direction))
        if abs(length - 1) > 1e-9:
            raise SceneError(f"load '{self.name}': direction of length {length:g}, needs 1")


@dataclass(frozen=True)
class Weight:
    """Gravity along `direction` (d,), a unit vector, by a named input in m/s^2.

    A load among loads: every cell's mass times the input, consistently, on its nodes. Gravity that
    is switched on at t = 0 is a constant input.
    """

    name: str
    direction: tuple[float, ...] = quantity(MISSING, "1", "unit vector of gravity")
    value: float | None = quantity(None, "m/s^2", "its input, where no recording gives it")

    def __post_init__(self) -> None:
        _take_direction(self)
        take_units(self)
        length = float(np.linalg.norm(self.direction))
        if abs(length - 1) > 1e-9:
            raise SceneError(f"weight '{self.name}': direction of length {length:g}, needs 1")


@dataclass(frozen=True)
class Pressure:
    """A pressure on faces by a named input in Pa, positive where it pushes into the body.

    It acts along the normals of the undeformed surface and does not follow the wall: a load of
    small strain. A fluid whose pressure follows the wall is a `Cavity`.
    """

    name: str
    facets: Place = quantity(MISSING, "1", "where it presses")
    value: float | None = quantity(None, "Pa", "its input, where no recording gives it")

    def __post_init__(self) -> None:
        take_units(self)


@dataclass(frozen=True)
class Mass:
    """A mass kg that hangs at faces, edges or points, spread over them as a uniform load is.

    It moves with its nodes, is weighed by every `Weight`, and is not damped: Rayleigh's damping is
    the body's own. Of the mesh, as the body's own mass is: with `copies` each has one.
    """

    name: str
    facets: Place = quantity(MISSING, "1", "where it hangs")
    mass: float = quantity(MISSING, "kg", "mass; 0: none hangs there")

    def __post_init__(self) -> None:
        take_units(self)
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise SceneError(f"mass '{self.name}': {self.mass:g} kg; expected a mass of 0 or above")


@dataclass(frozen=True)
class Probe:
    """A point m whose displacement is traced at every step as `<name>.x`, `.y`, `.z`.

    `stands`: it stands off the surface, as a marker on a stalk, and turns with the cell below it.
    """

    name: str
    point: tuple[float, ...] = quantity(MISSING, "m", "place at rest")
    stands: bool = quantity(False, "1", "whether it stands off the surface")

    def __post_init__(self) -> None:
        take_units(self)


@dataclass(frozen=True)
class Foundation:
    """Springs from a facet set to the ground along some components: stiffness N/m^3.

    Zero lets the facets slip, infinity would bond them; what lies between is partial friction.
    Declared, its `contact` may be either end as well: what slips has no springs, what is bonded is
    held.
    """

    facets: Place = quantity(MISSING, "1", "where the springs are")
    components: tuple[int, ...] = quantity(MISSING, "1", "0, 1, 2: springs along x, y, z")
    stiffness: float = quantity(MISSING, "N/m^3", "of the springs, if partial")
    contact: Contact = quantity("partial", "1", "slips, has springs, or is held")
    name: str = ""

    def __post_init__(self) -> None:
        take_units(self)
        if not (np.isfinite(self.stiffness) and self.stiffness >= 0):
            raise SceneError(
                f"foundation stiffness {self.stiffness:g} N/m3: expected a number >= 0"
            )


@dataclass(frozen=True)
class Membrane:
    """A taut elastic sheet glued to a facet set: thickness m. Declared, one of 0 is none."""

    facets: Place = quantity(MISSING, "1", "where it is glued to the body")
    thickness: float = quantity(MISSING, "m", "thickness; 0: none")
    material: Material = quantity(MISSING, "1", "of the sheet")
    name: str = ""

    def __post_init__(self) -> None:
        take_units(self)
        if not (np.isfinite(self.thickness) and self.thickness >= 0):
            raise SceneError(f"membrane thickness {self.thickness:g} m: expected a number >= 0")


@dataclass(frozen=True)
class Cavity:
    """A closed facet set filled with fluid at one gauge pressure Pa.

    Declared, "hole*" is every facet set whose name begins so, each with a fluid of its own: of the
    cavity "hole" they are "hole0", "hole1".
    """

    name: str
    facets: str = quantity(MISSING, "1", "closed facet set of its wall")


@dataclass(frozen=True)
class Scene:
    """What is simulated. Parts that are absent cost nothing.

    The `body` is a mesh, or a geometry from which `resolved` makes it; a function of the recording
    and the parameters where the mesh follows from them. `copies`: planes of symmetry leave this
    many equal parts, of which the mesh is one; the force of a drive is that on the whole body.
    `dilatation`: the volume change is that of every point, in the mean of the cells around each
    node (tet4), or "mixed", projected in every cell (`fem.assembly.assemble`); the latter
    two do not lock near nu = .5. Declared, "by_element" is the one of them that the mesh's cells
    may have. `plane` and `thickness` m are those of a 2-D mesh; at 1 m all forces are per metre.
    `force_unit`: N, or that of a recording whose unit nobody stated; moduli are then in it per m^2,
    and no force is in N.
    """

    body: Any
    material: Material
    supports: tuple[Support, ...] = ()
    pins: tuple[Pin, ...] = ()
    drives: tuple[Drive, ...] = ()
    cavities: tuple[Cavity, ...] = ()
    dilatation: Dilatation = quantity("pointwise", "1", "whose volume change counts")
    copies: int = quantity(1, "1", "equal parts that planes of symmetry leave")
    foundations: tuple[Foundation, ...] = ()
    membranes: tuple[Membrane, ...] = ()
    regions: tuple[Region, ...] = ()
    loads: tuple[Load | Weight | Pressure, ...] = ()
    probes: tuple[Probe, ...] = ()
    plane: PlaneState = quantity("strain", "1", "of a 2-D body")
    thickness: float = quantity(1.0, "m", "of a 2-D body; 1 m: forces are per metre")
    masses: tuple[Mass, ...] = ()
    contacts: tuple[RigidContact, ...] = ()
    tracked: tuple[Prescribed, ...] = ()
    force_unit: str = quantity("N", "1", "N, or that of a recording whose unit is unknown")
    tools: tuple[Needle, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        take_units(self)
        if isinstance(self.body, Mesh):
            own = tuple(d for d in self.drives if d.follows is None)
            drives = (*own, *(d for p in self.tracked for d in _drives(p)))
            object.__setattr__(self, "drives", drives)
            self._check()

    @property
    def mesh(self) -> Mesh:
        """Raises `SceneError` for a scene that is declared and not yet resolved."""
        if not isinstance(self.body, Mesh):
            raise SceneError(f"the body {self.body} has no mesh yet; resolve the scene first")
        return self.body

    def resolved(self, mesh: Mesh) -> "Scene":
        """Return the scene on this mesh of its body: words become places, symmetry holds its
        planes."""
        held, places = tuple(getattr(self.body, "held", ())), getattr(self.body, "places", {})
        # What does not lock in cells of this kind near nu = .5
        unlocked: Dilatation = "nodal_mean" if mesh.order == 1 else "pointwise"
        unlocked = "mixed" if mesh.bricks else unlocked
        sides = []  # one foundation for every place that is joined by "+"
        for f in self.foundations:
            joined = f.facets.split("+") if isinstance(f.facets, str) else [f.facets]
            sides += [replace(f, facets=p.strip() if isinstance(p, str) else p) for p in joined]
        bonded = tuple(Support(f.facets, f.components) for f in sides if f.contact == "bonded")

        def placed(parts: tuple[P, ...]) -> tuple[P, ...]:
            return tuple(_placed(part, mesh, places) for part in parts)

        return replace(
            self,
            body=mesh,
            supports=(supports := placed((*self.supports, *held, *bonded))),
            pins=(
                *(pin.placed(mesh, places) for pin in self.pins),
                *(pin for s in supports for pin in s.pins(mesh)),
            ),
            drives=placed(self.drives),
            foundations=placed(tuple(f for f in sides if f.contact == "partial")),
            membranes=placed(tuple(m for m in self.membranes if m.thickness)),
            loads=placed(self.loads),
            tracked=placed(self.tracked),
            masses=placed(tuple(mass for mass in self.masses if mass.mass)),
            cavities=tuple(one for c in self.cavities for one in _each(c, mesh)),
            contacts=tuple(
                standing(c, mesh, getattr(self.body, "middle", ())) for c in placed(self.contacts)
            ),
            dilatation=unlocked if self.dilatation == "by_element" else self.dilatation,
            regions=tuple(_chosen(r, mesh, self.material) for r in self.regions),
            copies=self.copies * getattr(self.body, "copies", 1),
        )

    def _check(self) -> None:
        known(self.material.E, "material.E")
        known(self.material.nu, "material.nu")
        if self.dilatation == "nodal_mean" and self.mesh.order != 1:
            raise SceneError("nodal mean dilatation needs linear elements; use order 1")
        if self.mesh.dimension == 2 and (
            self.dilatation == "nodal_mean" or self.foundations or self.membranes
        ):
            raise SceneError("mean dilatation, foundations and membranes are for 3-D meshes")
        self._check_cells()
        # nu = 0.5 needs cells with a pressure of their own, and a measure of the true volume.
        for material in self.materials:
            if not material.incompressible:
                continue
            if self.dilatation != "mixed":
                raise SceneError(
                    f"Poisson ratio nu = 0.5 in {self.mesh.kind} cells of {self.dilatation} "
                    "dilatation: expected nu < 0.5; use mixed cells (hexahedra or order 2, "
                    "dilatation 'mixed') or nu <= 0.4999"
                )
            if material.law == "svk" or material.coefficients.volumetric == "coupled":
                raise SceneError(
                    f"Poisson ratio nu = 0.5 with law '{material.law}' "
                    f"({material.coefficients.volumetric}) has no incompressible form; use "
                    "linear, or neo_hooke, mooney_rivlin, yeoh or ogden with volumetric "
                    "'split'"
                )
        if self.dilatation == "nodal_mean" and self.regions:
            raise SceneError("nodal mean dilatation supports one material; remove the regions")
        for region in self.regions:
            self._check_region(region)
            if (region.material.law == "linear") != (self.material.law == "linear"):
                raise SceneError(
                    f"region '{region.name}' has law '{region.material.law}', the body "
                    f"'{self.material.law}': use linear laws only, or no linear law"
                )
        for material in self.materials:
            material.require_stable()
        if self.force_unit not in ("N", *SYMBOLIC):
            raise SceneError(f"forces in '{self.force_unit}': N, or {', '.join(SYMBOLIC)}")
        if self.copies < 1:
            raise SceneError(f"{self.copies} copies of the mesh: expected at least 1")
        self._check_places()

    def _check_places(self) -> None:
        """Every part must sit somewhere, and what covers an area on faces."""
        places = [s.facets for s in self.supports] + [d.facets for d in self.drives]
        places += [load.facets for load in self.loads if isinstance(load, Load)]
        sheets = [f.facets for f in self.foundations] + [m.facets for m in self.membranes]
        sheets += [load.facets for load in self.loads if isinstance(load, Pressure)]
        for place in (*places, *(m.facets for m in self.masses), *sheets):
            nodes_of(self.mesh, place)
        for place in sheets:
            if kind_of(place) != "faces":
                raise SceneError(
                    f"a foundation, membrane or pressure on {kind_of(place)}; it needs an "
                    "area: choose faces"
                )
        for ground in self.foundations:
            if ground.contact != "partial":
                raise SceneError(
                    f"foundation '{ground.name or ground.facets}': contact '{ground.contact}' is "
                    "of a declared scene; on a mesh use a support, or no foundation"
                )
        holding: tuple[Support | Pin | Foundation, ...] = (
            *self.supports, *self.pins, *self.foundations
        )  # fmt: skip
        for part in holding:
            if not part.components or set(part.components) - set(range(self.mesh.dimension)):
                raise SceneError(
                    f"{type(part).__name__.lower()} with components {part.components}: expected "
                    f"some of {', '.join(map(str, range(self.mesh.dimension)))} (along x, y, z)"
                )
        for pin in self.pins:
            if pin.middle_of:
                raise SceneError(
                    f"pin in the middle of '{pin.middle_of}' is of a declared scene; on a mesh "
                    "give its point"
                )
        for cavity in self.cavities:
            self.mesh.facet_nodes(cavity.facets)
        require_clear(self.contacts, self.mesh)
        require_usable(self.tools, self.mesh)

    def _check_region(self, region: Region) -> None:
        """Its cells are those of the mesh."""
        known = range(len(self.mesh.cells))
        odd = [c for c in np.ravel(region.cells).tolist() if c not in known]
        if odd:
            raise SceneError(
                f"region '{region.name}' has cell {odd[0]}, the mesh {len(known)} from 0 on; "
                "choose its cells in this mesh"
            )

    def _check_cells(self) -> None:
        """What bricks cannot have, and plane state and thickness, which are for 2-D meshes."""
        flat, kind = self.mesh.dimension == 2, self.mesh.kind
        if self.mesh.bricks and self.dilatation == "nodal_mean":
            raise SceneError(f"nodal mean dilatation supports simplices, not {kind}; use 'mixed'")
        if self.dilatation == "mixed" and (kind in ("tri3", "tet4") or self.plane == "stress"):
            raise SceneError(
                "mixed dilatation supports hexahedra and quadratic simplices in 3-D or plane "
                f"strain, not {kind} in plane {self.plane}; use 'nodal_mean' or order 2"
            )
        if self.mesh.bricks and not flat and (self.foundations or self.membranes or self.cavities):
            raise SceneError(
                "foundations, membranes and cavities need triangular facets; use box()"
            )
        if not (np.isfinite(self.thickness) and self.thickness > 0):
            raise SceneError(f"thickness {self.thickness:g} m: a number above 0")
        if not flat and (self.plane != "strain" or self.thickness != 1):
            raise SceneError(f"plane {self.plane} of {self.thickness:g} m: for 2-D meshes only")
        if self.cavities and self.thickness != 1:
            raise SceneError(f"thickness {self.thickness:g} m: cavities in 2-D are per metre")

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what a step is given: drives in m, then loads in N, m/s^2 or Pa, then
        rigid bodies that move and needles' tips in m."""
        parts = (*self.drives, *self.loads, *self.movers)
        return (*(part.name for part in parts), *(i for tool in self.tools for i in tool.inputs))

    @property
    def movers(self) -> tuple[RigidContact, ...]:
        """The rigid bodies that an input moves."""
        return tuple(c for c in self.contacts if c.direction is not None)

    @property
    def materials(self) -> tuple[Material, ...]:
        """The body's, then those of its regions."""
        return self.material, *(region.material for region in self.regions)

    def per_cell(self, value: Callable[[Material], float]) -> Floats:
        """Return a number of every cell's material (e,)."""
        numbers = np.full(len(self.mesh.cells), value(self.material))
        for region in self.regions:
            numbers[region.cells] = value(region.material)
        return numbers


P = TypeVar("P")


def _placed(part: P, mesh: Mesh, places: Mapping[str, Place]) -> P:
    """A part whose place is words, on the facets that they choose; or a place of its geometry."""
    facets = getattr(part, "facets", None)
    if not isinstance(facets, str) or facets in mesh.facets:
        return part
    place = places[facets] if facets in places else place_of(facets, mesh)
    return replace(part, facets=place)  # type: ignore[type-var]


def _each(cavity: Cavity, mesh: Mesh) -> tuple[Cavity, ...]:
    """The cavities of a declared one, by facet set."""
    if not cavity.facets.endswith("*"):
        return (cavity,)
    start = cavity.facets[:-1]
    names = sorted(name for name in mesh.facets if name.startswith(start))
    if not names:
        raise SceneError(
            f"cavity '{cavity.name}': no facet set begins with '{start}'; the body has "
            f"{', '.join(sorted(mesh.facets)) or 'none'}"
        )
    return tuple(Cavity(cavity.name + name[len(start) :], name) for name in names)


def _chosen(region: Region, mesh: Mesh, own: Material) -> Region:
    """A declared region with its cells and material."""
    if not region.where:
        return region
    low, high = map(np.array, box_of(region.where))
    middles = mesh.nodes[mesh.corners].mean(axis=1)
    inside = ((middles >= low) & (middles <= high)).all(axis=1)
    stiff = region.material or replace(own, E=region.contrast * own.E)
    return replace(region, cells=np.flatnonzero(inside), material=stiff, where="")


def _take_direction(part: Any) -> None:
    """A direction in words ("-z") as its unit vector."""
    if isinstance(part.direction, str):
        object.__setattr__(part, "direction", axis_of(part.direction))


def _drives(part: Prescribed) -> tuple[Drive, ...]:
    """One drive for every component of every tracked point."""
    if not part.points:
        raise SceneError(f"'{part.name}': the recording says where {', '.join(part.labels)} are")
    d = part.places.shape[1]
    axes = np.eye(d).tolist()
    return tuple(
        Drive(name, part.facets, tuple(axes[i % d]), part.points[i // d][1], follows=(part, i))
        for i, name in enumerate(part.inputs)
    )
