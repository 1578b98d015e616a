"""Settings of a measured body besides its scene: observations, motion, machine, uncertainties."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.errors import UsageError
from validate.parameters import Ranges, quantity, take_units
from validate.pipeline.experiment.tree import Meshes
from validate.register.markers.quality import MarkerFit

Pose = Literal["recorded", "declared", "fitted"]


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
        take_units(self)
        if not (2 <= self.states <= 500 and 0 < self.fit_to < 1 and self.still >= 0):
            raise UsageError(
                f"seen.states {self.states} (2 to 500), fit_to {self.fit_to:g} (between 0 and 1), "
                f"still {self.still:g} s (0 or above): set them within these limits"
            )


@dataclass(frozen=True)
class BodyMotion:
    """Whether the body's motion in time is solved, from when to when, and its damping.

    Until the start the body rests; loads and displacements count from there. Damping is that of
    the stiffness: `material.stiffness_damping`, the share of critical damping at the first mode, or
    what is identified on the ring-down in the first `fit_window`. A load is released at the start
    where the force that held its place, or the displacement, is given.
    """

    how: Literal["static", "dynamic"] = quantity("static", "1", "static: no inertia; or dynamic")
    start: float | None = quantity(
        None, "s", "start of the motion on the recording's clock; none: detected"
    )
    length: float | None = quantity(None, "s", "solved and compared; none: to the end")
    dt: float | None = quantity(None, "s", "time step; none: 40 or more in the recorded period")
    damping_ratio: float | None = quantity(None, "1", "of critical damping, at the first mode")
    fit_window: float | None = quantity(
        None, "s", "from the start, in which damping is identified; only later is evidence"
    )
    held_force: float | None = quantity(
        None, "N", "force that held the released place, along the load"
    )
    held_displacement: float | None = quantity(
        None, "m", "displacement at which the released place was held, along the load"
    )

    def __post_init__(self) -> None:
        take_units(self)
        if self.damping_ratio is not None and not self.damping_ratio >= 0:
            raise UsageError(f"motion.damping_ratio = {self.damping_ratio}: set it to 0 or above")
        times = (self.length, self.dt, self.fit_window)
        if any(value is not None and not value > 0 for value in times):
            raise UsageError(
                f"motion.length = {times[0]}, motion.dt = {times[1]}, motion.fit_window = "
                f"{times[2]} s: each must be above 0"
            )


@dataclass(frozen=True)
class Machine:
    """Compliance of frame, load cell and grips: u_specimen = u_recorded - C F."""

    compliance: float | None = quantity(None, "m/N", "of the machine; none: not known, taken as 0")
    sd: float = quantity(0.0, "m/N", "standard uncertainty of a compliance that is given")
    measured: str | None = quantity(
        None, "1", "recording of a rigid block (same topics) that gives compliance and sd"
    )

    def __post_init__(self) -> None:
        given = self.compliance
        if (given is not None and not (np.isfinite(given) and given >= 0)) or not self.sd >= 0:
            raise UsageError(
                f"machine.compliance = {given} m/N, sd {self.sd:g} m/N: both must be 0 or above; a "
                "rigid machine has 0"
            )
        if given is not None and self.measured:
            raise UsageError(
                "machine.compliance and machine.measured are both set: give one of them"
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
    """What no scene holds of a measured body: what of the recording moves it is named as that drive
    or load of the scene is.

    One part moves the body: a drive or an indenter by a signal in m of its name, a load or pressure
    by one in N or Pa, what follows tracked markers, or weight. A motion that nothing recorded was
    `noted` by hand.
    """

    seen: SeenOf = SeenOf()
    ranges: BodyRanges = BodyRanges()
    machine: Machine = Machine()
    motion: BodyMotion = BodyMotion()
    noted: tuple[float, ...] = quantity(
        (), "m", "motion, evenly from the first instant to the last; none: recorded"
    )
    scale: float = quantity(1.0, "1", "ratio of true to recorded load")
    mesh: Meshes = Meshes()
    by_method: tuple[tuple[str, float, float], ...] = quantity(
        (), "1", "set by the run: modulus (Pa) of each model; the last number is 0"
    )

    def __post_init__(self) -> None:
        take_units(self)
