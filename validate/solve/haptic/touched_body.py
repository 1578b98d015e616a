"""Body at large strain under a spring probe, stepped explicitly between readings.

The spring and the nodes that share it enter the compiled step of `CentralDifference` itself: as a
stiffness of the body, and as a load that follows the probe. So it acts at every substep, on a probe
that goes straight from the last reading to this one, and its energy is in the balance that the
scheme watches. Hold and release are decided at readings.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.fem.large_strain.explicit import ExplicitMotion
from validate.fem.system import System
from validate.solve.explicit.central import CentralStepper, Past
from validate.solve.haptic.spring_probe import Hold, SpringProbe
from validate.solve.types import State


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
            self.kept[held.pad] = self._sprung(held)
        return self.kept[held.pad]

    def _sprung(self, held: Hold) -> CentralStepper:
        free, d = self.untouched, len(self.probe.axis)
        pad = np.repeat(d * np.array(held.pad), d).reshape(-1, d) + np.arange(d)
        pulls = np.tile(self.probe.spring / len(pad) * np.eye(d), (len(pad), 1))
        rule = replace(free.rule, loaded=pad.ravel(), loads=pulls)
        return replace(free, body=free.body.sprung(self._stiffness(held)), rule=rule)

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
