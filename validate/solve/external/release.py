"""Release of a body in an external simulator: vibration by one job, final rest by another."""

from dataclasses import dataclass, fields, replace

from validate.arrays import Floats
from validate.scene.scene import Scene
from validate.solve.dynamic.release import joined
from validate.solve.external.scheme import ExternalSimulator, at_rest
from validate.solve.types import Run


@dataclass(frozen=True)
class ExternalLetGo(ExternalSimulator):
    """Settings as of `LetGo`: even steps of time, then statics at the last instant."""

    def solve(self, scene: Scene, t: Floats, inputs: Floats) -> Run:
        """Return the run under inputs (nt, k) at t (nt,) s; refused as by `ExternalSimulator`."""
        plain = ExternalSimulator(
            **{f.name: getattr(self, f.name) for f in fields(ExternalSimulator)}
        )
        moving = replace(plain, inertia=True).solve(scene, t[:-1], inputs[:-1])
        if not moving.finished:
            return moving
        still = replace(plain, inertia=False).solve(at_rest(scene), t[-1:], inputs[-1:])
        both = joined(moving, still, t)
        said = dict.fromkeys((*both.said, *(f"at rest: {w}" for w in still.said[1:])))
        return replace(both, said=tuple(said), memory=max(moving.memory, still.memory))
