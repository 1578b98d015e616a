"""Converged answers of the random bodies by NGSolve, with no line of ours.

Displacement of order p and a discontinuous pressure of order p - 1, on hexahedra graded towards the
edges of the held and loaded ends. A cylinder is solved in its section: axisymmetric, or as the
first Fourier mode around the axis where it bends.

neo-Hooke: W = mu/2 (J^(-2/3) I1 - 3) + U(J), U = kappa/4 (J^2 - 1 - 2 ln J), in the form
p J - U*(p) of U, with J = q + sqrt(q^2 + 1) and q = p/kappa at its maximum.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
from bodies_drawn import Drawn, E
from ngsolve.meshes import MakeStructured2DMesh, MakeStructured3DMesh

STEPS, ITERATIONS, TOLERANCE = (2, 4, 8), 8, 1e-8
Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class Answer:
    """The force N on the moved end, or the displacements m of the markers, flat."""

    values: list[float]
    cells: int
    unknowns: int
    solution: Any


def answer(body: Drawn, order: int, layers: int, start: Any = None) -> Answer:
    """The answer in elements of this order; Newton starts from another solution, if one is given.

    `layers`: of cells towards every edge, each 0.15 times as thick as the one before.
    """
    if body.kind == "cylinder":
        if body.support == "bent":
            return _bent_round(body, order, layers)
        return _round(body, order, layers, start)
    return _block(body, order, layers, start)


def _graded(length: float, unit: float, layers: int, *, both: bool) -> Array:
    """Points from 0 to `length`, denser towards `length`; with `both` also towards 0."""
    if both:
        half = _graded(length / 2, unit, layers, both=False)
        return np.concatenate([length / 2 - half[::-1], length / 2 + half[1:]])
    ends = [0.5 * unit * 0.15**k for k in range(layers)]
    ends = [d for d in ends if d < 0.8 * length]
    inside = length - ends[0]
    count = max(1, round(inside / (1.2 * unit)))
    evenly, thin = np.linspace(0, inside, count + 1), length - np.array(ends[1:])
    return np.concatenate([evenly, thin, [length]])


def _laid(points: Array) -> Callable[[float], float]:
    """From the unit interval, evenly divided, to `points`."""
    n = len(points) - 1
    return lambda s: float(points[round(s * n)])


def _law(body: Drawn, F: Any, p: Any, J: Any, I1: Any, eps2: Any, trace: Any) -> Any:
    mu, lam = E / 2 / (1 + body.nu), E * body.nu / (1 + body.nu) / (1 - 2 * body.nu)
    if body.law == "linear":
        return mu * eps2 + p * trace - p * p / (2 * lam)
    kappa = lam + 2 * mu / 3
    q = p / kappa
    most = q + ng.sqrt(q * q + 1)
    conjugate = kappa * (q * most - (most * most - 1 - 2 * ng.log(most)) / 4)
    return mu / 2 * (J ** (-2 / 3) * I1 - 3) + p * J - conjugate


def _newton(fes: Any, form: Any, moved: Any, body: Drawn, load: Any) -> Any:
    """The solution; `moved` is a vector of the motion of the end (zero under a traction)."""
    for steps in (1,) if body.law == "linear" else STEPS:
        u = _stepped(fes, form, moved, body, load, steps)
        if u is not None:
            return u
    raise RuntimeError(f"seed {body.seed}: Newton did not converge in {STEPS[-1]} load steps")


def _continued(fes: Any, form: Any, moved: Any, body: Drawn, load: Any, start: Any) -> Any:
    """The solution from one on a coarser mesh under the same load; None without convergence."""
    u = ng.GridFunction(fes)
    for mine, theirs in zip(u.components, start.components, strict=True):
        mine.Set(theirs)
    fixed = ~fes.FreeDofs()
    for i in np.flatnonzero(np.array([fixed[j] for j in range(fes.ndof)])):
        u.vec[int(i)] = moved[int(i)]
    still = u.vec.CreateVector()
    still[:] = 0.0
    return _stepped(fes, form, still, body, load, 1, u)


def _stepped(
    fes: Any, form: Any, moved: Any, body: Drawn, load: Any, steps: int, start: Any = None
) -> Any:
    """The solution after so many load steps; None where Newton does not converge."""
    u = start or ng.GridFunction(fes)
    residual, du, part = (u.vec.CreateVector() for _ in range(3))
    for step in range(1, steps + 1):
        load.Set(step / steps)
        for i in range(ITERATIONS):
            form.Apply(u.vec, residual)
            form.AssembleLinearization(u.vec)
            inverse = form.mat.Inverse(fes.FreeDofs(True), inverse="sparsecholesky")
            part.data = residual
            part.data += form.harmonic_extension_trans * residual
            part *= -1.0
            du[:] = 0.0
            if i == 0:
                du.data = (1 / steps) * moved
                part.data -= form.mat * du
            du.data += inverse * part
            du.data += form.harmonic_extension * du
            du.data -= form.inner_solve * residual
            u.vec.data += du
            size = float(np.abs(np.array(du)).max() / np.abs(np.array(u.vec)).max())
            if not np.isfinite(size):
                return None
            if size < TOLERANCE or (body.law == "linear" and i == 1):
                break
        else:
            return None
    return u


def _reaction(form: Any, u: Any, unit: Any) -> float:
    force = u.vec.CreateVector()
    form.Apply(u.vec, force)
    return float(ng.InnerProduct(force, unit))


# --- blocks, pads, cantilevers --------------------------------------------------------------------


def _block(body: Drawn, order: int, layers: int, start: Any) -> Answer:
    size, axis, across = body.size, body.axis, body.across
    halved = [c != axis and not (body.support == "bent" and c == across) for c in range(3)]
    unit = min(size)
    points = []
    for c in range(3):
        if halved[c]:
            points.append(size[c] / 2 + _graded(size[c] / 2, unit, layers, both=False))
        else:
            points.append(_graded(size[c], unit, layers, both=True))
    laid = [_laid(x) for x in points]
    mesh = MakeStructured3DMesh(
        hexes=True, nx=len(points[0]) - 1, ny=len(points[1]) - 1, nz=len(points[2]) - 1,
        mapping=lambda x, y, z: (laid[0](x), laid[1](y), laid[2](z)),
    )  # fmt: skip
    sides = {(0, 0): "back", (0, 1): "front", (1, 0): "left", (1, 1): "right",
             (2, 0): "bottom", (2, 1): "top"}  # fmt: skip
    low, high = sides[axis, 0], sides[axis, 1]
    fixed: list[list[str]] = [[], [], []]
    for c in range(3):
        if halved[c]:
            fixed[c].append(sides[c, 0])
        if body.support != "slipping" or c == axis:
            fixed[c].append(low)
        if body.moves:
            fixed[c].append(high)
    spaces = [ng.H1(mesh, order=order, dirichlet="|".join(names)) for names in fixed]
    fes = ng.FESpace([*spaces, ng.L2(mesh, order=order - 1, lowest_order_wb=False)])
    ux, uy, uz, p = fes.TrialFunction()
    H = ng.CF((ng.grad(ux), ng.grad(uy), ng.grad(uz)), dims=(3, 3))
    F = H + ng.Id(3)
    eps = 0.5 * (H + H.trans)
    load = ng.Parameter(1.0)
    W = _law(body, F, p, ng.Det(F), ng.InnerProduct(F, F), ng.InnerProduct(eps, eps), ng.Trace(H))
    form = ng.BilinearForm(fes, symmetric=True, condense=True)
    form += ng.Variation(W.Compile() * ng.dx)
    if not body.moves:
        pulled = (ux, uy, uz)[body.along]
        form += ng.Variation(-load * body.amount * pulled * ng.ds(high))
    unit_motion = ng.GridFunction(fes)
    unit_motion.components[body.along].Set(1.0, definedon=mesh.Boundaries(high))
    moved = unit_motion.vec.CreateVector()
    moved.data = (body.amount if body.moves else 0.0) * unit_motion.vec
    u = _continued(fes, form, moved, body, load, start) if start else None
    u = u or _newton(fes, form, moved, body, load)
    if body.moves:
        force = 2 ** sum(halved) * _reaction(form, u, unit_motion.vec)
        return Answer([force], mesh.ne, fes.ndof, u)
    found = []
    for point in body.markers:
        at, sign = list(point), [1.0, 1.0, 1.0]
        for c in range(3):
            if halved[c] and at[c] < size[c] / 2:
                at[c], sign[c] = size[c] - at[c], -1.0
        there = mesh(*at)
        found += [s * float(u.components[c](there)) for c, s in enumerate(sign)]
    return Answer(found, mesh.ne, fes.ndof, u)


# --- cylinders ------------------------------------------------------------------------------------


def _section(body: Drawn, layers: int) -> Any:
    """x is the radius, y the height; left is the axis of the cylinder."""
    radius, height = body.size[0] / 2, body.size[2]
    unit = min(2 * radius, height)
    r = _laid(rs := _graded(radius, unit, layers, both=False))
    z = _laid(zs := _graded(height, unit, layers, both=True))
    return MakeStructured2DMesh(
        quads=True, nx=len(rs) - 1, ny=len(zs) - 1, mapping=lambda x, y: (r(x), z(y))
    )


def _round(body: Drawn, order: int, layers: int, start: Any) -> Answer:
    mesh = _section(body, layers)
    ends = "bottom|top" if body.moves else "bottom"
    sideways = "left|top" if body.support == "slipping" else f"left|{ends}"
    fes = ng.FESpace([
        ng.H1(mesh, order=order, dirichlet=sideways), ng.H1(mesh, order=order, dirichlet=ends),
        ng.L2(mesh, order=order - 1),
    ])  # fmt: skip
    ur, uz, p = fes.TrialFunction()
    r = ng.x
    gr, gz, hoop = ng.grad(ur), ng.grad(uz), ur / r
    plane = (1 + gr[0]) * (1 + gz[1]) - gr[1] * gz[0]
    J = (1 + hoop) * plane
    I1 = (1 + gr[0]) ** 2 + gr[1] ** 2 + gz[0] ** 2 + (1 + gz[1]) ** 2 + (1 + hoop) ** 2
    eps2 = gr[0] ** 2 + gz[1] ** 2 + hoop**2 + 0.5 * (gr[1] + gz[0]) ** 2
    load = ng.Parameter(1.0)
    W = _law(body, None, p, J, I1, eps2, gr[0] + gz[1] + hoop)
    form = ng.BilinearForm(fes, symmetric=True, condense=True)
    form += ng.Variation((2 * np.pi * r * W).Compile() * ng.dx(bonus_intorder=2))
    if not body.moves:
        form += ng.Variation(-load * body.amount * 2 * np.pi * r * uz * ng.ds("top"))
    unit = ng.GridFunction(fes)
    unit.components[1].Set(1.0, definedon=mesh.Boundaries("top"))
    moved = unit.vec.CreateVector()
    moved.data = (body.amount if body.moves else 0.0) * unit.vec
    u = _continued(fes, form, moved, body, load, start) if start else None
    u = u or _newton(fes, form, moved, body, load)
    if body.moves:
        return Answer([_reaction(form, u, unit.vec)], mesh.ne, fes.ndof, u)
    found: list[float] = []
    for x, y, z in body.markers:
        r_at = float(np.hypot(x, y))
        there = mesh(r_at, z)
        out, up = (float(u.components[c](there)) for c in (0, 1))
        found += [out * x / r_at, out * y / r_at, up]
    return Answer(found, mesh.ne, fes.ndof, u)


def _bent_round(body: Drawn, order: int, layers: int) -> Answer:
    """u_r = U cos, u_theta = (S - U) sin, u_z = W cos of the angle; S and W vanish on the axis."""
    mesh = _section(body, layers)
    fes = ng.FESpace([
        ng.H1(mesh, order=order, dirichlet="bottom"),
        ng.H1(mesh, order=order, dirichlet="bottom|left"),
        ng.H1(mesh, order=order, dirichlet="bottom|left"),
        ng.L2(mesh, order=order - 1),
    ])  # fmt: skip
    U, S, W, p = fes.TrialFunction()
    r = ng.x
    gU, gS, gW = ng.grad(U), ng.grad(S), ng.grad(W)
    hoop = S / r
    shear_rt = 0.5 * (gS[0] - gU[0] - S / r)
    shear_zt = 0.5 * (gS[1] - gU[1] - W / r)
    shear_rz = 0.5 * (gU[1] + gW[0])
    eps2 = gU[0] ** 2 + hoop**2 + gW[1] ** 2
    eps2 += 2 * (shear_rt**2 + shear_zt**2 + shear_rz**2)
    energy = _law(body, None, p, None, None, eps2, gU[0] + hoop + gW[1])
    load = ng.Parameter(1.0)
    form = ng.BilinearForm(fes, symmetric=True, condense=True)
    form += ng.Variation((np.pi * r * energy).Compile() * ng.dx(bonus_intorder=2))
    form += ng.Variation(-load * body.amount * np.pi * r * (2 * U - S) * ng.ds("top"))
    moved = ng.GridFunction(fes).vec
    u = _newton(fes, form, moved, body, load)
    found: list[float] = []
    for x, y, z in body.markers:
        r_at = float(np.hypot(x, y))
        c, s = x / r_at, y / r_at
        there = mesh(r_at, z)
        out, sheared, up = (float(u.components[k](there)) for k in range(3))
        turned = sheared - out
        found += [out * c * c - turned * s * s, (out + turned) * s * c, up * c]
    return Answer(found, mesh.ne, fes.ndof, u)
