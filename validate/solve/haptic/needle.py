"""Needle against a body with a fluid pocket, tick by tick (paper 000, section 5.2).

Where the tip enters the surface, that point joins the working set: its displacement along the local
axes at the needle is that of the tip, the rest of the body is condensed away. A change of contact
is a low-rank correction of the condensed system and one polynomial of the pocket's volume; between
changes a tick evaluates that polynomial, finds the pressure and gives the force to the hand.

Departures: the paper attaches the nearest node, here by default the point itself (`at`), where the
tip is at the first tick inside, so that the force begins at zero and no energy is made. Its force
is the reaction at the needle; with a pressure on normals that do not turn that is no gradient of
the energy, and a closed path may give some back. `force` "consistent" is that gradient.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.locate import Rows
from validate.fem.cavity import volume_form
from validate.fem.kernels.jit_cache import compiled
from validate.fem.linear_solvers.condense import Condensed, Imposed, WorkingSet, along, between
from validate.fem.system import System
from validate.parameters import quantity
from validate.scene.contact import Needle
from validate.scene.places import facets_of
from validate.scene.scene import Scene
from validate.scene.shape_functions import simplex_values
from validate.solve.fluid.pressure_curve import RATIOS, Root, cubic, pressure_of, root_of
from validate.solve.handles import Handles, require_handled
from validate.solve.haptic.rates import DEVICE_HZ
from validate.solve.types import Ending, State, Stepper

# --- Where the path of a tip enters a surface: the first facet that it crosses from outside.

_EDGE = 1e-9  # of a facet: a path through an edge belongs to one of its two facets


@dataclass(frozen=True)
class Entry:
    """Nodes (m,) of the facet with their shares (m,) at the point; outward unit `normal` (d,)."""

    nodes: Ints
    shares: Floats
    normal: Floats


@dataclass(frozen=True)
class Surface:
    """Facets (f, m) in numbers of the positions that `entered` is given, out of the solid."""

    facets: Ints
    dimension: int

    def __post_init__(self) -> None:
        d, nodes = self.dimension, self.facets.shape[1]
        if nodes not in (d, d * (d + 1) // 2):
            raise SceneError(f"facets of {nodes} nodes in {d}-D: a needle touches simplices")

    def entered(self, x: Floats, start: Floats, end: Floats) -> Entry | None:
        """Return the first crossing from outside on the way from `start` to `end` (d,) m, among
        corners at x (n, d) m; None without one."""
        d = self.dimension
        corners = self.facets[:, :d]
        search = _crossed_triangle if d == 3 else _crossed_edge
        index, L = search(x, corners, start, end)
        if index < 0:
            return None
        nodes = self.facets[index]
        shares = simplex_values(1 if len(nodes) == d else 2, L[None])[0]
        x0, *others = x[corners[index]]
        if d == 2:
            normal = np.array([others[0][1] - x0[1], x0[0] - others[0][0]])
        else:
            normal = np.cross(others[0] - x0, others[1] - x0)
        return Entry(nodes, np.asarray(shares), np.asarray(normal / np.linalg.norm(normal)))


@compiled()
def _crossed_edge(x: Floats, edges: Ints, a: Floats, b: Floats) -> tuple[int, Floats]:
    first, found, L = np.inf, -1, np.zeros(2)
    vx, vy = b[0] - a[0], b[1] - a[1]
    for i in range(len(edges)):
        p, q = x[edges[i, 0]], x[edges[i, 1]]
        ex, ey = q[0] - p[0], q[1] - p[1]
        inward = vx * ey - vy * ex  # v . outward normal
        if inward >= 0:
            continue
        t = ((p[0] - a[0]) * ey - (p[1] - a[1]) * ex) / inward
        s = ((p[0] - a[0]) * vy - (p[1] - a[1]) * vx) / inward
        if -_EDGE <= t <= 1 and -_EDGE <= s <= 1 + _EDGE and t < first:
            first, found = t, i
            L[0], L[1] = 1 - s, s
    return found, L


@compiled()
def _crossed_triangle(x: Floats, triangles: Ints, a: Floats, b: Floats) -> tuple[int, Floats]:
    first, found, L = np.inf, -1, np.zeros(3)
    v = b - a
    for i in range(len(triangles)):
        p = x[triangles[i, 0]]
        e = x[triangles[i, 1]] - p
        g = x[triangles[i, 2]] - p
        n0 = e[1] * g[2] - e[2] * g[1]
        n1 = e[2] * g[0] - e[0] * g[2]
        n2 = e[0] * g[1] - e[1] * g[0]
        inward = v[0] * n0 + v[1] * n1 + v[2] * n2
        if inward >= 0:
            continue
        w0, w1, w2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
        t = (w0 * n0 + w1 * n1 + w2 * n2) / inward
        if t < -_EDGE or t > 1 or t >= first:
            continue
        y0, y1, y2 = t * v[0] - w0, t * v[1] - w1, t * v[2] - w2
        square = n0 * n0 + n1 * n1 + n2 * n2
        s = ((y1 * g[2] - y2 * g[1]) * n0 + (y2 * g[0] - y0 * g[2]) * n1
             + (y0 * g[1] - y1 * g[0]) * n2) / square  # fmt: skip
        r = ((e[1] * y2 - e[2] * y1) * n0 + (e[2] * y0 - e[0] * y2) * n1
             + (e[0] * y1 - e[1] * y0) * n2) / square  # fmt: skip
        if s >= -_EDGE and r >= -_EDGE and s + r <= 1 + _EDGE:
            first, found = t, i
            L[0], L[1], L[2] = 1 - s - r, s, r
    return found, L


# -------------------------------------------------------------------------------------------------

_AXES = "xyz"
_ROUNDING = 1e-9  # N: a pull of no account
_ON = 1e-9  # m: as near as that is rounding
_WARM = 40  # ticks of a way in and out that is forgotten
_RUNAWAY = 1e3  # volume error at which the paper's law has left all bounds


@dataclass(frozen=True)
class NeedleLoop:
    """Settings; see the module's head. One cavity at most.

    `update` "exact" finds the pressure that keeps the volume, "proportional" is the paper's law
    (eqs 9, 10) with `gain` (None: tuned without the tool, as section 3.3 does) to `tolerance` in at
    most `most` updates a tick; what is left then stays for the next tick, as on the paper's device.
    `grip`: the pull in N at which the body lets go of the tip; None: never, as a needle that is in
    it. `limit` N: no larger force is given to the hand.
    """

    handles: ClassVar[Handles] = Handles(
        ("linear",), inertia=False, cavities=True, loads=False,
        contact=("foundations", "membranes", "needle"),
    )  # fmt: skip

    update: Literal["exact", "proportional"] = quantity("exact", "1", "method for the pressure")
    gain: float | None = quantity(None, "Pa", "Kp; none: tuned to the response of the volume")
    tolerance: float = quantity(1e-3, "1", "|1 - V/V0| at which the law of the paper stops")
    most: int = quantity(20, "1", "updates of the pressure in a tick")
    at: Literal["point", "node"] = quantity(
        "point", "1", "part of the surface that touches the tip"
    )
    imposes: Literal["all", "axis"] = quantity(
        "all", "1", "local axes along which the tip is attached"
    )
    grip: float | None = quantity(0.0, "N", "pulling force at which contact ends; none: never")
    force: Literal["consistent", "reaction"] = quantity("consistent", "1", "force on the hand")
    limit: float = quantity(10.0, "N", "largest force on the hand")

    def __post_init__(self) -> None:
        if not (np.isfinite(self.limit) and self.limit > 0):
            raise SceneError(f"force limit {self.limit:g} N: expected a finite number above 0")
        if not (self.grip is None or self.grip >= 0):
            raise SceneError(f"grip {self.grip:g} N: expected 0 or more, or none")
        if self.gain is not None and not 0 < self.gain < np.inf:
            raise SceneError(
                f"gain {self.gain:g} Pa: expected a gain above 0; a negative gain diverges and "
                "0 has no effect"
            )

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for a scene without needle, a tip inside the body, several cavities,
        facets that are no simplices."""
        scene = system.scene
        require_handled(scene, self)
        if len(scene.tools) != 1 or len(scene.cavities) > 1:
            raise SceneError(
                f"{len(scene.tools)} needles and {len(scene.cavities)} cavities: NeedleLoop "
                "needs one needle and at most one cavity"
            )
        if scene.drives:
            raise SceneError(
                f"{len(scene.drives)} drives together with a needle: NeedleLoop "
                "accepts no drives; remove them"
            )
        tool = scene.tools[0]
        rows = Rows.barycentric(scene.mesh, np.array([tool.tip]))
        if float(rows.outside[0]) < _ON:
            at = ", ".join(f"{1e3 * c:.3g}" for c in tool.tip)
            raise SceneError(
                f"needle '{tool.name}' starts inside the body at ({at}) mm: move it out"
            )
        facets = facets_of(scene.mesh, tool.facets)
        small = Condensed.of(system, np.unique(facets))
        numbers = np.searchsorted(small.nodes, facets)
        free = np.isin(np.arange(small.size), small.free).reshape(-1, scene.mesh.dimension)
        touchable = numbers[free[numbers].all(axis=(1, 2))]
        if not len(touchable):
            raise SceneError(
                f"needle '{tool.name}': all {len(facets)} facets that it may touch are held or "
                "driven; choose a free face"
            )
        unknowns_of = (
            np.unique(touchable)[:, None] * scene.mesh.dimension + np.arange(scene.mesh.dimension)
        ).ravel()
        small.prefetch(unknowns_of)
        return NeedleStepper(self, small, tool, Surface(touchable, scene.mesh.dimension))


