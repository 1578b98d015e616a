"""The block of paper 000, section 3.3, with one, two or three square cavities in a row.

5 x 5 cm, E 34 kPa, nu .35 are printed; cavity size, boundary, plane state and what presses it are
not, so that each is a parameter. x is centred, y runs from -height to 0, the lower side is held.
Forces are per metre of depth.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, SceneError, UsageError
from validate.fem.system import build as build_system
from validate.parameters import Ranges, quantity
from validate.recording.types import Recording, Source
from validate.register.observation import Selection
from validate.register.registered import Registered
from validate.register.signals import driving, validating
from validate.replay.cards import shipped
from validate.replay.experiment import Progress
from validate.scene.material import Material
from validate.scene.mesh import Mesh, boundary_facets, quadratic
from validate.scene.scene import Cavity, Drive, Pin, PlaneState, Scene, Support
from validate.solve.fluid import ElasticPressure, ExactPressure
from validate.solve.march import march
from validate.solve.pulse import MMHG, PulsePressure
from validate.twin.sensors import signal, streams

ToolName = Literal["needle", "patch", "plate"]
FRAME = "block"
_SENSORS = ("tool", "force", "pressure")
_LONG = 10.0  # s: how far apart the states of the twin are; a sample is no match beyond a second


@dataclass(frozen=True)
class Cavities:
    count: int = quantity(1, "1", "cavities in a row: 1, 2 or 3")
    width: float = quantity(0.010, "m", "of each cavity")
    height: float = quantity(0.010, "m", "of each cavity")
    septum: float = quantity(0.005, "m", "wall between two cavities")


@dataclass(frozen=True)
class PlaneBlock:
    width: float = quantity(0.05, "m", "of the block")
    height: float = quantity(0.05, "m", "of the block")
    plane: PlaneState = quantity("strain", "1", "plane strain or stress")
    plates: Literal["slip", "bonded"] = quantity("slip", "1", "what the tool does sideways")
    patch: float = quantity(0.01, "m", "width of the patch that a tool 'patch' presses")


@dataclass(frozen=True)
class PlaneGrid:
    squares: int = quantity(40, "1", "squares across the block, of two triangles each")
    order: Literal[1, 2] | None = quantity(
        None, "1", "of every method; none: as each method declares"
    )


@dataclass(frozen=True)
class GelSlab:
    E: float = quantity(34_000.0, "Pa", "Young's modulus, as printed")
    nu: float = quantity(0.35, "1", "Poisson ratio, as printed")


@dataclass(frozen=True)
class SlabRanges(Ranges):
    E: float = quantity(0.02, "1", "relative, of the modulus")
    nu: float = quantity(0.005, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class SlabTwin:
    """What made the recording: quadratic triangles on a finer mesh, exact volumes."""

    squares: int = quantity(80, "1", "squares across the twin's mesh")
    E: float = quantity(34_000.0, "Pa", "its modulus")
    nu: float = quantity(0.35, "1", "its Poisson ratio")
    seed: int = quantity(3, "1", "seed of the sensors' noise")
    sd_force: float = quantity(0.2, "N", "load cell noise, per metre")
    sd_pressure: float = quantity(10.0, "Pa", "pressure transducer noise")
    sd_tool: float = quantity(2e-6, "m", "noise of the tool's encoder")


@dataclass(frozen=True)
class FluidLaws:
    """The other laws that the report shows, under the plate; the pulse without a tool."""

    preset: float = quantity(0.0, "Pa", "Pe of a reservoir, P = Pe - B (V/V0 - 1)")
    stiffness: float = quantity(5e3, "Pa", "B of the reservoir")
    bulk_modulus: float = quantity(2.2e9, "Pa", "of a compressible fluid")
    pulse_low: float = quantity(80 * MMHG, "Pa", "least pressure of the pulse")
    pulse_high: float = quantity(120 * MMHG, "Pa", "largest pressure of the pulse")
    pulse_rate: float = quantity(70 / 60, "1/s", "pulses a second")

    def __post_init__(self) -> None:
        ElasticPressure(self.preset, self.stiffness)  # which refuse what has no sense
        ExactPressure(1.0, self.bulk_modulus)
        PulsePressure(self.pulse_low, self.pulse_high, self.pulse_rate)


@dataclass(frozen=True)
class FluidBlock:
    """`strains` are tool displacements over the block's height."""

    material: GelSlab = GelSlab()
    body: PlaneBlock = PlaneBlock()
    cavities: Cavities = Cavities()
    mesh: PlaneGrid = PlaneGrid()
    ranges: SlabRanges = SlabRanges()
    twin: SlabTwin = SlabTwin()
    laws: FluidLaws = FluidLaws()
    tool: ToolName = quantity("plate", "1", "what presses the upper side: one node, a patch, all")
    strains: tuple[float, ...] = quantity(
        (0.003, 0.01, 0.03, 0.05, 0.08, 0.10, 0.12, 0.15), "1", "displacement over height"
    )
    recording: str = quantity("", "1", "MCAP file")

    def __post_init__(self) -> None:
        odd = [s for s in self.strains if not 0 < s < 0.5]
        if not self.strains or odd or list(self.strains) != sorted(set(self.strains)):
            raise UsageError(
                f"strains = {','.join(f'{s:g}' for s in self.strains)}: rising numbers between 0 "
                "and .5"
            )


