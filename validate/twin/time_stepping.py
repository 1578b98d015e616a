"""Twin of a moving body: a scene solved at finer steps than the models', then tracked."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats, Ints
from validate.fem.system import build
from validate.recording.types import Recording
from validate.scene.scene import Scene
from validate.solve.march import march
from validate.solve.types import Run, Scheme
from validate.twin.tracker import Camera, Origin, Reading, points_of


@dataclass(frozen=True)
class SteppedTwin:
    """A scene with one input, marched by `scheme(dt)`, dt in s.

    `inputs` gives (nt,) at times (nt,) s. The models take `steps` of `dt` s; the twin takes `finer`
    steps in one of theirs.
    """

    scene: Scene
    scheme: Callable[[float], Scheme]
    inputs: Callable[[Floats], Floats]
    dt: float
    steps: int
    finer: int = 1

    def run(self, at: Ints) -> Run:
        """Return the run at the ends of the models' steps; fields at those numbered `at` (no,)."""
        f = self.finer
        dt = self.dt / f
        t: Floats = dt * np.arange(1, self.steps * f + 1, dtype=np.float64)
        stepper = self.scheme(dt).prepare(build(self.scene))
        run = march("twin", stepper, t, self.inputs(t)[:, None], (at + 1) * f - 1, 0.0)
        traces = {name: replace(trace, y=trace.y[f - 1 :: f]) for name, trace in run.traces.items()}
        return replace(run, t=run.t[f - 1 :: f], at=at, traces=traces)

    def record(
        self,
        origin: Origin,
        fiducials: Mapping[str, tuple[float, ...]],
        camera: Camera,
        reading: Callable[[Run], Mapping[str, Reading]],
        progress: Callable[[str], None],
    ) -> Recording:
        """Its probes and `fiducials` (d,) m as tracked, and what is read beside them.

        To what `origin` declares its modulus and Poisson ratio are added.
        """
        progress("simulate")
        run = self.run(np.array([0]))
        progress("measure")
        material, flat = self.scene.material, 3 - self.scene.mesh.dimension
        stiffness = {"E_Pa": repr(material.E), "nu": repr(material.nu)}
        return replace(origin, declared={**origin.declared, **stiffness}).record(
            points_of(run, self.scene),
            {k: np.array([*v, *[0.0] * flat]) for k, v in fiducials.items()},
            camera,
            reading(run),
        )
