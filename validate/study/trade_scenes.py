"""The scenes whose trade is measured: two swinging blocks and the fluid phantom.

Their bodies, materials and loads are those of the experiments of the same name; meshes, elements
and steps are the ladder's own.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import UsageError
from validate.papers.accuracy.rod import GRAVITY, SIZE, bending_rod
from validate.parameters import nearest_names
from validate.recording.types import Recording
from validate.replay.experiment import Experiment
from validate.replay.find import find
from validate.replay.options import folder_of
from validate.scene.box import box, grid
from validate.scene.mesh import Mesh, quadratic
from validate.scene.scene import LawName, Scene
from validate.solve.central import CentralDifference
from validate.solve.explicit_linear import ExplicitLinear
from validate.solve.fluid import ExactPressure, NoFluid, PressureLoop
from validate.solve.implicit import NewtonDynamics
from validate.solve.modal import Modal
from validate.solve.newmark import Newmark
from validate.solve.newton import StaticNewton
from validate.solve.quasi_static import QuasiStatic
from validate.solve.tabulated import Tabulated
from validate.solve.types import Scheme
from validate.study.trade_scene import LawPair, Solver, TradeScene

TETS = ("P1", "P2")
_MODES = 60  # of the reference, beside the statics of the rest
_SMALL, _MEDIUM = 2, 4  # finest meshes of baselines that solve anew every step
_ORDERS = {"H8": 2.0, "P1": 2.0, "MD": 2.0, "P2": 3.0}  # of displacements in smooth fields
_PARTS = 16  # explicit steps at large strain within one of the trade's


def trade_scene(name: str, quick: bool = False) -> TradeScene:
    """The scene of that name; `quick` has coarser meshes. `UsageError` names the nearest."""
    if name not in SCENES:
        known = ", ".join(SCENES)
        hint = nearest_names(name, set(SCENES))
        raise UsageError(f"no trade is declared for '{name}', only for {known}; {hint}")
    return SCENES[name](quick)


# --- blocks that swing ---------------------------------------------------------------------------


def _implicit(**settings: Any) -> Callable[[float], Scheme]:
    return lambda dt: Newmark(dt, **settings)


def _exact(dt: float) -> Scheme:
    """Exact in time for loads that stand still within a step."""
    return Modal(dt, modes=_MODES, propagate="constant")


def _dynamic_solvers(steps: tuple[float, ...]) -> tuple[Solver, ...]:
    """Every scheme of linear dynamics, and both of large strain on tetrahedra."""
    lumped = lambda dt: ExplicitLinear(dt)  # noqa: E731
    consistent = lambda dt: ExplicitLinear(dt, mass="consistent", damping_terms="full")  # noqa: E731
    exact: dict[str, Any] = {"propagate": "constant"}
    return (
        Solver("quasi-static", "static superposition", lambda dt: QuasiStatic(), stepped=False),
        Solver("10 modes", "modal", lambda dt: Modal(dt, modes=10, **exact), stepped=False),
        Solver("40 modes", "modal", lambda dt: Modal(dt, modes=40, **exact), stepped=False),
        Solver("implicit, prefactored", "prefactored", _implicit()),
        Solver("backward Euler, prefactored", "prefactored", _implicit(rule="backward_euler"),
               order=1.0),
        Solver("generalised alpha, prefactored", "prefactored",
               _implicit(rule="generalised_alpha", a0="zero")),
        Solver("implicit, dense inverse", "prefactored", _implicit(solver="dense_inverse"),
               finest=_MEDIUM),
        Solver("implicit, lumped mass", "prefactored", _implicit(mass="lumped")),
        Solver("implicit, conjugate gradients", "prefactored", _implicit(solver="cg")),
        Solver("implicit, Gauss-Seidel", "prefactored", _implicit(solver="gauss_seidel")),
        Solver("implicit, sparse LU every step", "prefactored", _implicit(solver="sparse_lu"),
               finest=_SMALL),
        Solver("implicit, Gaussian elimination every step", "prefactored",
               _implicit(solver="gaussian_elimination"), finest=_SMALL),
        Solver("explicit, consistent mass", "explicit", consistent),
        Solver("explicit, lumped, C = alpha M", "explicit", lumped),
        Solver("large strain, explicit", "large strain",
               lambda dt: CentralDifference(dt, _PARTS, "lagged"), law="neo_hooke",
               elements=("P1",)),
        Solver("large strain, implicit", "large strain",
               lambda dt: NewtonDynamics(dt, mass="consistent"), law="neo_hooke",
               elements=TETS, finest=_MEDIUM, shortest=steps[0]),
    )  # fmt: skip


def _block_mesh(size: tuple[float, ...], per: tuple[int, ...], element: str, level: int) -> Mesh:
    """`per` x level cells per axis; P2's have midside nodes: as many nodes as P1 at twice these."""
    cells = tuple(n * level for n in per)
    if element == "H8":
        return grid(size, cells)
    return quadratic(box(size, cells)) if element == "P2" else box(size, cells)


