"""Free unknowns of a system by region, and regions around a place of its surface."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.rigid import require_held
from validate.fem.system import System, damping_of
from validate.scene.places import facets_of
from validate.solve.regions.map import layers_from, node_graph, spacing, split, widened
from validate.solve.regions.march import BorderName, Coupled, Zone, zone_of
from validate.solve.regions.primary import PrimaryLaw, PrimarySolver, primary_solver
from validate.solve.regions.solvers import EXPLICIT, RegionMatrices, SolverName, critical_period


def require_one_probe(system: System) -> None:
    """Raise `SceneError` for a scene without one probe, with drives, or that can move rigidly."""
    scene = system.scene
    if len(scene.tools) != 1 or scene.drives:
        raise SceneError(
            f"{len(scene.tools)} probes and {len(scene.drives)} drives: a touched body needs "
            "one probe and no drive"
        )
    require_held(scene, system.held)


@dataclass(frozen=True)
class RegionBody:
    """`graph` (n, n) links the nodes that have free unknowns, `nodes` (n,) are their numbers in the
    mesh, `surface` (k,) those of the n that may be touched; `at` (m,) places the unknowns of `body`
    among the n times `d` components."""

    body: RegionMatrices
    graph: sparse.csr_array
    nodes: Ints
    surface: Ints
    at: Ints
    d: int

    @classmethod
    def of(cls, system: System) -> "RegionBody":
        """Raise `SceneError` where all that may be touched is held, or K damps."""
        scene, free = system.scene, system.free
        if any(m.stiffness_damping for m in scene.materials):
            raise SceneError(
                "touched bodies are solved with nodal damping, C = alpha M (paper 004, eq 5); "
                "remove stiffness_damping, or use Newmark"
            )
        d = scene.mesh.dimension
        nodes = np.unique(free // d)
        node = np.searchsorted(nodes, free // d)
        facets = facets_of(scene.mesh, scene.tools[0].facets)
        surface = np.flatnonzero(np.isin(nodes, facets))
        if not len(surface):
            raise SceneError(
                f"probe '{scene.tools[0].name}': all {len(np.unique(facets))} nodes that it may "
                "touch are held; choose a free face"
            )
        K = sparse.csr_array(system.K[free][:, free])
        c = damping_of(system, "lumped", "mass").diagonal()[free]
        body = RegionMatrices(K, system.masses[free], c, node, scene.mesh.nodes[nodes])
        return cls(body, node_graph(K, node), nodes, surface, node * d + free % d, d)

    @property
    def places(self) -> Floats:
        return self.body.places

    @cached_property
    def still(self) -> Floats:
        return np.zeros(len(self.at))

    @cached_property
    def size(self) -> float:
        """The body's longest side, m."""
        return float(np.ptp(self.body.places, axis=0).max())

    def spread(self, u: Floats) -> Floats:
        """Displacements (n, d) m of the nodes; held components are zero."""
        full = np.zeros(len(self.nodes) * self.d)
        full[self.at] = u
        return full.reshape(-1, self.d)

    def unknowns(self, nodes: Ints) -> Ints:
        """Of some of the n nodes, in rising order."""
        return np.flatnonzero(np.isin(self.body.node, nodes))


@dataclass(frozen=True)
class Around:
    """Layers (n,) of all nodes around a contact, `spacing` m apart."""

    layer: Ints
    spacing: float


@dataclass(frozen=True)
class Regions:
    """A coupled map with `layers` of its primary region; `words` on what was left out."""

    coupled: Coupled
    layers: int
    words: tuple[str, ...]

    @cached_property
    def limits(self) -> tuple[tuple[float, int, str], ...]:
        """Critical period s, ratio and solver of every explicit region."""
        body = self.coupled.body
        zones = [z for z in self.coupled.zones if z.name in EXPLICIT]
        return tuple(
            (critical_period(z.name, body, z.wide, _taut(z)), z.ratio, z.name) for z in zones
        )

    def beyond(self, dt: float, rounding: float) -> str:
        """Return the first explicit region whose period is above its critical one, in words."""
        for limit, ratio, name in self.limits:
            if ratio * dt > limit * (1 + rounding):
                times = ratio * dt / limit
                return (
                    f"a region solved by '{name}' every {ratio * dt:.4g} s takes {times:.4g} times "
                    f"its critical step of {limit:.4g} s"
                )
        return ""


def _taut(zone: Zone) -> sparse.csr_array | None:
    return zone.solver.law.taut if isinstance(zone.solver, PrimarySolver) else None


@dataclass(frozen=True)
class RegionPlan:
    """Regions around any contact; each is made once and `kept`. `law`: that of the primary one."""

    of: RegionBody
    dt: float
    layers: tuple[int, ...]
    ratios: tuple[int, ...]
    solvers: tuple[SolverName, ...]
    border: BorderName
    overlap: int
    kept: dict[tuple[int, ...], Around | Regions]
    law: PrimaryLaw | None = None

    def around(self, pad: tuple[int, ...]) -> Around:
        """Return the layers around the nodes `pad`."""
        if pad not in self.kept:
            contact = np.array(pad)
            layer = layers_from(self.of.graph, contact)
            self.kept[pad] = Around(layer, spacing(self.of.body.places, layer, contact))
        found = self.kept[pad]
        assert isinstance(found, Around)
        return found

    def regions(self, pad: tuple[int, ...], primary: int) -> Regions:
        """Those around the nodes `pad`, the first of `primary` layers."""
        key = (*pad, -primary)
        if key not in self.kept:
            self.kept[key] = self._made(self.around(pad).layer, primary)
        found = self.kept[key]
        assert isinstance(found, Regions)
        return found

    def _primary(self, zone: Zone, nodes: Ints) -> Zone:
        """The primary region, on `nodes` of the mesh, with its law."""
        if self.law is None:
            return zone
        beyond = self.law.beyond(zone.wide, nodes)
        if beyond is None:
            return zone
        return replace(
            zone, solver=primary_solver(zone.solver, beyond, self.of.body, zone.wide, self.dt)
        )

    def _made(self, layer: Ints, primary: int) -> Regions:
        """The regions after the primary one keep their outer borders where it grows over them."""
        ends = np.maximum(np.cumsum(self.layers), primary + np.arange(len(self.layers))).astype(int)
        ends[:1] = primary
        found = split(layer, tuple(np.diff(ends, prepend=0).tolist()), self.of.graph)
        names = self.solvers * (found.count if len(self.solvers) == 1 else 1)
        every = (1, *self.ratios)
        zones = []
        for i in range(found.count):
            wide = self.of.unknowns(widened(found.of, i, self.of.graph, self.overlap))
            own = self.of.unknowns(np.flatnonzero(found.of == i))
            zones.append(zone_of(self.of.body, wide, own, every[i], names[i], self.dt))
        zones[0] = self._primary(zones[0], self.of.nodes[found.of == 0])
        coupled = Coupled(self.of.body, tuple(zones), self.dt, self.border, {})
        count = int(layer[found.of == 0].max()) + 1
        words = found.words
        if self.law is not None and not isinstance(zones[0].solver, PrimarySolver):
            words += (f"a primary region of {count} layers has no complete cell and stays linear",)
        return Regions(coupled, count, words)
