"""One step of Newmark's family over the free unknowns, as a state equation of the displacement.

Every rule here reads u' = u + h v + h^2 (b0 a + b1 a'), v' = v + h (g0 a + g1 a'), with balance

    (1 - am) M a' + am M a + (1 - af) (C v' + K u') + af (C v + K u) = (1 - af) f' + af f

so that u' = J^-1 (A u + L v + M_a a + f_w) as in paper 001, eqs 8-14 (where am = af = 0).

Departures: the paper has average acceleration only. Backward Euler (first order, L-stable) and
generalised alpha (Chung & Hulbert 1993; second order, spectral radius rho_inf at high frequency)
do not ring as it does. Prescribed unknowns enter as forces on the free ones (`Excitation`).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Self

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.system import DampingTerms, MassName, System, damping_of, mass_of
from validate.solve.static.linear_solvers import TOLERANCE, Solver, SolverName, solver_of

RuleName = Literal["average", "backward_euler", "generalised_alpha"]


@dataclass(frozen=True)
class Rule:
    """Step h s, the weights of the old and new acceleration in u' and v', and the alphas."""

    h: float
    b0: float
    b1: float
    g0: float
    g1: float
    am: float = 0.0
    af: float = 0.0

    def rates(self, u_new: Floats, u: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
        """v', a' that lead to u' (paper 001, eqs 8 and 9, solved for them)."""
        h = self.h
        a_new = (u_new - u - h * v - (h * h * self.b0) * a) / (h * h * self.b1)
        return v + (h * self.g0) * a + (h * self.g1) * a_new, a_new

    def weighted(self, new: Floats, old: Floats) -> Floats:
        """Return a force, u or v at the instant of the balance: `new` itself unless af > 0."""
        return new if self.af == 0 else (1 - self.af) * new + self.af * old

    def weighted_a(self, new: Floats, old: Floats) -> Floats:
        """Return an acceleration at the instant of the balance: `new` itself unless am != 0."""
        return new if self.am == 0 else (1 - self.am) * new + self.am * old

    def maps(self, c: Floats, k: Floats, *, misprinted: bool = False) -> Floats:
        """Return the maps (r, 3, 3) of (q, q', q'') over a step of q'' + c q' + k q = 0; c 1/s,
        k 1/s^2 (r,). `misprinted`: with the update of u that paper 002 prints."""
        one, zero = np.ones_like(c), np.zeros_like(c)
        q = np.stack(per_mode(self, c, k)[:3], axis=-1)
        v_old = np.stack([zero, one, zero], axis=-1)
        a_old = np.stack([zero, zero, one], axis=-1)
        q_old = np.stack([one, zero, zero], axis=-1)
        v, a = self.rates(q, q_old, v_old, a_old)
        if misprinted:
            q = q + self.h * (v - v_old)
        return np.stack([q, v, a], axis=1)

    @classmethod
    def of(cls, name: RuleName, dt: float, rho_inf: float = 0.8) -> Self:
        """Return the rule by name; raises `SceneError` for dt <= 0 or too small, or rho_inf outside
        0..1."""
        if not (np.isfinite(dt) and dt > 0):
            raise SceneError(f"time step {dt:g} s: expected a positive number")
        if dt * dt < np.finfo(float).tiny:  # the step's matrix divides by it
            raise SceneError(
                f"time step {dt:g} s: its square underflows in double precision; take at least "
                "1e-150"
            )
        if not 0 <= rho_inf <= 1:
            raise SceneError(f"rho_inf = {rho_inf:g}: the spectral radius must lie in 0..1")
        if name == "average":
            return cls(dt, 0.25, 0.25, 0.5, 0.5)
        if name == "backward_euler":
            return cls(dt, 0.0, 1.0, 0.0, 1.0)
        am, af = (2 * rho_inf - 1) / (rho_inf + 1), rho_inf / (rho_inf + 1)
        beta, gamma = (1 - am + af) ** 2 / 4, 0.5 - am + af
        return cls(dt, 0.5 - beta, beta, 1 - gamma, gamma, am, af)


