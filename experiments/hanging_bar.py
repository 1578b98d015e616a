"""A soft bar that hangs under its weight, in our own solver and in those of others.

Seven solvers were printed for it, from 43 to 159 mm; the converged answer stands beside them. The
reference is what another code (dolfinx) tends to: a computation, no experiment. Another program is
judged by `validate run hanging_bar --guest "python my_guest.py"`.
"""

from validate.compare.verdict import Accept
from validate.papers.hanging_bar.bar import BarModel as Model
from validate.papers.hanging_bar.bar import HangingBar, build, load, place
from validate.papers.hanging_bar.converged import PUBLISHED, tell
from validate.papers.hanging_bar.ladder import trial
from validate.replay.experiment import Experiment, MeshLadder, Uncertainty
from validate.replay.ladder import Ladder
from validate.replay.method import Method
from validate.solve.guests.guest import Guest
from validate.solve.newton import StaticNewton

STATIC = StaticNewton("none")
FELUPE = Guest("python benchmarks/guests/felupe_guest.py")
CALCULIX = Guest("python benchmarks/guests/calculix_guest.py")
MUJOCO = Guest("python benchmarks/guests/mujoco_guest.py")
THEIRS, WHOLE = Model("tetrahedra"), Model("hexahedra")
METHODS = {
    "quadratic": Method("quadratic hexahedra of a quarter", STATIC, Model()),
    "tetrahedra": Method("linear tetrahedra, dolfinx's mesh", STATIC, THEIRS),
    "hexahedra": Method("linear hexahedra, 9 x 9 x 24", STATIC, WHOLE),
    "felupe": Method("FElupe, linear hexahedra, 9 x 9 x 24", FELUPE, WHOLE),
    "felupe_tetrahedra": Method("FElupe, linear tetrahedra, dolfinx's mesh", FELUPE, THEIRS),
    "calculix": Method("CalculiX, hexahedra of incompatible modes, 9 x 9 x 24", CALCULIX, WHOLE),
    "calculix_tetrahedra": Method("CalculiX, linear tetrahedra, dolfinx's mesh", CALCULIX, THEIRS),
    "mujoco": Method(
        "MuJoCo, linear tetrahedra, 833 nodes (dolfinx's mesh), St. Venant-Kirchhoff",
        MUJOCO,
        THEIRS,
    ),
}
EXPERIMENT = Experiment(
    name="hanging_bar",
    needs="hanging-bar",
    title="Bar hanging under its weight, by external simulators",
    source="AustrianTradingMachine/Newton 9e5d430 (MIT)",
    parameters=HangingBar(),
    methods=METHODS,
    accepted=("quadratic",),
    accept=(Accept("drop", 0.44e-3, "1 % of the displacement"),),
    load=load,
    build=build,
    place=place,
    uncertainty=Uncertainty(
        MeshLadder(
            ({"mesh.across": 3}, {"mesh.across": 2}),
            size=lambda p: p.width / 2 / p.mesh.across,
            order=3.0,
        ),
        surrogate="quadratic",
    ),
    exhibits=tell,
    published=PUBLISHED,
    ladder=Ladder(trial=trial),
    locates=("data",),
    kind="reference",
)
