"""Ecoflex 00-30 cylinders compressed on an Instron: real logs made by others.

Five logs of one specimen, 50 mm x 30 mm, 10 mm/min, from the public data set
abubakardawood/tissue-phantom-material-database (Dawood et al. 2026, CC BY 4.0). Whether the plates
slipped was not recorded, so linear FEM brackets it: slipping plates take the apparent modulus as
the material's, bonded ones divide it by the stiffening that the same mesh shows.
"""

from collections.abc import Mapping

from validate.compare.expected import Expected
from validate.compare.published import Figure
from validate.compare.verdict import Accept
from validate.papers.ecoflex.cylinder import DATA_SET, LoggedCylinder, build, load, place
from validate.papers.ecoflex.cylinder import CylinderModel as Model
from validate.papers.ecoflex.logged import follows
from validate.papers.ecoflex.modulus import identified
from validate.papers.ecoflex.specimens import specimen_of
from validate.parameters import describe
from validate.replay.cards import quarter_meshes
from validate.replay.compression_cards import stated_sizes
from validate.replay.experiment import Experiment, Uncertainty, vary
from validate.replay.method import Method
from validate.solve.fluid import NoFluid
from validate.solve.guests.guest import Guest
from validate.solve.newton import StaticNewton
from validate.solve.tabulated import Tabulated

FELUPE = "python benchmarks/guests/felupe_guest.py"
CALCULIX = "python benchmarks/guests/calculix_guest.py"
MUJOCO = "python benchmarks/guests/mujoco_guest.py"
COARSE = Model(radial=4, axial=4)
TABLE = Tabulated(StaticNewton("none"), 0.0015)
METHODS: Mapping[str, Method] = {
    "slip": Method("linear, slipping plates", NoFluid(), Model()),
    "bonded": Method("linear, bonded plates", NoFluid(), Model("bonded", "bonded")),
    "bonded_upper": Method(
        "linear, bonded plates, modulus of slipping ones",
        NoFluid(),
        Model("bonded", "slip"),
    ),
    "slip_lower": Method(
        "linear, slipping plates, modulus of bonded ones",
        NoFluid(),
        Model("slip", "bonded"),
    ),
    # Slipping plates leave the deformation homogeneous, and the mesh has the circle's area: two
    # elements suffice.
    "svk_slip": Method("SVK, slipping plates", TABLE, Model("slip", "svk_slip", "svk", 2, 2)),
    "neo_slip": Method(
        "neo-Hooke, slipping plates", TABLE, Model("slip", "neo_slip", "neo_hooke", 2, 2)
    ),
    "neo_bonded": Method(
        "neo-Hooke, bonded plates",
        TABLE,
        Model("bonded", "neo_bonded", "neo_hooke", 5, 6, 1),
    ),
    "svk_bonded": Method("SVK, bonded plates", TABLE, Model("bonded", "bonded", "svk", 5, 6, 1)),
    "felupe": Method(
        "FElupe, quadratic tetrahedra, 125 nodes, neo-Hooke, slipping plates",
        Guest(FELUPE, levels=10),
        Model("slip", "neo_slip", "neo_hooke", 2, 2),
    ),
    "calculix": Method(
        "CalculiX, quadratic tetrahedra, 729 nodes, linear, slipping plates",
        Guest(CALCULIX, levels=5),
        COARSE,
    ),
    "mujoco": Method(
        "MuJoCo, linear tetrahedra, 27 nodes, SVK, slipping plates",
        Guest(MUJOCO, levels=10),
        Model("slip", "svk_slip", "svk", 2, 2, 1),
    ),
}


MODULI = tuple(p.path for p in describe(LoggedCylinder()) if p.path.startswith("material.E_"))
UNCERTAINTY = Uncertainty(
    quarter_meshes(lambda p: float(p.specimen.height or 0.03)),
    (
        vary(MODULI, "relative ranges.modulus", "modulus",
             "E within the uncertainty of the calibrating specimens",
              "identified: scatter of their mean; the scatter between specimens is in u_D"),
        vary("material.nu", "absolute ranges.nu, below 0.5", "Poisson ratio",
              "nu within its declared uncertainty", "assumed; the data set gives none"),
    ),
    surrogate="slip",
)  # fmt: skip
_TEN = f"{DATA_SET}: ten repeats, two specimens"
PUBLISHED = (
    Figure(
        "modulus.E, 0.5-5 % strain", "identified:modulus.E", 104e3, 9e3, "Pa", "reproduced",
        "within two sd (4.5 kPa) of the scatter between specimens", _TEN, 107.666e3, 10.0,
    ),
    Figure(
        "sd of modulus.E", "identified:modulus.E.sd_repeats", 4.5e3, None, "Pa", "not comparable",
        "ours is of repeats on one specimen: the second one's logs are missing", _TEN,
        1.052e3, 1.0,
    ),
    Figure(
        "neo-Hooke shear modulus over the whole log",
        lambda v: v["identified"]["modulus.neo_slip"] / 3, 36.7e3, None, "Pa", "not comparable",
        "theirs is fitted to 66 % strain, ours to 50 % with slipping plates", _TEN, 30.391e3, 10.0,
    ),
)  # fmt: skip


EXPERIMENT = Experiment(
    name="ecoflex_cylinder",
    needs="ecoflex-compression",
    title="Ecoflex 00-30 cylinder compressed between plates, five logs",
    source="abubakardawood/tissue-phantom-material-database (CC BY 4.0); Dawood et al. (2026)",
    parameters=LoggedCylinder(),
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
    build=build,
    place=place,
    uncertainty=UNCERTAINTY,
    published=PUBLISHED,
    stated=stated_sizes,
    identify=identified,
    band="ranges.specimen",
    frames=2,
    follows=follows,
    specimen=specimen_of,
    locates=("data", "logs"),
)
