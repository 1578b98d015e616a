"""Figures of paper 002 for the block and the needle, and what both benchmarks have in common.

The paper prints few numbers; its figures are curves. Each claim is turned into one number of ours.
"""

from validate.compare.published import Figure, Values
from validate.scene.material import Material
from validate.solve.dynamic.newmark_rule import Rule

from .body import MP1, MP2, SPEED, STEP, STOP, needle_block

CURVE = "a curve without numbers: the report draws ours"


def material(name: str, ours: Material, theirs: tuple[float, ...], place: str) -> tuple[Figure,
                                                                               ...]:  # fmt: skip
    """The five numbers of a table: E Pa, nu, density kg/m^3, Rayleigh's alpha 1/s and beta s."""
    E, nu, rho, alpha, beta = theirs
    assert ours.rho is not None
    return (
        Figure.of_setup(f"{name}: Young's modulus", E, ours.E, "Pa", place),
        Figure.of_setup(f"{name}: Poisson ratio", nu, ours.nu, "1", place),
        Figure.of_setup(f"{name}: density", rho, ours.rho, "kg/m^3", place),
        Figure.of_setup(f"{name}: Rayleigh damping alpha", alpha, ours.mass_damping, "1/s", place),
        Figure.of_setup(f"{name}: Rayleigh damping beta", beta, ours.stiffness_damping, "s", place),
    )


def _trivial(values: Values) -> str:
    part = values["told"]["explicit.over.lumped"]
    return f"but this is trivial: the explicit part is {part:.2g} of the other"


def _whole(values: Values) -> str:
    return (
        "'in all cases': share of all compared times after the first step; while the load moves "
        f"the body it is {100 * values['told']['ordered']:.0f} %"
    )


def ways(body: str, moving: float, whole: float, restricted: float) -> tuple[Figure, ...]:
    """Claims of both benchmarks; the load moves the body until `moving` s, `whole` is our share of
    all times in the printed order, `restricted` our error of C = alpha M over lumping's."""
    section = "section VI.A"
    return (
        Figure(
            f"{body}: explicit best, lumped next, quasi-static worst", "told:ordered", 1.0, 0.1,
            "1", "reproduced",
            "share of the compared times while the load still moves the body, after the first "
            "step; later quasi-static crosses the lumped methods as the body swings", section,
            1.0, 0.1, f"0..{moving:g} s",
        ),
        Figure(
            f"{body}: the same order over the whole run", "told:ordered.all", 1.0, 0.1, "1",
            "reproduced" if whole >= 0.9 else "not reproduced", _whole, section, whole, 0.02,
        ),
        Figure(
            f"{body}: explicit lumped error over the sum of its two parts", "told:sum", 1.0, 0.1,
            "1", "reproduced", _trivial, section, 1.0, 0.1,
        ),
        Figure(
            f"{body}: error of C = αM over that of lumped masses, E_i at 2 s",
            "told:restriction.over.lumping", 0.0, None, "1", "not reproduced",
            "'the equations of continuum mechanics are modified' by lumping: most of that error is "
            "the damping beta K that its diagonal form drops", section, restricted, 0.05,
        ),
        Figure(
            f"{body}: distance to the static solution after 30 s", "told:static.end", 0.0, 1e-5,
            "1", "reproduced", "largest over the dynamic methods that finish, of the solution",
            section, scale=1.0,
        ),
    )  # fmt: skip