@dataclass(frozen=True)
class Propagation:
    """The step of a rule; all vectors (m,) and matrices (m, m) are over the `free` unknowns."""

    rule: Rule
    free: Ints
    M: sparse.csr_array
    C: sparse.csr_array
    K: sparse.csr_array
    solver: Solver

    def predict(self, u: Floats, v: Floats, a: Floats, f: Floats) -> Floats:
        """u' (m,) m of the next step under forces f (m,) N: one solve (paper 001, eq 11).

        f acts at the instant of the balance: f' of the step's end, except that generalised alpha
        takes `rule.weighted(f', f)`.
        """
        return self.solver.solve(self.history(u, v, a) + f)

    def history(self, u: Floats, v: Floats, a: Floats) -> Floats:
        """Return a u + L v + M_a a (m,) N, by one product with M and one with C."""
        (mu, mv, ma), (cu, cv, ca), ku = of_history(self.rule)
        damped = cu * u + cv * v if ca == 0 else cu * u + cv * v + ca * a
        total = self.M @ (mu * u + mv * v + ma * a) + self.C @ damped
        return np.asarray(total if ku == 0 else total + self.K @ (ku * u))

    def rates(self, u_new: Floats, u: Floats, v: Floats, a: Floats) -> tuple[Floats, Floats]:
        """v', a' (m,) that belong to u' whatever made it: a solution or a filter's estimate."""
        return self.rule.rates(u_new, u, v, a)

    def transition(self) -> Floats:
        """J^-1 A (m, m), dense: what paper 001 takes as the filter's transition."""
        return self.solver.solve(self.A.toarray())

    @cached_property
    def A(self) -> sparse.csr_array:
        """Paper 001, eq 12."""
        (mu, _, _), (cu, _, _), ku = of_history(self.rule)
        return sparse.csr_array(mu * self.M + cu * self.C + ku * self.K)

    @cached_property
    def J(self) -> sparse.csr_array:
        """Paper 001, eq 13."""
        return _system_matrix(self.rule, self.M, self.C, self.K)


def propagation(
    system: System,
    rule: Rule,
    mass: MassName = "consistent",
    solver: SolverName = "prefactored",
    terms: DampingTerms = "full",
    tolerance: float = TOLERANCE,
) -> Propagation:
    """Return the step's matrices over the free unknowns, with J factorised or as the solver takes
    it.

    Raises `SceneError` for missing densities, or a J that is not positive definite.
    """
    free = system.free
    matrices = mass_of(system, mass), damping_of(system, mass, terms), system.K
    M, C, K = (sparse.csr_array(X[free][:, free]) for X in matrices)
    J, mesh = _system_matrix(rule, M, C, K), system.scene.mesh
    ready = solver_of(solver, J, free // mesh.dimension, mesh.nodes, tolerance)
    return Propagation(rule, free, M, C, K, ready)


def _system_matrix(
    rule: Rule, M: sparse.csr_array, C: sparse.csr_array, K: sparse.csr_array
) -> sparse.csr_array:
    m, c, k = of_system(rule)
    return sparse.csr_array(m * M + c * C + k * K)


def of_system(rule: Rule) -> tuple[float, float, float]:
    """Weights of M, C and K in J (paper 001, eq 13)."""
    m = (1 - rule.am) / (rule.h**2 * rule.b1)
    return m, (1 - rule.af) * rule.g1 / (rule.h * rule.b1), 1 - rule.af


def require_start(system: System, rule: Rule, mass: MassName, terms: DampingTerms = "full") -> None:
    """Refuse a0 = M^-1 f with generalised alpha where damping acts within the step.

    The rule then carries the vanished a0 on for 1/(1 - rho_inf) steps, which leaves an offset in u:
    10 % of the static displacement of paper 001's block at rho_inf = .8, five times it at 0.
    Raises `SceneError` with the ratio, from below, of the step to the fastest decay.
    """
    free = system.free
    C = damping_of(system, mass, terms)
    fastest = (C.diagonal()[free] / mass_of(system, mass).diagonal()[free]).max()
    if rule.am != rule.af and fastest * rule.h > 1:
        raise SceneError(
            "generalised alpha from a0 = equilibrium: damping acts within "
            f"1/{fastest * rule.h:.3g} of a step and would leave an offset; use a0 = zero, a "
            "smaller dt or rule average"
        )


def per_mode(rule: Rule, c: Floats, k: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Factors (m,) of q, q', q'' and force in the next q, for q'' + c q' + k q = f per mode."""
    masses, dampings, ku = of_history(rule)
    h, w = rule.h, 1 - rule.af
    J = (1 - rule.am) / (h * h * rule.b1) + w * rule.g1 / (h * rule.b1) * c + w * k
    q, v, a = ((m + d * c) / J for m, d in zip(masses, dampings, strict=True))
    return q + ku * k / J, v, a, 1 / J


def of_history(r: Rule) -> tuple[tuple[float, float, float], tuple[float, float, float], float]:
    """Weights of M and of C in A, L, M_a, and of K in A (paper 001, eqs 12 and 14): of u, v, a."""
    c, d = 1 / (r.h**2 * r.b1), r.g1 / (r.h * r.b1)
    m, w = 1 - r.am, 1 - r.af
    masses = (m * c, m * c * r.h, m * r.b0 / r.b1 - r.am)
    dampings = (w * d, w * (r.h * d - 1) - r.af, w * r.h * (r.h * r.b0 * d - r.g0))
    return masses, dampings, -r.af
