"""Numbers that paper 004 states, sets or cites, its sentences as numbers, and its 1-D pictures."""

from validate.compare.published import Figure, Values
from validate.papers.async_regions.bodies import HapticTest
from validate.papers.stated import CITED, drawn, said, taken
from validate.solve.regions import AsyncRegions

from .claims import DEEP, STIFF
from .scene import SCENE

_P, _BODY, _MATERIAL = HapticTest(), SCENE.body, SCENE.material
_SHOWN = "a curve without numbers: the report draws the force of every method"
_SET = "section 6"


def _contradicts(values: Values) -> str:
    told = values["told"]
    return (
        "'the size has a more significant effect than the frequency': (5, 500) is "
        f"{told['error.n5_f500']:.1f} % off, (30, 50) {told['error.n30_f50']:.1f} %, and the "
        "printed 2.7 and 6.6 % say the same; true of the speed only"
    )


STATED = (
    taken("haptic rate", 1000.0, 1 / _P.dt, "Hz", "sections 1 and 6"),
    Figure(
        "eq 4: l sqrt(rho/E) over the critical step", "told:eq4", 1.0, 0.05, "1", "reproduced",
        "'approximately'; of the undamped bar with lumped masses", "section 4, eq 4",
    ),
    said("Fig. 2a: regions of a line", None, "1", "section 5.1, Fig. 2a",
         "a sketch; layers count from the touched node"),
    said("rate of its second region", 100.0, "Hz", "section 5.1, Fig. 2a",
         "of a sketch; `three` runs 500 Hz there"),
    said("rate of its third region", 10.0, "Hz", "section 5.1, Fig. 2a",
         "of a sketch; `three` runs 50 Hz there"),
    said("Fig. 3: regions in the matrix", None, "1", "section 5.2, Fig. 3",
         "a sketch of eq 7, which every border follows"),
    said("Fig. 4: interpolation of a slow region", 100.0, "Hz", "section 5.3, Fig. 4",
         "a sketch; `n5_f5` interpolates and `n5_f5_held` does not"),
    said("Fig. 5: primary region by deformation", None, "1", "section 5.5, Fig. 5",
         "a sketch; Table 2's adaptable row follows it"),
    *(said(f"modulus of soft tissue in other work, number {i}", E, "Pa", _SET, CITED)
      for i, E in enumerate((5e3, 35e3, 6e3, 11e3, 0.0, 3.5e3, 9.3e3), 1)),
    taken("softest bar", 5e3, _MATERIAL.E, "Pa", _SET),
    taken("stiffest bar", 25e3, STIFF, "Pa", _SET),
    taken("area of the bar", 40e-4, SCENE.thickness * _BODY.size[1], "m^2", _SET),
    taken("length of the bar", 0.1, _BODY.size[0], "m", _SET),
    taken("density", 1000.0, _MATERIAL.rho, "kg/m^3", _SET),
    taken("damping", 6.5, _MATERIAL.mass_damping, "1/s", _SET,
          "an input without unit: read as C = 6.5 M, which gives the whole solve's peaks"),
    taken("nodes of the bar", 40.0, float(_BODY.cells[0]), "1", _SET, "an input; free nodes"),
    taken("magnitude of the chirp", 0.01, _P.probe.depth, "m", _SET),
    taken("lowest frequency of the chirp", 0.1, _P.probe.lowest, "Hz", _SET),
    taken("highest frequency of the chirp", 1.0, _P.probe.highest, "Hz", _SET),
    taken("time at which Table 1's peaks are read", 20.0, _P.probe.seconds / 2, "s", _SET,
          "'approximately'; ours is the middle of a chirp whose length is not printed"),
    drawn("Fig. 6a: peak with N = 30, f = 500 Hz", "told:peak.n30_f500", "N", "section 6, Fig. 6",
          f"{_SHOWN}; its labels are lost, so Table 1 decides which of a to d it is"),
    drawn("Fig. 6b: peak with N = 30, f = 50 Hz", "told:peak.n30_f50", "N", "section 6, Fig. 6",
          f"{_SHOWN}; its labels are lost, so Table 1 decides which of a to d it is"),
    drawn("Fig. 6d: peak with N = 5, f = 500 Hz", "told:peak.n5_f500", "N", "section 6, Fig. 6",
          f"{_SHOWN}; its labels are lost, so Table 1 decides which of a to d it is"),
    said("Fig. 6c: force that rises with the frequency", None, "N", "section 6, Fig. 6",
         "'slightly' in words: the table of impedances gives the peak by frequency"),
    drawn("Fig. 7a: peak of the whole solve, 5 kPa", "told:peak.whole", "N", "section 6, Fig. 7",
          _SHOWN),
    drawn("Fig. 7b: peak of the whole solve, 25 kPa", "told:stiff.whole", "N",
          "section 6, Fig. 7", "a curve without numbers"),
    drawn("Fig. 7c: force error with N = 5, f = 5 Hz, 5 kPa", "told:error.n5_f5", "%",
          "section 6, Fig. 7", _SHOWN),
    drawn("Fig. 7d: force error with N = 5, f = 5 Hz, 25 kPa", "told:stiff.error", "%",
          "section 6, Fig. 7", "a curve without numbers"),
    Figure(
        "the softer the tissue, the larger the error: 25 kPa's over 5 kPa's",
        "told:stiff.over.soft", None, None, "1", "not comparable",
        "printed in words, and ours agree: below 1", "section 6, Fig. 7", 0.28, 0.02,
    ),
    Figure(
        "error of the smaller region over that of the slower one", "told:size.over.rate", None,
        None, "1", "not reproduced", _contradicts, "section 6, Table 1", 0.365, 0.02,
    ),
    taken("largest deformation", 0.05, DEEP, "m", "section 6, Fig. 8"),
    said("fixed primary region of Fig. 8", 10.0, "1", "section 6, Fig. 8",
         "an input, taken as printed: Table 2's fixed row"),
    said("rate of its far region", 50.0, "Hz", "section 6, Fig. 8",
         "an input, taken as printed: both regions of Table 2"),
    taken("gradient of the adaptable region", 4.0, AsyncRegions().slope, "1",
          "section 6, Fig. 8"),
    said("largest adaptable region", 30.0, "1", "section 6, Fig. 8",
         "an input, taken as printed: Table 2's adaptable row"),
    said("time at which Table 2's peaks are read", 30.0, "s", "section 6, Table 2",
         "ours ends on its tenth peak, at 30.8 s of .3 Hz"),
    drawn("Fig. 8a: peak with a fixed region", "told:growing.fixed", "N", "section 6, Fig. 8",
          "a curve; Table 2 has its peak"),
    drawn("Fig. 8b: peak with an adaptable region", "told:growing.adaptable", "N",
          "section 6, Fig. 8", "a curve; Table 2 has its peak"),
    Figure(
        "relative force error of a push over that of half the push", "told:error.by.size", None,
        None, "1", "not reproduced",
        "'the force error increases with increasing deformation size': the absolute one does; in a "
        "linear model the relative one of a fixed region cannot", "section 6, Fig. 8", 1.0, 1e-6,
    ),
)  # fmt: skip
