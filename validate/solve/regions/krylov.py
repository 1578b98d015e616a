"""Krylov-reduced model of a touched linear body, the benchmark of `solve.regions.scheme`.

Displacements are sums of a few Krylov vectors, K^-1 f, K^-1 M K^-1 f, ... of a unit force at the
contact in every direction; the first of them have its statics exactly. Steps are those of eq 3 of
paper 004 (`solve.regions.primary`), as the whole solve takes them, so that nothing but the
reduction lies between the two.

Departures: none of the paper's, which names no reduced model. It holds for a linear body whose
contact stays: the probe takes hold once, neither slides nor lets go.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.linear_solvers.factor import Factor, Fronts, factorise
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.contact import Needle
from validate.scene.scene import Scene
from validate.solve.handles import Handles, require_handled
from validate.solve.haptic.loop import SpringProbe
from validate.solve.regions.body import RegionBody, require_one_probe
from validate.solve.regions.scheme import AsyncRegions
from validate.solve.types import State, Stepper

_AXES = "xyz"
_NEW = 1e-10  # of the largest: a direction below it is rounding of the others


@dataclass(frozen=True)
class TouchedKrylov:
    """Settings. `vectors` for each direction of the force; the others as in `AsyncRegions`."""

    handles: ClassVar[Handles] = AsyncRegions.handles

    dt: float = quantity(1e-3, "s", "time step: a tick")
    vectors: int = quantity(4, "1", "Krylov vectors for each direction of the force")
    spring: float = quantity(1000.0, "N/m", "between probe and contact; 0: no force")
    reach: float = quantity(1e-3, "m", "distance at which the probe makes permanent contact")
    pad: float = quantity(
        0.0, "m", "distance from the contact within which surface nodes share the spring"
    )

    def __post_init__(self) -> None:
        if not (np.isfinite(self.dt) and self.dt > 0 and self.vectors >= 1):
            raise SceneError(
                f"tick of {self.dt:g} s, {self.vectors} vectors: expected a tick "
                "above 0 and at least 1 vector"
            )
        if not (self.spring >= 0 and self.reach > 0 and self.pad >= 0):
            raise SceneError(
                f"spring {self.spring:g} N/m, reach {self.reach:g} m, pad {self.pad:g} m: "
                "expected no value below 0, and a reach above 0"
            )

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for a scene without one probe, or whose surface is all held."""
        scene = system.scene
        require_handled(scene, self)
        require_one_probe(system)
        body, tool = RegionBody.of(system), scene.tools[0]
        probe = SpringProbe(body, np.array(tool.axis), self.spring, self.reach, self.pad, None,
                            slides=False)  # fmt: skip
        factor = factorise(body.body.K, body.body.node, body.body.places)
        stepper = KrylovStepper(self, system, tool, body, probe, factor)
        stepper.rest()  # what the probe touches at rest is reduced before the first tick
        return stepper


@dataclass(frozen=True)
class Reduced:
    """Eq 3 in r coordinates: q+ = `now` q + `before` q- + `push` (r, d) times forces (d,) N.

    `basis` (m, r) gives displacements, `shape` (d, r) that of the contact.
    """

    basis: Floats
    now: Floats
    before: Floats
    push: Floats
    shape: Floats


@dataclass(frozen=True)
class ReducedTick:
    """Coordinates now and a tick ago (r,). `slack` (d,) m: where the probe stands when the spring
    to an undeformed contact is slack."""

    model: Reduced
    slack: Floats
    q: Floats
    before: Floats


@dataclass(frozen=True)
class KrylovStepper:
    """Steps through displacements (d,) m of the probe; see `TouchedKrylov`. `kept`: models made,
    by the contact's nodes."""

    settings: TouchedKrylov
    system: System
    tool: Needle
    body: RegionBody
    probe: SpringProbe
    factor: Factor | Fronts
    kept: dict[tuple[int, ...], Reduced] = field(default_factory=dict)

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @cached_property
    def units(self) -> Mapping[str, str]:
        name = self.tool.name
        forces = {f"{name}.force.{a}": "N" for a in _AXES[: len(self.tool.tip)]}
        return forces | {f"{name}.contact": "1", f"{name}.vectors": "1"}

    def rest(self) -> State:
        tip = np.array(self.tool.tip)
        return self._told(0, self._touched(tip), np.zeros(len(tip)))

    def step(self, state: State, inputs: Floats) -> State:
        """One tick: contact, motion, force."""
        tip = np.array(self.tool.tip) + inputs
        tick: ReducedTick | None = state.inner or self._touched(tip)
        if tick is None:
            return self._told(state.k + 1, tick, np.zeros(len(tip)))
        m, away = tick.model, tip - tick.slack
        f = self.settings.spring * (away - m.shape @ tick.q)
        q = m.now @ tick.q + m.before @ tick.before + m.push @ f
        hand = self.settings.spring * (m.shape @ q - away)
        return self._told(state.k + 1, replace(tick, q=q, before=tick.q), hand)

    def _touched(self, tip: Floats) -> ReducedTick | None:
        """The body at rest, held where the tip is within reach."""
        held = self.probe.follow(None, tip, self.body.still)
        if held is None:
            return None
        if held.pad not in self.kept:
            h, body = self.settings.dt, self.body.body
            unit = np.stack(
                [self.probe.shared(held, e) for e in np.eye(len(self.tool.tip))], axis=1
            )
            V = krylov(self.factor, body.m, unit, self.settings.vectors)
            K, M, C = V.T @ (body.K @ V), V.T @ (body.m[:, None] * V), V.T @ (body.c[:, None] * V)
            solve = np.linalg.inv(M / h**2 + C / (2 * h) + K)
            b = V.T @ unit
            self.kept[held.pad] = Reduced(
                V, solve @ (2 * M / h**2), solve @ (C / (2 * h) - M / h**2), solve @ b, b.T
            )
        model = self.kept[held.pad]
        zero = np.zeros(len(model.now))
        return ReducedTick(model, self.body.body.places[held.node] + held.slack, zero, zero)

    def _told(self, k: int, tick: ReducedTick | None, hand: Floats) -> State:
        size = 0 if tick is None else len(tick.q)
        found = (*hand.tolist(), float(tick is not None), float(size))
        return State(k, tick, numbers=dict(zip(self.units, found, strict=True)))

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes."""
        tick: ReducedTick | None = state.inner
        u = np.zeros(len(self.system.moves))
        if tick is not None:
            u[self.system.free] = tick.model.basis @ tick.q
        return u.reshape(self.scene.mesh.nodes.shape)


def krylov(factor: Factor | Fronts, m: Floats, f: Floats, count: int) -> Floats:
    """Return an orthonormal basis (u, r) of K^-1 f, K^-1 M K^-1 f, ..., `count` blocks of f (u, d);
    m (u,) kg. Directions that are in the others already are left out, so r is at most count d."""
    pushed = f[:, np.abs(f).max(axis=0) > 0]  # what is held in a direction takes no force there
    V = last = _new(np.zeros((len(f), 0)), factor.solve(pushed))
    for _ in range(count - 1):
        last = _new(V, factor.solve(m[:, None] * last))
        V = np.hstack([V, last])
    return np.ascontiguousarray(V)


def _new(V: Floats, W: Floats) -> Floats:
    """An orthonormal basis (u, k) of what W (u, d) has beyond V (u, r), taken off twice."""
    size = np.linalg.norm(W)
    for _ in range(2):
        W = W - V @ (V.T @ W)
    Q, sizes, _ = np.linalg.svd(W, full_matrices=False)
    return np.asarray(Q[:, sizes > _NEW * size])
