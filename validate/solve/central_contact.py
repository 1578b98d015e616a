"""Contact of explicit steps: nodes that would enter a rigid body are put back on it, no penalty.

With lumped masses every node answers for itself: the force that ends the step on the surface is
known at once (Carpenter, Taylor & Katona 1991), Coulomb's law included, and the critical step stays
that of the body. Along the normals of the step's beginning, force x (u_{n+1} - u_{n-1})/2, which is
what central difference gains from it, is never above zero on a plane, relative to the rigid body:
contact takes energy and gives none. On curved bodies that holds to the square of the slip.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, Ints
from validate.fem.explicit import CentralRule, ExplicitBody, ExplicitMotion
from validate.fem.system import System
from validate.solve.touching import OPEN, SLIP, STICK, Candidates, candidates, frame
from validate.solve.touching_traces import Touched, contact_numbers


@dataclass(frozen=True)
class Struck:
    """After a step: `status` (c,) of the candidates, forces (c, d) N on them, mean over the step;
    how far (contacts, d) m the rigid bodies moved in its last substep, and their work so far."""

    status: Ints
    forces: Floats
    moved: Floats
    work: Floats


@dataclass(frozen=True)
class ExplicitContact:
    """The candidates of a system and its central-difference step."""

    system: System
    parts: Candidates
    body: ExplicitBody
    rule: CentralRule

    def rest(self) -> Struck:
        c, d = self.parts.unknowns.shape
        contacts = len(self.parts.contacts)
        return Struck(
            np.full(c, OPEN), np.zeros((c, d)), np.zeros((contacts, d)), np.zeros(contacts)
        )

    def advance(
        self, motion: ExplicitMotion, struck: Struck, begin: Floats, end: Floats, substeps: int
    ) -> tuple[ExplicitMotion, Struck, float, float, bool]:
        """As `ExplicitBody.advance`, with contact in every substep; its work on the body counts."""
        work, taken, mean = 0.0, 0.0, np.zeros_like(struck.forces)
        for s in range(substeps):
            at, to = (begin + (end - begin) * (s + i) / substeps for i in (0, 1))
            last = motion
            motion, more, _, finite = self.body.advance(motion, self.rule, at, to, 1)
            if not finite:
                return motion, struck, work, taken, False
            motion, struck, own = self._pushed(last, motion, struck, at, to)
            work, taken = work + more + own, taken + self._taken(last, motion)
            mean = mean + struck.forces / substeps
        struck = Struck(struck.status, mean, struck.moved, struck.work)
        return motion, struck, work, taken, True

    def _pushed(
        self, last: ExplicitMotion, now: ExplicitMotion, struck: Struck, at: Floats, to: Floats
    ) -> tuple[ExplicitMotion, Struck, float]:
        """The motion with what would penetrate put back, and the work J of that on the body."""
        parts, unknowns = self.parts, self.parts.unknowns
        X = self.system.scene.mesh.nodes[parts.nodes]
        view = frame(parts, X + last["u"][unknowns], at, to, True, np.zeros(len(X)))
        put, status = _put(parts, view.start, X + now["u"][unknowns], view.gaps, view.normals)
        gain = self.rule.gain[unknowns]
        forces = np.divide(put, gain, out=np.zeros_like(put), where=gain > 0)
        moved = self._moved(at, to)
        way = ((struck.moved + moved) / 2)[parts.owner]
        done = np.bincount(parts.owner, (forces * way).sum(axis=1), len(struck.work))
        new = Struck(status, forces, moved, struck.work + done)
        if not put.any():
            return now, new, 0.0
        rows, full = now.rows.copy(), np.zeros(now.rows.shape[1])
        full[unknowns] = put
        rows[:2] += full
        rows[2] = self.body.force(rows[0])
        rows.setflags(write=False)
        loads = self.rule.loads @ at[self.rule.moves.shape[1] :]
        work = float((forces * (last["d"] + rows[1])[unknowns]).sum()) / 2
        return ExplicitMotion(rows), new, work + float(loads @ full[self.rule.loaded]) / 2

    def _taken(self, last: ExplicitMotion, now: ExplicitMotion) -> float:
        """What damping took J, of the increment that contact and loads have left."""
        keep, gain, lag = self.rule.keep, self.rule.gain, self.rule.lag
        way = (last["d"] + now["d"]) / 2
        drag = np.divide(1 - keep, gain, out=np.zeros_like(gain), where=gain > 0) * way
        lagged = lag * (last["r"] - last["old"]) * (gain > 0)
        return float((drag + lagged) @ way)

    def _moved(self, at: Floats, to: Floats) -> Floats:
        bodies = range(len(self.parts.contacts))
        return np.array([self.parts.offset(k, to) - self.parts.offset(k, at) for k in bodies])

    def numbers(self, motion: ExplicitMotion, struck: Struck, inputs: Floats) -> dict[str, float]:
        """The numbers of `contact_units`."""
        scene = self.system.scene
        x = scene.mesh.nodes + motion["u"].reshape(scene.mesh.nodes.shape)
        now = Touched(x, inputs, struck.forces, struck.status, struck.work)
        return contact_numbers(self.parts, scene, now)


def _put(
    parts: Candidates, start: Floats, x: Floats, gaps: Floats, normals: Floats
) -> tuple[Floats, Ints]:
    """How far (c, d) m each candidate at x is put back, from `start` beside the moved body, and
    its status (c,)."""
    n = normals * parts.free
    square = (n**2).sum(axis=1)
    ways = (x - start) * parts.free
    left = gaps + ((x - start) * normals).sum(axis=1)
    hit = (left < 0) & (square > 0)
    depth = np.where(hit, -left, 0.0) / np.where(square > 0, square, 1.0)
    slid = ways - ((ways * n).sum(axis=1) / np.where(square > 0, square, 1.0))[:, None] * n
    size = np.linalg.norm(slid, axis=1)
    bears = parts.friction * depth * np.sqrt(square)
    share = np.divide(bears, size, out=np.zeros_like(size), where=size > bears)
    share[hit & (parts.friction > 0) & (size <= bears)] = 1.0
    sticks = hit & (share == 1.0)
    status = np.where(hit, np.where(sticks, STICK, SLIP), OPEN)
    return depth[:, None] * n - share[:, None] * slid, status


def explicit_contact(
    system: System, body: ExplicitBody, rule: CentralRule
) -> ExplicitContact | None:
    """None for a scene without rigid bodies."""
    if not system.scene.contacts:
        return None
    return ExplicitContact(system, candidates(system), body, rule)
