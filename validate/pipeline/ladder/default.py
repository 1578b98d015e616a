"""Default ladder of an experiment, derived from its scene and its recording.

Elements are those its cells allow, meshes coarser and finer ones of the same body, solvers all that
know its kind; those that refuse it are rows with the reason. Errors are against the finest mesh of
the ladder: a reference, not a measurement.

Under a probe, the whole prefactored solve, regions around the contact and reduced models are
compared at one spring and one pad. Their reference is the whole solve in short steps.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError, UsageError
from validate.fem.assembly.locate import Rows
from validate.fem.large_strain.explicit import knows_single
from validate.fem.system import System
from validate.pipeline.bodies.own_body import ExperimentBody, own_body, with_law
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.options import folder_of
from validate.pipeline.ladder.ladder import (
    LARGEST,
    QUALITY,
    Rival,
    Rung,
    StabilityBody,
    Trial,
    Turned,
    marker_noise,
    squeezed,
)
from validate.pipeline.ladder.references import (
    exact_in_ramps,
    still_best,
    still_pair,
    swinging_pair,
)
from validate.scene.geometries.box import centroids
from validate.scene.geometries.refinement import linear, of_element
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh, require_positive_cells
from validate.scene.places import nodes_of
from validate.scene.scene import Load, Scene
from validate.solve.explicit.central import CentralDifference
from validate.solve.handles import Handles
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions
from validate.solve.schemes import SCHEMES
from validate.solve.study_entries import StillBody, SwingingBody
from validate.solve.types import Scheme, State, Stepper

Touching = AsyncRegions | TouchedKrylov
_PARTS = 4  # steps of the reference within the ladder's shortest
_MORE = 1.01  # of the coarsest mesh's spacing: its neighbours are within the pad


@dataclass(frozen=True)
class Divided:
    """A scheme of a touched body in `parts` steps for one, the probe going straight."""

    handles: ClassVar[Handles] = AsyncRegions.handles

    settings: Touching
    parts: int

    def prepare(self, system: System) -> Stepper:
        return DividedStepper(self.settings.prepare(system), self.parts)


@dataclass(frozen=True)
class DividedStepper:
    """States hold that of the scheme and the last inputs (d,) m."""

    stepper: Stepper
    parts: int

    @property
    def scene(self) -> Scene:
        return self.stepper.scene

    @property
    def units(self) -> Mapping[str, str]:
        return self.stepper.units

    def rest(self) -> State:
        state = self.stepper.rest()
        return replace(state, inner=(state, np.zeros(self.scene.mesh.dimension)))

    def step(self, state: State, inputs: Floats) -> State:
        inner: State = state.inner[0]
        before: Floats = state.inner[1]
        for i in range(1, self.parts + 1):
            inner = self.stepper.step(inner, before + (inputs - before) * i / self.parts)
            if inner.failure:
                break
        return replace(inner, k=state.k + 1, inner=(inner, inputs))

    def field(self, state: State) -> Floats:
        return self.stepper.field(state.inner[0])


@dataclass(frozen=True)
class TouchedLadder:
    """Rivals with a common `pad` m, the `best` of them, and what is said of both."""

    whole: AsyncRegions
    solvers: tuple[Rival, ...]

    def best(self, dt: float) -> Scheme:
        return Divided(replace(self.whole, dt=dt / _PARTS), _PARTS)

    @property
    def note(self) -> str:
        return (
            f"The probe's spring of {self.whole.spring:g} N/m is shared by the nodes within "
            f"{1e3 * self.whole.pad:.3g} mm of the contact on every mesh: the solution of a point "
            f"contact does not converge under refinement. Layers of a region are those of each "
            f"mesh. The reference is the full solve, with each shortest step in {_PARTS} parts."
        )


def touched_ladder(own: ExperimentBody, coarsest: int) -> TouchedLadder | None:
    """Of the experiment's methods that step a touched body, or None where it has none."""
    given = own.experiment.sets(own.parameters, own.seen)
    found = {m.label: m.given(given) for m in own.experiment.methods.values()
             if isinstance(m.settings, Touching)}  # fmt: skip
    wholes = [s for s in found.values() if isinstance(s, AsyncRegions)]
    if not wholes:
        return None
    # From the touched node to the nearest other one of its surface, m
    scene = own.at(coarsest)
    tool = scene.tools[0]
    places = scene.mesh.nodes[nodes_of(scene.mesh, tool.facets)]
    away = np.linalg.norm(places - np.array(tool.tip), axis=1)
    others = np.linalg.norm(places - places[int(np.argmin(away))], axis=1)
    pad = max(wholes[0].pad, _MORE * float(np.partition(others, 1)[1]))
    rivals = (_rival(label, replace(s, pad=pad)) for label, s in found.items())
    whole = replace(wholes[0], layers=(), rates=(), solvers=wholes[0].solvers[:1], pad=pad)
    return TouchedLadder(whole, tuple(rivals))


