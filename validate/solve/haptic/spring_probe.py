"""Spring probe of paper 004, section 3: a spring to the nearest surface node."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from validate.arrays import Floats, Ints


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
