"""Explicit dynamics at large strain: central difference on lumped masses (paper 003, eqs 13-20).

The step is written in increments, d' = keep d - gain (R - f), which is eq 18 with C = alpha M and
keeps its digits where steps are small. Loads act at the start of a step, drives at its end.

Departures: eq 15 prints one U too many. Eq 16 is no bound on the step: the limit is 2/omega_max by
Lanczos, taken anew as the body deforms. Stiffness damping (beta K of eq 18) would need a solve; it
is taken at the last half step ("lagged"), which costs no solve and lowers the limit. A viscoelastic
body's strain energy is that of its relaxed law, and what its branches take is in no trace.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import lumped, mass
from validate.fem.critical import CriticalStep
from validate.fem.kernels.threads import Team, idle_cores, pilot
from validate.fem.large_strain.explicit import (
    BodyLook,
    CentralRule,
    ExplicitBody,
    ExplicitMotion,
    Precision,
)
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.scene import Scene
from validate.solve.handles import LARGE_DYNAMICS, Handles, require_handled
from validate.solve.study_entries import (
    TETS,
    Radii,
    Rates,
    Rival,
    Stepping,
    StudyBody,
    SwingingBody,
)
from validate.solve.types import Ending, Scheme, State, Stepper

_EXCESS = 0.05  # energy beyond the work done, as a share of the most work so far: divergence
_DEFORMED = 0.02  # of the body's size: the critical step is taken anew after such a motion
_SEEN = dict.fromkeys(
    ("energy.strain", "energy.kinetic", "energy.external", "energy.damped"), "J"
) | {"det_F.min": "1", "inverted": "1", "critical_step": "s"}

Damping = Literal["none", "mass", "lagged"]

_PARTS = 16  # explicit steps within one of a ladder's


@dataclass(frozen=True)
class CentralDifference:
    """Settings; inputs are linear over the substeps.

    `damping`: "mass" is eq 18 with C = alpha M and refuses a scene with stiffness damping, "lagged"
    takes that too, "none" is eq 19. A substep above (1 - margin) of the critical step is refused
    before the first step, or with `beyond_limit` "run" goes on. Every `watch` steps energies, det F
    and, when the body has deformed further, the critical step are looked at; traces hold between.
    Up to `threads` share the cells of a step, as many as a measured pilot shows to pay and no more
    than cores are idle; what was chosen is in the run's notes. Several change results by rounding.
    With `precision` "single" forces are of 7 digits; the motion is the velocity form, in doubles.
    """

    handles: ClassVar[Handles] = LARGE_DYNAMICS

    dt: float = quantity(1e-4, "s", "time step of the run")
    substeps: int = quantity(1, "1", "equal explicit steps in each")
    damping: Damping = quantity("mass", "1", "none, alpha M, or beta K too at the last half step")
    beyond_limit: Literal["refuse", "run"] = quantity(
        "refuse", "1", "a step above the critical step"
    )
    margin: float = quantity(0.05, "1", "share of the critical step kept as a margin")
    watch: int = quantity(20, "1", "steps between checks of energy, det F, critical step")
    threads: int = quantity(
        1, "1", "largest number of cores for the cells of a step, if they save time"
    )
    precision: Precision = quantity("double", "1", "of the element loops: double or single")

    @staticmethod
    def steppings() -> tuple[Stepping, ...]:
        """At rest, with damping of the mass alone and with lagged damping."""
        return tuple(
            Stepping(
                name, f"central difference at rest, {damping}", "lumped", _maps_at_rest(lagged),
                _step_at_rest(lagged), TETS, explicit=True, conserves=True,
                order=1.0 if lagged else 2.0,
            )
            for name, damping, lagged in (
                ("central", "C = alpha M", False), ("central_lagged", "lagged C", True)
            )
        )  # fmt: skip

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        """In single precision for the laws whose loops know it."""
        if not isinstance(asked, SwingingBody):
            return ()
        law, name = asked.law, "large strain, explicit"
        double = Rival(name, "large strain", _in_parts("double"), elements=("P1",), law=law)
        if law not in ("svk", "neo_hooke"):
            return (double,)
        return (double, replace(double, name=f"{name}, single precision", make=_in_parts("single")))

    def __post_init__(self) -> None:
        if not (self.dt > 0 and self.substeps >= 1 and self.watch >= 1):
            raise SceneError(
                f"dt {self.dt:g} s, {self.substeps} substeps, a check every {self.watch} "
                "steps: all must be positive"
            )
        if not 0 <= self.margin < 1:
            raise SceneError(
                f"margin {self.margin:g}: expected a share of the critical step, 0 to 1"
            )

    @property
    def step(self) -> float:
        """The step s of the integration."""
        return self.dt / self.substeps

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for what has no explicit form, a missing density, cavities."""
        require_handled(system.scene, self)
        beta = self._beta(system.scene)
        still = np.zeros(len(system.moves))
        inputs = np.zeros(len(system.scene.inputs))
        past = Past(ExplicitMotion(np.zeros((6, len(still)))), still, inputs)
        plates = system.moves[system.held]
        feels_loads = bool(system.loads[system.held].any())
        body = ExplicitBody(system.scene, self.threads, self.precision)
        body.share(1)  # until a pilot has shown that more pay
        masses = system.masses[system.free]
        alpha = np.zeros(len(system.moves))
        if self.damping != "none":
            alpha = lumped_damping(system) / system.masses
        half, free = alpha * self.step / 2, np.zeros(len(alpha))
        free[system.free] = 1.0
        loaded = np.intersect1d(np.flatnonzero(system.loads.any(axis=1)), system.free)
        rule = CentralRule(
            self.step,
            free * (1 - half) / (1 + half),
            free * self.step**2 / system.masses / (1 + half),
            beta / self.step,
            system.held,
            system.moves[system.held],
            loaded,
            system.loads[loaded],
        )
        stepper = CentralStepper(
            self, system, body, rule, beta, system.held, plates, feels_loads, masses, past
        )
        stepper.warm()
        stepper = replace(stepper, start=stepper.limited(stepper.start))
        return stepper if self.threads == 1 else stepper.teamed(idle_cores())

    def _beta(self, scene: Scene) -> float:
        betas = set(scene.per_cell(lambda m: m.stiffness_damping))
        if self.damping == "none" or betas == {0.0}:
            return 0.0
        if self.damping == "mass":
            raise SceneError(
                f"stiffness damping {max(betas):g} s has no explicit form; take "
                "damping='lagged', or 'none' to omit all damping"
            )
        if len(betas) > 1:
            raise SceneError(
                f"lagged damping needs one value of stiffness damping, got {sorted(betas)} s"
            )
        return float(betas.pop())


