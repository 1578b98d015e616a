"""A tool at 1 kHz on the liver of paper 003, simulated at a rate of its own (section 3.5).

St. Venant-Kirchhoff tissue by central difference reads the tool every n-th tick and answers a
period later; in between the force is held, or extrapolated in time by a line or a parabola. It
reports errors, energy created, passivity and ticks against the clock; `validate live haptic_liver`
runs it live. A path of your own: `--set recording=FILE`.
"""

from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Experiment, Twin
from validate.pipeline.experiment.method import Method
from validate.scene.material import Material
from validate.scene.scene import Scene, Support
from validate.solve.haptic.loop import HapticLoop

from ..ekf_liver.body import LiverBody
from .exhibits import tell
from .published import FIGURES
from .twin import EACH_TICK, TouchedLiver, build, follows, load, place, record, sets

METHODS = {
    "every_tick": Method("simulated at every tick", EACH_TICK),
    "hold": Method("100 Hz, held", HapticLoop(extrapolation="hold", background=True)),
    "linear": Method("100 Hz, linear", HapticLoop(background=True)),
    "quadratic": Method(
        "100 Hz, second order", HapticLoop(extrapolation="quadratic", background=True)
    ),
    "place": Method(
        "100 Hz, linear in the spring's place", HapticLoop(extrapolates="place", background=True)
    ),
    "slow": Method("33 Hz, linear", HapticLoop(every=30, late=30, background=True)),
}

EXPERIMENT = Experiment(
    name="haptic_liver",
    title="Tool at haptic rate on a liver that is simulated at a lower rate",
    source="paper 003 (EKF-NFEM), section 3.5",
    scene=Scene(
        body=LiverBody(),
        # The damping is ours, the paper prints none. Section 3.5 prints no Poisson ratio: the 0.49
        # of section 3.2 takes steps half as long, and its linear cells lock.
        material=Material("30 kPa", 0.45, "svk", "1000 kg/m3", mass_damping=20.0),
        supports=(Support("held"),),
    ),
    settings=TouchedLiver(),
    methods=METHODS,
    accepted=("every_tick",),
    accept=(Accept("force.z", 0.15, "a twentieth of the largest force"),),
    load=load,
    build=build,
    place=place,
    sets=sets,
    axis="z",
    reference="every_tick",
    exhibits=tell,
    published=FIGURES,
    frames=40,
    follows=follows,
    quick={"path.seconds": 0.8},
    twin=Twin(
        record,
        remake=("twin.", "path.", "body.", "material.", "hand."),
        kind="same model",
        seed=TouchedLiver().twin.seed,
        notice="The recording is a twin: the same body simulated at every tick, plus noise.",
    ),
)
