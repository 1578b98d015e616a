"""Asynchronous regions (paper 004): haptic rate near a touched place, lower rates elsewhere.

A probe whose path is given takes hold of the surface node nearest to it, as soon as that is within
a threshold, by a spring; the force to the hand is the spring's after the tick (section 3). Regions
are layers of nodes around that node; they move with it, and the primary one may follow the
deformation. The spring acts by its force at the tick's begin, so a stiff one is unstable: `run` the
spectral radius (`region_march.spectral_radius`) before a hand touches it.

Departures: the spring is slack where it takes hold (the paper's force jumps there by the distance
at the first contact), and does not change its force where the contact moves to another node.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import System
from validate.parameters import part, quantity
from validate.scene.contact import Needle
from validate.scene.material import LawName, Prony
from validate.scene.scene import Scene
from validate.solve.handles import Handles, require_handled
from validate.solve.haptic.loop import Hold, SpringProbe
from validate.solve.regions.body import (
    PrimarySize,
    RegionBody,
    RegionPlan,
    Regions,
    SizeName,
    ratios,
    require_one_probe,
)
from validate.solve.regions.march import BorderName, Motion, carried, spectral_radius
from validate.solve.regions.primary import EXPLICIT, PrimaryLaw, SolverName, UnsettledError
from validate.solve.types import Ending, State

_AXES = "xyz"
_RUNAWAY = 100.0  # body sizes
_ROUNDING = 1e-12


@dataclass(frozen=True)
class AsyncRegions:
    """Settings. `layers` of nodes in every region but the last, `rates` of every region but the
    first, which is solved every `dt`; both empty: the whole body at once.

    `solvers`: one for all regions, or one each. A rate that does not divide the primary one is
    rounded, a region beyond the body left out: the stepper's `notices` say so. `grip` as in
    `NeedleLoop`. An explicit region whose period is above its critical one is refused at the first
    step, or with `beyond_limit` "run" goes on until displacements are 100 times the body's size.

    `law` and `prony` are the primary region's alone (`region_primary`); they end where its cells
    do, so that a region that grows or moves gives its energy to the law it finds.
    """

    handles: ClassVar[Handles] = Handles(
        ("linear",), inertia=True, cavities=False, loads=False,
        contact=("foundations", "membranes", "needle"),
    )  # fmt: skip

    dt: float = quantity(1e-3, "s", "time step of the primary region: a tick")
    layers: tuple[int, ...] = quantity((5,), "1", "layers of nodes from the contact, by region")
    rates: tuple[float, ...] = quantity((50.0,), "Hz", "of the regions after the primary one")
    solvers: tuple[SolverName, ...] = quantity(("semi_implicit",), "1", "for all, or one for each")
    border: BorderName = quantity("delayed", "1", "displacements of regions between their solves")
    overlap: int = quantity(0, "1", "layers of neighbouring regions that a region also solves")
    adapt: SizeName = quantity("fixed", "1", "how the primary region follows the deformation")
    most: int = quantity(
        30, "1", "largest number of layers of the primary region; it starts with layers[0]"
    )
    slope: float = quantity(4.0, "1", "length of the primary region over that of the deformation")
    moved: float = quantity(1e-4, "m", "displacement above which a node belongs to it (threshold)")
    spring: float = quantity(1000.0, "N/m", "between probe and contact; 0: no force")
    reach: float = quantity(1e-3, "m", "distance at which the probe makes contact")
    pad: float = quantity(
        0.0, "m", "distance from the contact within which surface nodes share the spring"
    )
    grip: float | None = quantity(None, "N", "pulling force at which contact ends; none: never")
    slides: bool = quantity(False, "1", "the contact moves to the node nearest to the probe")
    beyond_limit: Literal["refuse", "run"] = quantity(
        "refuse", "1", "a period above the critical step"
    )
    law: LawName = quantity("linear", "1", "of the primary region; the rest is linear")
    prony: Prony = part(Prony(), "relaxation of the isochoric stress of the primary region")

    def __post_init__(self) -> None:
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise SceneError(f"tick of {self.dt:g} s: expected a finite number above 0")
        if len(self.layers) != len(self.rates):
            raise SceneError(
                f"{len(self.layers)} layer counts and {len(self.rates)} rates: expected one of "
                "each for every border between two regions"
            )
        if len(self.solvers) not in (1, len(self.layers) + 1):
            raise SceneError(
                f"{len(self.solvers)} solvers for {len(self.layers) + 1} regions: expected "
                "one, or one for each"
            )
        ratios(self.rates, self.dt)
        if any(count < 1 for count in self.layers):
            raise SceneError(
                f"regions of {self.layers} layers: expected at least 1 for each region"
            )
        if self.layers and self.adapt != "fixed" and self.most < self.layers[0]:
            raise SceneError(
                f"a primary region of {self.layers[0]} layers that grows to {self.most} at "
                "most: increase most, or use adapt fixed"
            )
        if self.overlap < 0 or not (self.spring >= 0 and self.reach > 0 and self.pad >= 0):
            raise SceneError(
                f"overlap {self.overlap}, spring {self.spring:g} N/m, reach {self.reach:g} m, "
                f"pad {self.pad:g} m: expected no value below 0, and a reach above 0"
            )
        if self.border == "joint" and (self.overlap or set(self.solvers) & set(EXPLICIT)):
            raise SceneError(
                "joint borders solve one system: remove the overlap and explicit solvers"
            )
        if self.of_its_own and (self.border == "joint" or self.overlap):
            raise SceneError(
                "a primary region with a separate law is solved separately: use neither joint "
                "borders nor overlap"
            )
        if self.prony.g and (self.adapt != "fixed" or self.slides or self.grip is not None):
            raise SceneError(
                "a viscoelastic primary region cannot move: set adapt fixed, slides false, "
                "grip none"
            )
        if not (self.grip is None or self.grip >= 0):
            raise SceneError(f"grip {self.grip:g} N: expected 0 or more, or none")

    @property
    def of_its_own(self) -> bool:
        """Whether the primary region has another law than the rest."""
        return self.law != "linear" or bool(self.prony.g)

    def prepare(self, system: System) -> "RegionStepper":
        """Raise `SceneError` for a scene without one probe, or whose surface is all held."""
        scene = system.scene
        require_handled(scene, self)
        require_one_probe(system)
        tool, body = scene.tools[0], RegionBody.of(system)
        every, words = ratios(self.rates, self.dt)
        primary = None
        if self.of_its_own:
            primary = PrimaryLaw(system.scene, system.free, self.law, self.prony)
        plan = RegionPlan(body, self.dt, self.layers, every, self.solvers, self.border,
                          self.overlap, {}, primary)  # fmt: skip
        probe = SpringProbe(body, np.array(tool.axis), self.spring, self.reach, self.pad, self.grip,
                      self.slides)  # fmt: skip
        return RegionStepper(self, system, tool, body, plan, probe, words)


@dataclass(frozen=True)
class RegionTick:
    """The probe's hold on the body, the regions around it and their motion; none before the first
    touch, when nothing has moved."""

    held: Hold | None = None
    regions: Regions | None = None
    motion: Motion | None = None


@dataclass(frozen=True)
class RegionStepper:
    """Steps through displacements (d,) m of the probe; see `AsyncRegions`.

    `words` on rounded rates; `notices` has them and what the regions of a touch leave out.
    """

    settings: AsyncRegions
    system: System
    tool: Needle
    body: RegionBody
    plan: RegionPlan
    probe: SpringProbe
    words: tuple[str, ...]

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @cached_property
    def units(self) -> Mapping[str, str]:
        name = self.tool.name
        forces = {f"{name}.force.{a}": "N" for a in _AXES[: len(self.tool.tip)]}
        return forces | {
            f"{name}.contact": "1", f"{name}.changed": "1", f"{name}.layers": "1",
            f"{name}.solved": "1",
        }  # fmt: skip

    def notices(self, state: State) -> tuple[str, ...]:
        """What was rounded or left out of the settings, in words."""
        tick: RegionTick = state.inner
        return self.words + (tick.regions.words if tick.regions else ())

    def growth(self) -> float:
        """Return how much the fastest growing motion grows in a tick while the probe stays at its
        tip: above 1 it grows without bound. Dense: small bodies."""
        tick: RegionTick = self.step(self.rest(), np.zeros(len(self.tool.tip))).inner
        regions = tick.regions
        if regions is None:
            raise SceneError(f"the probe '{self.tool.name}' touches nothing; move its tip")
        tip, units = np.array(self.tool.tip), np.eye(len(self.body.at))
        pull = np.stack([self.probe.nodal(tick.held, tip, u) for u in units], axis=1)
        radius = spectral_radius(regions.coupled, lambda visible: np.asarray(pull @ visible))
        return float(radius ** (1 / regions.coupled.common))

    def rest(self) -> State:
        tip = np.array(self.tool.tip)
        held = self.probe.follow(None, tip, self.body.still)
        return self._told(0, RegionTick(held), np.zeros(len(tip)), changed=False)

    def step(self, state: State, inputs: Floats) -> State:
        """One tick: contact, regions, motion, force."""
        last: RegionTick = state.inner
        tip = np.array(self.tool.tip) + inputs
        u = last.motion.visible if last.motion else self.body.still
        held = self.probe.follow(last.held, tip, u)
        regions, motion = self._regions(held, last)
        if regions is None or motion is None:
            return self._told(state.k + 1, last, np.zeros(len(tip)), changed=False)
        f = self.probe.nodal(held, tip, u)
        try:
            motion = regions.coupled.tick(motion, f)
        except UnsettledError as lost:
            return replace(state, failure=("not_converged", f"step {state.k + 1}: {lost}"))
        hand = -self.probe.force(held, tip, motion.visible)
        changed = last.regions is not None and regions is not last.regions
        new = RegionTick(held, regions, motion)
        return self._told(state.k + 1, new, hand, changed=changed)

    def _regions(self, held: Hold | None, last: RegionTick) -> tuple[Regions | None, Motion | None]:
        """The regions around the hold, and the motion as these carry it on."""
        if held is None:
            return last.regions, last.motion
        deformation = 0.0
        moved = np.zeros(len(self.body.nodes))
        if last.motion is not None:
            moved = np.linalg.norm(self.body.spread(last.motion.visible), axis=1)
            deformation = float(moved[held.node])
        around = self.plan.around(held.pad)
        s = self.settings
        least = s.layers[0] if s.layers else 1
        most = max(least, s.most)  # a fixed one never reads it
        size = PrimarySize(s.adapt, least, most, s.slope, s.moved, around.spacing)
        layers = size.layers(deformation, moved, around.layer) if s.layers else 0
        regions = self.plan.regions(held.pad, layers)
        if last.regions is None or last.motion is None:
            return regions, regions.coupled.rest()
        if regions is last.regions:
            return regions, last.motion
        return regions, carried(last.regions.coupled, last.motion, regions.coupled)

    def _told(self, k: int, tick: RegionTick, hand: Floats, *, changed: bool) -> State:
        coupled = tick.regions.coupled if tick.regions else None
        due = [z for z in coupled.zones if k % z.ratio == 0] if coupled and k else []
        layers = tick.regions.layers if tick.regions else 0
        found = (*hand.tolist(), float(tick.held is not None), float(changed), float(layers),
                 float(sum(len(z.wide) for z in due)))  # fmt: skip
        numbers = dict(zip(self.units, found, strict=True))
        return State(k, tick, self._failure(k, tick), numbers=numbers)

    def _failure(self, k: int, tick: RegionTick) -> tuple[Ending, str] | None:
        if tick.regions is None or tick.motion is None:
            return None
        if self.settings.beyond_limit == "refuse":
            beyond = tick.regions.beyond(self.settings.dt, _ROUNDING)
            if beyond:
                return "refused", f"{beyond}; take a smaller dt, or beyond_limit=run"
        if not float(np.abs(tick.motion.visible).max()) <= _RUNAWAY * self.body.size:
            return "diverged", f"step {k}: displacements over {_RUNAWAY:g} body sizes"
        return None

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes, as the regions show them."""
        tick: RegionTick = state.inner
        u = np.zeros(len(self.system.moves))
        if tick.motion is not None:
            u[self.system.free] = tick.motion.visible
        return u.reshape(self.scene.mesh.nodes.shape)
