"""Numbers that paper 001 states, sets or times on its machine, and its pictures."""

from validate.papers.kf_fem.block import PulledBlock
from validate.papers.stated import MACHINE, drawn, said, taken

from .scene import SCENE
from .seeds import PRINTED

_P = PulledBlock()
_TABLE = "section 3, Table 1"
_WIDE, _DEEP, _HIGH = SCENE.body.size
_A, _B, _ = (probe.point[2] for probe in SCENE.probes)
_BELOW = _A - _B

STATED = (
    said("Fig. 1: block diagram of the filter", None, "1", "section 2.2, Fig. 1",
         "a diagram; `kf_dense` is what it draws"),
    taken("width of the block", 0.004, _WIDE, "m", _TABLE),
    taken("depth of the block", 0.004, _DEEP, "m", _TABLE),
    taken("height of the block", 0.007, _HIGH, "m", _TABLE),
    taken("analysis time", 1.0, _P.clock.steps * _P.clock.dt, "s", _TABLE),
    taken("time increment", 0.002, _P.clock.dt, "s", _TABLE),
    taken("applied force over its area", 3000.0, _P.loading.traction, "Pa", _TABLE,
          "an input; taken as a consistent traction, because equal nodal forces pull 7 % less"),
    taken("Rayleigh's alpha 0", 0.0, SCENE.material.mass_damping, "1/s", _TABLE),
    taken("Rayleigh's alpha 1", 0.1, SCENE.material.stiffness_damping, "s", _TABLE),
    taken("density", 1068.0, SCENE.material.rho, "kg/m^3", _TABLE),
    taken("Poisson's ratio", 0.47, SCENE.material.nu, "1", _TABLE),
    taken("Young's modulus", 10e3, SCENE.material.E, "Pa", _TABLE),
    taken("edge of an element", 1e-3, _HIGH / SCENE.body.cells[2], "m", "section 3",
          "an input; the cells' edges, diagonals of the tetrahedra are longer"),
    said("Fig. 2: mesh with the observation point", None, "1", "section 3, Fig. 2",
         "a figure without numbers: the report draws ours"),
    drawn("Fig. 3: noise of the measurement over its range", "told:nrmse.raw", "1",
          "section 3, Fig. 3", "a curve without numbers; mean over the seeds, with the variance "
          "read as .001 mm2"),
    taken("depth of evaluation point 2", 0.002, _BELOW, "m", "section 3"),
    taken("intensity of the measurement noise", 0.001, PRINTED, "1", "section 3",
          "an input without unit: read as a variance of .001 mm2"),
    said("clock of the machine", 3.4e9, "Hz", "section 3", MACHINE),
    said("memory of the machine", 8e9, "1", "section 3", MACHINE),
    drawn("Fig. 4: error at evaluation point 1", "kf_printed:node_A.nrmse", "1",
          "section 3, Fig. 4", "a curve without numbers; over the range, on the shipped twin"),
    drawn("Fig. 5: error at evaluation point 2", "kf_printed:node_B.nrmse", "1",
          "section 3, Fig. 5", "a curve without numbers; over the range: with a perfect model "
                               "the point follows the prediction of FEM"),
    taken("steps of the run", 500.0, float(_P.clock.steps), "1", "section 3"),
    said("'in the first 0.05 seconds'", 0.05, "s", "section 3",
         "25 steps of 2 ms: compared as steps"),
)  # fmt: skip