def _rival(label: str, settings: Touching) -> Rival:
    """First order in time, and uneven where regions of several rates are due now and then."""
    rung: Rung = "regions" if getattr(settings, "layers", ()) else "prefactored"
    if isinstance(settings, TouchedKrylov):
        rung = "modal"

    def make(dt: float) -> Scheme:
        return replace(settings, dt=dt)

    return Rival(label, rung, make, order=1.0, uneven=rung == "regions")


_LEVELS = (400, 300, 200, 150, 125, 100, 75, 50, 35, 25, 18, 12)  # of a hundred: own mesh
_COARSER = (0.5, 0.7, 1.0)  # of the reference's level
_UNKNOWNS, _QUICK_UNKNOWNS = 30_000, 6_000  # of the reference
_STEPS, _QUICK_STEPS = 500, 100  # of the recording's time
_FRAMES = 40
_POINTS = 16
_TOUCHED, _QUICK_TOUCHED = 7_000, 1_500  # of a touched reference, stepped in parts
_DERIVED = (
    "The experiment declares no ladder: this one is derived from its scene. A mesh's "
    "number is its cells along an edge, in percent of the experiment's mesh."
)
_INSIDE = 1e-9  # of the body's size: a point within rounding of a face is on it


def trial_of(experiment: Experiment, quick: bool) -> Trial:
    """What the experiment declares, else a ladder of its own scene."""
    if experiment.ladder is None or experiment.ladder.trial is None:
        return _trial(own_body(experiment), quick)
    recording = experiment.load(experiment.parameters, folder_of(experiment))[0]
    return experiment.ladder.trial(recording, experiment.parameters, quick)


def body_of(experiment: Experiment) -> StabilityBody | None:
    """What the experiment declares, else its own body; None where it has no density."""
    if experiment.ladder and experiment.ladder.body:
        return experiment.ladder.body
    own = own_body(experiment)
    if own.scene.material.rho is None:
        return None
    _require_instants(own)
    # The body without its fluid, in linear cells, on meshes whose modes can all be taken
    if own.scene.tools:
        raise _untaken(own)
    fitting = [n for n in own.levels(_LEVELS) if linear(own.at(n).mesh).nodes.size <= LARGEST]
    if not fitting:
        raise UsageError(
            f"'{own.experiment.name}' has {linear(own.scene.mesh).nodes.size} unknowns and cannot "
            f"be coarsened to {LARGEST}, all of whose modes are taken; give it a number of cells "
            "as a parameter, or declare a body in its ladder"
        )
    meshes = own.levels([round(share * fitting[-1]) for share in _COARSER])
    drive = None if own.scene.loads else own.scene.drives[0]
    steps = np.diff(own.seen.t)
    base = Turned.of(own.scene.material, meshes[-1])
    return StabilityBody(
        f"{own.experiment.title} ({linear(own.scene.mesh).kind} cells; mesh: percent of the "
        f"experiment's mesh)",
        lambda level, material: _solid(own, level, material),
        base,
        meshes,
        float(np.median(steps)),
        pull=None if drive is None else Load("pull", drive.facets, drive.direction),
        qualities=QUALITY if _squeezable(_solid(own, meshes[-1], base.material)) else (1.0,),
    )


# --- error against time ---------------------------------------------------------------------------


@dataclass(frozen=True)
class _Loading:
    """Inputs (nt, k) at times (nt,) s from rest on, and the time in which they come on."""

    t: Floats
    y: Floats
    rise_s: float
    dynamic: bool

    def inputs(self, t: Floats) -> Floats:
        columns = [np.interp(t, self.t, column) for column in self.y.T]
        return np.stack(columns, axis=1)


def _untaken(own: ExperimentBody) -> UsageError:
    """Of a scene that is touched by a probe, where nothing on the ladder takes it."""
    return UsageError(
        f"'{own.experiment.name}' is touched by the probe '{own.scene.tools[0].name}', which a "
        f"derived ladder does not support; run the experiment, or declare its ladder"
    )