@dataclass(frozen=True)
class SlabModel:
    """What a method's scene is built with."""

    order: Literal[1, 2] = quantity(1, "1", "element order")


# --- geometry -------------------------------------------------------------------------------------


def block_mesh(body: PlaneBlock, cavities: Cavities, squares: int) -> Mesh:
    """Squares split by alternating diagonals; facet sets "bottom", "top", "patch", "cavity0"...

    Raises `SceneError` for cavities that touch each other or the outside, or do not fall on whole
    squares.
    """
    h = body.width / squares
    nx, ny = squares, _whole(body.height, h, "body.height")
    solid = np.ones((nx, ny), dtype=bool)
    boxes = _boxes(cavities, h, nx, ny)
    for i, j in boxes:
        solid[i, j] = False
    x, y = np.meshgrid(
        np.linspace(-body.width / 2, body.width / 2, nx + 1),
        np.linspace(-body.height, 0.0, ny + 1), indexing="ij",
    )  # fmt: skip
    nodes, cells = _split(np.stack([x.ravel(), y.ravel()], axis=1), solid)
    outside = boundary_facets(cells, 2)
    middle = nodes[outside].mean(axis=1)
    facets = {
        "bottom": outside[np.isclose(middle[:, 1], -body.height)],
        "top": outside[np.isclose(middle[:, 1], 0.0)],
    }
    on_patch = np.abs(middle[:, 0]) < max(body.patch / 2, 0.51 * h)
    facets["patch"] = outside[np.isclose(middle[:, 1], 0.0) & on_patch]
    for k, (i, j) in enumerate(boxes):
        low = np.array([x[i.start, 0], y[0, j.start]]) - h / 4
        high = np.array([x[i.stop, 0], y[0, j.stop]]) + h / 4
        facets[f"cavity{k}"] = outside[((middle > low) & (middle < high)).all(axis=1)]
    return Mesh(nodes, cells, "tri3", facets)


def _whole(length: float, h: float, name: str) -> int:
    count = round(length / h)
    if count < 1 or abs(length / h - count) > 1e-6:
        raise SceneError(
            f"{name} = {1e3 * length:g} mm is {length / h:.3f} squares of {1e3 * h:.4g} mm: choose "
            "whole squares, or other mesh.squares"
        )
    return count


def _boxes(cavities: Cavities, h: float, nx: int, ny: int) -> list[tuple[slice, slice]]:
    """The squares of each cavity, centred in the block."""
    if cavities.count not in (1, 2, 3):
        raise SceneError(f"cavities.count = {cavities.count}: 1, 2 or 3")
    wide = _whole(cavities.width, h, "cavities.width")
    high = _whole(cavities.height, h, "cavities.height")
    if cavities.count > 1 and not cavities.septum > 0:
        raise SceneError(
            f"cavities.septum = {1e3 * cavities.septum:g} mm: the {cavities.count} cavities touch "
            "each other; leave a wall between them"
        )
    apart = _whole(cavities.septum, h, "cavities.septum") if cavities.count > 1 else 0
    row = cavities.count * wide + (cavities.count - 1) * apart
    if row > nx - 2 or high > ny - 2:
        raise SceneError(
            f"{cavities.count} cavities take {row} x {high} of {nx} x {ny} squares: they touch the "
            "outside; make them smaller"
        )
    if (nx - row) % 2 or (ny - high) % 2:
        raise SceneError(
            f"{cavities.count} cavities take {row} x {high} of {nx} x {ny} squares: not centred on "
            "whole ones; take another mesh.squares"
        )
    left, bottom = (nx - row) // 2, (ny - high) // 2
    starts = [left + k * (wide + apart) for k in range(cavities.count)]
    return [(slice(s, s + wide), slice(bottom, bottom + high)) for s in starts]


