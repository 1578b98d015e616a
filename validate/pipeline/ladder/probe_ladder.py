"""Candidate methods for a body that a probe touches, ordered by cost.

The whole prefactored solve, regions around the contact and reduced models are compared at one
spring and one pad. Their reference is the whole solve in short steps.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from validate.arrays import Floats
from validate.fem.system import System
from validate.pipeline.bodies.own_body import ExperimentBody
from validate.pipeline.ladder.ladder import Rival, Rung
from validate.scene.places import nodes_of
from validate.scene.scene import Scene
from validate.solve.handles import Handles
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions
from validate.solve.types import Scheme, State, Stepper

Touching = AsyncRegions | TouchedKrylov
_PARTS = 4  # steps of the reference within the ladder's shortest
_MORE = 1.01  # of the coarsest mesh's spacing: its neighbours are within the pad


@dataclass(frozen=True)
class Divided:
    """A scheme of a touched body in `parts` steps for one, the probe going straight."""

    handles: ClassVar[Handles] = AsyncRegions.handles

    settings: Touching
    parts: int

    def prepare(self, system: System) -> Stepper:
        return DividedStepper(self.settings.prepare(system), self.parts)


@dataclass(frozen=True)
class DividedStepper:
    """States hold that of the scheme and the last inputs (d,) m."""

    stepper: Stepper
    parts: int

    @property
    def scene(self) -> Scene:
        return self.stepper.scene

    @property
    def units(self) -> Mapping[str, str]:
        return self.stepper.units

    def rest(self) -> State:
        state = self.stepper.rest()
        return replace(state, inner=(state, np.zeros(self.scene.mesh.dimension)))

    def step(self, state: State, inputs: Floats) -> State:
        inner: State = state.inner[0]
        before: Floats = state.inner[1]
        for i in range(1, self.parts + 1):
            inner = self.stepper.step(inner, before + (inputs - before) * i / self.parts)
            if inner.failure:
                break
        return replace(inner, k=state.k + 1, inner=(inner, inputs))

    def field(self, state: State) -> Floats:
        return self.stepper.field(state.inner[0])


@dataclass(frozen=True)
class TouchedLadder:
    """Rivals with a common `pad` m, the `best` of them, and what is said of both."""

    whole: AsyncRegions
    solvers: tuple[Rival, ...]

    def best(self, dt: float) -> Scheme:
        return Divided(replace(self.whole, dt=dt / _PARTS), _PARTS)

    @property
    def note(self) -> str:
        return (
            f"The probe's spring of {self.whole.spring:g} N/m is shared by the nodes within "
            f"{1e3 * self.whole.pad:.3g} mm of the contact on every mesh: the solution of a point "
            f"contact does not converge under refinement. Layers of a region are those of each "
            f"mesh. The reference is the full solve, with each shortest step in {_PARTS} parts."
        )


def touched_ladder(own: ExperimentBody, coarsest: int) -> TouchedLadder | None:
    """Of the experiment's methods that step a touched body, or None where it has none."""
    given = own.experiment.sets(own.parameters, own.seen)
    found = {m.label: m.given(given) for m in own.experiment.methods.values()
             if isinstance(m.settings, Touching)}  # fmt: skip
    wholes = [s for s in found.values() if isinstance(s, AsyncRegions)]
    if not wholes:
        return None
    # From the touched node to the nearest other one of its surface, m
    scene = own.at(coarsest)
    tool = scene.tools[0]
    places = scene.mesh.nodes[nodes_of(scene.mesh, tool.facets)]
    away = np.linalg.norm(places - np.array(tool.tip), axis=1)
    others = np.linalg.norm(places - places[int(np.argmin(away))], axis=1)
    pad = max(wholes[0].pad, _MORE * float(np.partition(others, 1)[1]))
    rivals = (_rival(label, replace(s, pad=pad)) for label, s in found.items())
    whole = replace(wholes[0], layers=(), rates=(), solvers=wholes[0].solvers[:1], pad=pad)
    return TouchedLadder(whole, tuple(rivals))


def _rival(label: str, settings: Touching) -> Rival:
    """First order in time, and uneven where regions of several rates are due now and then."""
    rung, uneven = _rung(settings)

    def make(dt: float) -> Scheme:
        return replace(settings, dt=dt)

    return Rival(label, rung, make, order=1.0, uneven=uneven)


def _rung(settings: Any) -> tuple[Rung, bool]:
    if isinstance(settings, TouchedKrylov):
        return "modal", False
    return ("regions", True) if settings.layers else ("prefactored", False)
