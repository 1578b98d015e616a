"""Laws of rubber identified in one mode and judged in the others: which predicts, not which fits.

Nominal stress against stretch, digitised from publications: Treloar (1944) vulcanised natural
rubber; a very soft gel (Soft Matter 7 (2011) 2632) by `--set material=yohsuke`; Kawabata's plane of
two stretches (Macromolecules 14 (1981) 154) by `--set material=kawabata1981`, identified on its
diagonal. Others of the same kind: `--set data=FOLDER --set material=NAME` of files NAME_MODE.csv.
"""

from validate.compare.overall_verdict import Expected
from validate.pipeline.experiment.experiment import Experiment, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.solve.static.stretch_test import StretchTest

from .calibration import accepted, calibrations, follows
from .curves import Multimode, build, load, material_of, place
from .exhibits import exhibits

METHODS = {
    "svk": Method("St. Venant-Kirchhoff", StretchTest(), "svk"),
    "neo_hooke": Method("neo-Hooke", StretchTest(), "neo_hooke"),
    "mooney_rivlin": Method("Mooney-Rivlin", StretchTest(), "mooney_rivlin"),
    "yeoh": Method("Yeoh", StretchTest(), "yeoh"),
    "ogden": Method("Ogden, one term", StretchTest(), "ogden"),
    "ogden_two": Method("Ogden, two terms", StretchTest(), "ogden_two"),
}
LESS = vary("nu", "absolute ranges.nu, below 0.5", "Poisson ratio", "nu",
            "assumed; the curves contain no volume")  # fmt: skip

EXPERIMENT = Experiment(
    name="multimode",
    needs="multimode",
    title="treloar: identified in uniaxial tension, predicted in equibiaxial tension, pure shear",
    source="HyperData.jl 66f5b45, Hyperelastics.jl 0fbfeb3 (MIT)",
    settings=Multimode(),
    methods=METHODS,
    accepted=tuple(name for name in METHODS if name != "svk"),
    accept=(accepted("equibiaxial"), accepted("pure_shear")),
    expected=(
        Expected("not good enough", "a law that is identified in uniaxial tension alone does not "
                 "predict the other modes"),
        Expected("undecided", "the uncertainty of a digitised curve is as large as the limit",
                 check="stress.pure_shear*"),
        Expected("not good enough", "one term has too few constants", check="stress.pure_shear*",
                 method="ogden"),
        Expected("nothing compared", "two Ogden terms are not identifiable from one curve",
                 method="ogden_two"),
    ),
    load=load,
    build=build,
    place=place,
    calibrations=calibrations("uniaxial", 0.3e6, 57.0),
    uncertainty=Uncertainty(inputs=(LESS,), surrogate="neo_hooke"),
    exhibits=exhibits,
    follows=follows,
    specimen=material_of,
    locates=("data", "material"),
)  # fmt: skip