@dataclass(frozen=True)
class Touch:
    """What holds while one contact lasts.

    `axes` (c, d): local ones, the first along the needle; `surface` (d,) m: the touched point at
    rest, `anchor` (d,) m: where the tip was when it took hold. Forces along the axes are
    stiffness g - pull P for local displacements g (c,) m and the pressure P; `fields` (c + k, W)
    are the kept displacements for each of (g, P), `volumes` the pocket's polynomial in (1, g, P).
    """

    entry: Entry
    axes: Floats
    surface: Floats
    anchor: Floats
    stiffness: Floats
    pull: Floats
    fields: Floats
    volumes: Floats
    imposed: tuple[Imposed, ...]


def _nothing() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class Tick:
    """The tip (d,) m; pressure P Pa; while it lasts the contact, its local displacements g (c,) m
    and forces (c,) N on the body. `left` is a contact that has let go with the tip still inside."""

    tip: Floats
    P: float = 0.0
    touch: Touch | None = None
    g: Floats = field(default_factory=_nothing)
    forces: Floats = field(default_factory=_nothing)
    left: Touch | None = None


@dataclass(frozen=True)
class NeedleStepper:
    """Steps through displacements (d,) m of the tip; see `NeedleLoop`."""

    settings: NeedleLoop
    small: Condensed
    tool: Needle
    surface: Surface

    @property
    def scene(self) -> Scene:
        return self.small.responses.scene

    @cached_property
    def units(self) -> Mapping[str, str]:
        name, d = self.tool.name, len(self.tool.tip)
        own = {f"{name}.force.{a}": "N" for a in _AXES[:d]} | {
            f"{name}.contact": "1", f"{name}.changed": "1", f"{name}.clipped": "1",
            f"{name}.energy": "J",
        }  # fmt: skip
        for cavity in self.scene.cavities:
            own |= {f"{cavity.name}.pressure": "Pa", f"{cavity.name}.volume_ratio": "1"}
        return own

    @cached_property
    def gain(self) -> float:
        """Kp Pa, tuned without the tool."""
        if self.settings.gain is not None:
            return self.settings.gain
        return float(np.polyfit(RATIOS, pressure_of(self._apart, 1, RATIOS), 1)[0])

    @cached_property
    def _apart(self) -> Floats:
        """The pocket's volume polynomial in the pressure while nothing touches."""
        return self._form(self.small.fields)

    @property
    def rate(self) -> float:
        """Ticks a second."""
        return DEVICE_HZ

    @property
    def limit(self) -> float:
        return self.settings.limit

    @property
    def threads(self) -> tuple[int, ...]:
        return ()

    def warm(self) -> None:
        """A way into the body and out again that is forgotten: kernels compiled, columns kept."""
        size = float(np.ptp(self.scene.mesh.nodes, axis=0).max())
        down = 0.2 * size * np.sin(np.pi * np.linspace(0, 1, _WARM))
        state = self.rest()
        for depth in down.tolist():
            state = self.step(state, depth * np.array(self.tool.axis))

    def rest(self) -> State:
        return self._told(0, Tick(np.array(self.tool.tip)), None, changed=False)

    def step(self, state: State, inputs: Floats) -> State:
        """One tick: contact, pressure, force."""
        last: Tick = state.inner
        tip = np.array(self.tool.tip) + inputs
        touch = last.touch or self._touched(last, tip)
        tick, root = self._solved(touch, tip, last.P)
        # A body that would have to be pulled harder than it grips lets go.
        grip, pulled = self.settings.grip, 0.0
        if touch is not None and grip is not None:
            pulled = float(tick.forces @ touch.axes @ touch.entry.normal)
        if touch is not None and grip is not None and pulled > grip + _ROUNDING:
            tick, root = self._solved(None, tip, last.P)
            tick = replace(tick, left=touch)
        elif touch is None and last.left is not None and _inside(last.left, tip):
            tick = replace(tick, left=last.left)
        changed = (tick.touch is None) != (last.touch is None)
        return self._told(state.k + 1, tick, root, changed=changed)

    def _touched(self, last: Tick, tip: Floats) -> Touch | None:
        """A new contact, where the tip has crossed the surface since the last tick, or goes deeper
        again where it was let go."""
        if last.left is not None and _inside(last.left, tip):
            deeper = (tip - last.left.anchor) @ last.left.entry.normal < 0
            return replace(last.left, anchor=tip) if deeper else None
        x = self.small.positions
        if last.P:
            x = x + (last.P * self.small.fields[0]).reshape(x.shape)
        entry = self.surface.entered(x, last.tip, tip)
        return None if entry is None else self.hold(entry, tip)

    def hold(self, entry: Entry, tip: Floats) -> Touch:
        """Return the contact of a tip at `tip` (d,) m with a point of the surface."""
        # (c, d): the needle's axis, then unit vectors across it
        axes = np.array(self.tool.axis)[None]
        if self.settings.imposes != "axis":
            basis = np.linalg.svd(axes)[2]
            axes = np.asarray(basis * np.sign(basis[0] @ axes[0]))
        node = int(entry.nodes[int(np.argmax(entry.shares))])
        imposed = tuple(
            along(node, a) if self.settings.at == "node" else between(entry.nodes, entry.shares, a)
            for a in axes
        )
        working = WorkingSet(self.small).with_rows(imposed)
        assert working.coupling is not None
        assert working.columns is not None
        assert working.bases is not None
        stiffness = np.asarray(np.linalg.inv(working.coupling), dtype=np.float64)
        pull, lifted = stiffness @ working.bases, stiffness @ working.columns
        fields = np.vstack([lifted, self.small.fields - working.bases.T @ lifted])
        at = entry.shares @ self.small.positions[entry.nodes]
        form = self._form(fields)
        return Touch(entry, axes, at, tip, stiffness, pull, fields, form, imposed)

    def _form(self, fields: Floats) -> Floats:
        """(1 + m, 1 + m, 1 + m) of amounts (1, z) of kept fields (m, W); zero without a pocket."""
        m = 1 + len(fields)
        if not self.small.surfaces:
            return np.zeros((m, m, m))
        rest = self.small.positions
        columns = np.concatenate([rest[None], fields.reshape(len(fields), *rest.shape)])
        return volume_form(self.small.surfaces[0], columns)

    def _solved(self, touch: Touch | None, tip: Floats, P: float) -> tuple[Tick, Root | None]:
        """The tick that ends with this contact, from the last pressure."""
        g = _nothing() if touch is None else touch.axes @ (tip - touch.anchor)
        root = None
        if self.scene.cavities:
            form = self._apart if touch is None else touch.volumes
            z = np.concatenate([[1.0], g, [0.0]])
            root = self._root(cubic(form, z, len(z) - 1), float(form[0, 0, 0]), P)
            P = root.P
        if touch is None:
            return Tick(tip, P), root
        forces = touch.stiffness @ g
        if root is not None:
            forces = forces - touch.pull[:, 0] * P
        return Tick(tip, P, touch, g, forces), root

    def _root(self, terms: tuple[float, float, float, float], V0: float, P: float) -> Root:
        if self.settings.update == "exact":
            return root_of(terms, V0, P)
        a, b, c, d = terms
        for updates in range(self.settings.most + 1):
            V = ((a * P + b) * P + c) * P + d
            error = 1 - V / V0
            if abs(error) <= self.settings.tolerance or updates == self.settings.most:
                break
            P += self.gain * error
        lost = not abs(error) < _RUNAWAY
        return Root(P, updates, V, f"volume error {error:.1e}, gain too large" if lost else "")

    def hand(self, tick: Tick) -> Floats:
        """Return the force (d,) N on the hand, before it is limited."""
        if tick.touch is None:
            return np.zeros(len(self.tool.tip))
        touch, forces = tick.touch, tick.forces
        exact = self.scene.cavities and self.settings.update == "exact"
        if exact and self.settings.force == "consistent":
            form = touch.volumes
            z = np.concatenate([[1.0], tick.g, [tick.P]])
            slopes = form @ z @ z
            if slopes[-1]:
                swelling = form[0, 0]  # a third of the linear change of volume, as slopes are
                turned = swelling[1:-1] - swelling[-1] * slopes[1:-1] / slopes[-1]
                forces = forces + 3 * tick.P * turned
        return np.asarray(-forces @ touch.axes)

    def energy(self, tick: Tick) -> float:
        """Stored energy of the body, J (per metre in 2-D)."""
        if tick.touch is None:
            swelling = 3 * float(self._apart[0, 0, 1]) * tick.P if self.scene.cavities else 0.0
            return tick.P * swelling / 2
        z = np.append(tick.g, tick.P) if self.scene.cavities else tick.g
        swelling = 3 * float(tick.touch.volumes[0, 0, 1:] @ z)
        return float(tick.forces @ tick.g + tick.P * swelling) / 2

    def _told(self, k: int, tick: Tick, root: Root | None, *, changed: bool) -> State:
        hand, name = self.hand(tick), self.tool.name
        size = float(np.linalg.norm(hand))
        clipped = size > self.settings.limit
        if clipped:
            hand = hand * (self.settings.limit / size)
        found = [*hand.tolist(), float(tick.touch is not None), float(changed), float(clipped),
                 self.energy(tick)]  # fmt: skip
        if self.scene.cavities:
            V0 = float(self._apart[0, 0, 0])
            found += [tick.P, root.volume / V0 if root else 1.0]
        failure: tuple[Ending, str] | None = None
        if root is not None and root.failed:
            why = f"needle '{name}': no pressure keeps the volume constant: {root.failed}"
            failure = ("not_converged", why)
        numbers = dict(zip(self.units, found, strict=True))
        return State(k, tick, failure, root.updates if root else 0, numbers)

    def field(self, state: State) -> Floats:
        """Displacements (n, d) m of all nodes; one solve with the whole body."""
        tick: Tick = state.inner
        forces = np.zeros(self.small.size)
        if tick.touch is not None:
            for one, force in zip(tick.touch.imposed, tick.forces, strict=True):
                forces[one.unknowns] += force * one.weights
        u = self.small.whole(forces)
        return u + tick.P * self.small.responses.fields[0] if self.scene.cavities else u


def _inside(touch: Touch, tip: Floats) -> bool:
    """Whether a tip that was let go has not yet gone back out of the surface there."""
    return bool((tip - touch.surface) @ touch.entry.normal < 0)
