"""The modulus of Ecoflex cylinders, by law and by what the plates may have done.

Whether the plates slipped was not recorded, so linear FEM brackets it: slipping plates take the
apparent modulus as the material's, bonded ones divide it by the stiffening that the mesh shows.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import hypot, sqrt
from typing import Any, TypeVar

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.score import Score
from validate.errors import ComparisonError
from validate.fem.system import build as build_system
from validate.identify.budget import Votes
from validate.identify.modulus import ModulusFit
from validate.parameters import with_given
from validate.pipeline.experiment.experiment import Identified
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording
from validate.register.signals import SignalObservation
from validate.scene.geometries.box import member

from .cylinder import (
    LoggedCylinder,
    model_scene,
    place,
    size,
    stiffening,
)
from .law_scale import LawFit, fit_scale
from .specimens import (
    HeldOut,
    ModulusSummary,
    apart_notes,
    left_out,
    specimen_of,
    split,
    summarised,
)

T = TypeVar("T")

LAWS = ("svk_slip", "neo_slip", "neo_bonded")
_ORDER = 1.19  # of convergence, which the corners at bonded plates limit
_SAFETY = 3.0 / 2  # two meshes: Roache's factor 3 on the difference is a 95 % band, half of it u


def identified(
    recordings: Sequence[Recording], tree: Tree, methods: Mapping[str, Method]
) -> Identified:
    """The modulus for which each method, on its own mesh, has the measured slope or force of the
    specimens that calibrate."""
    p: LoggedCylinder = tree.settings
    apart = split(recordings, p.judged)
    mine = [r for r in recordings if apart.calibrates(r)]
    every_log, own_size = with_given(tree, {"judged": None}), size(tree)
    fits = [ModulusFit.of(r, own_size, (p.fit_from, p.fit_to)) for r in recordings]
    every, names = ([specimen_of(r) for r in logs] for logs in (recordings, mine))
    calibrating = [f for f, s in zip(fits, every, strict=True) if s in apart.calibrating]
    found = summarised(calibrating, names)
    own = Votes.by_specimen([f.E_apparent for f in calibrating], names)
    factors = {name: _stiffening(tree, methods[name]) for name in ("slip", "bonded")}
    laws = {name: _law_fit(mine, every_log, methods[name]) for name in LAWS}
    moduli = {name: found.mean / factor for name, (factor, _) in factors.items()}
    moduli |= {name: fit.scale for name, (fit, _) in laws.items()}
    scores = _scores(found, factors, gent_correction(own_size.diameter, own_size.height))
    for name, (fit, mesh) in laws.items():
        votes = len(own.means) if len(own.means) > 1 else len(mine)
        scores += _law_scores(name, methods[name].label, fit, mesh, votes)
    scores += left_out([f.E_apparent for f in fits], every)
    headline = (
        f"{apart.words}. The modulus lies between "
        f"{_span(moduli['bonded'], found, factors['bonded'])} (bonded plates) and "
        f"{_span(moduli['slip'], found, factors['slip'])} (slipping); force alone cannot decide"
    )
    squat = with_given(tree, {"body.height": own_size.height / 2})
    half = stiffening(squat, methods["bonded"]) / factors["bonded"][0]
    notes = (
        *apart_notes(apart, own, p.ranges.specimen),
        *_notes(found, moduli, half, own_size.height),
    )
    fitted = p.material.E_slip is None or p.material.E_bonded is None
    calibrated = ("force@5pct",) if fitted and not apart.apart else ()
    return Identified(_used(tree, moduli, found, own, apart), scores, notes, headline, calibrated)


def _used(
    tree: Tree,
    moduli: Mapping[str, float],
    found: ModulusSummary,
    own: Votes,
    apart: HeldOut,
) -> Any:
    """The parameters with what was identified where nothing was set, and how sure that is."""
    p: LoggedCylinder = tree.settings
    chosen = {f"material.E_{k}": getattr(p.material, f"E_{k}") or v for k, v in moduli.items()}
    scatter = p.ranges.specimen if own.between is None else own.between / own.mean
    certain = p.ranges.modulus or found.sd_mean / found.mean
    return with_given(
        tree,
        {**chosen, "ranges.specimen": scatter, "ranges.modulus": certain, "judged": apart.judged},
    )


def gent_correction(diameter: float, height: float) -> float:
    """E_apparent / E = 1 + 2 S^2 of a bonded incompressible disc, shape factor S = D / 4h.

    Gent and Lindley, Proc. Inst. Mech. Eng. 173 (1959) 111-122. Sizes in m; small strains, nu 0.5.
    For a squat cylinder (S below about 1) it is low: a finite-element factor is the better one.
    """
    return 1 + 2 * (diameter / (4 * height)) ** 2


def mesh_share(own: float, other: float, ratio: float, order: float) -> float:
    """Standard uncertainty of a value on its `own` mesh, in the value's unit.

    Richardson's estimate from an `other` mesh with cells `ratio` times as large, at an `order` of
    convergence, with the factor for two meshes (Roache 1994). Raises `ComparisonError` where the
    meshes are alike.
    """
    if ratio <= 0 or ratio == 1 or order <= 0:
        raise ComparisonError(f"meshes of ratio {ratio:g}, order {order:g}: two sizes are needed")
    return _SAFETY * abs((own - other) / (1 - float(ratio**order)))


Factor = tuple[float, float]  # apparent over true modulus, and its uncertainty from the mesh


def _stiffening(tree: Tree, method: Method) -> Factor:
    return _meshed(tree, method, lambda m: stiffening(tree, m), float)


def _law_fit(recordings: Sequence[Recording], tree: Tree, method: Method) -> tuple[LawFit, float]:
    """The law's modulus over its whole range, by the method's own mesh, and the mesh's share Pa."""
    return _meshed(tree, method, lambda m: _fitted(recordings, tree, m), lambda f: f.scale)


