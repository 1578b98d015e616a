"""Coupled step of regions that exchange displacements only (paper 004, 5.2).

In a tick the primary region is solved first, then every other region that is due, outward; each
has its own period T and its own history. What a region shows to the others between its solves is
its "border": "delayed" interpolates from its last solve but one to its last (section 5.3), so it is
one period late; "hold" shows the last solve (the paper's moving wall); "joint" holds too, and all
that is due in a tick is solved as one system. With `overlap` every region also solves so many
layers of its neighbours, of which it keeps a history but shows nothing.

The map is linear while borders stand: columns of states (., q) are walked together, which is how
its spectral radius over a common period is found.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import lcm
from typing import Any, Literal

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.solve.regions.primary import (
    EXPLICIT,
    PrimarySolver,
    RegionMatrices,
    RegionSolver,
    SolverName,
    semi_implicit,
    solver_of,
)

BorderName = Literal["delayed", "hold", "joint"]


@dataclass(frozen=True)
class Zone:
    """A region's unknowns: `wide` (w,) are solved, `own` (o,) of the body are shown, which are
    `wide[shown]`; every `ratio` ticks. `outside` (w, m) are the entries of K to all others."""

    wide: Ints
    own: Ints
    shown: Ints
    ratio: int
    name: SolverName
    solver: RegionSolver
    outside: sparse.csr_array

    @property
    def memory(self) -> Any:
        """What the region's law remembers at rest."""
        return self.solver.law.rest() if isinstance(self.solver, PrimarySolver) else None

    def share(self, k: int) -> float:
        """How much of its period has passed at tick k, in (0, 1]."""
        return ((k - 1) % self.ratio + 1) / self.ratio


@dataclass(frozen=True)
class Piece:
    """A region's displacements m at its last solve, `before` (w,) one period earlier; `start` (o,)
    is what it showed at that solve; `seen` (m,) what an explicit one saw of all at that time;
    `memory` what its law remembers."""

    u: Floats
    before: Floats
    start: Floats
    seen: Floats
    memory: Any = None


@dataclass(frozen=True)
class Motion:
    """After k ticks: the pieces, and `visible` (m,) m of all unknowns."""

    k: int
    pieces: tuple[Piece, ...]
    visible: Floats


@dataclass(frozen=True)
class Coupled:
    """The zones of a body, the primary one first; `dt` s a tick."""

    body: RegionMatrices
    zones: tuple[Zone, ...]
    dt: float
    border: BorderName
    joints: dict[tuple[int, ...], tuple[Ints, RegionSolver, sparse.csr_array]]

    @property
    def common(self) -> int:
        """Ticks after which all regions are due together."""
        return lcm(*(zone.ratio for zone in self.zones))

    def rest(self, columns: tuple[int, ...] = ()) -> Motion:
        """All at rest; `columns` (q,) independent states."""
        zero = np.zeros((len(self.body.m), *columns))
        pieces = tuple(
            Piece(zero[z.wide], zero[z.wide], zero[z.own], zero, z.memory) for z in self.zones
        )
        return Motion(0, pieces, zero)

    def tick(self, last: Motion, f: Floats) -> Motion:
        """Return the next tick under forces f (m,) N."""
        k, pieces, visible = last.k + 1, list(last.pieces), last.visible.copy()
        for zone, piece in zip(self.zones[1:], pieces[1:], strict=True):
            u = piece.u[zone.shown]
            visible[zone.own] = (
                piece.start + zone.share(k) * (u - piece.start) if self.border == "delayed" else u
            )
        due = tuple(i for i, zone in enumerate(self.zones) if k % zone.ratio == 0)
        if self.border == "joint" and len(due) > 1:
            self._solve_jointly(due, pieces, visible, f)
        else:
            for i in due:
                zone, piece = self.zones[i], pieces[i]
                seen = piece.seen if zone.name in EXPLICIT else visible
                forces = f[zone.wide] - zone.outside @ seen
                if isinstance(zone.solver, PrimarySolver):
                    new, memory = zone.solver.walk(piece.u, piece.before, forces, piece.memory)
                    pieces[i] = replace(piece, memory=memory)
                else:
                    new = zone.solver.next(piece.u, piece.before, forces)
                self._take(i, new, pieces, visible)
        for i in due:
            if self.zones[i].name in EXPLICIT:
                pieces[i] = replace(pieces[i], seen=visible)
        return Motion(k, tuple(pieces), visible)

    def _take(self, i: int, new: Floats, pieces: list[Piece], visible: Floats) -> None:
        """The region's solution becomes its piece, and is shown where the border says so."""
        zone, piece = self.zones[i], pieces[i]
        pieces[i] = replace(piece, u=new, before=piece.u, start=visible[zone.own])
        if i == 0 or self.border != "delayed":
            visible[zone.own] = new[zone.shown]

    def _solve_jointly(
        self, due: tuple[int, ...], pieces: list[Piece], visible: Floats, f: Floats
    ) -> None:
        """All regions that are due as one system, each unknown with its own period."""
        if due not in self.joints:
            zones = [self.zones[i] for i in due]
            at = np.concatenate([z.wide for z in zones])
            periods = [
                np.full(len(z.wide), np.inf if z.name == "static" else z.ratio * self.dt)
                for z in zones
            ]
            joint = semi_implicit(self.body, at, np.concatenate(periods))
            self.joints[due] = at, joint, _outside(self.body.K, at)
        at, solver, outside = self.joints[due]
        u = np.concatenate([pieces[i].u for i in due])
        before = np.concatenate([pieces[i].before for i in due])
        new = solver.next(u, before, f[at] - outside @ visible)
        ends = np.cumsum([len(self.zones[i].wide) for i in due])
        for i, part in zip(due, np.split(new, ends[:-1]), strict=True):
            self._take(i, part, pieces, visible)


