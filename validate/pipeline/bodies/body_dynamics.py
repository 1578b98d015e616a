"""Dynamics of a measured body: methods, damping and uncertain parameters.

One scene, one registration and one error budget for everything that moves a body: a release, a
weight, a force, a pressure or a displacement over time. What differs is the load alone.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.compare.score import Score
from validate.errors import ComparisonError, UsageError, ValidateError
from validate.estimate.ensemble.ensemble_kf import EnsembleKf
from validate.estimate.ensemble.roukf import Roukf
from validate.estimate.filterpy.filters import FilterpyFilter
from validate.estimate.filters import FILTERS
from validate.estimate.kalman.kf_fem import KfFem
from validate.estimate.kalman.modal_kf import ModalKf
from validate.estimate.reduced.load_scale import LoadScale
from validate.estimate.reduced.reduced_ekf import ReducedEKF
from validate.estimate.reduced.reduced_kf import ReducedKf
from validate.identify.recorded_motion import (
    FRACTION,
    RecordedMotion,
    Ringing,
    motion_of,
    recorded_motion,
)
from validate.numbers import scale, shown_unit
from validate.pipeline.bodies.choices import SeenOf
from validate.pipeline.bodies.dynamics_registration import (
    FIRST,
    moving_markers,
    place_moving,
    preload,
    started,
    without_rest,
)
from validate.pipeline.bodies.first_modes import (
    Changes,
    assumed_density,
    first_frequencies,
    is_quadratic,
    law_of,
    model_of,
)
from validate.pipeline.experiment.experiment import (
    Experiment,
    Identified,
    Progress,
    ReportAdditions,
    StepLadder,
    vary,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import MAIN, Cases, MethodRun
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.report.sections.motion_words import motion_words, rests
from validate.scene.material import LawName
from validate.scene.scene import Probe, Scene
from validate.solve.dynamic.implicit import FromEquilibrium
from validate.solve.dynamic.modal import Modal
from validate.solve.dynamic.newmark import Newmark
from validate.solve.explicit.linear import ExplicitLinear
from validate.solve.static.quasi_static import QuasiStatic

# --- The recorded motion as a report shows it: over time along where it is largest, its
# spectrum, and its facts beside the body's first modes.

_POINTS = 1500  # of a chart


def motion_exhibit(
    p: Tree, cases: Cases, tell: Progress, *, shown: RecordedMotion
) -> ReportAdditions:
    """Return the recorded motion `shown`, and the runs of its marker where they are compared with
    it."""
    main = cases[MAIN]
    scene = next(iter(main.values())).scene
    modes: tuple[float, ...] = ()
    if isinstance(scene, Scene):
        with suppress(ValidateError, np.linalg.LinAlgError):
            modes = first_frequencies(scene)
    assumed = assumed_density(p)
    along = ", ".join(f"{x:+.3f}" for x in shown.direction)
    way = f" along ({along})" if len(shown.direction) > 1 else ""
    rings, size, unit = shown.ringing, scale(shown.unit), shown_unit(shown.unit)
    rows: list[tuple[Entry, ...]] = [
        ("largest motion, peak to peak", size * shown.size, unit, f"'{shown.marker}'{way}"),
        ("from first to last sample", size * shown.drift, unit, "drift, or a different rest"),
        ("samples a second", shown.rate, "Hz", ""),
        ("gaps", shown.gaps, "1", f"longest interval {shown.gap:.4g} s, "
                                  f"{100 * shown.missing:.2g} % of the samples missing"),
        ("rests until", shown.rests_until, "s", rests(shown)),
        ("largest peak of the spectrum", shown.frequency, "Hz",
         f"resolved to {shown.resolution:.2g} Hz"),
        ("ring-down, frequency", rings.frequency if rings else None, "Hz",
         f"damping {rings.damping:.3g} (sd {rings.damping_sd:.1g})" if rings else "none seen"),
        *((f"natural frequency {i}", f, "Hz", "of the body with its supports, undamped"
           + (assumed and f", {assumed}")) for i, f in enumerate(modes, 1)),
    ]  # fmt: skip
    if modes:
        share = shown.above(FRACTION * modes[0]) / shown.size
        word = "matters" if shown.inertia_matters(modes[0]) else "is small"
        rows.append(("motion above a third of the first", 100 * share, "%",
                     f"rms, of peak to peak: inertia {word}"))  # fmt: skip
    facts = NumberTable(
        "recorded_motion",
        "The recorded motion, and the body's first modes.",
        ("what", "value", "unit", "note"),
        tuple(rows),
    )
    charts = (*_over_time(shown, main), *_spectrum(shown))
    words = f"'{shown.marker}' moves most; along its direction, in the recording's frame."
    return ReportAdditions(
        (Exhibit("recorded-motion", "The recorded motion", (words,), (facts,), charts),)
    )


def _over_time(shown: RecordedMotion, main: Mapping[str, MethodRun]) -> tuple[Chart, ...]:
    """Of the registered marker, since rest: measured, and simulated by every method."""
    found = {name: h for name, f in main.items() for h in f.histories if shown.marker in h.names}
    if not found:
        return ()
    one = next(iter(found.values()))
    size, j = scale(one.unit), one.names.index(shown.marker)
    try:
        y = recorded_motion(one.t, {shown.marker: one.measured[:, j]})
    except ValidateError:
        return ()
    kept = slice(None, None, max(1, len(y.t) // _POINTS))
    y0 = (one.measured[np.searchsorted(one.t, y.t[0]), j]) @ y.direction
    series = [Series("measured", y.t[kept], size * (y0 + y.y[kept]), "points")]
    for name, history in found.items():
        u = history.simulated[:, j] @ y.direction
        seen = np.isfinite(u)
        series.append(Series(main[name].label, history.t[seen], size * u[seen]))
    what = "displacement" if one.unit == "m" else shown.marker
    return (Chart("recorded_motion", f"'{shown.marker}' along its largest motion", "time / s",
                  f"{what} / {shown_unit(one.unit)}", tuple(series)),)  # fmt: skip


def _spectrum(shown: RecordedMotion) -> tuple[Chart, ...]:
    if shown.resolution == 0:
        return ()
    size, unit = scale(shown.unit), shown_unit(shown.unit)
    t = np.linspace(shown.t[0], shown.t[-1], len(shown.t))
    f, amplitude = Ringing.spectrum(t, np.interp(t, shown.t, shown.y))
    last = f <= max(10 * shown.frequency, 10 * shown.resolution)
    return (Chart("recorded_spectrum", f"Spectrum of '{shown.marker}'", "frequency / Hz",
                  f"amplitude / {unit}", (Series("measured", f[last], size * amplitude[last]),),
                  caption="Under Hann's window, a parabola removed."),)  # fmt: skip


# -------------------------------------------------------------------------------------------------

MovingName = Literal[
    "implicit",
    "modal",
    "explicit",
    "large",
    "static",
    "kf_fem",
    "modal_kf",
    "reduced_kf",
    "roukf",
    "load_scale",
    "filterpy",
    "ensemble_kf",
    "reduced_ekf",
]
_MODES = 20
EXPLICIT_FILTERS = ("reduced_ekf",)  # pointwise tetrahedra without stiffness damping only
#: Settings and words of every method of a motion in time, by name.
METHODS: Mapping[str, tuple[Any, str]] = {
    "implicit": (Newmark(), "dynamic, implicit (Newmark), {law}"),
    "modal": (Modal(modes=_MODES), "dynamic, {modes} modes and the statics of the rest, {law}"),
    "explicit": (
        ExplicitLinear(damping_terms="full"), "dynamic, explicit (central differences), {law}"
    ),
    "large": (FromEquilibrium(), "dynamic at large strain, implicit (Newton), {law}"),
    "static": (QuasiStatic(), "quasi-static: no inertia, {law}"),
    "kf_fem": (KfFem(gains="shared"), "Kalman filter of all nodes (KF-FEM), {law}"),
    "reduced_kf": (ReducedKf(modes=_MODES), "Kalman filter of {modes} modes and the load, {law}"),
    "modal_kf": (ModalKf(), "Kalman filter of all modes (KF-FEM's), {law}"),
    "roukf": (Roukf(), "unscented filter of the modulus, {law}"),
    "load_scale": (LoadScale(), "filter of one load's scale, without inertia, {law}"),
    "filterpy": (FilterpyFilter(), "filterpy's Kalman filter of the modes and the load, {law}"),
    "ensemble_kf": (EnsembleKf(), "ensemble filter of the modulus, {law}"),
    "reduced_ekf": (ReducedEKF(), "extended filter of shapes at large strain, {law}"),
}  # fmt: skip


def moving(
    name: MovingName,
    law: LawName = "linear",
    element: str = "",
    *,
    markers: tuple[str, ...] = (),
    split: int = 1,
    **settings: Any,
) -> Method:
    """Return a method of a moving body, by name: schemes with inertia, statics beside them, and
    filters that are given `markers`. `element` is the body's, where it is another one than
    declared; `split` steps in one of the recording's, for the explicit one; `settings` are those of
    the scheme or filter."""
    scheme, words = METHODS[name]
    cells = ", quadratic cells" if is_quadratic(element) else ", linear cells" if element else ""
    label = words.format(law=f"{law} law{cells}", modes=_MODES)
    if markers:
        label += f", given {', '.join(markers)}"
    pointwise = {"dilatation": "pointwise"} if name in EXPLICIT_FILTERS else {}
    model = {**model_of(law, element), **pointwise}
    return Method(label, replace(scheme, **settings), model, markers=markers, split=split)


def model_law(name: str, law: LawName) -> LawName | None:
    """Return the law that a method has where the material's is `law`: the linear one if the method
    handles it, none if it handles neither."""
    handled = type(METHODS[name][0]).handles.law
    return "linear" if "linear" in handled else law if law in handled else None


def fits_motion(name: str, law: LawName, kind: str, *, preloaded: bool, measured: bool) -> bool:
    """Return whether a method can solve a body in motion: its law, drives or loads of that `kind`
    of motion, and a start at rest under a load (`preloaded`). Filters need something `measured`."""
    settings = METHODS[name][0]
    handles, driven = type(settings).handles, kind in ("moves", "follows")
    if model_law(name, law) is None or not (handles.drives if driven else handles.loads):
        return False
    if isinstance(settings, tuple(FILTERS)) and not measured:
        return False
    return not preloaded or model_law(name, law) == "linear" or hasattr(settings, "preload")


def in_motion(bare: Experiment, build: Any, folder: Path) -> Experiment:
    """Return the experiment with the motion of its body in place of static states."""
    assert bare.uncertainty is not None
    cheap = "modal" if "modal" in bare.methods else bare.accepted[0]
    linear = "implicit" if "implicit" in bare.methods else cheap
    judged = [
        name for name in bare.accepted if law_of(bare.methods[name], bare.parameters) != "linear"
    ]
    uncertainty = replace(
        bare.uncertainty, steps=StepLadder(2.0), surrogate=cheap, inputs=(
            *bare.uncertainty.inputs, *_INPUTS
        ), stand_in=dict.fromkeys(judged, linear),
    )  # fmt: skip
    return replace(
        bare,
        build=partial(_build, build=build, folder=folder),
        place=partial(place_moving, folder=folder),
        sets=_sets,
        identify=partial(_identify, build=build, folder=folder),
        follows=following,
        uncertainty=uncertainty,
        frames=200,
    )


def following(experiment: Experiment, recordings: Sequence[Recording], p: Tree) -> Experiment:
    """Charts follow the axis of the largest recorded motion, where something moved; an exhibit
    shows that motion, but where a force alone is judged in statics."""
    try:
        shown = motion_of(recordings[0], judged(p))
    except ValidateError:
        return experiment
    if p.settings.seen.markers:
        experiment = replace(experiment, axis=shown.axis)
    if shown.unit != "m" and p.settings.motion.how == "static":
        return experiment
    return replace(experiment, exhibits=partial(motion_exhibit, shown=shown))


def judged(p: Tree) -> str | None:
    """Return the topic whose motion a report describes: that of what is judged."""
    seen: SeenOf = p.settings.seen
    return seen.markers or seen.outline or seen.force


# --- the scene ------------------------------------------------------------------------------------


def _build(recording: Recording, p: Tree, model: Changes, *, build: Any, folder: Path) -> Scene:
    """The static scene with a density's damping, the weight that also acts, and the markers as
    probes."""
    if p.settings.motion.damping_ratio is not None and p.scene.material.stiffness_damping:
        raise UsageError(
            "motion.damping_ratio and material.stiffness_damping are both set; give one of them"
        )
    bare: Scene = build(recording, p, model)
    beta = _stiffness_damping(recording, p, model, build)
    scene = replace(bare, material=replace(bare.material, stiffness_damping=beta))
    if not p.settings.seen.markers:
        return scene
    begun = started(recording, p)
    seen = moving_markers(begun, without_rest(p), (scene.mesh, folder))
    probes = (
        Probe(name, tuple(at.tolist()), stands=True)
        for name, at in zip(seen.names, seen.rest, strict=True)
    )
    return replace(scene, probes=tuple(probes))


def _stiffness_damping(recording: Recording, p: Tree, model: Changes, build: Any) -> float:
    """Beta s: as given, or 2 zeta / w of the first mode (Clough & Penzien 1993, eq. 12-40)."""
    ratio: float | None = p.settings.motion.damping_ratio
    if ratio is None:
        return float(p.scene.material.stiffness_damping)
    first = first_frequencies(build(recording, p, model), 1)[0]
    return ratio / (np.pi * first)


def _sets(p: Tree, seen: Registered) -> Mapping[str, Any]:
    """The step, how loads begin, and what the body rests under before them."""
    sudden = "equilibrium" if seen.sudden else "zero"
    found: dict[str, Any] = {"dt": float(seen.t[0]), "a0": sudden}
    rests = preload(p, seen)
    return found | ({"preload": rests} if rests else {})


# --- damping --------------------------------------------------------------------------------------


def _identify(
    recordings: Sequence[Recording],
    p: Tree,
    methods: Mapping[str, Method],
    *,
    build: Any,
    folder: Path,
) -> Identified:
    """Damping, where a window is given, of the ring-down in it; and what the recording shows.

    Raises `UsageError` for a modulus that stands open, `ComparisonError` for what does not ring.
    """
    if p.scene.material.E is None:
        raise UsageError(
            "material.E is not set: a motion in time needs a known modulus; set it, or identify "
            "it on a static log"
        )
    shown = motion_of(recordings[0], judged(p))
    first = _first_of(recordings[0], p, methods, build)
    headline = f"dynamic: {against_mode(shown, first, p)}"
    seen = f"Recorded motion: {motion_words(shown)}."
    if p.settings.motion.fit_window is not None:
        p, scores, note, names = _ring_down(recordings[0], p, folder, build, methods)
        return Identified(p, scores, (seen, note), headline, calibrated=names)
    if p.settings.motion.damping_ratio is not None:  # every mesh and method has the same damping
        beta = _stiffness_damping(recordings[0], p, next(iter(methods.values())).scene, build)
        p = _damped(p, beta)
    return Identified(p, (), (seen,), headline)


def _damped(p: Tree, beta: float, **settings: Any) -> Tree:
    """With C = beta K in place of a share of critical damping."""
    material = replace(p.scene.material, stiffness_damping=beta)
    motion = replace(p.settings.motion, damping_ratio=None)
    return p.with_scene(material=material).with_settings(motion=motion, **settings)


def against_mode(shown: RecordedMotion, first: float | None, p: Tree) -> str:
    """Return the recorded frequency beside the body's first natural one, in words."""
    recorded = f"recorded motion mostly at {shown.frequency:.3g} Hz"
    if not first:
        return recorded
    assumed = assumed_density(p)
    return f"{recorded}, first mode of the body at {first:.3g} Hz{assumed and f' ({assumed})'}"


