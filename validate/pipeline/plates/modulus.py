"""Modulus of every law of a compression or tension test, with its uncertainty budget.

Each method's own force curve, of a unit modulus on its own mesh, is scaled and shifted to the
measured force in the window "fit": the scale is the modulus, the shift where the load begins (the
toe). Every uncertain input is moved by one standard uncertainty and the modulus identified again.
The predictions then use the value identified under the moved input, so that what identification
and prediction have in common (the area of the specimen, say) cancels as far as it does.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt
from pathlib import Path

import numpy as np

from validate.arrays import Floats, rms
from validate.errors import UsageError
from validate.fem.system import Responses
from validate.fem.system import build as build_system
from validate.identify.budget import NOISE, IdentifiedValue, pattern
from validate.identify.modulus import MIN_SAMPLES, ModulusFit, loading
from validate.identify.scaled_curve import ScaledFit, UnitCurve, fit_modulus_of, fit_scaled
from validate.pipeline.bodies.mesh import DIAMETER, HEIGHT
from validate.pipeline.calibration.fitted_moduli import (
    COMMON,
    Moves,
    counts,
    effect,
    finding,
    misfit,
    on_meshes,
    reidentified,
    sentence,
    with_move,
)
from validate.pipeline.experiment.experiment import Identified, Input, MeshLadder
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree, changed_by, require_used
from validate.pipeline.plates.scene import (
    BuiltPressed,
    Compression,
    Ends,
    between,
    ends_of,
    kind_of_test,
    pressed_size,
)
from validate.recording.merge import repeats_share
from validate.recording.types import Recording
from validate.scene.geometries.specification import Cylinder

_UNIT = 1e3  # Pa
_STEPS = 20  # of the curve to the strain limit, as the run's own table has them
_BEYOND = 1.02  # of the limit: toes
_ENDS = {
    "compression": {"slip": "slipping plates", "bonded": "bonded plates"},
    "tension": {"slip": "ends free to contract", "bonded": "grips"},
}
_OTHER: Mapping[Ends, Ends] = {"slip": "bonded", "bonded": "slip"}


@dataclass(frozen=True)
class _Log:
    """The samples of the window "fit" and of all up to the strain limit: displacement from contact
    m, force from the cell's zero N; the linear fit of the window; noise of the cell N."""

    fit: ModulusFit
    d: Floats
    force: Floats
    used: Floats  # 1 in the window "fit"
    noise: float
    offset_sd: float

    @property
    def window(self) -> tuple[Floats, Floats]:
        inside = self.used > 0
        return self.d[inside], self.force[inside]


def identify_pressed(
    recordings: Sequence[Recording],
    tree: Tree,
    methods: Mapping[str, Method],
    *,
    build: BuiltPressed,
    ladder: MeshLadder,
    accepted: Sequence[str],
    declared: Sequence[Input] = (),
) -> Identified:
    """Every method's modulus by its own law; those of accepted methods with all terms.

    `declared` inputs move more than forces (outlines): they stay, with the modulus of their own.

    Raises `UsageError` for an open modulus of a body with fluid inside, and children of
    `ValidateError` as the log and the laws do.
    """
    material, settings = tree.scene.material, tree.settings
    own = {n: changed_by(tree, m.scene or {}).scene for n, m in methods.items()}
    require_used(material.coefficients, {scene.material.law for scene in own.values()})
    if material.E is not None:
        return Identified(tree, (), ())
    if tree.scene.cavities:
        raise UsageError(
            "material.E is not set: a body with fluid inside does not deform uniformly, and the "
            "log's slope is not its modulus; give it with --set material.E=VALUE"
        )
    recording = recordings[0]
    log = _log(recording, tree, build.folder)
    first = next((n for n in accepted if n in methods), next(iter(methods)))
    order = (first, *(n for n in methods if n != first))
    given = settings.E_bonded is not None
    wanted = [n for n in order if "material.E" not in (methods[n].scene or {})
              and not (given and ends_of(own[n]) == "bonded")] or [first]  # fmt: skip
    found: dict[str, _Fitting] = {}
    for name in wanted:
        one = _Fitting(recording, tree, methods[name], name, build, log)
        same = next((f for f in found.values() if f.model == one.model), None)
        if same is None:
            found[name] = one
        else:
            # Methods of one model have one modulus
            a, b = (f.changed.scene.material for f in (one, same))
            if a != b:
                raise UsageError(
                    f"methods.{one.name}: another material than {same.name}, of the same model "
                    f"({one.model}), whose modulus is identified; set methods.{one.name}.material.E"
                )
    entries = tuple((f.model, f.E, f.toe) for f in found.values())
    bonded = next((f.E for f in found.values() if f.ends == "bonded"), None)
    fitted = replace(
        tree.with_scene(material=replace(material, E=found[wanted[0]].E)),
        settings=replace(settings, by_method=entries, E_bonded=settings.E_bonded or bonded),
    )
    judged = {n: f for n, f in found.items() if n in accepted} or {first: found[first]}
    budgets = {n: _Budget(f, ladder) for n, f in judged.items()}
    values = tuple(b.value(first=n == first) for n, b in budgets.items())
    rest = tuple(_of_rival(n, f) for n, f in found.items() if n not in judged)
    notes = [f"{sentence(v)}." for v in values] + [f"{line}." for line in rest]
    ratios = tuple(
        {b.f.model: b.meshes.ratios[i] for b in budgets.values() if i < len(b.meshes.ratios)}
        for i in range(len(ladder.levels))
    )
    return Identified(
        fitted, (), tuple(notes), calibrated=("force@fit",), values=values,
        inputs=_inputs(budgets, declared), mesh=reidentified(ladder, ratios),
    )  # fmt: skip


