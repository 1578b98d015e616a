"""Modulus of a measured body, identified with each tested law, with its budget.

Force under a displacement is in proportion to the modulus at a fixed Poisson ratio: one solution
with a unit modulus is scaled to the measured force up to `seen.fit_to` of the load. A second one
with another modulus checks the proportion. Every uncertain input is moved by one standard
uncertainty, by the cheapest method, and the modulus identified again.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt
from typing import Any

import numpy as np

from validate.arrays import Floats, rms
from validate.errors import ComparisonError, SceneError, UsageError
from validate.identify.budget import NOISE, IdentifiedValue, pattern
from validate.identify.scaled_curve import PROPORTIONAL, ScaledFit, fit_proportional
from validate.pipeline.bodies.body_registration import LOW
from validate.pipeline.bodies.drive import drive_kind, mover
from validate.pipeline.bodies.first_modes import Changes, law_of
from validate.pipeline.calibration.fitted_moduli import (
    COMMON,
    Moves,
    OnMeshes,
    counts,
    effect,
    finding,
    misfit,
    on_meshes,
    reidentified,
    sentence,
    with_move,
)
from validate.pipeline.experiment.experiment import Experiment, Identified, Input
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.case_solution import run_on
from validate.recording.merge import repeats_share
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.geometries.indented_bodies import IndentedBlock, IndentedCylinder
from validate.scene.geometries.specification import Box, Cylinder, MeshFile
from validate.scene.laws import Coefficients
from validate.scene.scene import Drive, Scene, Support

_UNIT = 1e3  # Pa: a modulus to scale
_OTHER = 10 * _UNIT  # Pa: another one, to check that force is in proportion to it
_NEWTON = 1e-4  # relative: equilibrium is found to less than this


def model_name(model: Changes) -> str:
    """Return the name of a model in parameters: its law and element, where it has its own."""
    return ", ".join(str(value) for value in (model or {}).values())


def identify_body(
    recordings: Sequence[Recording],
    p: Tree,
    methods: Mapping[str, Method],
    *,
    experiment: Experiment,
) -> Identified:
    """Every method's modulus by its own law; those of accepted methods with all terms.

    Raises `UsageError` where no force under a displacement is judged, and for a law with further
    moduli, with which no force is in proportion to E.
    """
    material, settings = p.scene.material, p.settings
    if material.E is not None:
        return Identified(p, (), ())
    if material.coefficients != Coefficients():
        raise UsageError(
            "material.E is not set, but other coefficients of its law are: give them all"
        )
    if settings.seen.force is None or drive_kind(recordings[0], p) != "moves":
        raise UsageError(
            "material.E is not set: an open modulus is identified on a force under a displacement "
            "(seen.force, a drive or an indenter); give it with --set material.E=VALUE"
        )
    bench = _Bench(experiment, recordings[0], p, methods)
    first = next((n for n in experiment.accepted if n in methods), next(iter(methods)))
    names = (first, *(n for n in methods if n != first))
    fits = {name: bench.fitted(name) for name in names}
    entries = {model_name(methods[n].scene): (f.scale, 0.0) for n, f in reversed(fits.items())}
    E, sd = fits[first].scale, fits[first].sd
    fitted = _of_modulus(p, E).with_settings(
        by_method=tuple((name, *both) for name, both in entries.items()),
        ranges=replace(settings.ranges, E=sd / E),
    )
    judged = {n: f for n, f in fits.items() if n in experiment.accepted} or {first: fits[first]}
    moved = bench.moved()
    meshes = {n: bench.on_meshes(n, f.scale) for n, f in judged.items()}
    values = tuple(
        _value(bench, n, f, meshes[n], moved, first=n == first) for n, f in judged.items()
    )
    rest = (
        f"E = {f.scale:.5g} ± {2 * f.sd:.3g} Pa (two sd of the fit alone) was identified by "
        f"{methods[n].label}; this method is not checked"
        for n, f in fits.items() if n not in judged
    )  # fmt: skip
    notes = tuple(f"{line}." for line in (*map(sentence, values), *rest))
    declared = experiment.uncertainty
    assert declared is not None
    assert declared.mesh is not None
    ratios = tuple(
        {model_name(methods[n].scene): m.ratios[i] for n, m in meshes.items()}
        for i in range(len(declared.mesh.levels))
    )
    return Identified(
        fitted, (), notes, calibrated=(f"force@{LOW}",), values=values,
        inputs=_inputs(declared.inputs, fits, methods, moved),
        mesh=reidentified(declared.mesh, ratios),
    )  # fmt: skip


@dataclass(frozen=True)
class _Moved:
    """An input moved by one standard uncertainty: the modulus identified under it over that
    without, and how much larger the force beyond is that is then predicted, relative."""

    ratio: float
    left: float


class _Bench:
    """Forces of a unit modulus at the compared instants, by method and parameters."""

    def __init__(
        self, experiment: Experiment, recording: Recording, p: Tree,
        methods: Mapping[str, Method],
    ) -> None:  # fmt: skip
        self.experiment, self.recording, self.methods = experiment, recording, methods
        self.p = _of_modulus(p, _UNIT).with_settings(by_method=())
        assert experiment.uncertainty is not None
        wanted = experiment.uncertainty.surrogate
        self.surrogate = wanted if wanted in methods else list(methods)[-1]
        self.seen = experiment.place(recording, self.p, self.scene(self.surrogate, self.p))
        self.cell = next(o for o in self.seen.of(SignalObservation) if o.quantity == "force")
        low = next(s for s in self.seen.selections if s.label == LOW)
        assert low.t is not None
        self.low = np.isin(self.cell.t, low.t)
        self.measured = self.cell.y[:, 0]

    def scene(self, name: str, p: Tree) -> Scene:
        scene = self.experiment.build(self.recording, p, self.methods[name].scene)
        assert isinstance(scene, Scene)
        return scene

    def forces(
        self, name: str, p: Tree, seen: Registered | None = None, steps: int | None = None
    ) -> Floats:
        """Force (nt,) N at the compared instants, up to where the run ends or `steps` of it.

        Raises `ComparisonError` for a run that ends within what identifies.
        """
        method = replace(self.methods[name], steps=steps)
        seen = seen or self.seen
        (run,) = run_on(self.experiment, name, method, p, self.scene(name, p), (seen,))
        done = run.traces[f"{mover(p.scene).name}.force"].y[: len(run.t)]
        t = (
            self.cell.t[self.cell.t <= run.t[len(done) - 1] + 1e-9]
            if len(done)
            else self.cell.t[:0]
        )
        if steps is None and len(t) <= int(np.flatnonzero(self.low)[-1]):
            raise ComparisonError(
                f"'{name}' {run.outcome.state} at step {run.outcome.step} with a modulus of "
                f"{_UNIT:g} Pa: {run.outcome.why}"
            )
        return np.asarray(np.interp(t, run.t[: len(done)], done))

    def fit(self, f: Floats, extra: float = 0.0) -> ScaledFit:
        """The scale of forces of a unit modulus, of 1 Pa, that fits up to `fit_to` of the load."""
        low = self.low[: len(f)]
        measured = self.measured[: len(f)][low] + extra
        return fit_proportional(f[low] / _UNIT, measured, sd=self.cell.sd)

    def fitted(self, name: str) -> ScaledFit:
        """By a method, after a check that its force is in proportion to the modulus.

        Raises `ComparisonError` where it is not.
        """
        f = self.forces(name, self.p)
        first = self.forces(name, _of_modulus(self.p, _OTHER), steps=2)
        own = f[: len(first)] * _OTHER / _UNIT
        off = np.abs(first - own).max(initial=0.0)
        allowed = max(_NEWTON, PROPORTIONAL) * np.abs(own).max(initial=0.0)
        if off > allowed:
            raise ComparisonError(
                f"'{name}': force is not in proportion to the modulus (off by {off:.3g} N at "
                f"{_OTHER:g} Pa); set material.E"
            )
        return self.fit(f)

    def on_meshes(self, name: str, E: float) -> OnMeshes:
        assert self.experiment.uncertainty is not None
        ladder = self.experiment.uncertainty.mesh
        assert ladder is not None
        last = int(np.flatnonzero(np.isin(self.seen.t, self.cell.t[self.low]))[-1])
        return on_meshes(
            self.p, ladder, E, lambda p: self.fit(self.forces(name, p, steps=last + 1)).scale
        )

    def moved(self) -> Mapping[str, _Moved]:
        """Every uncertain input but the fit's noise, by the surrogate."""
        p, name, ranges = self.p, self.surrogate, self.p.settings.ranges
        base = self.forces(name, p)
        found: dict[str, _Moved] = {}

        def add(what: str, changed: Tree, seen: Registered | None = None) -> None:
            found[what] = self._effect(base, self.forces(name, changed, seen))

        assert self.experiment.uncertainty is not None
        for declared in self.experiment.uncertainty.inputs:
            if declared.name == "Poisson ratio":
                add(declared.name, declared.move(p, 1.0))
            if declared.name == "machine compliance":
                changed = declared.move(p, 1.0)
                add(declared.name, p, self.experiment.place(
                    self.recording, changed, self.scene(name, changed)
                ))  # fmt: skip
        add("load", p, self._driven(1 + ranges.load, 0.0))
        zero = hypot(ranges.contact, *(d.sd for d in self.seen.drives))
        if zero > 0:
            add("contact point", p, self._driven(1.0, zero))
        for what, changed in _sizes(p).items():
            add(what, changed)
        if isinstance(p.scene.body, MeshFile):
            found["size"] = _Moved(1 / (1 + ranges.size), 0.0)
        held = _held_sideways(p)
        if held is not None and ranges.friction > 0:
            try:
                stiff = self.forces(name, held)
            except SceneError:  # held twice over: nothing slides there
                return found
            mixed = base + ranges.friction * (stiff[: len(base)] - base[: len(stiff)])
            found["friction"] = self._effect(base, mixed)
        return found

    def _effect(self, base: Floats, moved: Floats) -> _Moved:
        n = min(len(base), len(moved))
        base, moved, low = base[:n], moved[:n], self.low[:n]
        one, other = self.fit(base).scale, self.fit(moved).scale
        beyond = ~low
        left = effect(one * base[beyond], other * moved[beyond]) if beyond.any() else 0.0
        return _Moved(other / one, left)

    def _driven(self, scale: float, shift: float) -> Registered:
        """The recording with its displacement scaled, and shifted after rest."""
        (drive,) = self.seen.drives
        y = scale * drive.y
        y[1:] += shift
        new = replace(drive, y=y)
        observations = tuple(new if o is drive else o for o in self.seen.observations)
        return replace(self.seen, observations=observations)

    def zero_of_force(self, fit: ScaledFit, f: Floats) -> float:
        """Standard uncertainty of the modulus from the zero of the force, Pa."""
        topic, sd = str(self.p.settings.seen.force), 0.0
        signal = self.recording.signals.get(topic)
        if signal is not None:  # its noise over the samples at rest
            until = max(float(self.seen.t[0]) + self.p.settings.seen.still, float(signal.t[0]))
            noise = self.cell.sd if topic == self.p.settings.seen.force else signal.sd
            sd = noise / sqrt(max(int((signal.t <= until).sum()), 1))
        return abs(self.fit(f, sd).scale - fit.scale)