def _first_of(
    recording: Recording, p: Tree, methods: Mapping[str, Method], build: Any
) -> float | None:
    model = next(iter(methods.values())).scene
    try:
        return first_frequencies(build(recording, p, model), 1)[0]
    except ValidateError:
        return None


def _ring_down(
    recording: Recording, p: Tree, folder: Path, build: Any, methods: Mapping[str, Method]
) -> tuple[Tree, tuple[Score, ...], str, tuple[str, ...]]:
    """Parameters with beta = 2 zeta / w of the recorded ring-down in the window; every residual of
    that window served for it."""
    motion = p.settings.motion
    window = float(motion.fit_window or 0.0)
    begun = started(recording, p.with_settings(motion=replace(motion, length=window)))
    found = motion_of(begun.recording, judged(p)).ringing
    if found is None or found.damping <= 0:
        raise ComparisonError(
            f"motion.fit_window = {window:g} s: it contains no ring-down (three or more decaying "
            f"periods are needed); give material.stiffness_damping or motion.damping_ratio"
        )
    w = 2 * np.pi * found.frequency
    beta, share = 2 * found.damping / w, found.damping_sd / found.damping
    mesh = build(recording, p, next(iter(methods.values())).scene).mesh
    seen = moving_markers(started(recording, p), without_rest(p), (mesh, folder))
    used = _damped(p, beta, ranges=replace(p.settings.ranges, damping=max(share, 1e-3)))
    note = (
        f"Damping was identified, not predicted: ratio {found.damping:.4f} (sd "
        f"{found.damping_sd:.2g}) at {found.frequency:.4g} Hz, of the ring-down in the first "
        f"{window:g} s; only later samples are evidence."
    )
    score = Score(
        "damping.ratio", found.damping, "1", 1, "identified",
        f"share of critical damping of the ring-down in the first {window:g} s",
    )  # fmt: skip
    return used, (score,), note, tuple(f"{name}@{FIRST}" for name in seen.names)


