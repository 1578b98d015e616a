"""Explicit linear dynamics (paper 002, section V.B): Newmark with beta = 0, gamma = 1/2.

u' = u + h v + h^2/2 a, (M + h/2 C) a' = f' - K u' - C (v + h/2 a), v' = v + h/2 (a + a'). Lumped
masses and C = alpha M make that a division; all else is one solve with a matrix factorised once.
With `update` "lagged" C acts at the last half step alone, M a' = f' - K u' - C (v + h/2 a): masses
may then be lumped under any C without a solve, but the stable step is shorter.

Departures: lumping and the restriction of C to alpha M, one thing in the paper, are two switches:
of its "mass lumping" error most is the second. Prescribed unknowns keep all their coupling terms.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.linear_solvers.factor import factorise
from validate.fem.system import DampingTerms, MassName, System, damping_of, mass_of
from validate.parameters import quantity
from validate.solve.dynamic.linear import (
    DriveRates,
    Moving,
    MovingStepper,
    StartName,
    excitation,
    reactions,
)
from validate.solve.dynamic.newmark_rule import Rule
from validate.solve.handles import LINEAR_DYNAMICS, Handles, require_handled
from validate.solve.static.linear_solvers import Diagonal, Solver
from validate.solve.study_entries import (
    Rival,
    Stepping,
    StudyBody,
    SwingingBody,
    UpdateName,
    explicit_maps,
)
from validate.solve.types import Ending, State, Stepper

# Displacements of so many times the body's size say that a linear run has left all bounds.
_RUNAWAY = 100.0
_ROUNDING = 1e-12  # of the critical step


@dataclass(frozen=True)
class ExplicitLinear:
    """Settings. `a0`, `drive_rates` as in `Newmark`.

    A dt above the critical step is refused at the first step, or with `beyond_limit` "run" goes on
    until displacements are 100 times the body's size.
    """

    handles: ClassVar[Handles] = LINEAR_DYNAMICS

    dt: float = quantity(1e-4, "s", "time step")
    mass: MassName = quantity("lumped", "1", "mass matrix")
    damping_terms: DampingTerms = quantity("mass", "1", "alpha M + beta K, or alpha M alone")
    update: UpdateName = quantity(
        "printed", "1", "damping at the step's end, or half a step before"
    )
    a0: StartName = quantity("equilibrium", "1", "acceleration at t = 0: M^-1 f, or zero")
    drive_rates: DriveRates = quantity("difference", "1", "v and a of prescribed unknowns")
    beyond_limit: Literal["refuse", "run"] = quantity(
        "refuse", "1", "a step above the critical step"
    )

    @staticmethod
    def steppings() -> tuple[Stepping, ...]:
        """Both masses, damping in full or of the mass alone, as printed or lagged."""
        return (
            _stepping("explicit_consistent", "consistent", "full", "printed"),
            _stepping("explicit_consistent_lagged", "consistent", "full", "lagged"),
            _stepping("explicit_lumped", "lumped", "mass", "printed"),
            _stepping("explicit_lumped_lagged", "lumped", "full", "lagged"),
        )

    @staticmethod
    def candidates(asked: StudyBody) -> tuple[Rival, ...]:
        if not isinstance(asked, SwingingBody):
            return ()
        return (
            Rival("explicit, consistent mass", "explicit",
                   lambda dt: ExplicitLinear(dt, mass="consistent", damping_terms="full")),
            Rival("explicit, lumped, C = alpha M", "explicit", ExplicitLinear),
        )  # fmt: skip

    def __post_init__(self) -> None:
        Rule.of("average", self.dt)
        if self.drive_rates == "rule":
            raise SceneError(
                "an explicit step does not support drive rules; use drive_rates=difference"
            )

    @property
    def treatment(self) -> str:
        """Masses and damping in words, for messages about the limit."""
        C = "alpha M + beta K" if self.damping_terms == "full" else "alpha M"
        return f"{self.mass} mass, {self.update} C = {C}"

    def stable_step(self, system: System) -> float:
        """Return the critical step s, exact: 2/w for C in the matrix; (sqrt(c^2 + 4 w^2) - c)/w^2
        for lagged C with c = alpha + beta w^2; w is the highest frequency with the mass in use.

        Regions that are damped differently get their largest alpha and beta: a safe bound.
        """
        w = highest_frequency(system, self.mass)
        if self.update == "printed":
            return 2 / w
        c = float(system.scene.per_cell(lambda m: m.mass_damping).max())
        if self.damping_terms == "full":
            c += float(system.scene.per_cell(lambda m: m.stiffness_damping).max()) * w**2
        # The same as the formula above, without its cancellation under heavy damping.
        return float(4 / (np.sqrt(c**2 + 4 * w**2) + c))

    def prepare(self, system: System) -> Stepper:
        """Raise `SceneError` for a law at large strain, cavities, or missing densities."""
        require_handled(system.scene, self)
        free, terms = system.free, self.damping_terms
        matrices = mass_of(system, self.mass), damping_of(system, self.mass, terms), system.K
        M, C, K = (sparse.csr_array(X[free][:, free]) for X in matrices)
        J = M if self.update == "lagged" else sparse.csr_array(M + self.dt / 2 * C)
        mesh = system.scene.mesh
        rule = Rule.of("average", self.dt)
        # A division where J is diagonal, else its factorisation
        apart = J - sparse.diags_array(J.diagonal())
        solver = (
            Diagonal(1 / J.diagonal())
            if apart.count_nonzero() == 0
            else factorise(J, free // mesh.dimension, mesh.nodes)
        )
        return ExplicitStepper(
            system,
            reactions(system, self.mass, terms),
            excitation(system, rule, self.mass, self.drive_rates, terms, self.a0),
            self,
            C,
            K,
            solver,
            self.stable_step(system),
            float(np.ptp(mesh.nodes, axis=0).max()),
        )


def highest_frequency(system: System, mass: MassName) -> float:
    """Largest angular frequency 1/s of the free unknowns (Lanczos)."""
    free = system.free
    K = system.K[free][:, free].tocsc()
    start = np.random.default_rng(0).standard_normal(len(free))
    if mass == "lumped":
        root = sparse.diags_array(1 / np.sqrt(system.masses[free]))
        square = eigsh(root @ K @ root, k=1, which="LA", v0=start, return_eigenvectors=False)
    else:
        M = system.M[free][:, free].tocsc()
        square = eigsh(K, k=1, M=M, which="LA", v0=start, return_eigenvectors=False)
    return float(np.sqrt(square[0]))


@dataclass(frozen=True)
class ExplicitStepper(MovingStepper):
    """`C`, `K` (m, m) over the free unknowns, `solver` of the accelerations' matrix, `limit` s,
    `size` m of the body."""

    settings: ExplicitLinear
    C: sparse.csr_array
    K: sparse.csr_array
    solver: Solver
    limit: float
    size: float

    def step(self, state: State, inputs: Floats) -> State:
        """Return the state at the end of a step; `inputs` are those there, loads included."""
        last: Moving = state.inner
        h, k = self.settings.dt, state.k + 1
        f, moved, a = self.excitation.step(k, inputs, last.inputs, last.a)
        half = last.v + h / 2 * a
        u = last.u + h * half
        a = self.solver.solve(f - self.K @ u - self.C @ half)
        v = half + h / 2 * a
        numbers = self.forces(u, v, a, moved)
        return State(k, Moving(u, v, a, moved), self._failure(k, u), numbers=numbers)

    def _failure(self, k: int, u: Floats) -> tuple[Ending, str] | None:
        times = self.settings.dt / self.limit
        over = f"dt {self.settings.dt:.3g} s is {times:.4g} times the critical step "
        over += f"{self.limit:.4g} s ({self.settings.treatment})"
        if k == 1 and times > 1 + _ROUNDING and self.settings.beyond_limit == "refuse":
            return "refused", f"{over}; take a smaller dt, or beyond_limit=run to see it diverge"
        if not float(np.abs(u).max()) <= _RUNAWAY * self.size:
            return "diverged", f"step {k}: displacements over {_RUNAWAY:g} body sizes; {over}"
        return None


def _stepping(name: str, mass: MassName, terms: DampingTerms, update: UpdateName) -> Stepping:
    settings = ExplicitLinear(1.0, mass, terms, update)
    return Stepping(
        name,
        settings.treatment,
        mass,
        lambda r: explicit_maps(1.0, r.c(terms), r.x**2, update),
        settings.stable_step,
        explicit=True,
        conserves=True,
        order=1.0 if update == "lagged" else 2.0,  # of a damped mode
    )