def zone_of(
    body: RegionMatrices, wide: Ints, own: Ints, ratio: int, name: SolverName, dt: float
) -> Zone:
    """Return a zone of the unknowns `own`, solved with `wide`, both in rising order."""
    shown = np.searchsorted(wide, own)
    solver = solver_of(name, body, wide, ratio * dt)
    return Zone(wide, own, shown, ratio, name, solver, _outside(body.K, wide))


def _outside(K: sparse.csr_array, at: Ints) -> sparse.csr_array:
    """Rows `at` of K without their own columns."""
    others = np.ones(K.shape[1])
    others[at] = 0.0
    rows = sparse.csr_array(K[at] @ sparse.diags_array(others))
    rows.eliminate_zeros()
    return rows


def carried(old: Coupled, motion: Motion, new: Coupled) -> Motion:
    """Return the motion in other regions: what is seen stays, and so does every node's velocity.

    A region keeps the histories of the nodes that it had. One that it takes over stands where it is
    shown until the region's next solve, with its velocity for that solve: no displacement jumps
    (put back to where it was at the last solve, borders made 4 kJ out of 4 J on the paper's bar).
    """
    speed = np.zeros_like(motion.visible)
    for zone, piece in zip(old.zones, motion.pieces, strict=True):
        rate = (piece.u - piece.before)[zone.shown] / zone.ratio
        speed[zone.own] = rate  # m a tick
    pieces = []
    for i, zone in enumerate(new.zones):
        u, start = motion.visible[zone.wide], motion.visible[zone.own]
        before = u - zone.ratio * speed[zone.wide]
        if i < len(old.zones) and old.zones[i].ratio == zone.ratio:
            kept = np.isin(zone.wide, old.zones[i].wide)
            from_ = np.searchsorted(old.zones[i].wide, zone.wide[kept])
            u[kept], before[kept] = motion.pieces[i].u[from_], motion.pieces[i].before[from_]
            same = np.isin(zone.own, old.zones[i].own)
            start[same] = motion.pieces[i].start[np.searchsorted(old.zones[i].own, zone.own[same])]
        pieces.append(Piece(u, before, start, motion.visible, zone.memory))
    return Motion(motion.k, tuple(pieces), motion.visible)


# --- stability ------------------------------------------------------------------------------------


def period_map(coupled: Coupled, forces: Callable[[Floats], Floats] | None = None) -> Floats:
    """Return the map (s, s) of the state over a common period; `forces` gives f (m, q) from
    `visible`."""
    if any(isinstance(z.solver, PrimarySolver) for z in coupled.zones):
        raise SceneError(
            "the step map of a primary region with a separate law has no spectral radius"
        )
    size = len(_packed(coupled, coupled.rest()))
    motion = _unpacked(coupled, np.eye(size))
    for _ in range(coupled.common):
        f = np.zeros_like(motion.visible) if forces is None else forces(motion.visible)
        motion = coupled.tick(motion, f)
    return _packed(coupled, motion)


def spectral_radius(coupled: Coupled, forces: Callable[[Floats], Floats] | None = None) -> float:
    """Growth over a common period: above 1 some motion grows without bound. Dense: small bodies."""
    return float(np.abs(np.linalg.eigvals(period_map(coupled, forces))).max())


def _packed(coupled: Coupled, motion: Motion) -> Floats:
    """(s, q): all that a later tick reads."""
    parts = []
    for zone, p in zip(coupled.zones, motion.pieces, strict=True):
        parts += [p.u, p.before, p.start] + [p.seen] * (zone.name in EXPLICIT)
    return np.concatenate([*parts, motion.visible])


def _unpacked(coupled: Coupled, columns: Floats) -> Motion:
    m, pieces, at = len(coupled.body.m), [], 0
    for z in coupled.zones:
        sizes = [len(z.wide), len(z.wide), len(z.own), m * (z.name in EXPLICIT)]
        u, before, start, seen = np.split(columns[at : at + sum(sizes)], np.cumsum(sizes)[:-1])
        pieces.append(Piece(u, before, start, seen))
        at += sum(sizes)
    return Motion(0, tuple(pieces), columns[at:].copy())
