"""Pressure against volume of the block's cavities (paper 000, Fig. 4), and its shapes (Fig. 3).

With fixed normals V(P) is an exact quadratic in the plane; with normals that follow the wall it is
not, and is solved for. The line is what the paper tunes its gain by.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Exhibit, NodeMap, NumberTable, Series
from validate.errors import SceneError
from validate.fem.linear_solvers.condense import Condensed
from validate.fem.system import Responses
from validate.fem.system import build as build_system
from validate.pipeline.experiment.tree import Tree
from validate.scene.mesh import Mesh
from validate.solve.fluid.cavities import ExactPressure, NoFluid
from validate.solve.fluid.pressure_curve import pressure_at_volume, tuned_gain

from .block import slab

_SHARES = (0.7, 1.3)  # of the volume, to which the paper draws its curve
RATIOS = np.linspace(*_SHARES, 61)  # over which it fits its line
_TURNS = 60  # of the fixed point between wall and load
_CLOSE = 1e-11  # of the wall's size
_PRESSED = 0.15  # strain of Fig. 3, whose own is not printed


@dataclass(frozen=True)
class PressureCurve:
    """Pressures Pa at `RATIOS` of one cavity, the others at zero; `follower` with normals that turn
    with the wall, Pa. `terms` c1 1/Pa and c2 1/Pa^2 of the exact V/V0 = 1 + c1 P + c2 P^2."""

    fixed: Floats
    follower: Floats
    slope: float
    gain: float
    terms: tuple[float, float]

    @property
    def off(self) -> float:
        """The largest departure of the fixed curve from its line, Pa."""
        line = np.polyval(np.polyfit(RATIOS, self.fixed, 1), RATIOS)
        return float(np.abs(self.fixed - line).max())

    @property
    def r_squared(self) -> float:
        line = np.polyval(np.polyfit(RATIOS, self.fixed, 1), RATIOS)
        spread = float(((self.fixed - self.fixed.mean()) ** 2).sum())
        return 1 - float(((self.fixed - line) ** 2).sum()) / spread


def condensed_block(p: Tree, order: int) -> Condensed:
    """The block without a tool, on the walls of its cavities."""
    scene = slab(p, None, {"body.element": "tri6" if order == 2 else "tri3"})
    return Condensed.of(build_system(scene), np.zeros(0, dtype=np.int64))


def curve_of(small: Condensed, cavity: int = 0) -> PressureCurve:
    r = small.responses
    fixed = pressure_at_volume(r, RATIOS, cavity)
    V0, rise = r.rest_volumes[cavity], 3 * r.volumes[cavity, 0, 0, 1 + cavity]
    square = 3 * r.volumes[cavity, 0, 1 + cavity, 1 + cavity]
    return PressureCurve(fixed, follower_pressures(small, cavity, fixed), float(V0 / rise),
                 tuned_gain(r, cavity), (float(rise / V0), float(square / V0)))  # fmt: skip


def follower_pressures(small: Condensed, cavity: int, guess: Floats) -> Floats:
    """Pa at `RATIOS` of the volume, the load turning and growing with the wall.

    `guess` are the pressures with fixed normals. The wall is a fixed point of u = P A f_p(x + u),
    the pressure a secant's root. Raises `SceneError` where either does not settle.
    """
    surface, x = small.surfaces[cavity], small.positions
    A, V0 = small.compliance, surface.volume(x)
    found, u = np.empty(len(RATIOS)), np.zeros_like(x)
    middle = int(np.argmin(np.abs(RATIOS - 1)))
    for way in (range(middle, len(RATIOS)), range(middle - 1, -1, -1)):
        u = np.zeros_like(x)
        for i in way:
            found[i], u = _follower(surface, x, A, u, V0 * RATIOS[i], float(guess[i]))
    return found


def _follower(surface, x: Floats, A: Floats, u: Floats, V: float, P: float):  # type: ignore[no-untyped-def]
    """The pressure Pa and wall (k, d) m of a volume V, from a wall and pressure near by."""
    last, error = None, 0.0
    for _ in range(_TURNS):
        u = _wall(surface, x, A, u, P)
        error = surface.volume(x + u) - V
        if abs(error) < 1e-12 * V:
            return P, u
        if last is None or last[1] == error:
            step = 0.01 * P if P else 1.0
        else:
            step = -error * (P - last[0]) / (error - last[1])
        last, P = (P, error), P + step
    raise SceneError(
        f"no pressure with following normals gives the volume {V:.4g}: off {error:.2g}"
    )


def _wall(surface, x: Floats, A: Floats, u: Floats, P: float) -> Floats:  # type: ignore[no-untyped-def]
    for _ in range(_TURNS):
        new = (A @ (P * surface.pressure_load(x + u)).ravel()).reshape(x.shape)
        moved, u = float(np.abs(new - u).max()), new
        if moved <= _CLOSE * float(np.ptp(x, axis=0).max()):
            return u
    raise SceneError(f"the wall does not settle at {P:.4g} Pa: it still moves by {moved:.2g} m")


def curve_exhibit(curves: Sequence[tuple[str, PressureCurve]]) -> Exhibit:
    """Fig. 4a: a chart of the first curve, all in a table."""
    name, first = curves[0]
    line = np.asarray(np.polyval(np.polyfit(RATIOS, first.fixed, 1), RATIOS), dtype=np.float64)
    chart = Chart(
        "pressure_volume", f"Pressure against volume, {name}", "V/V0 / 1", "pressure / Pa",
        (Series("fixed normals, exact", RATIOS, first.fixed),
         Series("line, whose slope is Kp", RATIOS, line),
         Series("normals turn with the wall", RATIOS, first.follower)),
        caption="Fig. 4a of the paper; its axis reaches 8 kPa.",
    )  # fmt: skip
    rows = tuple(
        (label, c.slope, c.gain, c.fixed[0], c.fixed[-1], c.follower[0], c.follower[-1],
         *c.terms, 1 - c.r_squared, c.off)
        for label, c in curves
    )  # fmt: skip
    table = NumberTable(
        "pressure_volume", "Every cavity, the others at zero pressure.",
        ("cavity", "slope at rest / Pa", "Kp / Pa", "P(70 %) / Pa", "P(130 %) / Pa",
         "follower P(70 %) / Pa", "follower P(130 %) / Pa", "exact c1 / 1/Pa", "exact c2 / 1/Pa2",
         "1 - R2 of the line / 1", "largest departure / Pa"), rows,
    )  # fmt: skip
    words = (
        "With fixed normals V/V0 = 1 + c1 P + c2 P^2 is exact: the line is a fit, not a law. "
        "Following normals change the pressure by 5 to 9 % at 30 % of volume.",
    )
    return Exhibit("curve", "Pressure against volume", words, (table,), (chart,))


def kept(p: Tree, r: Responses) -> dict[str, float]:
    """V/V0 of the first cavity in Fig. 3, pressed without and with its pressure."""
    drive = np.array([_PRESSED * p.scene.body.height])
    found: dict[str, float] = {}
    for name, scheme in (("empty", NoFluid()), ("full", ExactPressure())):
        stepper = scheme.on(r)
        state = stepper.step(stepper.rest(), drive)
        found[f"ratio.{name}"] = state.numbers["cavity0.volume_ratio"]
    return found


def shapes_exhibit(p: Tree, r: Responses) -> Exhibit:
    """Fig. 3 (rest, pressed empty, pressed full) and 4b, 4c (70 and 130 % of volume)."""
    maps = []
    drive = np.array([_PRESSED * p.scene.body.height])
    for name, what, scheme in (("empty", "pressed, pressure zero", NoFluid()),
                               ("full", "pressed, volume kept", ExactPressure())):  # fmt: skip
        stepper = scheme.on(r)
        state = stepper.step(stepper.rest(), drive)
        if state.failure is None:
            maps.append(_shape(name, what, r.scene.mesh, stepper.field(state)))
    for share in _SHARES:
        P = float(pressure_at_volume(r, np.array([share]))[0])
        field = P * r.fields[r.drives]
        maps.append(_shape(f"at_{100 * share:.0f}", f"{share:.0%} of volume", r.scene.mesh, field))
    words = ("Fig. 3 prints no load: 15 % of the block's height is ours.",)
    return Exhibit("shapes", "Shapes of figures 3 and 4", words, maps=tuple(maps))


def _shape(name: str, what: str, mesh: Mesh, u: Floats) -> NodeMap:
    moved = Mesh(mesh.nodes + u, mesh.cells, mesh.kind)
    size = 1e3 * np.linalg.norm(u, axis=1)
    return NodeMap(f"shape_{name}", f"{what}: length of the displacement", moved, size, "mm",
                   "shapes of the block", "the deformed block")  # fmt: skip
