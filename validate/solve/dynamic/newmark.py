"""Linear dynamics by Newmark's family: M a + C v + K u = f, one solve a step (paper 001).

u' = J^-1 (A u + L v + M a + f'), then v' and a' by the rule (paper 001, eqs 8-14); J is factorised
once. The paper solves anew at every step by Gaussian elimination: that is a named solver here.

Paper 002 prints the same rule with u' = u + h v' + h^2/4 (a + a'), v' for v: a misprint, which is
an update here to show that it is unstable from w h = 1.155 (undamped; 1.29 at xi .1, 1.55 at .3).

Departures: average acceleration is not L-stable: with a0 = M^-1 f velocities and accelerations
ring for ever. Show none of them; take backward Euler or generalised alpha, or ramp the load.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import DampingTerms, MassName, System
from validate.parameters import quantity
from validate.solve.dynamic.linear import (
    DriveRates,
    Moving,
    MovingStepper,
    StartName,
    excitation,
    reactions,
)
from validate.solve.dynamic.newmark_rule import (
    Propagation,
    Rule,
    RuleName,
    propagation,
    require_start,
)
from validate.solve.explicit.linear import highest_frequency
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled
from validate.solve.static.linear_solvers import TOLERANCE, Iterative, Solved, SolverName
from validate.solve.study_entries import (
    LOOSE,
    Rates,
    Rival,
    Rung,
    Stepping,
    StudyBody,
    SwingingBody,
    implicit_maps,
)
from validate.solve.types import Ending, Scheme, State, Stepper

# --- Paper 002's Newmark update as it is printed, and the step up to which it is stable.


def misprinted_maps(r: Rates) -> Floats:
    """Return the step map of the printed update."""
    return Rule.of("average", 1.0).maps(r.c("full"), r.x**2, misprinted=True)


def misprint_limit(w: float, c: float) -> float:
    """Largest stable step s of the misprinted update for a mode of w 1/s, damped by c 1/s.

    Jury's criterion on its cubic leaves 3 w^4 h^3 - c w^2 h^2 - (4 w^2 + 2 c^2) h - 4 c <= 0, which
    is w h = 2/sqrt(3) undamped.
    """
    y = c / w  # of x = w h
    roots = np.roots([3.0, -y, -(4 + 2 * y * y), -4 * y])
    return float(roots.real.max()) / w


def misprint_step(system: System) -> float:
    """Largest stable step s, by the highest frequency of consistent masses."""
    w = highest_frequency(system, "consistent")
    m = system.scene.material
    return misprint_limit(w, m.mass_damping + m.stiffness_damping * w * w)


# -------------------------------------------------------------------------------------------------

UpdateName = Literal["newmark", "misprinted"]


@dataclass(frozen=True)
class Newmark:
    """Settings: one of three rules, one linear solve a step.

    `a0`: "equilibrium" starts from M a0 = f with the first step's loads, as for a load that is
    switched on at t = 0; "zero" starts without them (where damping rules, the first step of average
    acceleration is then half as long; paper 001 leaves it open). `drive_rates`: velocities and
    accelerations of prescribed unknowns by backward differences of the drives, or by the rule,
    which makes average acceleration ring with growing amplitude on a ramp.
    """

    handles: ClassVar[Handles] = LINEAR_DYNAMICS

    dt: float = quantity(0.002, "s", "time step")
    rule: RuleName = quantity("average", "1", "how v and a are derived from u within a step")
    a0: StartName = quantity("equilibrium", "1", "acceleration at t = 0: M^-1 f, or zero")
    solver: SolverName = quantity("prefactored", "1", "solver of the linear system of a step")
    mass: MassName = quantity("consistent", "1", "mass matrix")
    rho_inf: float = quantity(0.8, "1", "spectral radius at infinity; generalised alpha alone")
    drive_rates: DriveRates = quantity("difference", "1", "v and a of prescribed unknowns")
    damping_terms: DampingTerms = quantity("full", "1", "alpha M + beta K, or alpha M alone")
    update: UpdateName = quantity("newmark", "1", "of u: Newmark's, or as paper 002 prints it")
    tolerance: float = quantity(
        TOLERANCE, "1", "iterative solvers: residual relative to the right-hand side"
    )

    @staticmethod
    def steppings() -> tuple[Stepping, ...]:
        """Return the rules, average acceleration with lumped masses, too, and paper 002's printed
        one."""
        average = "average acceleration, {} mass"
        return (
            Stepping(
                "newmark_average", average.format("consistent"), "consistent",
                implicit_maps("average"), conserves=True, rounding=LOOSE,
            ),
            Stepping(
                "newmark_lumped", average.format("lumped"), "lumped", implicit_maps("average"),
                conserves=True, rounding=LOOSE,
            ),
            Stepping(
                "backward_euler", "backward Euler", "consistent", implicit_maps("backward_euler"),
                rounding=LOOSE, order=1.0,
            ),
            Stepping(
                "generalised_alpha", "generalised alpha, rho_inf .8", "consistent",
                implicit_maps("generalised_alpha"), rounding=LOOSE,
            ),
            Stepping(
                "newmark_misprinted", "paper 002's update as printed", "consistent",
                misprinted_maps, misprint_step, order=1.0,
            ),
        )  # fmt: skip

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if not isinstance(asked, SwingingBody):
            return ()
        prefactored: Rung = "prefactored"
        return (
            Rival("implicit, prefactored", prefactored, _with()),
            Rival("backward Euler, prefactored", prefactored, _with(rule="backward_euler"),
                   order=1.0),
            Rival("generalised alpha, prefactored", prefactored,
                   _with(rule="generalised_alpha", a0="zero")),
            Rival("implicit, dense inverse", prefactored, _with(solver="dense_inverse"),
                   finest=asked.medium),
            Rival("implicit, lumped mass", prefactored, _with(mass="lumped")),
            Rival("implicit, conjugate gradients", prefactored, _with(solver="cg")),
            Rival("implicit, Gauss-Seidel", prefactored, _with(solver="gauss_seidel")),
            Rival("implicit, sparse LU every step", prefactored, _with(solver="sparse_lu"),
                   finest=asked.small),
            Rival("implicit, Gaussian elimination every step", prefactored,
                   _with(solver="gaussian_elimination"), finest=asked.small),
        )  # fmt: skip

    def __post_init__(self) -> None:
        Rule.of(self.rule, self.dt, self.rho_inf)
        if self.update == "misprinted" and self.rule != "average":
            raise SceneError(
                "the misprinted update belongs to the average rule of paper 002, "
                f"not to {self.rule}"
            )
        if not 0 < self.tolerance < 1:
            raise SceneError(
                f"tolerance {self.tolerance:g} of the residual: expected a number in 0..1"
            )

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for a law at large strain, cavities, or missing densities."""
        require_handled(system.scene, self)
        rule = Rule.of(self.rule, self.dt, self.rho_inf)
        terms = self.damping_terms
        if self.a0 == "equilibrium" and system.scene.loads:
            require_start(system, rule, self.mass, terms)
        return NewmarkStepper(
            system,
            reactions(system, self.mass, terms),
            excitation(system, rule, self.mass, self.drive_rates, terms, self.a0),
            propagation(system, rule, self.mass, self.solver, terms, self.tolerance),
            self.update == "misprinted",
        )


