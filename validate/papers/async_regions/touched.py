"""The recording of a probe's path and of the force on the hand, and its registration."""

from validate.arrays import Floats
from validate.papers.async_regions.bodies import PROBE, LoadCell
from validate.recording.types import Recording, Signal, Source
from validate.register.registered import Registered
from validate.register.signals import driving, validating
from validate.replay.tree import Tree
from validate.scene.scene import Scene
from validate.twin.sensors import signal, streams
from validate.twin.tracked import START_NS


def probed(
    name: str, t: Floats, path: Floats, force: Floats, cell: LoadCell, *, same: bool, law: str
) -> Recording:
    """A recording of a probe's path (nt, d) m at t (nt,) s and the force (nt,) N on the hand."""
    rng = streams(cell.seed, ("force",))["force"]
    some = slice(None, None, cell.every)
    return Recording(
        name,
        Source(name, "", 0, "made in memory"),
        START_NS,
        signals={
            PROBE: Signal(t, path.round(9), "m", 0.0, "scene"),  # a nanometre: short files
            "force": signal(t[some], force[some], "N", cell.noise, "scene", rng),
        },
        metadata={
            "provenance": {
                "kind": "twin",
                "same_model": str(same).lower(),
                "seed": str(cell.seed),
                "law": law,
            }
        },
    )


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    drive = driving(recording, PROBE, "m", after_rest=True)
    seen = validating(recording, "force", "N", quantity="force", trace=f"{PROBE}.force.x")
    return Registered((drive, seen))
