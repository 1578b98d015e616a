"""The planar block assembled apart by scikit-fem: plane state, order, plates, tools, cavities.

Nothing of `fem` or `solve` is in these numbers: scikit-fem integrates stiffness and pressure, scipy
solves, and volumes are areas of polygons or, to first order, the work of the pressure's load.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skfem
from beside import beside, experiment
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve
from skfem.helpers import ddot, sym_grad, trace

from validate.arrays import Floats
from validate.fem.system import Responses
from validate.fem.system import build as build_system
from validate.parameters import with_given
from validate.pipeline.experiment.tree import Tree, mesh_of
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.fluid.pressure_curve import slopes, still

slab = beside("fluid_block", "block").slab
COARSE: Tree = with_given(experiment("fluid_block").parameters, {"body.cells": 20})
ELEMENTS = {1: "tri3", 2: "tri6"}


class Apart:
    """The block's stiffness and pressure loads by scikit-fem, on the same triangles."""

    def __init__(self, p: Tree, order: int) -> None:
        made = mesh_of(None, p, Path())
        self.mesh, self.facets = skfem.MeshTri(made.nodes.T, made.cells.T), made.facets
        element = skfem.ElementTriP1() if order == 1 else skfem.ElementTriP2()
        self.basis = skfem.Basis(self.mesh, skfem.ElementVector(element), intorder=4)
        E, nu = p.scene.material.E, p.scene.material.nu
        mu, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
        if p.scene.plane == "stress":
            lam = 2 * lam * mu / (lam + 2 * mu)

        @skfem.BilinearForm
        def energy(u: Any, v: Any, w: Any) -> Any:
            e, d = sym_grad(u), sym_grad(v)
            return 2 * mu * ddot(e, d) + lam * trace(e) * trace(d)

        @skfem.LinearForm
        def push(v: Any, w: Any) -> Any:
            """One pascal on the wall: from the fluid into the solid, against the solid's normal."""
            return -(w.n[0] * v[0] + w.n[1] * v[1])

        self.K = energy.assemble(self.basis).tocsc()
        self.held = self.dofs("bottom")
        self.loads = [
            push.assemble(skfem.FacetBasis(self.mesh, self.basis.elem, facets=self.lines(name)))
            for name in sorted(n for n in self.facets if n.startswith("cavity"))
        ]

    def lines(self, name: str) -> Any:
        """Facet numbers of scikit-fem of a facet set."""
        middles = self.mesh.p[:, self.mesh.facets].mean(axis=1).T
        mine = self.mesh.p.T[self.facets[name]].mean(axis=1)
        away = np.abs(middles[None] - mine[:, None]).max(axis=2)
        assert away.min(axis=1).max() < 1e-12
        return away.argmin(axis=1)

    def dofs(self, name: str, axes: tuple[str, ...] = ("u^1", "u^2")) -> Any:
        return np.unique(self.basis.get_dofs(self.lines(name)).all(list(axes)))

    def solve(self, load: Floats, fixed: Any, values: Floats) -> Floats:
        """Displacements under a load with `fixed` unknowns at `values`."""
        u = np.zeros(len(load))
        u[fixed] = values
        free = np.setdiff1d(np.arange(len(load)), fixed)
        u[free] = spsolve(self.K[free][:, free], (load - self.K @ u)[free])
        return u

    def area(self, k: int, u: Floats) -> float:
        """m^2 of cavity k with linear edges at x + u."""
        lines = self.facets[f"cavity{k}"]
        x = (self.mesh.p + u[self.basis.nodal_dofs]).T
        middle = x[np.unique(lines)].mean(axis=0)
        a, b = x[lines[:, 0]] - middle, x[lines[:, 1]] - middle
        return float(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2)


