"""The cone of paper 003 beside ours: what its 0.15 N can show, and elements."""

from collections.abc import Mapping

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.exhibit import Entry, Exhibit, NumberTable
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.register.markers.markers import MarkerObservation
from validate.register.signals import SignalObservation

from ..ekf_cube.tables import (
    fields_apart,
    locking_table,
    readings_table,
    steps_table,
)

_MM = 1e3
_PRINTED_FORCE, _PRINTED_STEP = 0.15, 1e-4  # N, s
_SEEN = 2.0  # standard deviations that a motion must span to be seen
_UNSEEN = "below noise; no method is ranked there."
_KINETIC = 0.01  # of the strain energy, after the first tenth of the ramp
_NU = (0.45, 0.49, 0.499, 0.4995)


def tell_cone(tree: Tree, cases: Cases, progress: Progress) -> ReportAdditions:
    """Signal against noise, ranking where there is one, elements, inertia, force readings."""
    main = cases[""]
    explicit = main["nfem"]
    progress("readings of the force")
    readings = readings_table(explicit.body, _PRINTED_FORCE, "z")
    progress("locking")
    locking = locking_table(explicit.body, _NU)
    locked = locking.rows[-1][1]
    assert isinstance(locked, float)
    limits = steps_table(explicit.body, _PRINTED_STEP)
    share = kinetic_share(explicit)
    numbers = {
        "nodes": float(len(explicit.body.mesh.nodes)),
        "cells": float(len(explicit.body.mesh.cells)),
        "locking": locked,
        "fields_apart": fields_apart(cases.get("small", {}), ("ekf_held", "nfem")),
    }
    if share is not None:
        numbers["kinetic_share"] = share
    ranked = (_ranking(main, tree.settings.twin.force),) if _seen(explicit, "node_A") else ()
    signals = Exhibit(
        "signal",
        "Motion of the markers against noise",
        _noise_words(cases),
        (_noise_table(cases), *ranked),
    )
    elements = Exhibit(
        "elements",
        "Element, material and force",
        (_inertia_words(tree.settings.clock.scale, share),),
        (_forces(main), locking, readings, limits, _cards(tree, main)),
    )
    return ReportAdditions((signals, elements), numbers)


def _inertia_words(scale: float, share: float | None) -> str:
    taken = f"Explicit runs take the ramp {scale:g} times as fast as it was recorded; "
    if share is None:
        return f"{taken}this run did not reach its end, so its inertia is not checked."
    verdict = "within" if share <= _KINETIC else "beyond"
    return (
        f"{taken}after its first tenth kinetic energy is at most {100 * share:.2f} % of strain "
        f"energy: {verdict} the declared {100 * _KINETIC:g} %."
    )


def kinetic_share(followed: MethodRun) -> float | None:
    """Largest kinetic over strain energy after the first tenth; None for a run that ended early."""
    if not followed.whole:
        return None
    traces, t = followed.run.traces, followed.run.t
    later = t > t[-1] / 10
    kinetic, strain = traces["energy.kinetic"].y[later], traces["energy.strain"].y[later]
    return float((kinetic / strain).max())


def _noise_words(cases: Cases) -> tuple[str, ...]:
    words = []
    for name, case in cases.items():
        followed = case["nfem"]
        moved, sd = _motion(followed, "node_A")
        verdict = "above noise." if _seen(followed, "node_A") else _UNSEEN
        words.append(
            f"{name or 'recorded'}: the plate moves by {_MM * moved:.3f} mm, the tracker's noise "
            f"is {_MM * sd:.3f} mm: {verdict}"
        )
    return tuple(words)


def _seen(followed: MethodRun, probe: str) -> bool:
    moved, sd = _motion(followed, probe)
    return moved > _SEEN * sd


def _motion(followed: MethodRun, probe: str) -> tuple[float, float]:
    """Largest true displacement m of a probe, and the tracker's sd m."""
    sd = next((m.sd for m in followed.seen.of(MarkerObservation)), 0.0)
    return float(np.linalg.norm(followed.truth.probes[probe], axis=1).max()), sd