@dataclass(frozen=True)
class Past:
    """Motion and inputs after a step; `limit` s was taken at the displacements `limit_u`."""

    motion: ExplicitMotion
    limit_u: Floats
    inputs: Floats
    limit: float = np.inf
    work: float = 0.0
    taken: float = 0.0
    most: float = 0.0


@dataclass(frozen=True)
class CentralStepper:
    """`plates` (held, k) m/m are the moves of the `held` unknowns, which may feel loads, too."""

    settings: CentralDifference
    system: System
    body: ExplicitBody
    rule: CentralRule
    beta: float
    held: Ints
    plates: Floats
    feels_loads: bool
    masses: Floats
    start: Past
    team: Team | None = None

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @property
    def units(self) -> Mapping[str, str]:
        """Energies half a step before the last watch, det F and critical step then, forces."""
        forces = {f"{d.name}.force": "N" for d in self.scene.drives}
        return _SEEN | forces

    def warm(self) -> None:
        """Compiles: no step is charged with it."""
        inputs = self.start.inputs
        self.body.advance(self.start.motion, self.rule, inputs, inputs, 1)
        self.body.look(self.start.motion["u"])

    def teamed(self, idle: int) -> "CentralStepper":
        """With as many threads as pay where `idle` cores are."""
        begin = self.start.inputs

        def steps(threads: int) -> None:
            self.body.share(threads)
            self._advanced(self.start, begin)

        team = Team(pilot(steps, self.settings.threads, idle))
        self.body.share(team.threads)
        return replace(self, team=team)

    def notices(self, state: State) -> tuple[str, ...]:
        return (self.team.said,) if self.team else ()

    def rest(self) -> State:
        u = self.start.motion["u"]
        seen = self._seen(self.start, self.body.look(u))
        return State(0, self.start, numbers=seen | self._forces(u, self.start.inputs))

    def step(self, state: State, inputs: Floats) -> State:
        """To the inputs (k + l,) at the end of the step: drives in m, then loads in N."""
        past: Past = state.inner
        if state.k == 0 and self._refused(past.limit, self.settings.margin):
            return replace(state, failure=("refused", self._too_large(past.limit)))
        k, substeps = state.k + 1, self.settings.substeps
        start = perf_counter()
        motion, work, taken, finite = self._advanced(past, inputs)
        if self.team:
            self.team.saw(perf_counter() - start)
            self.body.share(self.team.threads)
        if not finite:
            ratio = self.rule.dt / past.limit
            words = (
                f"the displacements are not finite after it; dt is {ratio:.3g} of the critical step"
            )
            return replace(state, failure=("diverged", words))
        total = past.work + work
        new = replace(
            past,
            motion=motion,
            inputs=inputs,
            work=total,
            taken=past.taken + taken,
            most=max(past.most, abs(total)),
        )
        numbers, failure = dict(state.numbers), None
        if k % self.settings.watch == 0 or k == 1:
            new, seen, failure = self._watched(new, k)
            numbers |= seen
        numbers |= self._forces(motion["r"], inputs)
        return State(k, new, failure, substeps, numbers)

    def _advanced(self, past: Past, inputs: Floats) -> tuple[ExplicitMotion, float, float, bool]:
        """Motion, work, what damping took, and whether all is finite."""
        substeps = self.settings.substeps
        return self.body.advance(past.motion, self.rule, past.inputs, inputs, substeps)

    def _forces(self, r: Floats, inputs: Floats) -> dict[str, float]:
        """Forces N of the plates on the whole body (eq 32), compression positive, no inertia."""
        if not self.scene.drives:
            return {}
        acting = r[self.held]
        if self.feels_loads:
            acting = acting - self.system.loads[self.held] @ inputs[len(self.scene.drives) :]
        forces = self.scene.copies * (acting @ self.plates)
        return {f"{d.name}.force": float(f) for d, f in zip(self.scene.drives, forces, strict=True)}

    def _watched(
        self, past: Past, k: int
    ) -> tuple[Past, Mapping[str, float], tuple[Ending, str] | None]:
        """The state half a step before, where all energies are known: numbers, and what fails."""
        past = self.limited(past)
        look = self.body.look(past.motion["u"] - past.motion["d"] / 2)
        seen = self._seen(past, look)
        ratio = self.rule.dt / past.limit
        own = self._increment_energy(past.motion, ratio, seen["energy.kinetic"])
        excess = seen["energy.strain"] + seen["energy.kinetic"] + past.taken - past.work - own
        most = past.most + abs(own)
        if not excess <= _EXCESS * most:
            times = 1 + excess / most if most else np.inf
            words = f"step {k}: energy {times:.3g} times the work done, dt is {ratio:.3g}"
            return past, seen, ("diverged", f"{words} of the critical step {past.limit:.3g} s")
        if look.inverted:
            words = f"step {k}: {look.inverted} of {look.cells} elements inverted (det F <= 0)"
            return past, seen, ("invalid", words)
        if self._refused(past.limit, 0.0):
            return past, seen, ("refused", f"step {k}: as deformed, {self._too_large(past.limit)}")
        return past, seen, None

    def _increment_energy(self, motion: ExplicitMotion, ratio: float, kinetic: float) -> float:
        """d K d/8 J of the last increment: what central difference holds beyond the work done.

        In a linear body strain + kinetic - work is exactly this at half steps, as long as the run
        lasts and also as it diverges. So of the free unknowns' share no more is granted than
        stable runs can have, (dt/critical step)^2 times the kinetic energy, and none beyond it.
        """
        u, d = motion["u"], motion["d"]
        r = self.body.force(u) if self.body.branches else motion["r"]
        whole = free = float(d @ (r - self.body.force(u - d))) / 8
        if self.scene.drives:
            alone = d.copy()
            alone[self.held] = 0.0
            free = float(alone @ self.body.tangent_product(u - d / 2, alone)) / 8
        return whole - free + (min(free, ratio**2 * kinetic) if ratio < 1 else 0.0)

    def limited(self, past: Past) -> Past:
        """Return the critical step of the body as it is deformed now, if that has changed much."""
        u, size = past.motion["u"], float(np.ptp(self.scene.mesh.nodes, axis=0).max())
        if np.isfinite(past.limit) and np.abs(u - past.limit_u).max() < _DEFORMED * size:
            return past
        full, free = np.zeros(len(u)), self.system.free

        def apply(x: Floats) -> Floats:
            full[free] = x
            return self.body.tangent_product(u, full)[free]

        undamped = CriticalStep.by_lanczos(apply, self.masses).limit
        limit = float(np.hypot(undamped, self.beta)) - self.beta
        return replace(past, limit=limit, limit_u=u)

    def _seen(self, past: Past, look: BodyLook) -> dict[str, float]:
        d = past.motion["d"][self.system.free]
        kinetic = float(self.masses @ (d * d)) / (2 * self.rule.dt**2)
        return {
            "energy.strain": look.energy,
            "energy.kinetic": kinetic,
            "energy.external": past.work,
            "energy.damped": past.taken,
            "det_F.min": look.det_F,
            "inverted": float(look.inverted),
            "critical_step": past.limit,
        }

    def _refused(self, limit: float, margin: float) -> bool:
        return self.settings.beyond_limit == "refuse" and self.rule.dt > (1 - margin) * limit

    def _too_large(self, limit: float) -> str:
        dt, settings = self.rule.dt, self.settings
        safe = (1 - settings.margin) * limit
        need = int(np.ceil(settings.dt / safe))
        return (
            f"dt {dt:.3g} s is {dt / limit:.3g} times the critical step {limit:.3g} s; take "
            f"substeps={need} or dt below {safe:.3g} s"
        )

    def field(self, state: State) -> Floats:
        """Displacements (n, 3) m of all nodes."""
        u: Floats = state.inner.motion["u"]
        return u.reshape(-1, 3)


