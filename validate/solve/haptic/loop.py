"""Haptic loop: a spring probe at haptic rate on a slower simulation (papers 003 and 004).

The body is St. Venant-Kirchhoff (or another law at large strain) by central difference, with as
many substeps as its critical step needs. It reads the probe at every n-th tick and answers by a
force some ticks later; in between the force is extrapolated in time from the last answers. Of a
body that is computed in the `background`, a tick takes what is there, and waits at the tick at
which the answer is due: what comes out never depends on how fast it was.

Departures: the paper's own forces are those of displaced nodes (eq 32) and its extrapolation is a
reference; here the hand feels the spring of a probe (virtual coupling), and `extrapolates` "place"
predicts where that spring hangs, not its force. A force begins and ends with its contact: what was
answered before does not count, and no hand is pulled harder than the body grips.

Body at large strain under a spring probe, stepped explicitly between readings. The spring and the
nodes that share it enter the compiled step of `CentralDifference` itself: as a stiffness of the
body, and as a load that follows the probe. So it acts at every substep, on a probe that goes
straight from the last reading to this one, and its energy is in the balance that the scheme
watches. Hold and release are decided at readings.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, partial
from threading import get_native_id
from typing import ClassVar, Literal, Protocol, get_args

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError, UsageError
from validate.fem.critical import CriticalStep
from validate.fem.large_strain.explicit import ExplicitMotion
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.contact import Needle
from validate.scene.places import nodes_of
from validate.scene.scene import Scene
from validate.solve.explicit.central import CentralDifference, CentralStepper, Damping, Past
from validate.solve.handles import LARGE, Handles, require_handled
from validate.solve.types import State

# --- spring probe of paper 004, section 3: a spring to the nearest surface node ------------------


class Touchable(Protocol):
    """A body as a probe knows it: `places` (n, d) m of its nodes at rest, `surface` (k,) those that
    may be touched, `at` (m,) where the unknowns stand among the n d components."""

    @property
    def places(self) -> Floats: ...

    @property
    def surface(self) -> Ints: ...

    @property
    def at(self) -> Ints: ...

    def spread(self, u: Floats) -> Floats:
        """Displacements (n, d) m of the nodes."""
        ...


@dataclass(frozen=True)
class Hold:
    """The probe holds `node`, and the nodes `pad` (it among them) share the spring; at `slack` (d,)
    m between probe and node the spring is slack."""

    node: int
    pad: tuple[int, ...]
    slack: Floats


@dataclass(frozen=True)
class SpringProbe:
    """A spring N/m, of a probe that points along the unit `axis` (d,); see `AsyncRegions` for the
    rest."""

    body: Touchable
    axis: Floats
    spring: float
    reach: float
    pad: float
    grip: float | None
    slides: bool

    def follow(self, held: Hold | None, tip: Floats, u: Floats) -> Hold | None:
        """Return the hold at this tick: taken, moved, let go or as it was."""
        if held is None:
            node, away, places = self._nearest(tip, u)
            if away > self.reach:
                return None
            pad = self._pad(node)
            return Hold(node, pad, tip - self._hung(node, pad, places))
        # How hard the probe pulls back out, N
        if self.grip is not None and float(self.force(held, tip, u) @ -self.axis) > self.grip:
            return None
        if not self.slides:
            return held
        # The hold at the nearest node, with the force that the spring has
        node, _, places = self._nearest(tip, u)
        if node == held.node or not self.spring:
            return held
        stretch, pad = self.force(held, tip, u) / self.spring, self._pad(node)
        return Hold(node, pad, tip - self._hung(node, pad, places) - stretch)

    def _nearest(self, tip: Floats, u: Floats) -> tuple[int, float, Floats]:
        """The surface node nearest to the tip, how far it is, and all nodes' places."""
        places = self.body.places + self.body.spread(u)
        away = np.linalg.norm(places[self.body.surface] - tip, axis=1)
        i = int(np.argmin(away))
        return int(self.body.surface[i]), float(away[i]), places

    def _pad(self, node: int) -> tuple[int, ...]:
        rest = self.body.places
        near = np.linalg.norm(rest[self.body.surface] - rest[node], axis=1) <= self.pad
        return tuple(np.union1d(self.body.surface[near], [node]).tolist())

    def _hung(self, node: int, pad: tuple[int, ...], places: Floats) -> Floats:
        """Where the spring hangs (d,) m: the node, moved as the mean of its pad."""
        rest = self.body.places
        return np.asarray(rest[node] + (places - rest)[list(pad)].mean(axis=0))

    def slack_at(self, held: Hold, u: Floats) -> Floats:
        """Where the probe (d,) m would feel nothing."""
        places = self.body.places + self.body.spread(u)
        return np.asarray(self._hung(held.node, held.pad, places) + held.slack)

    def force(self, held: Hold | None, tip: Floats, u: Floats) -> Floats:
        """Of the spring on the body (d,) N; it pulls at the mean of the pad."""
        if held is None:
            return np.zeros(len(tip))
        return np.asarray(self.spring * (tip - self.slack_at(held, u)))

    def nodal(self, held: Hold | None, tip: Floats, u: Floats) -> Floats:
        """That force on the unknowns (m,)."""
        if held is None:
            return np.zeros(len(self.body.at))
        return self.shared(held, self.force(held, tip, u))

    def shared(self, held: Hold, force: Floats) -> Floats:
        """Return a force (d,) N on the unknowns (m,), equal on the pad's nodes."""
        f = np.zeros(self.body.places.shape)
        f[list(held.pad)] = force / len(held.pad)
        return np.asarray(f.ravel()[self.body.at])


