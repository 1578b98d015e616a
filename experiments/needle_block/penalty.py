"""Incompressible by a penalty (paper 002, sections VI.B and VII): its error and its critical step.

The paper would test Picinbono's penalty forces, with a low Poisson ratio and a large step, against
a high Poisson ratio with a small one. Here both meet the exact constraint, a mixed (Taylor-Hood)
solution on a finer mesh.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.linalg import eigvals
from scipy.sparse.linalg import splu

from validate.arrays import Floats
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.fem.assembly.assemble import stiffness_points
from validate.fem.assembly.volume_constraints import mixed_static
from validate.fem.critical import CriticalStep
from validate.fem.system import System, build
from validate.scene.material import Material
from validate.scene.scene import Scene

from .errors import l2_error
from .volume_penalty import volume_penalty

WEIGHTS = (1.0, 10.0, 100.0, 1e3, 1e4)  # of the penalty, over the shear modulus
LOWER = 0.3  # the "lower Poisson ratio" of the penalised body
EXACT = 0.4999999  # of the reference: its volume strains are below 1e-6 of its strains
NEARLY = 0.4999  # of elements that do not lock, which need a finite lambda
_ROUNDING = 1e-8  # of the load: a smaller net force is none
_HEADS = (
    "method of incompressibility", "λ / μ", "critical step / ms", "displacement error / %",
    "volume strain over strain / %", "compliance over exact / %", "net force over load / %",
    "undamped growth / (1/s)",
)  # fmt: skip
_WAYS = {
    "raised": "Poisson ratio raised",
    "area": f"ν = {LOWER:g} and penalty, area-weighted normals",
    "unit": f"ν = {LOWER:g} and penalty, unit normals",
}


@dataclass(frozen=True)
class Squeezed:
    """A body under its one load, `make(n, material)` of n linear simplices across.

    `finer` cells across make the reference; `instead` are elements that do not lock, as a scene
    and in words.
    """

    make: Callable[[int, Material], Scene]
    material: Material
    cells: int
    finer: int
    instead: tuple[str, Scene]

    def of(self, nu: float) -> Scene:
        return self.make(self.cells, replace(self.material, nu=nu))


@dataclass(frozen=True)
class KeptVolume:
    """How one way fared: `step` s is 2/w_max with lumped masses; `error` that of the displacement
    in the mass-weighted L2 norm and `compliance`, relative to the exact ones; `volume` the rms
    volume strain of the cells over the rms strain; `net` the sum of the penalty's forces over the
    load; `growth` 1/s the fastest of an undamped free motion."""

    step: float
    error: float
    volume: float
    compliance: float
    net: float = 0.0
    growth: float = 0.0


@dataclass(frozen=True)
class ExactStatics:
    """Displacements u (n, d) m of the reference on its scene's mesh, and its compliance J."""

    scene: Scene
    u: Floats
    compliance: float


def penalty_exhibit(body: Squeezed) -> tuple[Exhibit, dict[str, float]]:
    """Both penalties and the raised Poisson ratio over the same lambda/mu, beside elements that do
    not lock."""
    exact = exactly(body)
    found = {way: [kept(body, exact, way, w) for w in WEIGHTS] for way in _WAYS}
    words, scene = body.instead
    instead = _judged(build(scene), None, exact)
    rows = [
        _row(_WAYS[way], lame_ratio(w), k)
        for way, line in found.items()
        for w, k in zip(WEIGHTS, line, strict=True)
    ]
    nu = scene.material.nu
    rows.append(_row(f"{words}, ν = {nu:g}", 2 * nu / (1 - 2 * nu), instead))
    numbers = {
        "penalty.best": min(k.error for k in found["area"]),
        "penalty.stiffest": found["area"][-1].error,
        "penalty.net": max(k.net for k in found["unit"]),
        "penalty.instead": instead.error,
    }
    return _shown(found, tuple(rows), instead, words), numbers


def lame_ratio(weight: float) -> float:
    """lambda / mu of the penalised body, of a weight over the shear modulus."""
    return 2 * LOWER / (1 - 2 * LOWER) + weight


def kept(body: Squeezed, exact: ExactStatics, way: str, weight: float) -> KeptVolume:
    """One way at one weight over the shear modulus; the raised ratio has the same lambda/mu."""
    ratio = lame_ratio(weight)
    if way == "raised":
        return _judged(build(body.of(ratio / (2 * (ratio + 1)))), None, exact)
    system = build(body.of(LOWER))
    k = weight * system.scene.material.shear_modulus
    P = volume_penalty(system.scene, k, "area" if way == "area" else "unit")
    return _judged(system, P, exact)


def exactly(body: Squeezed) -> ExactStatics:
    """The body's statics with mixed elements on the finer mesh."""
    scene = body.make(body.finer, replace(body.material, nu=EXACT))
    solved = mixed_static(scene)
    return ExactStatics(scene, solved.u[0], float(solved.compliances[0]))


def _judged(system: System, P: sparse.csr_array | None, exact: ExactStatics) -> KeptVolume:
    """Statics of the system with the penalty P (N, N) N/m under one unit of its load."""
    mesh, free, f = system.scene.mesh, system.free, system.loads[:, 0]
    K = system.K if P is None else sparse.csr_array(system.K + P)
    inner = sparse.csc_array(K[free][:, free])
    u = np.zeros(len(f))
    u[free] = splu(inner).solve(f[free])
    field = u.reshape(mesh.nodes.shape)
    off = l2_error(mesh, field, exact.scene, exact.u)
    pushed = np.zeros_like(field) if P is None else (P @ u).reshape(field.shape)
    load = float(np.linalg.norm(f.reshape(field.shape).sum(axis=0)))
    net = float(np.linalg.norm(pushed.sum(axis=0))) / load
    step, growth = motion(inner, system.masses[free])
    return KeptVolume(
        step, off, volume_share(system.scene, field), float(f @ u) / exact.compliance,
        net if net > _ROUNDING else 0.0, growth,
    )  # fmt: skip