# --- what is uncertain ----------------------------------------------------------------------------


_INPUTS = (
    vary("material.rho", "relative ranges.rho", "density", "rho within its declared uncertainty"),
    vary("material.stiffness_damping", "relative ranges.damping, at least 0", "damping",
         "damping within its declared uncertainty"),
)  # fmt: skip


# --- statics of what moves ------------------------------------------------------------------------


def doubting(
    recordings: Sequence[Recording],
    p: Tree,
    methods: Mapping[str, Method],
    *,
    identify: Any,
    build: Any,
) -> Identified:
    """What statics identifies; where the recording shows inertia, headline and warnings doubt it.

    Of slow recordings a note says that they are quasi-static.
    """
    found: Identified = identify(recordings, p, methods)
    try:
        shown = motion_of(recordings[0], p.settings.seen.markers)
    except ValidateError:
        return found
    first = (
        _first_of(recordings[0], found.parameters, methods, build) if p.scene.material.E else None
    )
    if not shown.inertia_matters(first):
        slow = f"Quasi-static: {against_mode(shown, first, p)}; inertia is small."
        return replace(found, notes=(*found.notes, slow)) if first else found
    why = (
        f"statics, although inertia matters: {against_mode(shown, first, p)}; answer motion.how = "
        "dynamic in `validate new`"
    )
    headline = f"{why}; {found.headline}" if found.headline else why
    seen = f"Recorded motion: {motion_words(shown)}."
    return replace(
        found, headline=headline, doubts=(*found.doubts, why), notes=(*found.notes, seen)
    )