def _log(recording: Recording, tree: Tree, folder: Path) -> _Log:
    p, size, test = tree.settings, pressed_size(tree, folder), kind_of_test(tree)
    fit = ModulusFit.of(recording, size, (p.fit_from, p.fit_to), test)
    log = loading(recording, test)
    d = log.d - fit.contact
    strain = d / size.height
    beyond = strain - fit.toe > p.limit
    end = int(np.argmax(beyond)) if beyond.any() else int(np.argmax(strain)) + 1
    before = int((log.d[:end] < fit.contact).sum())
    used = (strain[:end] >= p.fit_from) & (strain[:end] <= p.fit_to)
    noise = max(fit.noise, recording.signal("force", "N").sd)
    zero = sqrt(before) if before >= MIN_SAMPLES else sqrt(max(int(used.sum()), 1)) / 3
    return _Log(
        fit, d[:end], log.force[:end] - fit.offset, used.astype(float), noise, noise / max(zero, 1)
    )


class _Fitting:
    """One method's own curve and the scale and shift that fit it to the log."""

    def __init__(
        self, recording: Recording, tree: Tree, method: Method, name: str, build: BuiltPressed,
        log: _Log,
    ) -> None:  # fmt: skip
        self.recording, self.tree, self.name = recording, tree, name
        self.p: Compression = tree.settings
        self.method, self.build, self.log = method, build, log
        self.size = pressed_size(tree, build.folder)
        self.changed = changed = changed_by(tree, method.scene or {})
        self.model, self.law = build.model(changed), changed.scene.material.law
        self.ends = ends_of(changed.scene)
        self.linear = self.law == "linear"
        self.meshed = not isinstance(tree.scene.body, Cylinder)
        start = log.fit.E_apparent
        self.curve, self.fit, self.solutions = fit_modulus_of(
            lambda E: self.curve_of(tree, E, self.p.limit), self.fitted, start
        )

    @property
    def E(self) -> float:
        return self.fit.scale

    @property
    def toe(self) -> float:
        """m from contact."""
        return self.fit.shift

    def fitted(self, curve: UnitCurve, force: float = 0.0) -> ScaledFit:
        """The curve fitted in the window, with `force` N added to what was measured."""
        d, F = self.log.window
        start = self.log.fit.toe * self.size.height
        return fit_scaled(curve, d, F + force, sd=self.log.noise, shifted=True, start=start)

    def curve_of(
        self, tree: Tree, E: float, limit: float, *, ends: Ends | None = None, law: str = ""
    ) -> UnitCurve:
        """Force of modulus E to the strain `limit`, on the mesh that the parameters have."""
        law = law or self.law
        own = changed_by(tree, self.method.scene or {})
        changes = {**(between(ends, own) if ends else {}), "material.law": law, "material.E": E}
        built = self.build(self.recording, own, changes)
        height = pressed_size(tree, self.build.folder).height
        reach = _BEYOND * limit * height + abs(self.log.fit.toe) * height
        if law == "linear":
            # One solution: displacement and force are in proportion.
            unit = float(Responses.of(build_system(built)).reactions[0, 0])
            return UnitCurve(np.array([0.0, reach]), np.array([0.0, unit * reach]), E)
        step = self.p.limit * height / _STEPS
        grid: Floats = step * np.arange(np.ceil(reach / step) + 1.0)
        stepper = self.method.given({"step": step}).prepare(build_system(built))
        states = [stepper.step(stepper.rest(), np.array([d])) for d in grid]
        forces = [s.numbers["stage.force"] for s in states if s.failure is None]
        return UnitCurve(grid[: len(forces)], np.array(forces), E)

    def predicted(self, curve: UnitCurve, fit: ScaledFit) -> Floats:
        """Force beyond the window under a fit, N."""
        beyond = self.log.d > self.p.fit_to * self.size.height
        return fit.scale * curve(self.log.d[beyond] - fit.shift)