def motion(K: sparse.csc_array, masses: Floats) -> tuple[float, float]:
    """2/w_max s of the free motion M a + K u = 0 with masses (m,) kg, and its fastest growth 1/s.

    Of a symmetric K by products alone, and without growth; of another by all its eigenvalues w^2,
    where a pair that is not real grows by the imaginary part of w.
    """
    if abs(K - K.T).max() <= 1e-12 * abs(K).max():
        return CriticalStep.by_lanczos(
            lambda x: K @ x, masses, products=min(80, len(masses))
        ).limit, 0.0
    w = np.sqrt(eigvals(K.toarray() / masses[:, None]).astype(complex))
    return 2 / float(np.abs(w).max()), float(np.abs(w.imag).max())


def volume_share(scene: Scene, u: Floats) -> float:
    """Rms volume strain of the cells, each its mean, over the rms strain of a field u (n, d) m."""
    at = stiffness_points(scene.mesh)
    slopes = np.einsum("eqai,eam->eqim", at.slopes, u[scene.mesh.cells])
    strain = (slopes + np.swapaxes(slopes, 2, 3)) / 2
    volumes = at.weights.sum(axis=1)
    mean = (at.weights * np.trace(strain, axis1=2, axis2=3)).sum(axis=1) / volumes
    square = (at.weights * (strain**2).sum(axis=(2, 3))).sum()
    return float(np.sqrt(volumes @ mean**2 / square))


# --- exhibit --------------------------------------------------------------------------------------


def _row(label: str, ratio: float, k: KeptVolume) -> tuple[Entry, ...]:
    return (label, ratio, 1e3 * k.step, 100 * k.error, 100 * k.volume, 100 * k.compliance,
            100 * k.net, k.growth)  # fmt: skip


def _shown(
    found: Mapping[str, list[KeptVolume]],
    rows: tuple[tuple[Entry, ...], ...],
    instead: KeptVolume,
    words: str,
) -> Exhibit:
    table = NumberTable(
        "penalty",
        "Statics under the load against the exact constraint (mixed elements, finer mesh), "
        "and the critical step, 2/w_max with lumped masses.",
        _HEADS, rows,
        "Net force: sum of the penalty forces over the body, which must be 0. Growth: of free "
        "motion without damping; where it is not 0, no step is stable without damping.",
    )  # fmt: skip
    charts = tuple(
        Chart(
            f"penalty_{name}", title, "critical step / ms", axis,
            tuple(_line(_WAYS[way], line, name) for way, line in found.items()),
            levels=((words, 100 * float(getattr(instead, name))),), log="xy", caption=caption,
        )
        for name, title, axis, caption in _CHARTS
    )  # fmt: skip
    return Exhibit("penalty", "Incompressible by a penalty", _said(found, instead, words), (table,),
                   charts)  # fmt: skip


_CHARTS = (
    ("error", "Displacement error against critical step", "displacement error / %",
     "The penalty increases to the left. Linear simplices lock before they are accurate."),
    ("volume", "Change of volume", "volume strain over strain / %",
     "The penalty keeps the volume of every cell and thereby prevents the cells from deforming."),
)  # fmt: skip


def _line(label: str, line: list[KeptVolume], name: str) -> Series:
    x = np.array([1e3 * k.step for k in line])
    return Series(label, x, np.array([100 * float(getattr(k, name)) for k in line]))


def _said(
    found: Mapping[str, list[KeptVolume]], instead: KeptVolume, words: str
) -> tuple[str, ...]:
    area, unit, raised = found["area"], found["unit"], found["raised"]
    best = min(range(len(area)), key=lambda i: area[i].error)
    last = area[-1]
    shear = (1 + 0.5) / (1 + LOWER)
    net = max(k.net for k in unit)
    summed = (
        f"their sum over the body is up to {net:.2g} times the load"
        if net
        else "they do not add up within a cell, though over this regular mesh they happen to"
    )
    return (
        "Area-weighted normals are a raised λ, to rounding: against a high Poisson ratio of "
        f"the same λ/μ they do not increase the step ({1e3 * area[best].step:.3g} ms to "
        f"{1e3 * raised[best].step:.3g} ms), and with E kept the shear modulus stays "
        f"{shear:.2f} times that of the incompressible body.",
        f"No weight is accurate: the least error is {100 * area[best].error:.0f} % at k = "
        f"{WEIGHTS[best]:g} μ, and at k = {WEIGHTS[-1]:g} μ the body shows "
        f"{100 * last.compliance:.0f} % of its compliance at a volume strain of "
        f"{100 * last.volume:.2g} %: it locks. {words.capitalize()} are "
        f"{100 * instead.error:.1f} % off at {1e3 * instead.step:.3g} ms.",
        f"Forces along unit normals do not come from an energy: {summed}, undamped motion grows by "
        f"up to {max(k.growth for k in unit):.2g} 1/s, and the heaviest weight leaves "
        f"{100 * unit[-1].compliance:.2g} % of the compliance.",
    )
