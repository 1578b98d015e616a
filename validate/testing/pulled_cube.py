"""Cube under tension (paper 001, and a smaller one), and checks that contracts are made of."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache
from typing import Any

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.errors import ValidateError
from validate.estimate.measurements import Measurements
from validate.fem.system import System, build
from validate.scene.geometries.box import box
from validate.scene.material import Material
from validate.scene.scene import Load, Probe, Scene, Support
from validate.solve.dynamic.newmark import Newmark
from validate.solve.march import march
from validate.solve.types import Run, Stepper

DT = 0.002
Shape = tuple[tuple[float, float, float], tuple[int, int, int]]  # size m, cells
PAPER: Shape = ((0.004, 0.004, 0.007), (4, 4, 7))
SMALL: Shape = ((0.004, 0.004, 0.004), (2, 2, 2))
SD = np.sqrt(1e-9)  # m: .001 mm^2
TOP, BELOW, CORNER = "top", "below", "corner"


@cache
def cube(E: float = 1e4, shape: Shape = SMALL) -> System:
    """An earlier study: E Pa, nu .47, rho 1068, stiffness damping .1 s, pulled at the top."""
    (x, y, z), _ = shape
    probes = ((TOP, (x / 2, y / 2, z)), (BELOW, (x / 2, y / 2, z - 0.002)), (CORNER, (0.0, 0.0, z)))
    return build(
        Scene(
            box(*shape),
            Material(E, 0.47, rho=1068.0, stiffness_damping=0.1),
            (Support("z0", (0, 1, 2)),),
            loads=(Load("pull", "z1", (0.0, 0.0, 1.0)),),
            probes=tuple(Probe(*p) for p in probes),
        )
    )


@dataclass(frozen=True)
class PulledCase:
    """Times (nt,) s, inputs (nt, 1) N, and the plain run of a system."""

    system: System
    inputs: Floats
    truth: Run

    @property
    def t(self) -> Floats:
        return np.asarray(DT * np.arange(1, len(self.inputs) + 1), np.float64)

    def march(self, stepper: Stepper, at: tuple[int, ...] = (-1,)) -> Run:
        steps = np.array([k % len(self.t) for k in at])
        return march("m", stepper, self.t, self.inputs, steps, 0.0)

    def probe(self, name: str = TOP) -> Floats:
        """Displacements (nt, 3) m of the truth."""
        return np.stack([self.truth.traces[f"{name}.{c}"].y for c in "xyz"], axis=1)

    def rows(self, name: str = TOP) -> sparse.csr_array:
        mesh = self.system.scene.mesh
        point = next(p.point for p in self.system.scene.probes if p.name == name)
        node = mesh.nearest_node(np.array(point))
        ones, columns = np.ones(3), 3 * node + np.arange(3)
        return sparse.csr_array((ones, (np.arange(3), columns)), shape=(3, mesh.nodes.size))

    def measured(self, seed: int, sd: float = SD, every: int = 1) -> Measurements:
        """The top node with white noise, at every `every`-th step."""
        noise = sd * np.random.default_rng(seed).normal(size=(len(self.t), 3))
        z = (self.probe() + noise)[every - 1 :: every]
        names = ("top.x", "top.y", "top.z")
        return Measurements(self.t[every - 1 :: every], self.rows(), z, np.full(3, sd), names)

    def two_measured(self, seed: int, sd: float = SD) -> Measurements:
        """The top node and a corner at every step."""
        shown = np.hstack([self.probe(TOP), self.probe(CORNER)])
        z = shown + sd * np.random.default_rng(seed).normal(size=shown.shape)
        H = sparse.csr_array(sparse.vstack([self.rows(TOP), self.rows(CORNER)]))
        names = tuple(f"{m}.{c}" for m in (TOP, CORNER) for c in "xyz")
        return Measurements(self.t, H, z, np.full(6, sd), names)

    def nrmse(self, run: Run, name: str = TOP) -> float:
        """RMSE of u_z over all steps, by the range of the truth over steps 1 to nt."""
        z = self.probe(name)[:, 2]
        error = run.traces[f"{name}.z"].y - z
        return float(np.sqrt((error**2).mean()) / np.ptp(z))


@cache
def case(steps: int = 60, shape: Shape = SMALL) -> PulledCase:
    """3000 Pa on the top from t = 0, as the finite elements answer it."""
    system = cube(shape=shape)
    (x, y, _), _ = shape
    inputs = np.full((steps, 1), 3000.0 * x * y)
    t = np.asarray(DT * np.arange(1, steps + 1), np.float64)
    truth = march("fem", Newmark(DT).prepare(system), t, inputs, np.array([steps - 1]), 0.0)
    return PulledCase(system, inputs, truth)


# --- checks that contracts are made of -----------------------------------------------------------


def require(condition: object, what: str) -> None:
    """Raise `AssertionError` with `what` is expected where the condition is false."""
    if not condition:
        raise AssertionError(what)


def refusal(action: Callable[[], Any]) -> str:
    """Return the one line of the `ValidateError` that an action raises.

    Raises `AssertionError` where it raises none, or one of several lines.
    """
    try:
        action()
    except ValidateError as error:
        text = str(error.args[0])
        require(len(text.splitlines()) == 1, f"an error of several lines: {text!r}")
        return str(error)
    raise AssertionError("expected a ValidateError, but nothing was raised")


def require_documented_settings(kind: type) -> None:
    """Every field of settings has a sentence and a unit, except a scheme inside."""
    for f in fields(kind):
        if f.name != "inner":
            doc = f.metadata.get("doc")
            require(doc, f"{kind.__name__}.{f.name}: declare it by quantity(default, unit, doc)")
