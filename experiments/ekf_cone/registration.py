"""The pressed cone of paper 003: what its scene does not hold, truth, registration."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from validate.parameters import Ranges, quantity
from validate.pipeline.experiment.experiment import Progress
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Truth
from validate.recording.types import Recording
from validate.register.markers.markers import MarkerObservation
from validate.register.markers.quality import MarkerFit
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.specification import Cone, MeshFile
from validate.scene.scene import Scene

from .twin import (
    ConeTwin,
    LoadTable,
    cone_scene,
    load_table,
    marker_places,
    record_cone,
)

TWIN = ConeTwin()
FILE = MeshFile("../meshes/cone.npz")  # of the explicit runs


@dataclass(frozen=True)
class ScaledTime:
    scale: float = quantity(30.0, "1", "recorded over simulated time of the explicit runs")
    substeps: int = quantity(60, "1", "explicit steps between two samples")


@dataclass(frozen=True)
class ConeRanges(Ranges):
    modulus: float = quantity(0.02, "1", "relative, of the shear modulus")
    nu: float = quantity(0.0002, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class PressedCone:
    """What the cone's scene does not hold."""

    clock: ScaledTime = ScaledTime()
    ranges: ConeRanges = ConeRanges()
    twin: ConeTwin = TWIN
    registration: MarkerFit = MarkerFit()
    load_step: float = quantity(0.4e-3, "m", "grid of loads that the quarter is solved at")


def cone_of(tree: Tree) -> Cone:
    cone: Cone = tree.scene.body
    return cone


def record(tree: Tree, progress: Progress) -> Recording:
    return record_cone(cone_of(tree), tree.settings.twin, progress)


def truth(tree: Tree, seen: Registered) -> Truth:
    """The twin's own displacements at the samples after rest."""
    s, cone = tree.settings.twin, cone_of(tree)
    n = round(s.duration * s.rate)
    _, u = _table(cone, replace(s, force=max(s.force, TWIN.force))).at(
        s.force * np.arange(1, n + 1) / n
    )
    return Truth({name: u[:, j] for j, name in enumerate(marker_places(cone))})


@cache
def _table(cone: Cone, s: ConeTwin) -> LoadTable:
    """One table for both recordings: it is by far the dearest part of a run."""
    places = np.array(list(marker_places(cone).values()))
    return load_table(cone_scene(cone, s), places, s.force, s.loads)


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """The plate's path, or the load cell's ramp, each fitted by least squares; explicit runs in
    scaled time."""
    own: PressedCone = tree.settings
    mesh = FILE.resolved(Path(__file__).parent)
    whole = MarkerObservation.placed(recording, mesh, how=own.registration)
    markers = whole.within(scene.mesh)
    cell = SignalObservation.driving(recording, "load_cell", "N", after_rest=True)
    if scene.drives:
        return _plate(markers, cell)
    return _pushed(markers, cell, own.clock.scale)


def _plate(markers: MarkerObservation, cell: SignalObservation) -> Registered:
    """Compression by a cubic through the plate's marker, from rest; the cell's force validates."""
    j = markers.names.index("node_A")
    down = markers.rest[j, 2] - markers.x[:, j, 2]
    seen = np.isfinite(down)
    powers = markers.t[:, None] ** np.arange(1, 4)
    path = powers @ np.linalg.lstsq(powers[seen], down[seen], rcond=None)[0]
    y = np.interp(cell.t, markers.t, path)[:, None]
    plate = SignalObservation("plate", "drives", cell.t, y, "m", markers.sd, sd_t=markers.sd_t)
    force = replace(cell, role="validates", quantity="force", trace="plate.force")
    return Registered((plate, markers, force))


def _pushed(markers: MarkerObservation, cell: SignalObservation, scale: float) -> Registered:
    """A straight ramp through the load cell's samples, in time divided by `scale`."""
    t = cell.t
    slope = float(t @ cell.y[:, 0] / (t @ t))
    press = replace(cell, t=t / scale, y=(slope * t)[:, None])
    return Registered((press, replace(markers, t=markers.t / scale)), time_scale=scale)


def sets(tree: Tree, seen: Registered) -> Mapping[str, Any]:
    own: PressedCone = tree.settings
    return {"dt": float(seen.t[0]), "substeps": own.clock.substeps, "step": own.load_step}
