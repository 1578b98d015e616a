"""Figures of a scene and the requirements on a method that follow from them."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.catalogue import reports_of
from validate.compare.effects import TELLS_APART
from validate.fem.assembly.assemble import shape_gradients
from validate.fem.critical import Modes
from validate.fem.locking import LOCKING_FROM
from validate.fem.system import build
from validate.pipeline.experiment.experiment import EffectSpec, Experiment
from validate.pipeline.ladder.ladder import Rival, Trial
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.static.quasi_static import QuasiStatic
from validate.study.tradeoff.study import Trade

# --- Effects that a recording shows, as the stored run of an experiment found them.
#
# `validate run` sets every declared effect against the noise of the recording. A choice reads its
# results: to compute them anew would cost a whole run.


@dataclass(frozen=True)
class ShownEffect:
    """An effect that the recording shows: by which quantities, with the largest separation."""

    name: str
    doc: str
    seen_by: tuple[str, ...]
    separation: float


@dataclass(frozen=True)
class ShownEffects:
    """Effects of a stored run; `unknown` says why there are none to read."""

    shown: tuple[ShownEffect, ...] = ()
    not_shown: tuple[str, ...] = ()
    unknown: str = ""


def stored_effects(experiment: Experiment, out: Path | None) -> ShownEffects | None:
    """Read from the experiment's own run in `out`; None where it declares no effects."""
    if not experiment.effects:
        return None
    path = reports_of(experiment.path, out) / experiment.name / "results.json"
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))["effects"]
        effects = []
        for e in stored:
            seen_by = tuple(e["seen_by"])
            by = [float(c["separation"]) for c in e["changes"] if c["name"] in seen_by]
            effects.append(ShownEffect(e["name"], e["doc"], seen_by, max(by, default=0.0)))
        shown = tuple(e for e in effects if e.seen_by)
    except FileNotFoundError:
        return ShownEffects(unknown="no stored run")
    except (OSError, ValueError, KeyError, TypeError):
        return ShownEffects(unknown="the stored run cannot be read")
    if not effects:
        return ShownEffects(unknown="the stored run compared no effects")
    return ShownEffects(shown, tuple(e.name for e in effects if not e.seen_by))


def with_effects(trial: Trial, experiment: Experiment, effects: ShownEffects | None) -> Trial:
    """Return the ladder whose candidates are marked where they lack an effect that the recording
    shows."""
    shown = {e.name for e in effects.shown} if effects else set()
    specs = [s for s in experiment.effects if s.name in shown]
    return replace(
        trial, solvers=tuple(_marked(r, trial, experiment, specs) for r in trial.solvers)
    )


def _marked(rival: Rival, trial: Trial, experiment: Experiment, specs: list[EffectSpec]) -> Rival:
    lacking = [s for s in specs if lacks(rival, trial, experiment, s)]
    if rival.lacks or not lacking:
        return rival
    return replace(
        rival, lacks=", ".join(f"'{s.name}', which the recording shows" for s in lacking)
    )


def lacks(rival: Rival, trial: Trial, experiment: Experiment, effect: EffectSpec) -> bool:
    """Return whether a candidate is the scheme of the effect's other method, without the effect.

    Effects between two variants of one scheme are parts of the scene, which every candidate has. A
    scheme of an accepted method lacks nothing.
    """
    kinds = {name: type(method.settings) for name, method in experiment.methods.items()}
    kept = {kinds[effect.one.method], *(kinds[name] for name in experiment.accepted)}
    other = kinds[effect.other.method]
    return other not in kept and type(rival.make(trial.steps[0])) is other


def effect_words(
    effects: ShownEffects | None, experiment: Experiment, trial: Trial
) -> Iterator[tuple[str, str, str]]:
    """Name, value and meaning of every effect, for the table of the scene's own numbers."""
    if effects is None:
        return
    if effects.unknown:
        first = (
            f"run `validate run {experiment.name}` first; until then effects exclude no candidate"
        )
        yield "effects in the recording", f"unknown: {effects.unknown}", first
        return
    specs = {s.name: s for s in experiment.effects}
    for e in effects.shown:
        value = f"{e.doc}: {e.separation:.3g} u, seen by {', '.join(e.seen_by)}"
        without = [
            r.name for r in trial.solvers
            if e.name in specs and lacks(r, trial, experiment, specs[e.name])
        ]  # fmt: skip
        means = "required: every candidate includes it as the scene declares it"
        if without:
            means = (
                f"required: candidates without it do not solve this scene ({'; '.join(without)})"
            )
        yield f"effect: {e.name}", value, means
    if effects.not_shown:
        names = ", ".join(effects.not_shown)
        yield (
            "effects that the recording does not show",
            names,
            (f"below {TELLS_APART:g} u: not required by it"),
        )


# -------------------------------------------------------------------------------------------------

_WATER = 1000.0  # kg/m3, of a soft tissue whose density nobody declared
_SLOW = 10.0  # periods of the lowest mode within which a load that rises is nearly static
_SMALL_STRAIN = 0.02  # strain at which the square terms of Green's strain are 1 % of the linear