def _trial(own: ExperimentBody, quick: bool) -> Trial:
    if own.scene.tools:
        return _touched(own, quick)
    meshes, reference = _meshes(own, _QUICK_UNKNOWNS if quick else _UNKNOWNS, quick)
    loading = _loading(own)
    dt, frames = _steps_and_frames(loading, quick)
    # All that handle the scene, and what its law costs on the coarsest mesh
    levels = next(iter(meshes.values()))
    element, coarse, medium = list(meshes)[-1], levels[0], levels[len(levels) // 2]
    own_law = own.scene.material.law
    law: LawName = "neo_hooke" if own_law == "linear" else own_law
    if loading.dynamic:
        pair = swinging_pair(element, coarse, dt[0], law)
        every = SCHEMES.candidates(SwingingBody(dt, coarse, medium, law))
    else:
        cavities, table = bool(own.scene.cavities), float(np.abs(loading.y).max()) / 6
        pair = still_pair(element, coarse, dt[0], cavities, law)
        every = SCHEMES.candidates(StillBody(cavities, dt[0], table, medium, coarse, law))
    solvers = tuple(s for s in every if _handles(s, dt[0], own.scene))

    def build(element: str, level: int, law: LawName) -> Scene:
        return with_law(of_element(own.at(level), element), law)

    return Trial(
        build=build,
        size=own.size,
        meshes=meshes,
        steps=dt,
        inputs=loading.inputs,
        frames=frames,
        points=_points(own, meshes, reference),
        reference=reference,
        best=exact_in_ramps if loading.dynamic else still_best(bool(own.scene.cavities)),
        solvers=solvers,
        pair=pair,
        dynamic=loading.dynamic,
        rise_s=loading.rise_s,
        noise=marker_noise(own.recording),
        notes=(_DERIVED,),
    )


def _touched(own: ExperimentBody, quick: bool) -> Trial:
    """Under a probe: the experiment's own methods, linear cells, smaller bodies."""
    known = touched_ladder(own, 100)
    if known is None:
        raise _untaken(own)
    element = _elements(linear(own.scene.mesh), own.scene)[0]
    levels = _touched_levels(own, _QUICK_TOUCHED if quick else _TOUCHED)
    ladder = touched_ladder(own, levels[0]) or known
    loading, meshes, reference = _loading(own), {element: levels[:-1]}, (element, levels[-1])
    dt, frames = _steps_and_frames(loading, quick)
    return Trial(
        build=lambda element, level, law: with_law(of_element(own.at(level), element), law),
        size=own.size,
        meshes=meshes,
        orders={element: 1.0},
        steps=dt,
        inputs=loading.inputs,
        frames=frames,
        points=_points(own, meshes, reference),
        reference=reference,
        best=ladder.best,
        solvers=ladder.solvers,
        pair=None,
        dynamic=True,
        rise_s=loading.rise_s,
        notes=(_DERIVED, ladder.note),
    )


def _touched_levels(own: ExperimentBody, most: int) -> tuple[int, ...]:
    """Rising meshes as `_meshes` takes them, the finest of at most so many unknowns. Raises
    `UsageError` where there are not two."""
    for top in own.levels(_LEVELS)[::-1]:
        levels = own.levels([round(share * top) for share in _COARSER])
        if len(levels) > 1 and own.at(levels[-1]).mesh.nodes.size <= most:
            return levels
    raise UsageError(
        f"'{own.experiment.name}' has {own.scene.mesh.nodes.size} unknowns and cannot be meshed "
        f"twice with at most {most}; give it a number of cells as a parameter"
    )


def _elements(mesh: Mesh, scene: Scene) -> tuple[str, ...]:
    """What the cells allow, the most exact last."""
    if mesh.bricks:
        return ("Q4",) if mesh.dimension == 2 else ("H8",)
    return ("P1", "P2") if mesh.dimension == 2 or scene.regions else ("P1", "MD", "P2")


def _meshes(
    own: ExperimentBody, most: int, quick: bool
) -> tuple[Mapping[str, tuple[int, ...]], tuple[str, int]]:
    """Levels by element, and the reference: the most exact element on the finest mesh that has at
    most so many unknowns. Raises `UsageError` where there are not two meshes."""
    *others, best = _elements(linear(own.scene.mesh), own.scene)
    shares = _COARSER[::2] if quick else _COARSER
    for top in own.levels(_LEVELS)[::-1]:
        levels = own.levels([round(share * top) for share in shares])
        if len(levels) > 1 and of_element(own.at(levels[-1]), best).mesh.nodes.size <= most:
            coarse = {e: levels if e != best else levels[:-1] for e in (*others, best)}
            return coarse, (best, levels[-1])
    if others and (levels := own.levels(_LEVELS)[:2])[1:]:  # a mesh that cannot be coarsened
        return {others[0]: levels[:1]}, (others[0], levels[1])
    raise UsageError(
        f"'{own.experiment.name}' has only one mesh, so it cannot be refined; give it a number of "
        f"cells as a parameter, or declare a ladder"
    )


def _loading(own: ExperimentBody) -> _Loading:
    """With inertia the recorded inputs, else a ramp to the largest of them."""
    seen, dynamic = own.seen, own.scene.material.rho is not None
    if dynamic:
        _require_instants(own)
    steps = np.diff(seen.t)
    dt = float(np.median(steps)) if len(steps) else 1.0
    t, size = seen.t - seen.t[0] + dt, np.abs(seen.inputs).sum(axis=1)
    if not size.any():
        raise UsageError(f"'{own.experiment.name}' has only zero inputs; nothing moves")
    reached = int(np.argmax(size >= 0.999 * size.max()))
    if dynamic:
        return _Loading(t, seen.inputs, 0.0 if reached == 0 else float(t[reached]), dynamic=True)
    rise, peak = float(t[reached]), seen.inputs[int(np.argmax(size))]
    return _Loading(np.array([0.0, rise]), np.array([0 * peak, peak]), rise, dynamic=False)


def _require_instants(own: ExperimentBody) -> None:
    """A step in time is the recording's: raises `UsageError` where it has none."""
    if len(own.seen.t) < 2:
        raise UsageError(
            f"'{own.experiment.name}' is driven at {len(own.seen.t)} instant, so there is no time "
            f"step to study; run the experiment, or declare its ladder"
        )


def _steps_and_frames(loading: _Loading, quick: bool) -> tuple[tuple[float, ...], Floats]:
    """Steps around the recording's, and the times compared; increments of a static load."""
    if not loading.dynamic:
        rise = loading.rise_s
        return (rise / 6, rise / 240), rise * np.array([1 / 3, 2 / 3, 1.0])
    dt = float(np.median(np.diff(loading.t)))
    pairs = min(len(loading.t), _QUICK_STEPS if quick else _STEPS) // 2
    apart = max(1, pairs // _FRAMES)
    frames: Floats = 2 * dt * apart * np.arange(1, pairs // apart + 1, dtype=np.float64)
    return ((2 * dt, dt) if quick else (2 * dt, dt, dt / 2)), frames


def _handles(solver: Rival, dt: float, scene: Scene) -> bool:
    scheme, body = solver.make(dt), with_law(scene, solver.law)
    if isinstance(scheme, CentralDifference) and scheme.precision == "single":
        return scheme.handles.covers(body) and knows_single(body)
    return scheme.handles.covers(body)


def _points(
    own: ExperimentBody, meshes: Mapping[str, tuple[int, ...]], reference: tuple[str, int]
) -> Floats:
    """The probes, and points inside the body on every mesh, far from one another."""
    levels = sorted({reference[1], *(n for ns in meshes.values() for n in ns)})
    coarsest = linear(own.at(levels[0]).mesh)
    points = centroids(coarsest)
    near = _INSIDE * float(np.ptp(coarsest.nodes, axis=0).max())
    for level in levels:
        points = points[Rows.barycentric(linear(own.at(level).mesh), points).outside <= near]
    if not len(points):
        raise SceneError("the meshes have no common point; declare a ladder in the experiment")
    probes = [np.array(p.point)[None] for p in own.scene.probes]
    # At most `_POINTS` of them, each the furthest from those before
    picked = [int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))]
    while len(picked) < min(_POINTS, len(points)):
        away = np.linalg.norm(points[:, None] - points[picked], axis=2).min(axis=1)
        picked.append(int(np.argmax(away)))
    return np.vstack([*probes, points[picked]])


# --- stability ------------------------------------------------------------------------------------


def _solid(own: ExperimentBody, level: int, material: Material) -> Scene:
    """Of another material; regions keep their modulus over the rest."""
    scene = own.at(level)
    share = material.E / own.scene.material.E
    regions = tuple(
        replace(r, material=replace(material, E=share * r.material.E)) for r in scene.regions
    )
    return replace(
        scene, body=linear(scene.mesh), material=material, regions=regions, cavities=(),
        probes=(), dilatation="pointwise",
    )  # fmt: skip


def _squeezable(scene: Scene) -> bool:
    """Whether a layer of cells can be squeezed without turning others over."""
    try:
        require_positive_cells(squeezed(scene.mesh, min(QUALITY)))
    except SceneError:
        return False
    return True
