"""Small scenes with exact solutions: capabilities and accuracy of an external simulator."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from validate.arrays import Floats
from validate.fem.laws.plane_stress import response
from validate.scene.geometries.box import grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.meshless import MaterialPoint
from validate.scene.scene import Drive, DriveShape, Scene, Support, Weight
from validate.solve.external.program import words
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.types import Run

_E, _NU, _RHO, _G = 10e3, 0.3, 1000.0, 9.81
_SIDE = 0.02
_ONCE = np.ones(1)
_DOWN = (Weight("gravity", (0.0, 0.0, 1.0)),)  # away from the clamp: so slender, it cannot stand


@dataclass(frozen=True)
class SmallScene:
    """Exact displacements u (nt, n, 3) m and forces (nt,) N by drive, under inputs (nt, k) at t."""

    name: str
    words: str
    scene: Scene
    t: Floats
    inputs: Floats
    u: Floats
    forces: Mapping[str, Floats] = field(default_factory=dict)
    inertia: bool = False


@dataclass(frozen=True)
class OffBy:
    """Largest error of one quantity; `exact` is the largest exact value of that quantity.

    `error` is None if the run has no such quantity; `state` and `why` are the outcome of the run.
    """

    scene: str
    state: str
    quantity: str
    error: float | None
    exact: float
    unit: str
    why: str


def small_scenes() -> tuple[SmallScene, ...]:
    """Rigid motions, patch test, uniaxial strain of two laws, hanging bar, ring-down."""
    return (_moved(), _turned(), _patch(), _stretched(), _stretched_far(), _hanging(), _ringing())


def check_simulator(simulator: ExternalSimulator) -> Iterator[tuple[OffBy, ...]]:
    """Run every small scene and yield its errors, one scene after the other.

    Raises `UsageError` for a command whose program is missing.
    """
    words(simulator.command)
    for small in small_scenes():
        run = replace(simulator, inertia=small.inertia).solve(small.scene, small.t, small.inputs)
        yield _measured(small, run)


def _measured(small: SmallScene, run: Run) -> tuple[OffBy, ...]:
    why = "; ".join(line for line in (run.outcome.why, *run.said) if line)
    one = partial(OffBy, small.name, run.outcome.state)
    largest = float(np.linalg.norm(small.u, axis=2).max())
    if not run.finished:
        return (one("displacement", None, largest, "m", why),)
    off = float(np.linalg.norm(run.u - small.u, axis=2).max())
    rows = [one("displacement", off, largest, "m", why)]
    for drive, exact in small.forces.items():
        trace = run.traces.get(f"{drive}.force")
        error = None if trace is None else float(np.abs(trace.y - exact).max())
        rows.append(one(f"force of '{drive}'", error, float(np.abs(exact).max()), "N", ""))
    return tuple(rows)


def _block(cells: int = 2) -> Mesh:
    return grid((_SIDE, _SIDE, _SIDE), (cells, cells, cells))


def _moved() -> SmallScene:
    """The bottom is moved and turned a little: linear, so the whole body follows u = a + w x X."""
    mesh = _block()
    field_ = np.array([1e-3, -5e-4, 2e-4]) + np.cross([0.02, -0.01, 0.03], mesh.nodes)
    scene = Scene(mesh, Material(_E, _NU), drives=(_shaped(mesh, "z0", field_),))
    return SmallScene("rigid motion", "small translation and rotation, linear law", scene, _ONCE,
                      np.ones((1, 1)), field_[None], {"base": np.zeros(1)})  # fmt: skip


def _turned() -> SmallScene:
    """The bottom is turned by 30 degrees in ten steps: neo-Hooke, no strain at any of them."""
    mesh, steps = _block(), 10
    angle = np.deg2rad(30.0) * np.arange(1, steps + 1) / steps
    x, y, z = mesh.nodes.T
    c, s, o = np.cos(angle)[:, None], np.sin(angle)[:, None], np.zeros((steps, len(x)))
    u = np.stack([(c - 1) * x - s * y, s * x + (c - 1) * y, z * o], axis=2)
    away = np.stack([x, y, o[0]], axis=1), np.stack([-y, x, o[0]], axis=1)
    drives = tuple(_shaped(mesh, "z0", f, n) for f, n in zip(away, ("out", "round"), strict=True))
    scene = Scene(mesh, Material(_E, _NU, "neo_hooke"), (Support("z0", (2,)),), drives=drives)
    t = np.arange(1, steps + 1) / steps
    none = {"out": np.zeros(steps), "round": np.zeros(steps)}
    return SmallScene("rigid turn", "rotation by 30 degrees, neo-Hooke", scene, t,
                      np.hstack([c - 1, s]), u, none)  # fmt: skip


def _patch() -> SmallScene:
    """All of the surface is moved affinely; inner nodes are not on a lattice, and follow."""
    plain, rng = _block(3), np.random.default_rng(1)
    inner = np.setdiff1d(np.arange(len(plain.nodes)), plain.surface)
    nodes = plain.nodes.copy()
    nodes[inner] += rng.uniform(-0.1, 0.1, (len(inner), 3)) * _SIDE / 3
    mesh = Mesh(nodes, plain.cells, plain.kind, {"all": plain.surface})
    gradient = 1e-3 * np.array([[3.0, 1.0, -2.0], [0.5, -1.0, 1.0], [1.0, 2.0, 4.0]])
    affine = nodes @ gradient.T
    scene = Scene(mesh, Material(_E, _NU), drives=(_shaped(mesh, "all", affine, "surface"),))
    strain = (gradient + gradient.T) / 2
    mu, lam = _E / 2 / (1 + _NU), _E * _NU / (1 + _NU) / (1 - 2 * _NU)
    stress = 2 * mu * strain + lam * np.trace(strain) * np.eye(3)
    work = float(np.sum(stress * strain)) * _SIDE**3  # of the force, per unit of its input
    return SmallScene("patch test", "affine motion of the surface, distorted cells", scene,
                      _ONCE, np.ones((1, 1)), affine[None],
                      {"surface": np.array([work])})  # fmt: skip


def _stretched() -> SmallScene:
    """A block between smooth plates, pulled by 1 %: linear."""
    mesh, strain = _block(), 0.01
    u = mesh.nodes * strain * np.array([-_NU, -_NU, 1.0])
    return SmallScene("uniaxial, linear", "stretched by 1 %, free lateral faces",
                      _smooth(Material(_E, _NU)), _ONCE, np.array([[strain * _SIDE]]), u[None],
                      {"pull": np.array([_E * strain * _SIDE**2])})  # fmt: skip


def _stretched_far() -> SmallScene:
    """The same by up to 30 %: neo-Hooke, its stretch aside from one equation a step."""
    material, steps = Material(_E, _NU, "neo_hooke"), 6
    scene = _smooth(material)
    stretch = 1 + 0.3 * np.arange(1, steps + 1) / steps
    found = response(MaterialPoint(material, "uniaxial"), stretch[:, None])
    aside = found["free_stretch"] - 1
    u = scene.mesh.nodes * np.stack([aside, aside, stretch - 1], axis=1)[:, None]
    t = np.arange(1, steps + 1) / steps
    return SmallScene("uniaxial, neo-Hooke", "stretched by 30 %, free lateral faces", scene, t,
                      _SIDE * (stretch[:, None] - 1), u,
                      {"pull": found["nominal_stress"] * _SIDE**2})  # fmt: skip


def _smooth(material: Material) -> Scene:
    """Three sides on smooth walls, the top pulled along z."""
    walls = tuple(Support(f"{axis}0", (i,)) for i, axis in enumerate("xyz"))
    return Scene(_block(), material, walls, drives=(Drive("pull", "z1", (0.0, 0.0, 1.0)),))


_BAR = (0.01, 0.01, 0.1)


def _bar(cells: int, mass_damping: float = 0.0) -> Scene:
    """Clamped at the top end of its weight; nu = 0, so that every section keeps its shape."""
    material = Material(_E, 0.0, rho=_RHO, mass_damping=mass_damping)
    return Scene(grid(_BAR, (1, 1, cells)), material, (Support("z0", (0, 1, 2)),), loads=_DOWN)


def _sagged(z: Floats) -> Floats:
    """u (n,) m of a bar clamped at z = 0: rho g (L z - z^2/2)/E, at nodes of linear cells too."""
    return np.asarray(_RHO * _G * (_BAR[2] * z - z**2 / 2) / _E)


def _hanging() -> SmallScene:
    scene = _bar(5)
    u = np.zeros((1, *scene.mesh.nodes.shape))
    u[0, :, 2] = _sagged(scene.mesh.nodes[:, 2])
    return SmallScene("hanging bar", "weight of the body, linear, nu = 0", scene, _ONCE,
                      np.array([[_G]]), u)  # fmt: skip


def _ringing() -> SmallScene:
    """Gravity is switched on and the bar rings down by its mass damping.

    Exact in time for linear cells with consistent masses: its n modes are sin(k z), k L =
    (j - 1/2) pi, of omega^2 = 6 E/(rho h^2) (1 - cos k h)/(2 + cos k h), each a damped oscillator
    under a force that is switched on.
    """
    cells, damping = 8, 20.0
    scene = _bar(cells, damping)
    h, z = _BAR[2] / cells, scene.mesh.nodes[:, 2]
    k = (np.arange(cells) + 0.5) * np.pi / _BAR[2]
    omega2 = 6 * _E / (_RHO * h**2) * (1 - np.cos(k * h)) / (2 + np.cos(k * h))
    levels: Floats = h * np.arange(1.0, cells + 1)
    shapes: Floats = np.sin(np.outer(levels, k))
    shares = np.linalg.solve(shapes, _sagged(levels))
    t = np.arange(1, 201) * 2 * np.pi / np.sqrt(omega2[0]) / 100
    w = np.sqrt(omega2 - damping**2 / 4)
    wt = np.outer(t, w)
    risen = 1 - np.exp(-damping / 2 * t)[:, None] * (np.cos(wt) + damping / 2 / w * np.sin(wt))
    u = np.zeros((len(t), *scene.mesh.nodes.shape))
    u[:, :, 2] = (shares * risen) @ np.sin(np.outer(z, k)).T
    return SmallScene("ring-down", "gravity switched on, two periods, damped", scene, t,
                      np.full((len(t), 1), _G), u, inertia=True)  # fmt: skip


def _shaped(mesh: Mesh, facets: str, field_: Floats, name: str = "base") -> Drive:
    shape = DriveShape(field_[mesh.facet_nodes(facets)])
    return Drive(name, facets, (1.0, 0.0, 0.0), shape=shape)