# --- haptic loop: a spring probe at haptic rate on a slower simulation ---------------------------


@dataclass(frozen=True)
class TouchableBody:
    """All nodes of a system's mesh; see `Touchable`."""

    system: System
    surface: Ints

    @property
    def places(self) -> Floats:
        return self.system.scene.mesh.nodes

    @property
    def at(self) -> Ints:
        return np.arange(self.places.size)

    def spread(self, u: Floats) -> Floats:
        return u.reshape(self.places.shape)


@dataclass(frozen=True)
class Read:
    """The body when the probe was read: the scheme's own state, the hold, the force (d,) N on the
    hand and the place (d,) m at which the probe would feel nothing."""

    state: State
    held: Hold | None
    force: Floats
    place: Floats


@dataclass(frozen=True)
class TouchedBody:
    """`untouched` steps the body while nothing holds it; what steps it while `kept` nodes share the
    spring is made once."""

    untouched: CentralStepper
    probe: SpringProbe
    kept: dict[tuple[int, ...], CentralStepper]

    def rest(self, tip: Floats) -> Read:
        """Return the body at rest and the probe at `tip` (d,) m."""
        state = self.untouched.rest()
        past: Past = replace(state.inner, inputs=np.zeros(len(tip)))
        return self._read(replace(state, inner=past), None, tip)

    def to(self, last: Read, tip: Floats) -> Read:
        """One reading further, the probe gone straight to `tip` (d,) m."""
        inputs = np.zeros(len(tip)) if last.held is None else self._aim(last.held, tip)
        return self._read(self._holding(last.held).step(last.state, inputs), last.held, tip)

    def _read(self, state: State, held: Hold | None, tip: Floats) -> Read:
        if state.failure:
            return Read(state, held, np.zeros(len(tip)), tip)
        u = state.inner.motion["u"]
        new = self.probe.follow(held, tip, u)
        if new is not held:
            state = replace(state, inner=self._handed_over(state.inner, held, new, tip))
        place = tip if new is None else self.probe.slack_at(new, u)
        return Read(state, new, -self.probe.force(new, tip, u), place)

    def _holding(self, held: Hold | None) -> CentralStepper:
        """The body's stepper with the spring in it, whose inputs are the `_aim` of the probe."""
        if held is None:
            return self.untouched
        if held.pad not in self.kept:
            free, d = self.untouched, len(self.probe.axis)
            pad = np.repeat(d * np.array(held.pad), d).reshape(-1, d) + np.arange(d)
            pulls = np.tile(self.probe.spring / len(pad) * np.eye(d), (len(pad), 1))
            rule = replace(free.rule, loaded=pad.ravel(), loads=pulls)
            self.kept[held.pad] = replace(
                free, body=free.body.sprung(self._stiffness(held)), rule=rule
            )
        return self.kept[held.pad]

    def _aim(self, held: Hold, tip: Floats) -> Floats:
        """The mean displacement (d,) m of the pad at which the spring would be slack."""
        return np.asarray(tip - self.probe.body.places[held.node] - held.slack)

    def _stiffness(self, held: Hold | None) -> sparse.csr_array:
        """(N, N) N/m of the spring at the mean of the pad."""
        N, d = self.probe.body.places.size, len(self.probe.axis)
        if held is None:
            return sparse.csr_array((N, N))
        rows = np.repeat(np.arange(d), len(held.pad))
        columns = (d * np.array(held.pad) + np.arange(d)[:, None]).ravel()
        share = np.full(len(rows), 1 / len(held.pad))
        mean = sparse.csr_array((share, (rows, columns)), shape=(d, N))
        return sparse.csr_array(self.probe.spring * (mean.T @ mean))

    def _handed_over(self, past: Past, old: Hold | None, new: Hold | None, tip: Floats) -> Past:
        """The state as the new hold takes it on: forces and stored energy are those of its spring.

        The energy that the spring has in the body's balance jumps with the hold; so does the work.
        """
        change = sparse.csr_array(self._stiffness(new) - self._stiffness(old))
        u, rows = past.motion["u"], past.motion.rows.copy()
        rows[2] += change @ u
        rows[3] += change @ (u - past.motion["d"])
        rows.setflags(write=False)
        inputs = np.zeros(len(tip)) if new is None else self._aim(new, tip)
        work = past.work + float(u @ (change @ u)) / 2
        motion = ExplicitMotion(rows, past.motion.memory)
        return replace(past, motion=motion, inputs=inputs, work=work)