def _of_modulus(p: Tree, E: float) -> Tree:
    return p.with_scene(material=replace(p.scene.material, E=E))


def _sizes(p: Tree) -> dict[str, Tree]:
    """The body with one size after the other larger by its standard uncertainty."""
    by, body = 1 + p.settings.ranges.size, p.scene.body
    found: dict[str, Any] = {}
    if isinstance(body, Box | IndentedBlock):
        found = {f"size {axis}": _widened(body, i, by) for i, axis in enumerate("xyz")}
    if isinstance(body, Cylinder | IndentedCylinder):
        found = {n: replace(body, **{n: by * getattr(body, n)}) for n in ("diameter", "height")}
    return {name: p.with_scene(body=changed) for name, changed in found.items()}


def _widened(body: Any, i: int, by: float) -> Any:
    """A block larger along the axis i; the point that is pressed moves along."""

    def larger(at: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(by * x if i == j else x for j, x in enumerate(at))

    pressed = {"at": larger(body.at)} if isinstance(body, IndentedBlock) else {}
    return replace(body, size=larger(body.size), **pressed)


def _held_sideways(p: Tree) -> Tree | None:
    """The body with everything that slides held; None where nothing does."""
    scene, moved = p.scene, mover(p.scene)
    across: tuple[int, ...] = ()
    if isinstance(moved, Drive):
        across = tuple(c for c in range(3) if not moved.direction[c])
        held = {c for s in scene.supports if s.facets == moved.facets for c in s.components}
        across = () if held >= set(across) else across
    if not across and not any(s.rests for s in scene.supports):
        return None
    supports = tuple(Support(s.facets) if s.rests else s for s in scene.supports)
    sideways = (Support(moved.facets, across),) if isinstance(moved, Drive) and across else ()
    return p.with_scene(supports=(*supports, *sideways))


def _value(
    bench: _Bench,
    name: str,
    fit: ScaledFit,
    meshes: OnMeshes,
    moved: Mapping[str, _Moved],
    *,
    first: bool,
) -> IdentifiedValue:
    p, E = bench.p, fit.scale
    f = bench.forces(name, p)
    parts = {
        NOISE: fit.sd,
        "force zero": bench.zero_of_force(fit, f),
        "mesh": meshes.u * E,
        **{what: abs(m.ratio - 1) * E for what, m in moved.items()},
        "repeats": repeats_share(bench.recording) * E,
    }
    on = f"force of {bench.recording.name} up to {100 * p.settings.seen.fit_to:g} % of the load"
    called = "material.E" if first else f"material.E of {name}"
    return IdentifiedValue(
        called, E, "Pa", name, on, {k: u for k, u in parts.items() if u > 0},
        len(fit.residual), fit.freedom, COMMON, _finding(bench, name, fit, f, moved),
    )  # fmt: skip


def _finding(
    bench: _Bench, name: str, fit: ScaledFit, f: Floats, moved: Mapping[str, _Moved]
) -> str:
    """How the residual of the law departs from noise over the whole load, if it does."""
    n = len(f)
    force = fit.scale * f / _UNIT
    beyond = force[~bench.low[:n]]
    if not len(beyond):
        return ""
    size = rms(beyond[:, None])
    u = size * hypot(fit.sd / fit.scale, *(m.left for m in moved.values()))
    load = np.abs(np.interp(bench.cell.t[:n], bench.seen.t, bench.seen.inputs[:, 0]))
    order = np.argsort(load, kind="stable")
    followed = np.stack([force, np.ones(n)], axis=1)[order]
    residual = (bench.measured[:n] - force)[order]
    law = law_of(bench.methods[name], bench.p)
    off = misfit((bench.measured[:n] - force)[~bench.low[:n]], fit.noise, u, fit.dependence)
    return finding(law, pattern(load[order], residual, followed, fit.noise), off)


def _inputs(
    declared: Sequence[Input],
    fits: Mapping[str, ScaledFit],
    methods: Mapping[str, Method],
    moved: Mapping[str, _Moved],
) -> tuple[Input, ...]:
    """Inputs of the predictions: the body or the load moves, and the modulus as identified."""
    models = {n: model_name(methods[n].scene) for n in fits}

    def all_by(ratio: Callable[[str], float]) -> Moves:
        return Moves({models[n]: ratio(n) for n in fits}, {})

    by = f"identified on force@{LOW}"
    noise = all_by(lambda n: 1 + fits[n].sd / fits[n].scale)
    found = [with_move("identified modulus", "E within the noise of its fit", by, noise)]
    own: dict[str, Any] = {i.name: i for i in declared if i.name in moved}
    for name, one in own.items():
        ratio = moved[name].ratio
        also = own[name].move
        found.append(with_move(name, one.doc, one.source, _same(ratio, models), also))
    for name, m in moved.items():
        if name not in own and counts(m.left):
            doc = f"{name} within its range, E identified again under it"
            found.append(with_move(name, doc, "assumed", _same(1 + m.left, models)))
    return tuple(found)


def _same(ratio: float, models: Mapping[str, str]) -> Moves:
    return Moves(dict.fromkeys(models.values(), ratio), {})
