"""Numbers that paper 000 states, sets or cites and does not compute, and its pictures."""

import numpy as np

from validate.papers.fluid_inclusion.twin import PROFILE, SCANNER, SLICES, PhantomTwin
from validate.papers.stated import CITED, drawn, said, taken

from .scene import SCENE

_RECIPE = "a recipe: it enters by the modulus and Poisson ratio only"
_SHOWN = "a figure without numbers: the report draws ours"


STATED = (
    said("strain to which small strain is accurate", 0.01, "1", "section 2.2",
          f"{CITED}; `fluid_phantom_large` measures what a linear model costs at 15 %"),
    said("rate of a haptic simulation", 500.0, "Hz", "sections 2.2 and 3",
          "a requirement; the rate of the condensed phantom is given below"),
    said("rate of a painting simulation in other work", 70.0, "Hz", "section 2.3", CITED),
    said("grid of a painting simulation in other work", 64.0, "1", "section 2.3", CITED),
    said("Poisson ratio of the incompressible", 0.5, "1", "section 3.1",
          "refused with the reason; `fluid_block` runs to .4999999999"),
    said("Fig. 1: cavities in a body", None, "1", "section 3",
          "a sketch; one to three cavities in `fluid_block`, a pulse as the flow of Fig. 1b"),
    said("Fig. 2: a mesh with its normals", None, "1", "section 3.2",
          "a sketch; the mesh and its deformed shape are drawn in both reports"),
    said("strain to which gelatin is linear, in other work", 0.10, "1", "section 4.1", CITED),
    said("gelatin in the phantom", 0.13, "1", "section 4.1", _RECIPE),
    said("glycerol in the fluid", 0.10, "1", "section 4.1", "the fluid is incompressible"),
    said("cellulose in the phantom", 0.03, "1", "section 4.1",
          "it makes speckle: synthetic images have theirs"),
    taken("Poisson ratio of the phantom", 0.485, SCENE.material.nu, "1", "sections 4.1 and 4.4"),
    taken("modulus in the simulation", 15.2e3, SCENE.material.E, "Pa", "section 4.4"),
    said("Fig. 5a: the plate test", None, "1", "section 4.1", "a photograph"),
    said("Fig. 6: the apparatus", None, "1", "section 4.2",
          "a photograph and a diagram; the frame of the recording is the diagram's"),
    said("frequency of the ultrasound", 12e6, "Hz", "section 4.2",
          "synthetic images are drawn with a resolution, not with a frequency"),
    taken("width of the ultrasound array", 0.040, SCANNER.width * SCANNER.m_per_px, "m",
           "section 4.2"),
    taken("step of the sweep", 0.002, float(np.diff(SLICES)[0]), "m", "section 4.4"),
    *(taken(f"displacement number {i}", 0.003 * i, PROFILE.loads[i], "m", "section 4.5")
      for i in (1, 2, 3)),
    taken("error of a manually placed marker", 1e-3, float(np.sqrt(3) * PhantomTwin().sd_hand),
           "m", "section 4.5", "the twin's pen has the same error"),
    said("Fig. 7a: contour at rest", None, "m", "section 4.5, Fig. 7a",
          "a figure without numbers: 0.14 mm rms is under 'at rest' in the report"),
    drawn("Fig. 7b: largest contour error at 3 mm", "p1_loop:contour.max@3mm", "m",
           "section 4.5, Fig. 7b", _SHOWN),
    drawn("Fig. 7c: largest contour error at 6 mm", "p1_loop:contour.max@6mm", "m",
           "section 4.5, Fig. 7c", _SHOWN),
    drawn("Fig. 8: markers in plane at 3 mm", "p1_loop:marker.inplane.rms@3mm", "m",
           "section 4.5, Fig. 8", _SHOWN),
    drawn("Fig. 8: markers in plane at 6 mm", "p1_loop:marker.inplane.rms@6mm", "m",
           "section 4.5, Fig. 8", _SHOWN),
    said("memory of the machine", 512e6, "1", "section 5.3",
          "bytes of another machine; `benchmarks/fluid_loop.py` gives the memory of every form"),
    said("nodes with the tool's two", 82.0, "1", "section 5.3",
          "which two is not printed; `benchmarks/fluid_loop.py` takes two of the upper side"),
)  # fmt: skip