def _spread_points(size: tuple[float, ...], along: int) -> Floats:
    """Nine points on the free end across axis `along` and three on the axis to it."""
    share = [(a, b) for a in (0.25, 0.5, 0.75) for b in (0.25, 0.5, 0.75)]
    ends = np.array([np.insert(np.array(s), along, 1.0) for s in share])
    axis = np.array([np.insert(np.array([0.5, 0.5]), along, s) for s in (0.25, 0.5, 0.75)])
    return np.asarray(np.vstack([ends, axis]) * np.array(size))


def _rod_scene(element: str, level: int, law: LawName) -> Scene:
    scene = bending_rod(1)
    mesh = _block_mesh(SIZE, (2, 1, 1), element, level)
    return replace(scene, mesh=mesh, material=replace(scene.material, law=law))


def _rod(quick: bool) -> TradeScene:
    steps = (1 / 15, 1 / 30, 1 / 60)
    fine = (2, 4) if quick else (2, 4, 8)
    return TradeScene(
        "bending_rod",
        "A bending rod under gravity that is switched on",
        "paper 002, section IV.B (MP3)",
        _rod_scene,
        lambda level: SIZE[1] / level,
        {"H8": fine, "P1": fine, "P2": (2,) if quick else (2, 4)},
        _ORDERS,
        steps[:2] if quick else steps,
        lambda t: np.full((len(t), 1), GRAVITY),
        np.arange(0.2, 4.1 if quick else 8.1, 0.2),
        _spread_points(SIZE, 0),
        ("P2", 4 if quick else 6),
        _exact,
        _dynamic_solvers(steps),
        LawPair("P2", 2, steps[0], _implicit(), lambda dt: NewtonDynamics(dt, mass="consistent")),
        dynamic=True,
        rise_s=0.0,
    )


def _cube_scene(base: Scene, size: tuple[float, ...], element: str, level: int,
                law: LawName) -> Scene:  # fmt: skip
    mesh = _block_mesh(size, (1, 1, 2), element, level)
    return replace(base, mesh=mesh, material=replace(base.material, law=law))


def _cube(quick: bool) -> TradeScene:
    experiment = find("kf_cube_inertia", Path.cwd())
    p = experiment.parameters
    recording = experiment.load(p, folder_of(experiment))[0]
    base = experiment.build(recording, p, experiment.methods["average"].scene)
    size = tuple(float(x) for x in base.mesh.nodes.max(axis=0))
    total = p.loading.traction * size[0] * size[1]
    steps = (0.004, 0.002, 0.001)
    fine = (2, 4) if quick else (2, 4, 8)
    return TradeScene(
        experiment.name,
        "A block that is pulled, released and swings",
        experiment.source,
        partial(_cube_scene, base, size),
        lambda level: size[0] / level,
        {"H8": fine, "P1": fine, "P2": (2,) if quick else (2, 4)},
        _ORDERS,
        steps[:2] if quick else steps,
        lambda t: total * (t < p.loading.off + 1e-9)[:, None].astype(np.float64),
        np.arange(0.016, 0.5 if quick else 0.97, 0.016),
        _spread_points(size, 2),
        ("P2", 4 if quick else 6),
        _exact,
        _dynamic_solvers(steps),
        LawPair("P2", 2, steps[0], _implicit(), lambda dt: NewtonDynamics(dt, mass="consistent")),
        dynamic=True,
        rise_s=0.0,
        noise=_marker_noise(recording),
    )


# --- the phantom ---------------------------------------------------------------------------------

GRIDS = {7: (7, 8, 11), 9: (9, 10, 15), 11: (11, 13, 19)}  # nodes along x, y, z by level
_DEEPEST = 0.009  # m, the last load of the experiment
_TABLE = 0.0015  # m between the loads that large strain is solved at
_ELEMENTS: Mapping[str, dict[str, Any]] = {
    "P1": {"order": 1}, "MD": {"order": 1, "dilatation": "nodal_mean"}, "P2": {"order": 2},
}  # fmt: skip


