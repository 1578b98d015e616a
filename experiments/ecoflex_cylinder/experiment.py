"""Ecoflex 00-30 cylinders compressed on an Instron: real logs made by others.

Five logs of one specimen, 50 mm x 30 mm, 10 mm/min, from the public data set
abubakardawood/tissue-phantom-material-database (Dawood et al. 2026, CC BY 4.0). Whether the plates
slipped was not recorded, so linear FEM brackets it: slipping plates take the apparent modulus as
the material's, bonded ones divide it by the stiffening that the same mesh shows.
"""

from collections.abc import Mapping
from dataclasses import fields

from validate.compare.overall_verdict import Expected
from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Experiment, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.pipeline.plates.scene import stated_sizes
from validate.scene.geometries.specification import Cylinder
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.fluid.cavities import NoFluid
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton

from .cylinder import (
    LoggedCylinder,
    SiliconeModuli,
    load,
    place,
)
from .modulus import identified
from .published import PUBLISHED, follows
from .specimens import specimen_of

FELUPE = "python benchmarks/external/felupe_simulator.py"
CALCULIX = "python benchmarks/external/calculix_simulator.py"
MUJOCO = "python benchmarks/external/mujoco_simulator.py"
TABLE = Tabulated(StaticNewton("none"), 0.0015)
BONDED = {"supports": (Support("lower_plate"), Support("upper_plate", (0, 1)))}
E_SLIP, E_BONDED = ({"material.E": f"as material.E_{plates}"} for plates in ("slip", "bonded"))
# Slipping plates leave the deformation homogeneous, and the mesh has the circle's area: two
# elements suffice.
TWO = {"body.cells": (2, 2)}
SVK = {"material.law": "svk", "material.E": "as material.E_svk_slip", **TWO}
NEO = {"material.law": "neo_hooke", "material.E": "as material.E_neo_slip", **TWO}
LINEAR_CELLS = {"body.element": "tet4", "dilatation": "nodal_mean"}
HELD = {**BONDED, **LINEAR_CELLS, "body.cells": (5, 6)}
METHODS: Mapping[str, Method] = {
    "slip": Method("linear, slipping plates", NoFluid(), E_SLIP),
    "bonded": Method("linear, bonded plates", NoFluid(), {**BONDED, **E_BONDED}),
    "bonded_upper": Method("linear, bonded plates, modulus of slipping ones", NoFluid(),
                           {**BONDED, **E_SLIP}),
    "slip_lower": Method("linear, slipping plates, modulus of bonded ones", NoFluid(), E_BONDED),
    "svk_slip": Method("SVK, slipping plates", TABLE, SVK),
    "neo_slip": Method("neo-Hooke, slipping plates", TABLE, NEO),
    "neo_bonded": Method("neo-Hooke, bonded plates", TABLE,
                         {**NEO, **HELD, "material.E": "as material.E_neo_bonded"}),
    "svk_bonded": Method("SVK, bonded plates", TABLE, {**SVK, **HELD, **E_BONDED}),
    "felupe": Method("FElupe, quadratic tetrahedra, 125 nodes, neo-Hooke, slipping plates",
                     ExternalSimulator(FELUPE, levels=10), NEO),
    "calculix": Method("CalculiX, quadratic tetrahedra, 729 nodes, linear, slipping plates",
                       ExternalSimulator(CALCULIX, levels=5), {**E_SLIP, "body.cells": (4, 4)}),
    "mujoco": Method("MuJoCo, linear tetrahedra, 27 nodes, SVK, slipping plates",
                     ExternalSimulator(MUJOCO, levels=10), {**SVK, **LINEAR_CELLS}),
}  # fmt: skip
MODULI = tuple(f"material.{f.name}" for f in fields(SiliconeModuli))

EXPERIMENT = Experiment(
    name="ecoflex_cylinder",
    needs="ecoflex-compression",
    title="Ecoflex 00-30 cylinder compressed between plates, five logs",
    source="abubakardawood/tissue-phantom-material-database (CC BY 4.0); Dawood et al. (2026)",
    scene=Scene(
        body=Cylinder(cells=(6, 8), element="tet10", part="quarter", grading=2.0),
        material=Material(None, 0.4995),  # nearly incompressible silicone
        supports=(Support("lower_plate", (2,)),),
        drives=(Drive("stage", "upper_plate", "-z"),),
    ),
    settings=LoggedCylinder(),
    variations=(
        vary("body.cells", "x 0.5 0.75 1.3, order 1.19"),  # the corners of bonded plates
        vary(MODULI, "relative ranges.modulus", "modulus",
             "E within the uncertainty of the calibrating specimens",
             "identified: scatter of their mean; the scatter between specimens is in u_D"),
        vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
             "nu within its declared uncertainty", "assumed; the data set gives none"),
    ),
    methods=METHODS,
    accepted=("slip",),  # bonded plates have the same slope: one evidence
    accept=(Accept("force", 2.1, "a tenth of the force at 10 % strain", ("10pct",), "rms"),),
    expected=(
        Expected(
            "undecided",
            "the five logs of one specimen scatter by 0.7 N at 10 % strain",
            check="force*",
        ),
    ),
    load=load,
    place=place,
    uncertainty=Uncertainty(surrogate="slip"),
    published=PUBLISHED,
    stated=stated_sizes,
    identify=identified,
    band="ranges.specimen",
    frames=2,
    follows=follows,
    specimen=specimen_of,
    locates=("data", "logs"),
)  # fmt: skip
