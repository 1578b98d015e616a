"""The shipped recording: a hand's path through a finer body of quadratic elements, and sensors."""

import numpy as np

from validate.errors import SceneError
from validate.fem.system import build as build_system
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Built, Tree
from validate.recording.types import Recording, Source
from validate.solve.haptic.needle import NeedleLoop
from validate.solve.march import march
from validate.twin.sensors import signal, streams

from .hand import Hand
from .pocket import AXES, TOOL, grip_of, under
from .scene import POCKET

FRAME = "block"
_START_NS = 1_080_345_600_000_000_000  # the year of the paper, an arbitrary moment
_BESIDE = 0.0031  # m: off the pocket's middle, so that a mirrored path cannot pass
_FREE = 1e6  # N: the twin's own force is not limited
_SD_FORCE = {"plane": 0.2, "solid": 1e-3}  # N


def hand_of(p: Tree) -> Hand:
    """The path over the body's upper side."""
    above = (_BESIDE, 0.0) if p.scene.body.space == "plane" else (_BESIDE, 0.0, 0.6 * _BESIDE)
    twin = p.settings.twin
    return Hand(twin.depth, above, twin.rate, twin.tremor, twin.seed)


def record(p: Tree, progress: Progress) -> Recording:
    """Path, force on the hand and pressure at every tick; seeded."""
    progress("simulate")
    twin, body = p.settings.twin, p.scene.body
    t, x = hand_of(p).path()
    t = np.round(t, 9)
    finer = {
        "body.plane": twin.plane, "body.solid": twin.solid, "body.element": "quadratic"
    }  # fmt: skip
    scene = under(Built()(None, with_given(p, finer)), x[0])
    mesh = scene.mesh
    stepper = NeedleLoop(grip=grip_of(p), limit=_FREE).prepare(build_system(scene))
    run = march("twin", stepper, t, x - x[0], np.array([len(t) - 1]), 0.0)
    if not run.finished:
        raise SceneError(f"the twin: {run.outcome.why}")
    progress("measure")
    rng = streams(twin.seed, ("tip", "force", "pressure"))
    sd = _SD_FORCE[body.space] if twin.sd_force is None else twin.sd_force
    signals = {}
    for c, a in enumerate(AXES[: body.dimension]):
        y = run.traces[f"{TOOL}.force.{a}"].y
        signals[f"tip.{a}"] = signal(t, x[:, c], "m", twin.sd_tip, FRAME, rng["tip"])
        signals[f"force.{a}"] = signal(t, y, "N", sd, FRAME, rng["force"])
    P = run.traces[f"{POCKET}.pressure"].y
    signals["pressure"] = signal(t, P, "Pa", twin.sd_pressure, FRAME, rng["pressure"])
    provenance = {
        "kind": "twin", "law": "linear elasticity, small strain",
        "element": f"{mesh.kind}, {len(mesh.nodes)} nodes", "fluid": "constant volume, exact",
        "hand": "minimum-jerk moves with tremor, synthetic", "seed": str(twin.seed),
    }  # fmt: skip
    return Recording(
        "needle_pocket", Source("needle_pocket", "", 0, "made in memory"), _START_NS,
        signals=signals, metadata={"provenance": provenance},
    )  # fmt: skip
