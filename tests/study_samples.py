"""A small experiment over time, as a file: a block pulled upward, one filter, one solver."""

from pathlib import Path

TEXT = '''
"""A block of 27 nodes that is pulled; its top is measured."""
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validate.compare.verdict import Accept
from validate.estimate.kalman.kf_fem import KfFem
from validate.fem.system import build as build_system
from validate.parameters import quantity
from validate.register.registration import Registered
from validate.pipeline.experiment.experiment import Experiment, Twin
from validate.pipeline.run.method_run import Truth
from validate.pipeline.experiment.method import Method
from validate.pipeline.run.twin_record import stamped
from validate.pipeline.experiment.tree import Built
from validate.scene.geometries.specification import Box
from validate.scene.material import Material
from validate.scene.scene import Load, Probe, Scene, Support
from validate.solve.march import march
from validate.solve.dynamic.newmark import Newmark
from validate.twin.tracker import Camera, Origin, Reading, points_of

STEPS, DT = 40, 0.01
FIXED = {n: np.array(x) for n, x in
         {"a": (0.0, 0.0, 0.0), "b": (0.02, 0.0, 0.0), "c": (0.0, 0.02, 0.0)}.items()}


@dataclass(frozen=True)
class TwinCard:
    seed: int = quantity(5, "1", "seed of the noise")
    noise: float = quantity(1e-10, "m2", "variance")
    stiffness: float = quantity(1.0, "1", "its modulus over the models'")
    missing: float = quantity(0.0, "1", "share of looks that miss a marker")


@dataclass(frozen=True)
class Settings:
    twin: TwinCard = TwinCard()


@dataclass(frozen=True)
class Filter:
    Q: float = quantity(1e-11, "m2", "process noise")
    R: float | None = quantity(None, "m2", "measurement noise")
    gains: str = quantity("shared", "1", "shared or every_step")
    gate: float | None = quantity(None, "1", "of looks")
    smooth: bool = quantity(False, "1", "by later looks")
    trap: str = quantity("", "1", "raise, or wait for a file")

    def prepare(self, system, looks):
        if self.trap == "die" and self.Q > 1e-10:
            os._exit(1)
        if self.trap == "raise":
            raise ZeroDivisionError("a trap")
        if self.trap.startswith("count:"):
            with (Path(self.trap[6:]) / "runs").open("a") as out:
                out.write(f"{self.Q}\\n")
            time.sleep(float(os.environ.get("TRAP_SECONDS", "0")))
        return KfFem(DT, self.Q, self.R, 1e-11, gains=self.gains, gate=self.gate,
                     smooth=self.smooth).prepare(system, looks)


SCENE = Scene(
    Box(("20 mm", "20 mm", "20 mm"), cells=(2, 2, 2)),
    Material("10 kPa", 0.4, "linear", "1000 kg/m3", stiffness_damping="0.02 s"),
    (Support("z0"),),
    loads=(Load("pull", "z1", "+z"),),
    probes=(Probe("top", (0.01, 0.01, 0.02)), Probe("side", (0.0, 0.01, 0.01))),
)


def run(p):
    t = DT * np.arange(1, STEPS + 1)
    force = 0.2 * np.sin(9 * t)[:, None]
    made = Built()(None, p, {"material.E": f"x {p.settings.twin.stiffness}"})
    stepper = Newmark(DT).prepare(build_system(made))
    return made, march("twin", stepper, t, force, np.array([0]), 0.0)


def record(p, progress):
    made, done = run(p)
    twin = p.settings.twin
    camera = Camera(float(np.sqrt(twin.noise)), missing=twin.missing, still=10_000)
    return Origin("pulled", twin.seed, True).record(points_of(done, made), FIXED,
                          camera, {"pull": Reading(done.traces["pull.force"].y, "N")})


def truth(p, seen):
    made, done = run(p)
    return Truth({q.name: np.stack([done.traces[f"{q.name}.{c}"].y for c in "xyz"], axis=1)
                  for q in made.probes})


EXPERIMENT = Experiment(
    name="pulled", title="A pulled block", source="made for tests", scene=SCENE,
    settings=Settings(),
    methods={"kf": Method("filter", Filter(), markers=("top",)),
             "plain": Method("solver", Newmark())},
    accepted=("kf",), accept=(Accept("top", 1e-3, "made for tests"),),
    load=lambda p, folder: (stamped(record(p, lambda _: None), p),),
    place=lambda recording, p, made: Registered.following(recording, made.mesh, "pull", "N"),
    sets=lambda p, seen: {"dt": DT}, axis="z", reference="plain",
    twin=Twin(record, truth, kind="same model", seed=5),
)
'''


def experiment_file(folder: Path) -> Path:
    """Writes experiments/pulled.py below `folder`."""
    path = folder / "experiments" / "pulled.py"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(TEXT, encoding="utf-8")
    return path