class _Budget:
    """What one standard uncertainty of every input makes of a method's modulus."""

    def __init__(self, f: _Fitting, ladder: MeshLadder) -> None:
        self.f, p = f, f.p
        fit, E = f.fit, f.E
        self._own = self._linear_stiffness(f.tree)
        # Without the finest level where every mesh has the exact, uniform solution
        f = self.f
        fewer = replace(ladder, levels=ladder.levels[:2])
        sizes = {ladder.size(f.tree), *(ladder.size(change(f.tree)) for change in fewer.levels)}
        self.meshes = on_meshes(
            f.tree,
            fewer if f.linear and self._uniform and len(sizes) == 3 else ladder,
            E,
            self._on_mesh,
        )
        zero = f.fitted(f.curve, f.log.offset_sd)
        coarse = f.curve.coarser
        step = abs(f.fitted(coarse).scale - E) / 3 if coarse is not None else 0.0
        self.curves = self._curves()
        self.moved = {name: f.fitted(curve) for name, curve in self.curves.items()}
        scale = p.ranges.load * E
        self.parts = {
            NOISE: fit.alone,
            "contact point": hypot(fit.along_shift, zero.scale - E),
            "mesh": self.meshes.u * E,
            "load step": step,
            **{name: abs(one.scale - E) for name, one in self.moved.items()},
            "load cell": scale,
            "repeats": repeats_share(f.recording) * E,
        }

    def _on_mesh(self, tree: Tree) -> float:
        f = self.f
        return f.fitted(f.curve_of(tree, f.E, f.p.fit_to)).scale

    def _curves(self) -> dict[str, UnitCurve]:
        """The method's curve under every moved input, by its name."""
        f, tree, r = self.f, self.f.tree, self.f.p.ranges
        found = {}
        wide, high = 1 + r.diameter, 1 + r.height
        for name, changed, plain in (
            ("diameter", _larger(tree, DIAMETER, f.size.diameter * wide), wide**2),
            ("height", _larger(tree, HEIGHT, f.size.height * high), 1 / high),
        ):
            gain = self._stiffer(changed) if changed is not None else plain
            along = high if name == "height" else 1.0
            found[name] = f.curve.scaled(gain * along, along)
        held = self._stiffer(tree, _OTHER[f.ends])
        found["friction"] = f.curve.scaled(1 + r.friction * (held - 1))
        # Moved up by one standard uncertainty, or down where that ends at .5
        nu, off = tree.scene.material.nu, tree.settings.ranges.nu
        moved = tree.given({"material.nu": nu + off if nu + off < 0.4999 else nu - off})
        if not (f.linear and self._uniform):
            found["Poisson ratio"] = (
                f.curve.scaled(self._stiffer(moved))
                if f.linear
                else f.curve_of(moved, f.E, f.p.limit)
            )
        return found

    @property
    def _uniform(self) -> bool:
        """Whether every cell is strained alike."""
        return self.f.ends == "slip" and not self.f.meshed

    def _stiffer(self, tree: Tree, ends: Ends | None = None) -> float:
        """Stiffness of the linear law with other parameters or ends, over that as it is."""
        if self._uniform and not ends:  # modulus times area over height
            a, b = pressed_size(tree, self.f.build.folder), self.f.size
            return (a.area / a.height) / (b.area / b.height)
        return self._linear_stiffness(tree, ends) / self._own

    def _linear_stiffness(self, tree: Tree, ends: Ends | None = None) -> float:
        """N/m of the linear law with a unit modulus, on the method's mesh."""
        f = self.f
        found = f.curve_of(tree, _UNIT, f.p.fit_to, law="linear", ends=ends)
        return float(found.force[-1] / found.d[-1])

    def value(self, *, first: bool) -> IdentifiedValue:
        f, p = self.f, self.f.p
        name = "material.E" if first else f"material.E of {f.name}"
        on = f"force of {f.recording.name} from {100 * p.fit_from:.3g} to {100 * p.fit_to:.3g} %"
        parts = {k: u for k, u in self.parts.items() if u > 0}
        f = self.f
        d, F = f.log.d, f.log.force
        kept = d >= f.p.fit_from * f.size.height
        at = d[kept] - f.toe
        curve, slope = f.curve(at), f.E * f.curve.slope(at)
        followed = np.stack([curve, slope], axis=1)
        residual = F[kept] - f.E * curve
        beyond = d[kept] > f.p.fit_to * f.size.height
        off = misfit(residual[beyond], f.fit.noise, self._u_predicted(), f.fit.dependence)
        shape = pattern(at, residual, followed, f.log.noise, f.fit.dependence)
        return IdentifiedValue(
            name, f.E, "Pa", f.name, f"{on} of strain", parts, len(f.fit.residual),
            f.fit.freedom, COMMON, finding(f.law, shape, off),
        )  # fmt: skip

    def _u_predicted(self) -> float:
        """Standard uncertainty of the force beyond the window, N rms, from identification."""
        f = self.f
        base = f.predicted(f.curve, f.fit)
        size = rms(base[:, None])
        alone = f.fit.alone / f.E * size
        shifted = replace(
            f.fit, scale=f.E + f.fit.along_shift, shift=f.fit.shift + f.fit.shift_sd
        )  # fmt: skip
        toe = effect(base, f.predicted(f.curve, shifted)) * size
        each = [effect(base, f.predicted(self.curves[n], m)) * size for n, m in self.moved.items()]
        return hypot(alone, toe, *each)