SETUPS = (
    {},
    {"plane": "stress"},
    {"body.cavities.width": 0.015, "body.cavities.height": 0.005},
    {"body.cavities.width": 0.02, "body.cavities.height": 0.02},
    {"body.cavities.count": 2},
    {"body.cavities.count": 3},
    {"plane": "stress", "body.cavities.count": 2},
)


def set_up(values: dict[str, Any]) -> Tree:
    return with_given(COARSE, values)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("values", SETUPS, ids=str)
def test_every_cavity_swells_as_computed_apart(values: dict[str, Any], order: int) -> None:
    """d(V_i/V0_i)/dP_j at rest: the work of the load of i on what j's pressure moves."""
    p = set_up(values)
    apart = Apart(p, order)
    moved = [apart.solve(f, apart.held, np.zeros(len(apart.held))) for f in apart.loads]
    V0 = p.scene.body.cavities.width * p.scene.body.cavities.height
    theirs = np.array([[f @ u / V0 for u in moved] for f in apart.loads])
    ours = Responses.of(build_system(slab(p, None, {"body.element": ELEMENTS[order]})))
    assert slopes(ours, still(ours)) == pytest.approx(theirs, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("tool", ["needle", "patch", "plate"])
@pytest.mark.parametrize("plates", ["slip", "bonded"])
@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_pressure_and_force_under_a_tool_are_those_computed_apart(
    tool: Any, plates: Any, plane: Any
) -> None:
    """The root by bisection on the polygon's area, the force as the reaction of scikit-fem's K."""
    p = set_up({"plane": plane, "plates": plates})
    apart, down = Apart(p, 1), 0.1 * p.scene.body.height
    if tool == "needle":
        node = int(np.abs(apart.mesh.p.T - [0.0, 0.0]).sum(axis=1).argmin())
        pressed, aside = apart.basis.nodal_dofs[1:, node], apart.basis.nodal_dofs[:1, node]
    else:
        name = "top" if tool == "plate" else "patch"
        pressed, aside = apart.dofs(name, ("u^2",)), apart.dofs(name, ("u^1",))
    fixed = np.concatenate([apart.held, pressed, aside if plates == "bonded" else []]).astype(int)
    moved = np.where(np.isin(fixed, pressed), -down, 0.0)
    dry = apart.solve(np.zeros(apart.K.shape[0]), fixed, moved)
    wet = apart.solve(apart.loads[0], fixed, np.zeros(len(fixed)))
    V0 = apart.area(0, 0 * dry)
    P = float(brentq(lambda P: apart.area(0, dry + P * wet) - V0, 0, 1e5, xtol=1e-9))
    u = dry + P * wet
    force = -float((apart.K @ u - P * apart.loads[0])[pressed].sum())
    ours = Responses.of(build_system(slab(p, tool)))
    stepper = ExactPressure().on(ours)
    state = stepper.step(stepper.rest(), np.array([down]))
    assert state.numbers["cavity0.pressure"] == pytest.approx(P, rel=1e-9)
    assert state.numbers["tool.force"] == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize(
    ("squares", "order", "slope"),
    [(10, 1, 12758.9), (20, 1, 10760.1), (50, 1, 9832.3), (50, 2, 9446.8)],
)
def test_slopes_of_the_note(squares: int, order: int, slope: float) -> None:
    """An earlier study, cavity of 10 mm, plane strain."""
    changes = {"body.cells": squares, "body.element": ELEMENTS[order]}
    r = Responses.of(build_system(slab(COARSE, None, changes)))
    assert 1 / float(slopes(r, still(r))[0, 0]) == pytest.approx(slope, abs=0.06)


def test_a_bonded_needle_holds_its_own_node_alone() -> None:
    """Of a block that is its own mirror image that node does not move aside anyway."""
    p = set_up({"plates": "bonded"})
    scene = slab(p, "needle")
    assert [(pin.point, pin.components) for pin in scene.pins] == [((0.0, 0.0), (0,))]
    assert [s.facets for s in scene.supports] == ["bottom"]
