"""What a user decides of a measured body: its shape, material, supports, what moves it, what was
seen of it. Places and directions are words (`scene.named_place`)."""

from dataclasses import dataclass
from typing import Literal

from validate.errors import UsageError
from validate.parameters import Ranges, part, quantity
from validate.register.fitting import MarkerFit
from validate.replay.contact_cards import Indenter as Indenter
from validate.replay.contact_cards import Machine as Machine
from validate.scene.laws import Coefficients
from validate.scene.material import LawName

Pose = Literal["recorded", "declared", "fitted"]


@dataclass(frozen=True)
class Solid:
    """One of a mesh file, a block [0, size] or a cylinder about z from the origin."""

    file: str | None = quantity(None, "1", "mesh file, from the experiment's folder")
    unit: str | None = quantity(None, "1", "unit of lengths in a mesh file other than npz")
    block: tuple[float, ...] = quantity((), "m", "sizes along x, y, z of a block from the origin")
    cylinder: tuple[float, ...] = quantity((), "m", "diameter and height of a cylinder along z")
    cells: int = quantity(6, "1", "cells along the longest edge of a block or cylinder, about")
    divisions: tuple[int, ...] = quantity(
        (), "1", "cells along x, y, z of a block; radius, height of a cylinder; none: by cells"
    )
    finer: float = quantity(1.5, "1", "how many times finer the finest mesh is, for u_num")
    halvings: int = quantity(
        0, "1", "of a mesh file: times its cells' edges are cut in half; -1: filled anew, coarser"
    )
    budget: bool = quantity(
        True, "1", "keep a first answer to about 30 s by fewer meshes; false: as --refine"
    )

    def __post_init__(self) -> None:
        given = [bool(self.file), bool(self.block), bool(self.cylinder)]
        if sum(given) > 1 or len(self.block) not in (0, 3) or len(self.cylinder) not in (0, 2):
            raise UsageError(
                f"body: expected one of file, block (three sizes) and cylinder (diameter, "
                f"height); {sum(given)} are given: block {self.block}, cylinder {self.cylinder}"
            )
        axes = len(self.block) or len(self.cylinder)
        if self.divisions and (len(self.divisions) != axes or min(self.divisions) < 1):
            raise UsageError(
                f"body.divisions = {self.divisions}: {axes} positive numbers of cells are needed "
                "(a block: along x, y, z; a cylinder: along radius and height; a mesh file: none)"
            )


@dataclass(frozen=True)
class Tissue:
    E: float | None = quantity(None, "Pa", "Young's modulus; none: identified")
    nu: float = quantity(0.45, "1", "Poisson ratio")
    rho: float = quantity(1000.0, "kg/m3", "density: its weight, and its inertia in motion")
    by_method: tuple[tuple[str, float, float], ...] = quantity(
        (), "1", "set by the run: modulus (Pa) of each model; the last number is 0"
    )
    coefficients: Coefficients = part(Coefficients(), "further parameters of the models' laws")


@dataclass(frozen=True)
class HeldAt:
    """Places by which displacements cannot happen there; several are joined by "+"."""

    all: str | None = quantity(None, "1", "held in every direction")
    x: str | None = quantity(None, "1", "held along x only")
    y: str | None = quantity(None, "1", "held along y only")
    z: str | None = quantity(None, "1", "held along z only")
    slides: str | None = quantity(
        None,
        "1",
        "rests on a slippery plate: held normal to it; its middle is fixed and cannot turn",
    )


@dataclass(frozen=True)
class MovedBy:
    """What loads the body: a signal in m (moves a place), N (pulls at it) or Pa (presses on it),
    "markers" that sit on a place, which follows them as a rigid body, "gravity", a motion of a
    place that was "noted" by hand where nothing recorded it, or the "release" of a place that was
    held (motion.held_force or motion.held_displacement)."""

    by: str = quantity("gravity", "1", "a signal's topic, or: markers, gravity, noted, release")
    place: str | None = quantity(None, "1", "where; gravity needs none")
    along: str = quantity("-z", "1", "direction: +x, -z, or three numbers")
    sideways: bool = quantity(True, "1", "whether a moved place is held across its direction")
    markers: tuple[str, ...] = quantity((), "1", "markers on the moved place, three or more")
    noted: tuple[float, ...] = quantity(
        (), "m", "motion, evenly from the first instant to the last"
    )
    amount: float = quantity(9.80665, "m/s^2", "gravity")
    scale: float = quantity(1.0, "1", "ratio of true to recorded load")