def _meshed(
    tree: Tree,
    method: Method,
    solve: Callable[[Method], T],
    value: Callable[[T], float],
) -> tuple[T, float]:
    """What `solve` finds on the method's mesh, and the mesh's share from a similar one of about 2/3
    the elements, of 3/2 where two of them are the least."""
    changes = {**(method.scene or {}), "material.E": 1.0}
    own = changes.get("body.cells", tree.scene.body.cells)
    radial, axial = member(own, 2 / 3 if min(own) > 2 else 3 / 2)
    changes["body.cells"] = (radial, axial)
    found, again = solve(method), solve(replace(method, scene=changes))
    ratio = sqrt(own[0] * own[1] / (radial * axial))
    return found, mesh_share(value(found), value(again), ratio, _ORDER)


def _fitted(recordings: Sequence[Recording], tree: Tree, method: Method) -> LawFit:
    scene = model_scene(tree, method, E=1.0)
    stepper = method.settings.prepare(build_system(scene))
    curves: dict[str, list[Floats]] = {}
    forces: dict[str, list[Floats]] = {}
    for recording in recordings:
        seen = place(recording, tree, scene)
        states = [stepper.step(stepper.rest(), q) for q in seen.inputs]
        good = [s.failure is None for s in states]
        found = [s.numbers["stage.force"] for s in states if s.failure is None]
        name = specimen_of(recording)
        curves.setdefault(name, []).append(np.array(found))
        forces.setdefault(name, []).append(seen.of(SignalObservation)[0].y[good, 0])
    return _one_vote_each([fit_scale(curves[name], forces[name]) for name in curves])


def _one_vote_each(fits: Sequence[LawFit]) -> LawFit:
    """The mean over specimens, whose scatter then stands for that of repeats."""
    if len(fits) == 1:
        return fits[0]
    scales, count = [f.scale for f in fits], sum(f.count for f in fits)
    squares = sum(f.residual_rms**2 * f.count for f in fits)
    sd = float(np.std(scales, ddof=1))
    return LawFit(float(np.mean(scales)), sd, count, float(np.sqrt(squares / count)))