def _split(nodes: Floats, solid: np.ndarray) -> tuple[Floats, Ints]:
    """Two triangles of every solid square, diagonals alternating; unused nodes dropped."""
    i, j = (a.ravel() for a in np.nonzero(solid))
    n = solid.shape[1] + 1
    a, b = i * n + j, (i + 1) * n + j
    d, c = a + 1, b + 1
    even = ((i + j) % 2 == 0)[:, None]
    first = np.where(even, np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(even, np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    used, number = np.unique(np.vstack([first, second]), return_inverse=True)
    return nodes[used], np.asarray(number).reshape(-1, 3)


# --- scene and registration -----------------------------------------------------------------------


def slab(
    body: PlaneBlock, cavities: Cavities, squares: int, order: int, material: Material,
    tool: ToolName | None,
) -> Scene:  # fmt: skip
    """The block with its fluid, pressed by a tool; none: nothing drives it."""
    mesh = block_mesh(body, cavities, squares)
    supports: tuple[Support, ...] = (Support("bottom", (0, 1)),)
    drives = () if tool is None else (_drive(tool),)
    pins: tuple[Pin, ...] = ()
    if tool == "needle" and body.plates == "bonded":
        pins = (Pin((0.0, 0.0), (0,)),)
    elif tool and body.plates == "bonded":
        supports += (Support("top" if tool == "plate" else "patch", (0,)),)
    return Scene(
        quadratic(mesh) if order == 2 else mesh, material, supports, pins, drives,
        cavities=tuple(Cavity(f"cavity{k}", f"cavity{k}") for k in range(cavities.count)),
        plane=body.plane,
    )  # fmt: skip


def _drive(tool: ToolName) -> Drive:
    if tool == "needle":
        return Drive("tool", "top", (0.0, -1.0), (0.0, 0.0))
    return Drive("tool", "top" if tool == "plate" else "patch", (0.0, -1.0))


def build(recording: Recording, p: FluidBlock, model: SlabModel) -> Scene:
    order = p.mesh.order or model.order
    material = Material(p.material.E, p.material.nu)
    return slab(p.body, p.cavities, p.mesh.squares, order, material, p.tool)


def place(recording: Recording, p: FluidBlock, scene: Scene) -> Registered:
    """The tool drives; its force and every cavity's pressure are compared, all states together."""
    tool = driving(recording, "tool", "m")
    seen = [validating(recording, "force", "N", quantity="force", trace="tool.force")]
    for cavity in scene.cavities:
        topic = cavity.name.replace("cavity", "pressure")
        if topic not in recording.signals:
            raise ComparisonError(
                f"{recording.name}: no signal '{topic}' for cavity {cavity.name[6:]} of "
                f"{len(scene.cavities)}; it has {sorted(recording.signals)}"
            )
        seen.append(
            validating(recording, topic, "Pa", quantity=topic, trace=f"{cavity.name}.pressure")
        )
    pressed = Selection("pressed", tool.t[1:], "every state under the tool")
    return Registered((tool, *seen), (pressed,))


# --- the twin -------------------------------------------------------------------------------------


def load(p: FluidBlock, folder: Path) -> tuple[Recording, ...]:
    return shipped(p, folder)


def record(p: FluidBlock, progress: Progress) -> Recording:
    """States under the tool one after the other, rest first; seeded."""
    progress("simulate")
    material = Material(p.twin.E, p.twin.nu)
    scene = slab(p.body, p.cavities, p.twin.squares, 2, material, p.tool)
    down = p.body.height * np.array([0.0, *p.strains])
    t = _LONG * np.arange(len(down), dtype=np.float64)
    run = march("twin", ExactPressure().prepare(build_system(scene)), t, down[:, None],
                np.array([len(t) - 1]), 0.0)  # fmt: skip
    if not run.finished:
        raise SceneError(f"the twin: {run.outcome.why}")
    progress("measure")
    rng, twin = streams(p.twin.seed, _SENSORS), p.twin
    signals = {
        "tool": signal(t, down, "m", twin.sd_tool, FRAME, rng["tool"]),
        "force": signal(t, run.traces["tool.force"].y, "N", twin.sd_force, FRAME, rng["force"]),
    }
    for k in range(p.cavities.count):
        y = run.traces[f"cavity{k}.pressure"].y
        signals[f"pressure{k}"] = signal(t, y, "Pa", twin.sd_pressure, FRAME, rng["pressure"])
    provenance = {
        "kind": "twin", "law": "linear elasticity, small strain", "plane": p.body.plane,
        "element": f"P2 triangles, {scene.mesh.nodes.size} unknowns",
        "fluid": "constant volume, exact", "E_Pa": repr(twin.E), "nu": repr(twin.nu),
        "seed": str(twin.seed),
    }  # fmt: skip
    return Recording(
        "fluid_block", Source("fluid_block", "", 0, "made in memory"), 1_080_345_600_000_000_000,
        signals=signals, metadata={"provenance": provenance},
    )  # fmt: skip


def refined(squares: int) -> Any:
    """The parameters on another mesh."""

    def change(p: FluidBlock) -> FluidBlock:
        return replace(p, mesh=replace(p.mesh, squares=squares))

    return change


def sets(p: FluidBlock, seen: Registered) -> Mapping[str, Any]:
    return {}