@dataclass(frozen=True)
class NewmarkStepper(MovingStepper):
    propagation: Propagation
    misprinted: bool = False

    def step(self, state: State, inputs: Floats) -> State:
        """Return the state at the end of a step; `inputs` are those there, loads included."""
        last: Moving = state.inner
        u, v, k = last.u, last.v, state.k + 1
        f, moved, a = self.excitation.step(k, inputs, last.inputs, last.a)
        b, solver = self.propagation.history(u, v, a) + f, self.propagation.solver
        if isinstance(solver, Iterative):
            solved = solver.solve_from(b, u)
        else:
            solved = Solved(solver.solve(b), 0, True)
        u_new = solved.x
        v_new, a_new = self.propagation.rates(u_new, u, v, a)
        if self.misprinted:
            u_new = u_new + self.propagation.rule.h * (v_new - v)
        numbers = self.forces(u_new, v_new, a_new, moved)
        new = Moving(u_new, v_new, a_new, moved)
        failure: tuple[Ending, str] | None = None
        if not np.isfinite(new.a.sum()):
            failure = "diverged", f"accelerations are not finite at step {k}"
        elif not solved.converged:
            why = f"{solved.iterations} iterations leave the residual above the tolerance"
            failure = "not_converged", f"step {k}: {why}"
        return State(k, new, failure, solved.iterations, numbers)


def _with(**settings: Any) -> Callable[[float], Scheme]:
    return lambda dt: Newmark(dt, **settings)