def _phantom(quick: bool) -> TradeScene:
    experiment = find("fluid_phantom", Path.cwd())
    p = experiment.parameters
    recording = experiment.load(p, folder_of(experiment))[0]
    build = partial(_phantom_scene, experiment, recording)
    rise = _DEEPEST / _fastest(recording)
    frames = rise * np.array([1 / 3, 2 / 3, 1.0])
    fine = (7, 9) if quick else (7, 9, 11)
    return TradeScene(
        experiment.name,
        experiment.title,
        experiment.source,
        build,
        lambda level: _cell_size(p, level),
        {"P1": fine, "MD": fine, "P2": (7,) if quick else (7, 9)},
        _ORDERS,
        (rise / 6, rise / 240),
        lambda t: _DEEPEST / rise * t[:, None],
        frames,
        _phantom_points(build("P1", 7, "linear").mesh),
        ("P2", 9 if quick else 11),
        lambda dt: ExactPressure(),
        _phantom_solvers(rise),
        LawPair("P2", 7, rise / 6, lambda dt: ExactPressure(), lambda dt: StaticNewton()),
        dynamic=False,
        rise_s=rise,
        noise=_marker_noise(recording),
        notes=(
            "Steps are static: a step is a load increment, and no density is declared, so nothing "
            "with inertia runs here.",
        ),
    )


def _phantom_solvers(rise: float) -> tuple[Solver, ...]:
    table = lambda dt: Tabulated(StaticNewton(), _TABLE)  # noqa: E731
    return (
        Solver("superposition, cavity empty", "static superposition", lambda dt: NoFluid(),
               stepped=False, lacks="the fluid and its pressure"),
        Solver("condensed, exact pressure", "condensed", lambda dt: ExactPressure(), stepped=False),
        Solver("condensed, paper's loop at 1 %", "condensed", lambda dt: PressureLoop(),
               stepped=False),
        Solver("large strain, table", "large strain", table, stepped=False, law="neo_hooke",
               finest=9),
        Solver("large strain, Newton every step", "large strain", lambda dt: StaticNewton(),
               law="neo_hooke", finest=7, shortest=rise / 6),
    )  # fmt: skip


def _phantom_scene(
    experiment: Experiment, recording: Recording, element: str, level: int, law: LawName
) -> Scene:
    p = experiment.parameters
    x, y, z = GRIDS[level]
    mesh = replace(p.mesh, nodes_x=x, nodes_y=y, nodes_z=z)
    model = replace(experiment.methods["p1_fluid"].scene, law=law, **_ELEMENTS[element])
    return experiment.build(recording, replace(p, mesh=mesh), model)


def _cell_size(p: Any, level: int) -> float:
    x, y, z = GRIDS[level]
    volume = p.block.x * p.block.y * p.block.z
    return float((volume / ((x - 1) * (y - 1) * (z - 1))) ** (1 / 3))


def _phantom_points(mesh: Mesh) -> Floats:
    """A ring in the solid a little outside the cavity, and a grid on the top face."""
    wall = mesh.nodes[mesh.facet_nodes("cavity")]
    centre = (wall.max(axis=0) + wall.min(axis=0)) / 2
    radius = 1.1 * float(np.ptp(wall[:, 0])) / 2
    angle = 2 * np.pi * np.arange(16) / 16
    ring = np.stack([np.cos(angle), np.zeros(16), np.sin(angle)], axis=1)
    top = mesh.nodes.max(axis=0)
    shares = [(a, b) for a in (0.15, 0.4, 0.6, 0.85) for b in (0.15, 0.4, 0.6, 0.85)]
    face = np.array([(a * top[0], top[1], b * top[2]) for a, b in shares])
    return np.vstack([centre + radius * ring, face])


def _fastest(recording: Recording) -> float:
    """Speed m/s of the stage over its quickest second."""
    stage = recording.signal("stage", "m")
    y = np.interp(np.arange(stage.t[0], stage.t[-1], 1.0), stage.t, stage.y[:, 0])
    return float(np.abs(np.diff(y)).max())


def _marker_noise(recording: Recording) -> tuple[float, str] | None:
    """The declared standard deviation m of the markers, and what declares it."""
    for name, marker in recording.markers.items():
        if marker.sd:
            return float(marker.sd), f"markers '{name}' of the recording"
    return None


SCENES: Mapping[str, Callable[[bool], TradeScene]] = {
    "fluid_phantom": _phantom,
    "bending_rod": _rod,
    "kf_cube_inertia": _cube,
}
