"""Regions of a body: layers around a contact, their solve rates and their unknowns.

Region of each node, and solve rate of each region (paper 004, section 5). Nodes are layered by
graph distance from the contact: links are the entries of the stiffness matrix, so a layer is what
one solve of its neighbour can feel. The first region is the primary one, at one solve a tick; the
last has what is left.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components, dijkstra

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.system import System, damping_of, require_held
from validate.scene.places import facets_of
from validate.solve.regions.march import BorderName, Coupled, Zone, zone_of
from validate.solve.regions.primary import (
    EXPLICIT,
    PrimaryLaw,
    PrimarySolver,
    RegionMatrices,
    SolverName,
    critical_period,
    primary_solver,
)

# --- How many layers the primary region has, from the deformation (paper 004, section 5.5).
#
# The paper runs the linear function alone and names the others; both are here.

SizeName = Literal["fixed", "linear", "saturating", "threshold"]


@dataclass(frozen=True)
class PrimarySize:
    """Layers between `least` and `most`.

    "linear": the deformation l_d m times `slope`, in layers of `spacing` m (Fig. 5). "saturating":
    least + (most - least) (1 - exp(-slope l_d / (spacing (most - least)))), which begins with that
    slope. "threshold": as far as a node is displaced by more than `moved` m.
    """

    name: SizeName
    least: int
    most: int
    slope: float
    moved: float
    spacing: float

    def __post_init__(self) -> None:
        if not 1 <= self.least <= self.most:
            raise SceneError(
                f"primary region of {self.least} to {self.most} layers: expected at least 1, "
                "and increasing"
            )
        if not (self.slope > 0 and self.moved > 0):
            raise SceneError(
                f"slope {self.slope:g} and threshold {self.moved:g} m of the primary region: "
                "expected values above 0, otherwise it never grows"
            )

    def layers(self, deformation: float, moved: Floats, layer: Ints) -> int:
        """Layers for l_d m at the contact and displacements `moved` (n,) m of nodes in `layer`."""
        if self.name == "fixed":
            return self.least
        if self.name == "threshold":
            far = layer[moved > self.moved]
            wanted = float(far.max()) + 1 if len(far) else 0.0
        else:
            wanted = self.slope * deformation / self.spacing if self.spacing else 0.0
        if self.name == "saturating":
            room = max(self.most - self.least, 1)
            wanted = self.least + room * -np.expm1(-wanted / room)
        return int(np.clip(np.ceil(wanted - 1e-9), self.least, self.most))


# -------------------------------------------------------------------------------------------------

_SELDOM = 1.0  # s between two solves from which it is said
_WHOLE = 1e-9  # of a ratio of rates, beyond which it is rounded with a notice


def node_graph(K: sparse.csr_array, node: Ints) -> sparse.csr_array:
    """Links (n, n) between nodes; unknown i of K (m, m) belongs to node `node[i]` of 0..n-1."""
    entries = K.tocoo()
    ones = np.ones(entries.nnz)
    n = int(node.max()) + 1
    graph = sparse.coo_array((ones, (node[entries.row], node[entries.col])), shape=(n, n))
    return sparse.csr_array(graph)


def layers_from(graph: sparse.csr_array, contact: Ints) -> Ints:
    """Links (n,) between every node and the nearest of `contact`.

    Raises `SceneError` for nodes that nothing links to the contact.
    """
    away = dijkstra(graph, directed=False, indices=contact, unweighted=True, min_only=True)
    lost = int(np.isinf(away).sum())
    if lost:
        raise SceneError(
            f"{lost} of {len(away)} free nodes are not connected to the contact: the body has "
            "separate parts, or held nodes split it; simulate only the touched part"
        )
    return np.asarray(away, dtype=np.int64)


@dataclass(frozen=True)
class NodeSplit:
    """`of` (n,) the region of every node, 0 the primary one; `words` on what was rounded."""

    of: Ints
    words: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        return int(self.of.max()) + 1


def split(layer: Ints, layers: tuple[int, ...], graph: sparse.csr_array) -> NodeSplit:
    """Regions of so many `layers` each from the contact, and one of the rest.

    A region beyond the body is left out, and said; so is one that its borders split into parts.
    Raises `SceneError` for a region without a layer: it would be empty.
    """
    if any(count < 1 for count in layers):
        raise SceneError(f"regions of {layers} layers: expected at least 1 for each region")
    of = np.searchsorted(np.cumsum(layers), layer, side="right").astype(np.int64)
    words = []
    left = len(layers) - int(of.max())
    if left:
        depth = int(layer.max()) + 1
        words.append(
            f"{left} of {len(layers) + 1} regions lie beyond the body's {depth} layers and are "
            "omitted"
        )
    for region in range(int(of.max()) + 1):
        inside = np.flatnonzero(of == region)
        parts = connected_components(graph[inside][:, inside], directed=False)[0]
        if parts > 1:
            words.append(
                f"region {region + 1} is {parts} parts that are connected only "
                "through other regions"
            )
    return NodeSplit(of, tuple(words))


def widened(of: Ints, region: int, graph: sparse.csr_array, overlap: int) -> Ints:
    """Nodes of a region and of `overlap` layers around it, in rising order."""
    inside = (of == region).astype(np.float64)
    for _ in range(overlap):
        inside = ((graph @ inside + inside) > 0).astype(np.float64)
    return np.flatnonzero(inside)


def ratios(rates: tuple[float, ...], dt: float) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Ticks of dt s between two solves of each region, and what was rounded.

    Raises `SceneError` for a rate that is not positive or above the primary one.
    """
    found, words = [], []
    for rate in rates:
        if not (np.isfinite(rate) and rate > 0) or rate * dt > 1 + _WHOLE:
            raise SceneError(
                f"a region at {rate:g} Hz with a primary one at {1 / dt:g} Hz: expected a rate "
                "above 0 and at most the primary rate; reduce dt for a faster one"
            )
        exact = 1 / (rate * dt)
        ticks = round(exact)
        if abs(exact - ticks) > _WHOLE * exact:
            words.append(
                f"{rate:g} Hz does not divide {1 / dt:g} Hz: solved every {ticks} ticks, at "
                f"{1 / (ticks * dt):.4g} Hz"
            )
        if ticks * dt > _SELDOM:
            words.append(f"{rate:g} Hz is solved every {ticks * dt:.4g} s, never in a shorter run")
        found.append(ticks)
    return tuple(found), tuple(words)


def spacing(places: Floats, layer: Ints, contact: Ints) -> float:
    """Mean length m of a layer: the farthest node's distance over its layers; 0 for one layer."""
    depth = int(layer.max())
    if not depth:
        return 0.0
    return float(np.linalg.norm(places - places[contact].mean(axis=0), axis=1).max()) / depth


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
        # The primary region has its law where it has a complete cell.
        first, beyond = zones[0], None
        if self.law is not None:
            beyond = self.law.beyond(first.wide, self.of.nodes[found.of == 0])
        if beyond is not None:
            solver = primary_solver(first.solver, beyond, self.of.body, first.wide, self.dt)
            zones[0] = replace(first, solver=solver)
        coupled = Coupled(self.of.body, tuple(zones), self.dt, self.border, {})
        count = int(layer[found.of == 0].max()) + 1
        words = found.words
        if self.law is not None and not isinstance(zones[0].solver, PrimarySolver):
            words += (f"a primary region of {count} layers has no complete cell and stays linear",)
        return Regions(coupled, count, words)