_AVERAGE = Rule.of("average", 1.0)
_SIDE = float(needle_block(2).mesh.nodes.max())
_STATED = (
    Figure.uncompared("Fig. 1: symmetric difference of two shapes", None, "1",
                      "section III.B, Fig. 1",
                      "a sketch; E_s is exact, and 'Deformed shapes' draws the areas it counts"),
    Figure.uncompared("Fig. 2: block and needle", None, "1", "section IV.A, Fig. 2",
                      "a figure without numbers: 'Deformed shapes' draws ours"),
    *material("MP1", MP1, (200.0, 0.47, 2000.0, 1.0, 0.1), "section IV.A, Table 1"),
    *material("MP2", MP2, (60e3, 0.495, 1140.0, 1.0, 0.1), "section IV.A, Table 2"),
    Figure.of_setup("height and width of the block", 1.0, _SIDE, "m",
                    "section IV.A, Tables 1 and 2"),
    Figure.of_setup("speed of the needle", 0.08, SPEED, "m/s", "section IV.A"),
    Figure.of_setup("time for which it moves", 2.0, STOP, "s", "section IV.A"),
    Figure.of_setup("time step", 1 / 30, STEP, "s", "section IV.A"),
    Figure.of_setup("implicit rule: beta, in the paper's notation", 0.5, 2 * _AVERAGE.b1, "1",
                    "section V.A", "an input; twice the usual beta"),
    Figure.of_setup("implicit rule: gamma", 0.5, _AVERAGE.g1, "1", "section V.A"),
    Figure(
        "order of the integration with gamma = 1/2", "told:order", 2.0, 0.2, "1", "reproduced",
        "of the implicit rod's tip at 1 s, by three steps", "section V.A",
    ),
    Figure.uncompared("Fig. 4: relations of the solvers", None, "1", "section V, Fig. 4",
                      "a diagram; 'Time per step' measures the speeds"),
    Figure.uncompared("clock of the machine", 750e6, "Hz", "section VI", Figure.MACHINE),
    Figure.uncompared("memory of the machine", 128e6, "1", "section VI", Figure.MACHINE),
    Figure.drawn("Fig. 5: E_n at 2 s, explicit with lumped masses", "told:E_n@2s", "1",
                 "section VI.A, Fig. 5", CURVE),
    Figure.drawn("Fig. 6: E_s at 2 s, explicit with lumped masses", "told:E_s@2s", "1",
                 "section VI.A, Fig. 6", CURVE),
    Figure.drawn("Fig. 7: E_i at 2 s, explicit with lumped masses", "told:E_i@2s", "m^2",
                 "section VI.A, Fig. 7", CURVE),
    Figure.drawn("Fig. 8: E_i at 2 s, quasi-static", "told:E_i@2s.quasi_static", "m^2",
                 "section VI.A, Fig. 8", CURVE),
    Figure.drawn("Fig. 11: E_s at 10 s, implicit with MP1", "told:E_s@10s.MP1", "1",
                 "section VI.B, Fig. 11", f"{CURVE}; the 'different steady-state solution'"),
    Figure.uncompared("Poisson ratio of the incompressible", 0.5, "1", "section VI.B",
               "refused by displacement elements with the reason; mixed ones run to .4999999"),
    Figure.drawn("Picinbono's penalty: least displacement error over its weights",
                 "told:penalty.best",
                 "1", "sections VI.B and VII", "future work in the paper; against the exact "
                                               "constraint, compared with a high Poisson ratio of "
                                               "the same critical step"),
    Figure.drawn("diagonal damping: E_n at 2 s of C = αM", "told:damping.papers", "1",
                 "section VII",
                 "future work in the paper; consistent mass, so the damping alone"),
)  # fmt: skip


def _stable_to(values: Values) -> str:
    return (
        "only with lagged damping, plane strain, consistent mass and n = 30 or finer; the scheme "
        f"it prints is stable to {values['told']['limit.printed']:.2g} s there, whatever the "
        "damping"
    )


def _sweeps(values: Values) -> str:
    told = values["told"]
    return (
        "printed in words ('several thousand'); first step to a residual of 1e-6, needle along y; "
        f"{told['sweeps.MP2.strain.20']:.0f} for n = 20; plane stress takes "
        f"{told['sweeps.MP2.stress.20']:.0f} (n = 20), so the paper's block is in plane strain"
    )


#: Claims that rest on the block and the needle.
NEEDLE_FIGURES = (
    *ways("block", 5.0, 0.7, 5.29),
    Figure(
        "peaks of quasi-static's E_s after 5 s", "told:peaks", None, None, "1", "not comparable",
        "printed in words ('multiple peaks'): swings about the steady state",
        "section VI.A, Fig. 6", 2.0, 0.0,
    ),
    Figure(
        "E_s of quasi-static MP2 over implicit MP1, mean over time", "told:material.mean",
        None, None, "1", "not comparable",
        "printed in words ('far less error'), and true for ours: against implicit MP2 the "
        "material matters more than the solver",
        "section VI.B, Fig. 11", 7.3e-4, 1e-4,
    ),
    Figure(
        "implicit MP2 converges with alpha and beta below", None, 1.0, None, "1",
        "not comparable", "a bound: the constants themselves are not printed", "section VI.B",
    ),
    Figure(
        "explicit MP2 is impossible at this step", "told:limit.printed", 1 / 30, None, "s",
        "not comparable", "a bound, which holds: ours is the largest stable step", "section VI.B",
        4.306e-4, 1e-7,
    ),
    Figure(
        "explicit step of MP2", "told:limit.lagged", 1e-6, None, "s",
        "not reproducible as printed", _stable_to, "section VI.B", 9.271e-7, 1e-9,
    ),
    Figure(
        "Gauss-Seidel iterations, MP2 in plane strain, n = 30", "told:sweeps.MP2.strain.30",
        None, None, "1", "not comparable", _sweeps, "section VI.B", 4820.0, 50.0,
    ),
    Figure(
        "'2 beta >= gamma >= 1/2 is unconditionally stable': limit of beta .25, gamma .5",
        "told:clash", 0.0, None, "1", "not reproduced",
        "the rule is that of the usual beta; the paper's beta is twice as large, so these "
        "values pass and are unstable beyond this w h", "section V.A", 2.828427, 1e-5,
    ),
    Figure(
        "printed update of u: limit w h without damping", "told:misprint.0", 0.0, None, "1",
        "not reproducible as printed",
        "'unconditionally stable' holds with v of the old time, not with v of the new as printed",
        "section V.A", 1.154701, 1e-5,
    ),
    *_STATED,
)  # fmt: skip
