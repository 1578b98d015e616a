"""Numbers that paper 002 states or sets, its machine, and its pictures."""

from validate.compare.published import Figure
from validate.papers.accuracy.needle import MP1, MP2, SPEED, STEP, STOP, needle_block
from validate.papers.accuracy.rod import GRAVITY, MP3, SIZE
from validate.papers.stated import MACHINE, drawn, said, taken
from validate.scene.material import Material
from validate.solve.newmark_rule import rule_of

_CURVE = "a curve without numbers: the report draws ours"
_AVERAGE = rule_of("average", 1.0)


def _material(name: str, ours: Material, theirs: tuple[float, ...], place: str) -> tuple[Figure,
                                                                               ...]:  # fmt: skip
    """The five numbers of a table: E Pa, nu, density kg/m^3, Rayleigh's alpha 1/s and beta s."""
    E, nu, rho, alpha, beta = theirs
    assert ours.rho is not None
    return (
        taken(f"{name}: Young's modulus", E, ours.E, "Pa", place),
        taken(f"{name}: Poisson ratio", nu, ours.nu, "1", place),
        taken(f"{name}: density", rho, ours.rho, "kg/m^3", place),
        taken(f"{name}: Rayleigh damping alpha", alpha, ours.mass_damping, "1/s", place),
        taken(f"{name}: Rayleigh damping beta", beta, ours.stiffness_damping, "s", place),
    )


_SIDE = float(needle_block(2).mesh.nodes.max())
NEEDLE_STATED = (
    said("Fig. 1: symmetric difference of two shapes", None, "1", "section III.B, Fig. 1",
         "a sketch; E_s is exact, and 'Deformed shapes' draws the areas it counts"),
    said("Fig. 2: block and needle", None, "1", "section IV.A, Fig. 2",
         "a figure without numbers: 'Deformed shapes' draws ours"),
    *_material("MP1", MP1, (200.0, 0.47, 2000.0, 1.0, 0.1), "section IV.A, Table 1"),
    *_material("MP2", MP2, (60e3, 0.495, 1140.0, 1.0, 0.1), "section IV.A, Table 2"),
    taken("height and width of the block", 1.0, _SIDE, "m", "section IV.A, Tables 1 and 2"),
    taken("speed of the needle", 0.08, SPEED, "m/s", "section IV.A"),
    taken("time for which it moves", 2.0, STOP, "s", "section IV.A"),
    taken("time step", 1 / 30, STEP, "s", "section IV.A"),
    taken("implicit rule: beta, in the paper's notation", 0.5, 2 * _AVERAGE.b1, "1",
          "section V.A", "an input; twice the usual beta"),
    taken("implicit rule: gamma", 0.5, _AVERAGE.g1, "1", "section V.A"),
    Figure(
        "order of the integration with gamma = 1/2", "told:order", 2.0, 0.2, "1", "reproduced",
        "of the implicit rod's tip at 1 s, by three steps", "section V.A",
    ),
    said("Fig. 4: relations of the solvers", None, "1", "section V, Fig. 4",
         "a diagram; 'Time per step' measures the speeds"),
    said("clock of the machine", 750e6, "Hz", "section VI", MACHINE),
    said("memory of the machine", 128e6, "1", "section VI", MACHINE),
    drawn("Fig. 5: E_n at 2 s, explicit with lumped masses", "told:E_n@2s", "1",
          "section VI.A, Fig. 5", _CURVE),
    drawn("Fig. 6: E_s at 2 s, explicit with lumped masses", "told:E_s@2s", "1",
          "section VI.A, Fig. 6", _CURVE),
    drawn("Fig. 7: E_i at 2 s, explicit with lumped masses", "told:E_i@2s", "m^2",
          "section VI.A, Fig. 7", _CURVE),
    drawn("Fig. 8: E_i at 2 s, quasi-static", "told:E_i@2s.quasi_static", "m^2",
          "section VI.A, Fig. 8", _CURVE),
    drawn("Fig. 11: E_s at 10 s, implicit with MP1", "told:E_s@10s.MP1", "1",
          "section VI.B, Fig. 11", f"{_CURVE}; the 'different steady-state solution'"),
    said("Poisson ratio of the incompressible", 0.5, "1", "section VI.B",
         "refused by displacement elements with the reason; mixed ones run to .4999999"),
    drawn("Picinbono's penalty: least displacement error over its weights", "told:penalty.best",
          "1", "sections VI.B and VII", "future work in the paper; against the exact "
                                        "constraint, compared with a high Poisson ratio of "
                                        "the same critical step"),
    drawn("diagonal damping: E_n at 2 s of C = αM", "told:damping.papers", "1", "section VII",
          "future work in the paper; consistent mass, so the damping alone"),
)  # fmt: skip

ROD_STATED = (
    said("Fig. 3: the bending rod", None, "1", "section IV.B, Fig. 3",
         "a figure without numbers: 'Deformed shapes' draws ours"),
    *_material("MP3", MP3, (7000.0, 0.2, 10_000.0, 1.0, 0.1), "section IV.B, Table 3"),
    taken("width of the rod", 0.5, SIZE[0], "m", "section IV.B, Table 3", "an input; its length"),
    taken("depth of the rod", 0.25, SIZE[1], "m", "section IV.B, Table 3"),
    taken("height of the rod", 0.25, SIZE[2], "m", "section IV.B, Table 3"),
    taken("gravity", 0.05, GRAVITY, "m/s^2", "section IV.B"),
    taken("time step of the rod", 1 / 30, STEP, "s", "section IV.B"),
    drawn("Fig. 9: E_i at 2 s, explicit with lumped masses", "told:E_i@2s", "m^3",
          "section VI.A, Fig. 9", _CURVE),
    drawn("Fig. 10: E_i at 2 s, quasi-static", "told:E_i@2s.quasi_static", "m^3",
          "section VI.A, Fig. 10", _CURVE),
    drawn("Picinbono's penalty on the rod: least displacement error over its weights",
          "told:penalty.best", "1", "sections VI.B and VII",
          "future work in the paper; the smallest weight, because linear tetrahedra lock"),
    drawn("Picinbono's penalty on the rod: net force of unit normals over the weight",
          "told:penalty.net", "1", "sections VI.B and VII",
          "'no formal methods are given to justify the realism of this artificial force'"),
    drawn("diagonal damping of the rod: E_n at 2 s of C = αM", "told:damping.papers", "1",
          "section VII", "future work in the paper; consistent mass, so the damping alone"),
)  # fmt: skip