# --- A force between the answers of a slower simulation: the polynomial through the last of
# them.
#
# Paper 003, section 3.5, names "force extrapolation" for tissues too large for 1 kHz and leaves
# the rule to others. Of order p (0 held, 1 linear, 2 quadratic) it is exact for a force that is
# such a polynomial of time, and else off by f^(p+1) times the distances in time over (p+1)!.

Extrapolation = Literal["hold", "linear", "quadratic"]
NAMES: tuple[Extrapolation, ...] = get_args(Extrapolation)


def answers_of(name: Extrapolation) -> int:
    """How many of the last answers it takes; as long as there are fewer, those that are there."""
    return NAMES.index(name) + 1


def extrapolated(t: Floats, y: Floats, at: float) -> Floats:
    """Return the polynomial through y (m, d) at distinct times t (m,) s, at the time `at` s:
    (d,)."""
    # Lagrange's, (m,); they add up to one
    apart = t[:, None] - t
    np.fill_diagonal(apart, 1.0)
    beyond = np.tile(at - t, (len(t), 1))
    np.fill_diagonal(beyond, 1.0)
    return np.asarray((beyond / apart).prod(axis=1) @ y)


# -------------------------------------------------------------------------------------------------

_AXES = "xyz"


@dataclass(frozen=True)
class HapticLoop:
    """Settings. `every` 1 and `late` 0: the body answers every tick, at once.

    `margin` is the share of the critical step kept as a margin for how the limit falls as the body
    deforms; `damping` and `watch` (of answers) are those of `CentralDifference`, and the spring's
    those of `AsyncRegions`. `limit` N: no larger force is given to the hand.
    """

    handles: ClassVar[Handles] = Handles(
        LARGE, inertia=True, cavities=False, loads=False, contact=("foundations", "needle")
    )

    dt: float = quantity(1e-3, "s", "a tick of the hand")
    every: int = quantity(10, "1", "ticks between two readings of the probe by the simulation")
    late: int = quantity(10, "1", "ticks from a reading to its answer")
    extrapolation: Extrapolation = quantity("linear", "1", "hold, linear, quadratic")
    extrapolates: Literal["force", "place"] = quantity(
        "force", "1", "quantity that is extrapolated in time"
    )
    background: bool = quantity(False, "1", "simulate in a separate thread")
    margin: float = quantity(0.25, "1", "share of the critical step kept as a margin")
    damping: Damping = quantity("mass", "1", "none, alpha M, or beta K too at the last half step")
    watch: int = quantity(20, "1", "answers between checks of energy, det F, critical step")
    spring: float = quantity(1000.0, "N/m", "between probe and contact")
    reach: float = quantity(2e-3, "m", "distance at which the probe makes contact")
    pad: float = quantity(
        0.01, "m", "distance from the contact within which surface nodes share the spring"
    )
    grip: float | None = quantity(0.0, "N", "pulling force at which contact ends; none: never")
    slides: bool = quantity(False, "1", "the contact moves to the node nearest to the probe")
    limit: float = quantity(5.0, "N", "largest force on the hand")

    def __post_init__(self) -> None:
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise SceneError(f"tick of {self.dt:g} s: expected a finite number above 0")
        if not (self.every >= 1 and 0 <= self.late <= self.every):
            raise UsageError(
                f"a reading every {self.every} ticks that is answered {self.late} ticks later: "
                "expected at least 1, and an answer no later than the next reading"
            )
        if not 0 <= self.margin < 1:
            raise SceneError(
                f"margin {self.margin:g}: expected a share of the critical step, 0 to 1"
            )
        if not (self.spring > 0 and self.reach > 0 and self.pad >= 0):
            raise SceneError(
                f"spring {self.spring:g} N/m, reach {self.reach:g} m, pad {self.pad:g} m: "
                "expected spring and reach above 0, and a pad of 0 or more"
            )
        if not (np.isfinite(self.limit) and self.limit > 0):
            raise SceneError(f"force limit {self.limit:g} N: expected a finite number above 0")
        if not (self.grip is None or self.grip >= 0):
            raise SceneError(f"grip {self.grip:g} N: expected 0 or more, or none")

    def between_answers(self, y: Floats) -> Floats:
        """Return what ticks 0, 1, .. give of a force y (nt, d) N that every tick has: it is read
        and answered as set; the first answer stands before it is there."""
        given, most = np.empty_like(y), answers_of(self.extrapolation)
        for k in range(len(y)):
            last = max(k - self.late, 0) // self.every
            read = self.every * np.arange(max(0, last + 1 - most), last + 1)
            given[k] = extrapolated(read.astype(np.float64), y[read], float(k))
        return given

    def prepare(self, system: System) -> "HapticStepper":
        """Raise `SceneError` for a scene without one probe, with drives, or held where it may be
        touched."""
        scene = system.scene
        require_handled(scene, self)
        if len(scene.tools) != 1 or scene.drives:
            raise SceneError(
                f"{len(scene.tools)} probes and {len(scene.drives)} drives: the haptic loop "
                "needs one probe and no drive"
            )
        tool, bare = scene.tools[0], replace(system, scene=replace(scene, tools=()))
        # Nodes that may be touched and of which nothing is held
        mesh = system.scene.mesh
        nodes, held = nodes_of(mesh, tool.facets), np.unique(system.held // mesh.dimension)
        free = np.setdiff1d(nodes, held)
        if not len(free):
            raise SceneError(
                f"probe '{tool.name}': all {len(nodes)} nodes that it may touch are held; choose a "
                "free face"
            )
        touchable = TouchableBody(bare, free)
        # Explicit steps in a tick: stable with the spring on any one node, by Weyl's bound
        found = CriticalStep.of(bare).lanczos
        least = float(bare.masses.reshape(touchable.places.shape)[touchable.surface].min())
        limit = 2 / np.sqrt((2 / found) ** 2 + self.spring / least)
        substeps = int(np.ceil(self.dt / ((1 - self.margin) * limit)))
        rule = CentralDifference(
            self.every * self.dt, self.every * substeps, self.damping, margin=0.0, watch=self.watch
        )
        body = rule.prepare(bare)
        assert isinstance(body, CentralStepper)
        probe = SpringProbe(touchable, np.array(tool.axis), self.spring, self.reach, self.pad,
                            self.grip, self.slides)  # fmt: skip
        jobs = Background() if self.background else None
        return HapticStepper(self, system, tool, TouchedBody(body, probe, {}), substeps, jobs)


@dataclass(frozen=True)
class Answer:
    """The probe as it was read at the tick `k`: force (d,) N on the hand, the place (d,) m at which
    it would feel nothing, and whether it holds the body."""

    k: int
    force: Floats
    place: Floats
    holds: bool


@dataclass(frozen=True)
class HapticTick:
    """The last body that was answered, the one that is computed and since which tick, and the last
    answers in rising time, of one contact."""

    body: Read
    answers: tuple[Answer, ...]
    running: Callable[[], Read] | None = None
    since: int = 0


class Background:
    """One thread, begun with its first job; `numbers` are the system's of it."""

    def __init__(self) -> None:
        self.numbers: list[int] = []
        self._pool = ThreadPoolExecutor(1, "simulation", self._begun)

    def _begun(self) -> None:
        self.numbers.append(get_native_id())

    def result_of(self, job: Callable[[], Read]) -> Callable[[], Read]:
        """Begin a job; what waits for its result."""
        return self._pool.submit(job).result


@dataclass(frozen=True)
class HapticStepper:
    """Steps through displacements (d,) m of the probe, a tick each; see `HapticLoop`.

    `substeps` explicit steps are made in every tick's time.
    """

    settings: HapticLoop
    system: System
    tool: Needle
    body: TouchedBody
    substeps: int
    jobs: Background | None

    @property
    def scene(self) -> Scene:
        return self.system.scene

    @property
    def rate(self) -> float:
        """Ticks a second."""
        return 1 / self.settings.dt

    @property
    def limit(self) -> float:
        return self.settings.limit

    @cached_property
    def units(self) -> Mapping[str, str]:
        name = self.tool.name
        forces = {f"{name}.force.{a}": "N" for a in _AXES[: len(self.tool.tip)]}
        own = {
            f"{name}.contact": "1", f"{name}.changed": "1", f"{name}.clipped": "1",
            f"{name}.answered": "1", f"{name}.jump": "N", f"{name}.stretch": "J",
        }  # fmt: skip
        return {**forces, **own, **self.body.untouched.units}

    @property
    def threads(self) -> tuple[int, ...]:
        """The simulation's own, once it has begun."""
        return tuple(self.jobs.numbers) if self.jobs else ()

    def warm(self) -> None:
        """A touch that is forgotten: kernels compiled, and the spring at the nearest node."""
        places, tip = self.body.probe.body.places, np.array(self.tool.tip)
        surface = places[self.body.probe.body.surface]
        onto = surface[np.argmin(np.linalg.norm(surface - tip, axis=1))] - tip
        state = self.rest()
        for _ in range(3 * self.settings.every + 1):
            state = self.step(state, onto)

    def rest(self) -> State:
        read = self.body.rest(np.array(self.tool.tip))
        return self._told(0, HapticTick(read, (_answer(0, read),)), np.array(self.tool.tip), 0.0)

    def step(self, state: State, inputs: Floats) -> State:
        """One tick: what is due is taken, the probe is read where it is time, the force given."""
        last: HapticTick = state.inner
        k, tip = state.k + 1, np.array(self.tool.tip) + inputs
        tick = self._begun(self._taken(last, k), k, tip)
        tick = self._taken(tick, k)  # what is answered at once
        if tick.body.state.failure:
            return replace(state, k=k, inner=tick, failure=tick.body.state.failure)
        jump = float(np.linalg.norm(self._force(tick, k, tip) - self._force(last, k, tip)))
        return self._told(k, tick, tip, jump, last)

    def _begun(self, tick: HapticTick, k: int, tip: Floats) -> HapticTick:
        """The simulation sent on its way to the probe, at the ticks that are read."""
        if k % self.settings.every:
            return tick
        to = partial(self.body.to, tick.body, tip)
        return replace(tick, running=self.jobs.result_of(to) if self.jobs else to, since=k)

    def _taken(self, tick: HapticTick, k: int) -> HapticTick:
        """The answer, at the tick at which it is due."""
        if tick.running is None or k < tick.since + self.settings.late:
            return tick
        read = tick.running()
        new, last = _answer(tick.since, read), tick.answers[-1]
        most = answers_of(self.settings.extrapolation)
        same = (*tick.answers, new)[-most:] if new.holds == last.holds else (new,)
        return HapticTick(read, same)

    def _force(self, tick: HapticTick, k: int, tip: Floats) -> Floats:
        """On the hand (d,) N, extrapolated to tick k with the probe at `tip`, before its limit."""
        if not tick.answers[-1].holds:
            return np.zeros(len(tip))
        times = np.array([a.k for a in tick.answers], dtype=np.float64)
        if self.settings.extrapolates == "place":
            places = np.array([a.place for a in tick.answers])
            force = self.settings.spring * (extrapolated(times, places, k) - tip)
        else:
            force = extrapolated(times, np.array([a.force for a in tick.answers]), k)
        # Without what would pull the hand into the body harder than the body grips
        if self.settings.grip is None:
            return force
        axis = self.body.probe.axis
        return np.asarray(force - max(float(force @ axis) - self.settings.grip, 0.0) * axis)

    def _told(
        self, k: int, tick: HapticTick, tip: Floats, jump: float, last: HapticTick | None = None
    ) -> State:
        hand, s, body = self._force(tick, k, tip), self.settings, tick.body
        size = float(np.linalg.norm(hand))
        clipped = size > s.limit
        if clipped:
            hand = hand * (s.limit / size)
        answered = last is not None and tick.body is not last.body
        changed = last is not None and tick.answers[-1].holds != last.answers[-1].holds
        stretch = float(body.force @ body.force) / (2 * s.spring)
        found = (*hand.tolist(), float(tick.answers[-1].holds), float(changed), float(clipped),
                 float(answered), jump if answered else 0.0, stretch)  # fmt: skip
        own = dict(zip(self.units, found, strict=False))
        return State(k, tick, None, self.substeps, own | dict(body.state.numbers))

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes, as last answered."""
        tick: HapticTick = state.inner
        return self.body.untouched.field(tick.body.state)


def _answer(k: int, read: Read) -> Answer:
    return Answer(k, read.force, read.place, read.held is not None)
