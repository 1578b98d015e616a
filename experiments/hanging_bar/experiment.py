"""Soft bar that hangs under its weight: solvers of the package and external simulators.

Seven solvers have published results, from 43 to 159 mm. The reference is the limit of another code
(dolfinx): a computation, no experiment. Test another simulator by `validate run hanging_bar
--external "python my_simulator.py"`.
"""

from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Experiment, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.pipeline.ladder.ladder import Ladder
from validate.scene.geometries.specification import Box
from validate.scene.laws import Coefficients
from validate.scene.material import Material
from validate.scene.scene import Scene, Support, Weight
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.static.newton import StaticNewton

from .published import PUBLISHED, tell
from .reference_solutions import SolvedByOthers, load, place, tetrahedra
from .study import trial

SIZE = ("0.6 m", "0.6 m", "1.6 m")  # held at its top
STATIC = StaticNewton("none")
FELUPE = ExternalSimulator("python benchmarks/external/felupe_simulator.py")
CALCULIX = ExternalSimulator("python benchmarks/external/calculix_simulator.py")
MUJOCO = ExternalSimulator("python benchmarks/external/mujoco_simulator.py")
THEIRS = {"body": tetrahedra}
WHOLE = {"body": Box(SIZE, cells=(9, 9, 24), element="hex8")}

EXPERIMENT = Experiment(
    name="hanging_bar",
    needs="hanging-bar",
    title="Bar hanging under its weight, by external simulators",
    source="AustrianTradingMachine/Newton 9e5d430 (MIT)",
    scene=Scene(
        # A quarter with its axis at x = y = 0: the held edge bends most, and cells are small there.
        body=Box(SIZE, cells=(4, 4, 12), element="hex27", grading=3.0, symmetry=("x", "y")),
        # W = mu/2 (I1 - 3) - mu ln J + lambda/2 ln^2 J with mu = 10 kPa, lambda = 50 kPa.
        material=Material(
            E=1e4 * 17 / 6,
            nu=5 / 12,
            law="neo_hooke",
            rho="100 kg/m3",
            coefficients=Coefficients(volumetric="coupled"),
        ),
        supports=(Support("zmax"),),
        loads=(Weight("gravity", "-z", "9.80665 m/s^2"),),
    ),
    settings=SolvedByOthers(),
    variations=(vary("body.cells", "x 0.75 0.5, order 3"),),
    methods={
        "quadratic": Method("quadratic hexahedra of a quarter", STATIC),
        "tetrahedra": Method("linear tetrahedra, dolfinx's mesh", STATIC, THEIRS),
        "hexahedra": Method("linear hexahedra, 9 x 9 x 24", STATIC, WHOLE),
        "felupe": Method("FElupe, linear hexahedra, 9 x 9 x 24", FELUPE, WHOLE),
        "felupe_tetrahedra": Method("FElupe, linear tetrahedra, dolfinx's mesh", FELUPE, THEIRS),
        "calculix": Method(
            "CalculiX, hexahedra of incompatible modes, 9 x 9 x 24", CALCULIX, WHOLE
        ),
        "calculix_tetrahedra": Method(
            "CalculiX, linear tetrahedra, dolfinx's mesh", CALCULIX, THEIRS
        ),
        "mujoco": Method(
            "MuJoCo, linear tetrahedra, 833 nodes (dolfinx's mesh), St. Venant-Kirchhoff",
            MUJOCO,
            THEIRS,
        ),
    },
    accepted=("quadratic",),
    accept=(Accept("drop", 0.44e-3, "1 % of the displacement"),),
    load=load,
    place=place,
    uncertainty=Uncertainty(surrogate="quadratic"),
    exhibits=tell,
    published=PUBLISHED,
    ladder=Ladder(trial=trial),
    locates=("data",),
    kind="reference",
)
