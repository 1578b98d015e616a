"""The haptic probe of paper 004, section 3: a spring to the surface node nearest to it."""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.solve.region_body import RegionBody


@dataclass(frozen=True)
class Hold:
    """The probe holds `node`, and the nodes `pad` (it among them) share the spring; at `slack` (d,)
    m between probe and node the spring is slack."""

    node: int
    pad: tuple[int, ...]
    slack: Floats


@dataclass(frozen=True)
class SpringProbe:
    """A spring N/m; see `AsyncRegions` for the rest. `tip` (d,) m at rest."""

    body: RegionBody
    tip: Floats
    spring: float
    reach: float
    pad: float
    grip: float | None
    slides: bool

    def follow(self, held: Hold | None, tip: Floats, u: Floats) -> Hold | None:
        """The hold at this tick: taken, moved, let go or as it was."""
        if held is None:
            return self._taken(tip, u)
        if self.grip is not None and self._pulled(held, tip, u) > self.grip:
            return None
        return self._moved(held, tip, u) if self.slides else held

    def _nearest(self, tip: Floats, u: Floats) -> tuple[int, float, Floats]:
        """The surface node nearest to the tip, how far it is, and all nodes' places."""
        places = self.body.body.places + self.body.spread(u)
        away = np.linalg.norm(places[self.body.surface] - tip, axis=1)
        i = int(np.argmin(away))
        return int(self.body.surface[i]), float(away[i]), places

    def _taken(self, tip: Floats, u: Floats) -> Hold | None:
        node, away, places = self._nearest(tip, u)
        if away > self.reach:
            return None
        return Hold(node, self._pad(node), tip - places[node])

    def _pad(self, node: int) -> tuple[int, ...]:
        rest = self.body.body.places
        near = np.linalg.norm(rest[self.body.surface] - rest[node], axis=1) <= self.pad
        return tuple(np.union1d(self.body.surface[near], [node]).tolist())

    def _moved(self, held: Hold, tip: Floats, u: Floats) -> Hold:
        """The hold at the nearest node, with the force that the spring has."""
        node, _, places = self._nearest(tip, u)
        if node == held.node or not self.spring:
            return held
        stretch = self.force(held, tip, u) / self.spring
        return Hold(node, self._pad(node), tip - places[node] - stretch)

    def force(self, held: Hold | None, tip: Floats, u: Floats) -> Floats:
        """Of the spring on the body (d,) N; it pulls at the mean of the pad."""
        if held is None:
            return np.zeros(len(tip))
        places = self.body.body.places[held.node] + self._mean(held, u)
        return np.asarray(self.spring * (tip - places - held.slack))

    def nodal(self, held: Hold | None, tip: Floats, u: Floats) -> Floats:
        """That force on the free unknowns (m,), equal on the pad's nodes."""
        f = np.zeros((len(self.body.nodes), self.body.d))
        if held is not None:
            f[list(held.pad)] = self.force(held, tip, u) / len(held.pad)
        return f.ravel()[self.body.at]

    def _mean(self, held: Hold, u: Floats) -> Floats:
        return np.asarray(self.body.spread(u)[list(held.pad)].mean(axis=0))

    def _pulled(self, held: Hold, tip: Floats, u: Floats) -> float:
        """How hard the probe pulls outward, N: along the line from the body's middle."""
        out = self.body.body.places[held.node] - self.body.body.places.mean(axis=0)
        return float(self.force(held, tip, u) @ out / np.linalg.norm(out))