@dataclass(frozen=True)
class SeenOf:
    """What of the recording is compared; what is none is not.

    A "fitted" pose has the declared directions, its plane passes through the body's middle, and the
    outline at rest has its centroid where the body's section has it: places are then fitted, and
    only shapes and motions are evidence.
    """

    force: str | None = quantity(None, "1", "signal in N: the force on the moved place")
    markers: str | None = quantity(None, "1", "markers' topic")
    layout: str = quantity("as seen", "1", "markers' places: recorded, as seen, or a file")
    stands: float = quantity(2e-3, "m", "largest distance of a marker from the body, as on a stalk")
    outline: str | None = quantity(None, "1", "outlines' topic")
    surface: str = quantity("surface", "1", "facet set the outlines show; surface: the whole one")
    pose: Pose = quantity("recorded", "1", "pose of the images: recorded, declared or fitted")
    origin: tuple[float, ...] = quantity((), "m", "of the images, where it is declared")
    image_x: str = quantity("+x", "1", "direction of the images' x (columns), where not recorded")
    image_y: str = quantity("-z", "1", "direction of the images' y (rows), where not recorded")
    states: int = quantity(30, "1", "instants that are solved and compared, evenly spaced")
    still: float = quantity(0.0, "s", "from the first instant, in which the body is unloaded")
    fit_to: float = quantity(0.5, "1", "share of the load below which an open E is identified")
    registration: MarkerFit = MarkerFit()

    def __post_init__(self) -> None:
        if not (2 <= self.states <= 500 and 0 < self.fit_to < 1 and self.still >= 0):
            raise UsageError(
                f"seen.states {self.states} (2 to 500), fit_to {self.fit_to:g} (between 0 and 1), "
                f"still {self.still:g} s (0 or above): set them within these limits"
            )


@dataclass(frozen=True)
class BodyMotion:
    """Whether the body's motion in time is solved, from when to when, and its damping.

    Until the start the body rests; loads and displacements count from there. Damping is that of
    the stiffness, C = beta K (Rayleigh): beta itself, or the share of critical damping at the first
    mode, or what is identified on the ring-down in the first `fit_window`. `gravity` acts before
    the start, too. A place is released at the start from a force, or a displacement.
    """

    how: Literal["static", "dynamic"] = quantity("static", "1", "static: no inertia; or dynamic")
    start: float | None = quantity(
        None, "s", "start of the motion on the recording's clock; none: detected"
    )
    length: float | None = quantity(None, "s", "solved and compared; none: to the end")
    dt: float | None = quantity(None, "s", "time step; none: 40 or more in the recorded period")
    stiffness_damping: float | None = quantity(None, "s", "beta of C = beta K")
    damping_ratio: float | None = quantity(None, "1", "of critical damping, at the first mode")
    fit_window: float | None = quantity(
        None, "s", "from the start, in which damping is identified; only later is evidence"
    )
    gravity: str | None = quantity(None, "1", "direction of gravity in addition, as -z")
    held_force: float | None = quantity(
        None, "N", "force that held the released place, along moved.along"
    )
    held_displacement: float | None = quantity(
        None, "m", "displacement at which the released place was held, along moved.along"
    )

    def __post_init__(self) -> None:
        damping = (self.stiffness_damping, self.damping_ratio)
        if any(value is not None and not value >= 0 for value in damping) or None not in damping:
            raise UsageError(
                f"motion.stiffness_damping = {damping[0]}, motion.damping_ratio = {damping[1]}: "
                "set only one of them, to 0 or above"
            )
        times = (self.length, self.dt, self.fit_window)
        if any(value is not None and not value > 0 for value in times):
            raise UsageError(
                f"motion.length = {times[0]}, motion.dt = {times[1]}, motion.fit_window = "
                f"{times[2]} s: each must be above 0"
            )


@dataclass(frozen=True)
class BodyRanges(Ranges):
    E: float = quantity(0.05, "1", "relative, of a given modulus")
    nu: float = quantity(0.01, "1", "of the Poisson ratio")
    load: float = quantity(0.01, "1", "relative, of what moves or pulls the body")
    rho: float = quantity(0.01, "1", "relative, of the density; of a motion in time")
    damping: float = quantity(0.2, "1", "relative, of the damping; of a motion in time")
    size: float = quantity(0.005, "1", "relative, of each size of the body; of an identified E")
    contact: float = quantity(
        0.0, "m", "of the start of the load: of an indenter's gap, of an identified E"
    )
    friction: float = quantity(
        0.05, "1", "of an identified E: share of the way from sliding places to held ones"
    )


@dataclass(frozen=True)
class MeasuredBody:
    """Everything that is decided; `recording` lies beside the experiment's file."""

    recording: str = quantity("", "1", "MCAP file, from the experiment's folder")
    body: Solid = Solid()
    material: Tissue = Tissue()
    held: HeldAt = HeldAt()
    moved: MovedBy = MovedBy()
    seen: SeenOf = SeenOf()
    ranges: BodyRanges = BodyRanges()
    indenter: Indenter = Indenter()
    machine: Machine = Machine()
    motion: BodyMotion = BodyMotion()


@dataclass(frozen=True)
class SolidModel:
    """What a method's scene is built with."""

    law: LawName = quantity("neo_hooke", "1", "linear, or the law at large strain")
    order: Literal[1, 2] = quantity(1, "1", "element order; 1 means nodal mean dilatation")