def _noise_table(cases: Cases) -> NumberTable:
    rows: list[tuple[Entry, ...]] = []
    for name, case in cases.items():
        followed = case["nfem"]
        for probe in followed.truth.probes:
            moved, sd = _motion(followed, probe)
            seen = "above noise" if _seen(followed, probe) else "below noise"
            rows.append((name or "recorded", probe, _MM * moved, _MM * sd, moved / sd, seen))
    return NumberTable(
        "signal",
        "Largest motion of every marker against the noise of one sample; detectable above "
        f"{_SEEN:g} sd.",
        ("case", "marker", "largest motion / mm", "noise sd / mm", "ratio / 1", "verdict"),
        tuple(rows),
    )


def _error_z(followed: MethodRun, probe: str) -> Floats:
    """Estimate less truth (nt,) m at a probe, along z."""
    return followed.run.traces[f"{probe}.z"].y - followed.reference(probe)[:, 2]


def _ranking(main: Mapping[str, MethodRun], force: float) -> NumberTable:
    """Methods by their error at B, which no filter is given."""
    errors = {
        f.label: [_MM * rms(_error_z(f, probe)) for probe in ("node_B", "node_A")]
        for f in main.values()
        if "node_B" in f.scored
    }
    ordered = sorted(errors.items(), key=lambda item: item[1][0])
    rows: tuple[tuple[Entry, ...], ...] = tuple(
        (i + 1, label, *values) for i, (label, values) in enumerate(ordered)
    )
    return NumberTable(
        "ranking",
        f"At {force:g} N, by the error of u_z at node B on the side, which no filter is given.",
        ("rank", "method", "RMSE at B / mm", "RMSE at A / mm"),
        rows,
        "One recording: neighbours closer than the marker's noise are not distinguishable.",
    )


def _forces(main: Mapping[str, MethodRun]) -> NumberTable:
    """Force at the end by element, for bodies that the plate moves, beside what was measured."""
    rows: list[tuple[Entry, ...]] = []
    for f in main.values():
        seen = [s for s in f.seen.of(SignalObservation) if s.quantity == "force"]
        if not seen or not f.whole:
            continue
        ours, theirs = float(f.run.traces[seen[0].trace].y[-1]), _end(seen[0].t, seen[0].y[:, 0])
        rows.append((f.label, ours, theirs, 100 * (ours / theirs - 1)))
    return NumberTable(
        "forces",
        "Plate force at the end of the ramp by element; linear tetrahedra lock.",
        ("method", "simulated / N", "measured / N", "difference / %"),
        tuple(rows),
    )


def _end(t: Floats, y: Floats) -> float:
    """Last value of the straight line through the samples: one sample is mostly noise."""
    slope, offset = np.polyfit(t, y, 1)
    return float(slope * t[-1] + offset)


def _cards(tree: Tree, main: Mapping[str, MethodRun]) -> NumberTable:
    """The force of the accepted element for every material card: proportional to the modulus."""
    shear = {
        "paper": (22_081.0, "printed, paper 003"),
        "cylinders_slip": (31_200.0, "real Ecoflex 00-30 cylinders, if their plates slipped"),
        "cylinders_bonded": (18_500.0, "the same, if their plates were bonded"),
    }
    followed, used = main["plate_p2"], tree.scene.material
    end = float(followed.run.traces["plate.force"].y[-1]) if followed.whole else None
    base = used.shear_modulus
    rows = tuple(
        (card, mu / 1e3, 2 * (1 + used.nu) * mu / 1e3, end * mu / base if end else None, words)
        for card, (mu, words) in shear.items()
    )
    return NumberTable(
        "cards",
        "Material parameters: shear modulus and the force that quadratic elements predict "
        "with it at the same compression.",
        (
            "card",
            "shear modulus / kPa",
            "material.E / kPa",
            "force at the end / N",
            "where it comes from",
        ),
        rows,
        "Choose one with --set material.E=VALUE.",
    )