@dataclass(frozen=True)
class Fact:
    """One of the scene's own numbers, and what it asks of a method."""

    name: str
    value: str
    means: str


def facts(trade: Trade, error: float, effects: ShownEffects | None = None) -> tuple[Fact, ...]:
    """Loading against the lowest frequency, strain, law, Poisson ratio, fluid, noise, and `effects`
    of the recording; `error` is the one that is wanted, in the trade's unit."""
    scene = trade.trial
    element = "P1" if "P1" in scene.meshes else next(iter(scene.meshes))
    body = scene.build(element, scene.meshes[element][0], "linear")
    nu = body.material.nu
    locks = f"above {LOCKING_FROM:g} linear tetrahedra lock: compare P1 with the other elements"
    n = len(body.cavities)
    means = (
        "condensed response columns; the pressure keeps the volume constant"
        if n
        else "no pressure is computed"
    )
    if scene.noise is None:
        noise = Fact("noise", "no recording", "no statement")
    else:
        sd, where = scene.noise
        if trade.unit != "m":
            shows = f"no statement about an error in {trade.shown_unit}"
        elif sd < error:
            shows = "a recording can detect such an error"
        else:
            shows = "a recording cannot detect such an error at a single point"
        noise = Fact("noise", f"{1e3 * sd:.3g} mm, {where}", shows)
    density = body.material.rho or _WATER
    solid = replace(body, cavities=(), material=replace(body.material, rho=density))
    modes = Modes.of(build(solid), 1)
    f, ratio = modes.omega[0] / (2 * np.pi), modes.damping[0] / (2 * modes.omega[0])
    at = f"{f:.3g} Hz"
    assumed = "" if body.material.rho else f", at an assumed {_WATER:g} kg/m3"
    if scene.rise_s == 0:
        rises = f"switched on at once; {at}, damping ratio {ratio:.2g}{assumed}"
        needs = (
            "the load has no rise time: inertia and damping are needed until the motion has decayed"
        )
    else:
        periods = scene.rise_s * f
        rises = f"rises in {scene.rise_s:.3g} s; {at}{assumed}: {periods:.3g} periods"
        needs = "not static: inertia matters"
        if periods > _SLOW:
            needs = "nearly static: a static method may be enough"
    return (
        Fact("loading rate against lowest frequency", rises, needs),
        _strain(scene, body, trade),
        Fact("Poisson ratio", f"{nu:g}", locks if nu >= LOCKING_FROM else "no locking to expect"),
        Fact("fluid", f"{n} cavity" if n == 1 else f"{n} cavities" if n else "none", means),
        noise,
        Fact(
            "reference",
            f"{trade.trial.reference[0]} mesh {trade.trial.reference[1]}, its error "
            f"about {trade.shown(trade.floor, 2)} (Richardson)",
            "smaller errors cannot be distinguished",
        ),
        *(Fact(*words) for words in effect_words(effects, trade.experiment, scene)),
    )


def _strain(scene: Trial, body: Scene, trade: Trade) -> Fact:
    # Displacements (n, d) m under the largest inputs: statics, or where a probe touches the motion
    # up to there.
    if not body.tools:
        static = (ExactPressure() if body.cavities else QuasiStatic()).prepare(build(body))
        u = static.field(static.step(static.rest(), scene.largest_inputs))
    else:
        dt = scene.steps[-1]
        path = scene.inputs(scene.times(dt))
        stepper = scene.best(dt).prepare(build(body))
        state = stepper.rest()
        for x in path[: int(np.abs(path).sum(axis=1).argmax()) + 1]:
            state = stepper.step(state, x)
        u = stepper.field(state)
    strain = principal_strains(body.mesh, u)
    peak, most = float(strain.max()), float(np.quantile(strain, 0.95))
    cost = f"large strain was not solved ({trade.law_words})"
    if trade.law_error is not None:
        moved = trade.shown(trade.law_error)
        cost = f"large strain changes the answer by {moved} ({trade.law_words})"
    means = "within small strain" if peak < _SMALL_STRAIN else "large strain is on the ladder"
    return Fact(f"strain level ({'' if body.tools else 'static '}pilot, coarse mesh)",
                f"peak {100 * peak:.2g} %, 95 % of cells below {100 * most:.2g} %",
                f"{means}; measured, {cost}")  # fmt: skip


def principal_strains(mesh: Mesh, u: Floats) -> Floats:
    """Largest |principal small strain| of every simplex (e,), from u (n, d) m at its corners."""
    if mesh.bricks:
        mesh = Mesh(mesh.nodes, mesh.simplices, "tri3" if mesh.dimension == 2 else "tet4")
    H = np.einsum("eai,eaj->eij", u[mesh.corners], shape_gradients(mesh))
    return np.asarray(np.abs(np.linalg.eigvalsh((H + np.swapaxes(H, 1, 2)) / 2)).max(axis=1))