def lumped_damping(system: System) -> Floats:
    """alpha M (N,) N s/m of every unknown, lumped as the masses are."""
    scene = system.scene
    if not scene.regions:
        return scene.material.mass_damping * system.masses
    return lumped(scene, mass(scene, damping=True))


def _in_parts(precision: Precision) -> Callable[[float], Scheme]:
    return lambda dt: CentralDifference(dt, _PARTS, "lagged", precision=precision)


def _maps_at_rest(lagged: bool) -> Radii:
    """Of (u, d), d the last increment: d' = keep d - gain (K u + lag K d), paper 003, eq 18."""

    def maps(r: Rates) -> Floats:
        keep, gain = (1 - r.alpha / 2) / (1 + r.alpha / 2), 1 / (1 + r.alpha / 2)
        k = gain * r.x**2
        d = keep - (r.beta * k if lagged else 0 * k)
        return np.stack([np.stack([1 - k, d], axis=-1), np.stack([-k, d], axis=-1)], axis=1)

    return maps


def _step_at_rest(lagged: bool) -> Callable[[System], float]:
    """As the scheme takes it: by Lanczos, with sqrt(h^2 + beta^2) - beta for lagged damping."""

    def limit(system: System) -> float:
        free = system.free
        K = system.K[free][:, free]
        h = CriticalStep.by_lanczos(lambda x: K @ x, system.masses[free]).limit
        beta = system.scene.material.stiffness_damping if lagged else 0.0
        # The same as hypot(h, beta) - beta, without its cancellation.
        return float(h * h / (np.hypot(h, beta) + beta))

    return limit