def _law_scores(name: str, label: str, fit: LawFit, mesh: float, logs: int) -> tuple[Score, ...]:
    words = f"modulus over the law's whole range, {label}; shear modulus is a third"
    rows = [(f"modulus.{name}", fit.scale, "Pa", words)]
    rows.append((f"modulus.{name}.mesh", mesh, "Pa", _MESH))
    if fit.sd_repeats is not None:
        rows.append((f"modulus.{name}.sd_repeats", fit.sd_repeats, "Pa", "sd of one log's modulus"))
        band = fit.confidence(logs, mesh) or 0.0
        rows.append((f"modulus.{name}.confidence", band, "Pa", _BAND))
    rows.append((f"force.fit_rms.{name}", fit.residual_rms, "N", "rms residual of the fitted law"))
    return tuple(Score(n, v, unit, fit.count, "measured logs", w) for n, v, unit, w in rows)


_MESH = "standard uncertainty from the mesh, of two meshes"
_BAND = "two sd: of the mean over the logs and of the mesh"


def _scores(found: ModulusSummary, factors: Mapping[str, Factor], gent: float) -> tuple[Score, ...]:
    logs, samples = len(found.fits), sum(f.count for f in found.fits)
    noise = rms([f.noise for f in found.fits])
    words = {"slip": "material's, if the plates slip", "bonded": "material's, if the plates hold"}
    rows = [
        ("modulus.E", found.mean, "Pa", samples, "apparent modulus, mean over the logs"),
        ("modulus.E.sd_repeats", found.sd_repeats or 0.0, "Pa", logs, "sd of one log's modulus"),
        ("modulus.E.sd_mean", found.sd_mean, "Pa", logs, "sd of the mean over the logs"),
        ("modulus.bonded_factor", factors["bonded"][0], "1", 1,
         "apparent over true modulus, bonded, this mesh"),
        ("modulus.gent_factor", gent, "1", 1, "the same by Gent's formula"),
        ("load_cell.noise", noise, "N", samples, "sd of the load cell's noise, from the logs"),
    ]  # fmt: skip
    for name, (factor, mesh) in factors.items():
        E = found.mean / factor
        rows += [
            (f"modulus.E_{name}", E, "Pa", samples, words[name]),
            (f"modulus.E_{name}.mesh", E * mesh / factor, "Pa", samples, _MESH),
            (f"modulus.E_{name}.confidence", _band(found, (factor, mesh)), "Pa", samples, _BAND),
        ]
    return tuple(Score(name, v, unit, n, "measured logs", w) for name, v, unit, n, w in rows)


def _band(found: ModulusSummary, factor: Factor) -> float:
    value, mesh = factor
    return 2 * found.mean / value * hypot(found.sd_mean / found.mean, mesh / value)


def _span(E: float, found: ModulusSummary, factor: Factor) -> str:
    """A modulus with two standard deviations of the logs' mean and of the mesh."""
    return f"{E / 1e3:.1f} ± {_band(found, factor) / 1e3:.1f} kPa"


def _notes(
    found: ModulusSummary, moduli: Mapping[str, float], half: float, height: float
) -> tuple[str, ...]:
    offsets = [f.offset for f in found.fits]
    toes = [1e3 * height * f.toe for f in found.fits]
    return (
        f"Whether the plates slipped was not recorded. The material's modulus lies between "
        f"{moduli['bonded'] / 1e3:.1f} kPa (bonded) and {moduli['slip'] / 1e3:.1f} kPa (slipping).",
        f"Force alone cannot distinguish the two. A cylinder of {500 * height:.0f} mm height "
        f"can: its apparent modulus would be {half:.2f} times this one's with bonded plates "
        "and the same with slipping ones.",
        f"Load cell offsets of {min(offsets):.3f}..{max(offsets):.3f} N and toes of "
        f"{min(toes):.3f}..{max(toes):.3f} mm (seating of the plate: where the fitted line reaches "
        "zero force) were taken off.",
    )