def _larger(tree: Tree, path: str, size: float) -> Tree | None:
    """Another size of a cylinder; None where the shape is a mesh file's own."""
    return tree.given({path: size}) if isinstance(tree.scene.body, Cylinder) else None


# --- what identification leaves uncertain in predictions ------------------------------------------


def _inputs(budgets: Mapping[str, _Budget], declared: Sequence[Input]) -> tuple[Input, ...]:
    """Inputs of the predictions, of all models at once; what cancels is left out.

    A `declared` input moves the body itself, and the modulus as identification under it does.
    """
    by = "identified on the window 'fit'"
    fits = {b.f.model: b.f.fit for b in budgets.values()}
    noise = Moves({m: 1 + f.alone / f.scale for m, f in fits.items()}, {})
    toe = Moves(
        {m: 1 + f.along_shift / f.scale for m, f in fits.items()},
        {m: f.shift_sd for m, f in fits.items()},
    )
    found = [
        with_move("identified modulus", "E within the noise of its fit", by, noise),
        with_move("contact point", "start of the load, and E fitted with it", by, toe),
    ]
    names = dict.fromkeys(n for b in budgets.values() for n in b.moved)
    kept = [i for i in declared if i.name != "modulus"]
    for i in kept:
        ratios = {b.f.model: b.moved[i.name].scale / b.f.E
                  for b in budgets.values() if i.name in b.moved}  # fmt: skip
        found.append(with_move(i.name, i.doc, i.source, Moves(ratios, {}), i.move))
    for name in (n for n in names if n not in {i.name for i in kept}):
        ratios = {b.f.model: 1 + _left(b, name) for b in budgets.values() if name in b.moved}
        if any(counts(r - 1) for r in ratios.values()):
            doc = f"{name} within its declared range, E identified again under it"
            found.append(with_move(name, doc, "assumed", Moves(ratios, {})))
    return tuple(found)


def _left(b: _Budget, name: str) -> float:
    """What an input still does to the force beyond the window after E is identified again."""
    f = b.f
    return effect(f.predicted(f.curve, f.fit), f.predicted(b.curves[name], b.moved[name]))


def _of_rival(name: str, f: _Fitting) -> str:
    half, ends = 2 * f.fit.sd, _ENDS[kind_of_test(f.tree)][f.ends]
    return (
        f"E = {f.E:.5g} ± {half:.3g} Pa (two sd of the fit alone) was identified by {name} for "
        f"{ends}, law '{f.law}'; this method is not checked"
    )
