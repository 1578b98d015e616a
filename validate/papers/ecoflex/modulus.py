"""The modulus of Ecoflex cylinders, by law and by what the plates may have done.

Whether the plates slipped was not recorded, so linear FEM brackets it: slipping plates take the
apparent modulus as the material's, bonded ones divide it by the stiffening that the mesh shows.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from validate.arrays import rms
from validate.compare.score import Score
from validate.fem.system import build as build_system
from validate.identify.law import LawFit, fit_scale
from validate.identify.modulus import (
    Cylinder,
    ModulusSummary,
    apparent_to_material,
    gent_correction,
    identify_modulus,
)
from validate.papers.ecoflex.cylinder import (
    LoggedCylinder,
    model_scene,
    place,
    specimen_size,
    stiffening,
)
from validate.recording.types import Recording
from validate.register.signals import SignalObservation
from validate.replay.experiment import Identified
from validate.replay.method import Method


def identified(
    methods: Mapping[str, Method], recordings: Sequence[Recording], parameters: LoggedCylinder
) -> Identified:
    """The modulus for which this mesh has the measured slope, slipping and bonded."""
    p = parameters
    window = (p.fit_from, p.fit_to)
    diameter, height = specimen_size(recordings[0], p)
    found = identify_modulus(recordings, Cylinder(diameter, height), window)
    slip, bonded = (
        stiffening(diameter, height, p.mesh, p.material.nu, c) for c in ("slip", "bonded")
    )
    half = stiffening(diameter, height / 2, p.mesh, p.material.nu, "bonded")
    laws = {
        name: _law_fit(recordings, p, methods[name])
        for name in ("svk_slip", "neo_slip", "neo_bonded")
    }
    material = replace(
        p.material,
        E_slip=p.material.E_slip or found.mean / slip,
        E_bonded=p.material.E_bonded or found.mean / bonded,
        **{f"E_{k}": getattr(p.material, f"E_{k}") or fit.scale for k, fit in laws.items()},
    )
    scores = _scores(found, bonded, gent_correction(diameter, height))
    scores += tuple(
        s
        for name, fit in laws.items()
        for s in _law_scores(name, methods[name].label, fit, len(recordings))
    )
    headline = (
        f"The modulus lies between {found.mean / bonded / 1e3:.1f} kPa (bonded plates) and "
        f"{found.mean / 1e3:.1f} kPa (slipping): force alone cannot say which"
    )
    notes = _notes(found, bonded, half, height)
    return Identified(replace(p, material=material), scores, notes, headline)


def _law_fit(recordings: Sequence[Recording], p: LoggedCylinder, method: Method) -> LawFit:
    """The law's modulus over its whole range, by the method's own mesh."""
    scene = model_scene(specimen_size(recordings[0], p), p, method.scene, 1.0)
    stepper = method.settings.prepare(build_system(scene))
    curves, forces = [], []
    for recording in recordings:
        seen = place(recording, p, scene)
        states = [stepper.step(stepper.rest(), q) for q in seen.inputs]
        good = [s.failure is None for s in states]
        found = [s.numbers["stage.force"] for s in states if s.failure is None]
        curves.append(np.array(found))
        forces.append(seen.of(SignalObservation)[0].y[good, 0])
    return fit_scale(curves, forces)


def _law_scores(name: str, label: str, fit: LawFit, logs: int) -> tuple[Score, ...]:
    words = f"modulus over the law's whole range, {label}; shear modulus is a third"
    rows = [(f"modulus.{name}", fit.scale, "Pa", words)]
    if fit.sd_repeats is not None:
        rows.append((f"modulus.{name}.sd_repeats", fit.sd_repeats, "Pa", "sd of one log's modulus"))
        band = fit.confidence(logs) or 0.0
        rows.append((f"modulus.{name}.confidence", band, "Pa", "two sd of the mean over the logs"))
    rows.append((f"force.fit_rms.{name}", fit.residual_rms, "N", "rms residual of the fitted law"))
    return tuple(Score(n, v, unit, fit.count, "measured logs", w) for n, v, unit, w in rows)


def _scores(found: ModulusSummary, bonded: float, gent: float) -> tuple[Score, ...]:
    logs, samples = len(found.fits), sum(f.count for f in found.fits)
    bracket = apparent_to_material(found, bonded)
    noise = rms([f.noise for f in found.fits])
    rows = [
        ("modulus.E", found.mean, "Pa", samples, "apparent modulus, mean over the logs"),
        ("modulus.E.sd_repeats", found.sd_repeats or 0.0, "Pa", logs, "sd of one log's modulus"),
        ("modulus.E.sd_mean", found.sd_mean, "Pa", logs, "sd of the mean over the logs"),
        ("modulus.E_slip", bracket.slip, "Pa", samples, "material's, if the plates slip"),
        ("modulus.E_bonded", bracket.bonded, "Pa", samples, "material's, if the plates hold"),
        ("modulus.bonded_factor", bonded, "1", 1, "apparent over true modulus, bonded, this mesh"),
        ("modulus.gent_factor", gent, "1", 1, "the same by Gent's formula"),
        ("load_cell.noise", noise, "N", samples, "sd of the load cell's noise, from the logs"),
    ]
    return tuple(
        Score(name, v, unit, n, "measured logs", words) for name, v, unit, n, words in rows
    )


def _notes(found: ModulusSummary, bonded: float, half: float, height: float) -> tuple[str, ...]:
    offsets = [f.offset for f in found.fits]
    toes = [1e3 * height * f.toe for f in found.fits]
    return (
        f"Whether the plates slipped was not recorded. The material's modulus lies between "
        f"{found.mean / bonded / 1e3:.1f} kPa (bonded) and {found.mean / 1e3:.1f} kPa (slipping).",
        f"Force alone cannot tell the two apart. A cylinder of {500 * height:.0f} mm height would: "
        f"its apparent modulus would be {half / bonded:.2f} times this one's with bonded plates "
        "and the same with slipping ones.",
        f"Load cell offsets of {min(offsets):.3f}..{max(offsets):.3f} N and toes of "
        f"{min(toes):.3f}..{max(toes):.3f} mm (seating of the plate: where the fitted line reaches "
        "zero force) were taken off. The modulus is fitted in the window 5pct, so only 10pct is a "
        "prediction.",
        "The scatter of repeats on one specimen understates that between specimens; the range "
        "declared for the modulus is the latter.",
    )
