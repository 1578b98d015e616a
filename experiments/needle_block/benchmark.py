"""A benchmark of solvers (paper 002): the implicit run is the truth, every method is held to it.

What its two experiments share: the twin, which is `Newmark` with consistent mass and full damping
on the models' own mesh and step (as in the paper) or on finer ones, its recording by a tracker, and
the methods' inputs. An experiment gives the input and the places of the fiducials.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.parameters import quantity
from validate.pipeline.experiment.experiment import Progress, Twin
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Built, TimeSteps, Tree
from validate.pipeline.run.method_run import Truth
from validate.recording.types import Recording
from validate.register.markers.quality import MarkerFit
from validate.register.registration import Registered
from validate.scene.scene import Drive, Scene
from validate.solve.dynamic.newmark import Newmark
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.march import output_frames
from validate.solve.static.quasi_static import QuasiStatic
from validate.twin.tracker import Camera, Origin, Reading, SteppedTwin

from .body import STEP

FRAMES = 300  # all steps of 10 s: errors are drawn over time
IMPLICIT = Newmark(STEP, drive_rates="given")
EXPLICIT = ExplicitLinear(STEP, "consistent", "full", drive_rates="given")


@dataclass(frozen=True)
class RefinedTwin:
    """What made the recording; the models do not know it."""

    seed: int = quantity(1, "1", "seed of the noise")
    noise: float = quantity(1e-4, "m", "standard deviation of a marker per axis")
    refined: int = quantity(1, "1", "its cells across in one of the models'")
    finer: int = quantity(1, "1", "its steps in one of the models'")


@dataclass(frozen=True)
class SolverTest:
    """Of one benchmark, in addition to its scene."""

    clock: TimeSteps
    twin: RefinedTwin = RefinedTwin()
    registration: MarkerFit = MarkerFit()


@dataclass(frozen=True)
class Benchmark:
    """The scene's one input (nt,) in `unit` at times (nt,) s.

    `fiducials` (d,) m are points that do not move.
    """

    name: str
    input: str
    unit: str
    values: Callable[[Floats], Floats]
    fiducials: Mapping[str, tuple[float, ...]]

    # --- the pipeline -----------------------------------------------------------------------------

    def place(self, recording: Recording, p: Tree, scene: Scene) -> Registered:
        for drive in scene.drives:
            _require_node(scene, drive)
        how = p.settings.registration
        return Registered.following(recording, scene.mesh, self.input, self.unit, how)

    def sets(self, p: Tree, seen: Registered) -> Mapping[str, Any]:
        return {"dt": p.settings.clock.dt}

    # --- the twin ---------------------------------------------------------------------------------

    def twin(self, p: Tree) -> SteppedTwin:
        own: SolverTest = p.settings
        cells = tuple(n * own.twin.refined for n in p.scene.body.cells)
        return SteppedTwin(
            Built()(None, p, {"body.cells": cells}),
            lambda dt: replace(IMPLICIT, dt=dt),
            self.values,
            own.clock.dt,
            own.clock.steps,
            own.twin.finer,
        )

    def made(self, notice: str) -> Twin:
        """The experiment's twin, with what its report says of it."""
        prefixes = ("body.", "plane", "clock.", "twin.")
        return Twin(self.record, self.truth, prefixes, "same model", RefinedTwin().seed, notice)

    def record(self, p: Tree, progress: Progress) -> Recording:
        made, twin = self.twin(p), p.settings.twin
        scene = made.scene
        declared = {
            "element": f"{scene.mesh.kind}, {len(scene.mesh.nodes)} nodes",
            "law": "linear elasticity, Rayleigh damping, average acceleration, consistent mass",
            "plane": scene.plane if scene.mesh.dimension == 2 else "",
        }
        return made.record(
            Origin(self.name, twin.seed, twin.refined == twin.finer == 1, declared),
            self.fiducials,
            Camera(twin.noise),
            lambda run: {self.input: Reading(self.values(run.t), self.unit)},
            progress,
        )

    def truth(self, p: Tree, seen: Registered) -> Truth:
        """The twin's displacements at the steps, and its fields at the frames."""
        made = self.twin(p)
        return Truth.of(made.run(output_frames(p.settings.clock.steps, FRAMES)), made.scene)


def _require_node(scene: Scene, drive: Drive) -> None:
    """Raises `SceneError` where a drive acts on a point that is no node."""
    if drive.point is None:
        return
    mesh, point = scene.mesh, np.array(drive.point)
    away = float(np.linalg.norm(mesh.nodes[mesh.nearest_node(point)] - point))
    if away > 1e-9:
        raise SceneError(
            f"'{drive.name}' acts at {drive.point} m, and the nearest node is {1e3 * away:.4g} mm "
            "away: take even numbers of body.cells"
        )


# --- methods and cases ----------------------------------------------------------------------------

#: The paper's five; its "lumped" restricts the damping to alpha M as well.
FIVE: Mapping[str, Method] = {
    "implicit": Method("implicit", IMPLICIT),
    "implicit_lumped": Method(
        "implicit, lumped M, C = αM", replace(IMPLICIT, mass="lumped", damping_terms="mass")
    ),
    "explicit": Method("explicit", EXPLICIT),
    "explicit_lumped": Method(
        "explicit, lumped M, C = αM", replace(EXPLICIT, mass="lumped", damping_terms="mass")
    ),
    "quasi_static": Method("quasi-static", QuasiStatic()),
}
#: Lumping and the restriction of C one at a time.
SWITCHES: Mapping[str, Method] = {
    "implicit_lumped_full": Method("implicit, lumped M, full C", replace(IMPLICIT, mass="lumped")),
    "implicit_restricted": Method(
        "implicit, consistent M, C = αM", replace(IMPLICIT, damping_terms="mass")
    ),
    "explicit_lumped_full": Method("explicit, lumped M, full C", replace(EXPLICIT, mass="lumped")),
    "explicit_restricted": Method(
        "explicit, consistent M, C = αM", replace(EXPLICIT, damping_terms="mass")
    ),
    "explicit_lagged": Method(
        "explicit, lumped M, lagged full C", replace(EXPLICIT, mass="lumped", update="lagged")
    ),
}


def solvers() -> dict[str, Method]:
    """The linear solvers of the implicit step, and the update as misprinted."""
    return {
        "gauss_seidel": Method(
            "implicit by Gauss-Seidel", replace(IMPLICIT, solver="gauss_seidel")
        ),
        "cg": Method("implicit by conjugate gradients", replace(IMPLICIT, solver="cg")),
        "dense_inverse": Method(
            "implicit by a dense inverse", replace(IMPLICIT, solver="dense_inverse")
        ),
        "misprinted": Method(
            "implicit, update as misprinted", replace(IMPLICIT, update="misprinted")
        ),
    }
