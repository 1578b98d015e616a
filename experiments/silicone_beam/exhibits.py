"""What the silicone beam shows besides: its swing, its spectrum, its rest, and what was printed."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.identify.recorded_motion import Ringing
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.run.method_run import MAIN, Cases, MethodRun

from .beam import SETTLED, Resting
from .settings import FEET, TIPS
from .swing import Swing, quantity_of

_MM = 1e3
_TO = 20.0  # Hz: of the spectrum that is shown
_AXES = "xyz"
_SHOWN = {"mixed": "simulated, large strain", "ring_down": "simulated, small vibrations"}


def tell(parameters: Any, cases: Cases, progress: Progress) -> ReportAdditions:
    """From the runs on the recording itself; what did not reach the end is left out."""
    runs = {n: f for n, f in cases[MAIN].items() if n in _SHOWN and f.whole}
    if "mixed" not in runs:
        return ReportAdditions()
    swing = runs["mixed"].seen.of(Swing)[0]
    return ReportAdditions((_swing(swing, runs), _rest(runs["mixed"])), _printed(runs["mixed"]))


# --- the swing ------------------------------------------------------------------------------------


def _swing(swing: Swing, runs: Mapping[str, MethodRun]) -> Exhibit:
    words = (
        f"The first {swing.length:g} s from the release. Deviations are over the measured vertical "
        "peak to peak of each marker; every run is compared from the release that fits it best.",
    )
    charts = (*(_curves(swing, runs, j, 2) for j in range(len(TIPS))),
              *(_curves(swing, runs, j, 0) for j in range(len(TIPS))),
              _spectra(swing, runs))  # fmt: skip
    return Exhibit("swing", "The swing", words, (_ringing(swing, runs), _markers(swing, runs)),
                   charts)  # fmt: skip


def _ringing(swing: Swing, runs: Mapping[str, MethodRun]) -> NumberTable:
    seen = swing.moved[swing.compared]
    found: dict[str, tuple[float | None, Ringing | None]] = {"measured": (None, swing.rung(seen))}
    for name, f in runs.items():
        release, shown = swing.aligned(f.run)
        found[_SHOWN[name]] = (release, swing.rung(shown))
    return NumberTable(
        "ringing",
        "Ringing: the damped oscillation fitted to the mean vertical motion, in the same way; "
        "standard deviations are of that fit. The release is from the last sample at rest.",
        ("", "frequency / Hz", "sd / Hz", "damping ratio / 1", "sd / 1", "periods", "release / ms"),
        tuple((label, *_numbers(rung), None if late is None else _MM * late)
              for label, (late, rung) in found.items()),
        note="no ringing was found" if any(r is None for _, r in found.values()) else "",
    )  # fmt: skip


def _numbers(rung: Ringing | None) -> tuple[Entry, ...]:
    if rung is None:
        return (None,) * 5
    return (rung.frequency, rung.frequency_sd, rung.damping, rung.damping_sd, rung.periods)


def _markers(swing: Swing, runs: Mapping[str, MethodRun]) -> NumberTable:
    rows = []
    for name, f in runs.items():
        off = swing.aligned(f.run)[1] - swing.moved[swing.compared]
        for j, marker in enumerate(swing.names):
            mine = off[:, j][np.isfinite(off[:, j]).all(axis=1)]
            if len(mine):
                rows.append((_SHOWN[name], marker, *_deviation(mine, float(swing.span[j]))))
    return NumberTable(
        "swing",
        "Simulated minus measured displacement of every marker, as a vector and along each axis.",
        ("", "marker", "peak to peak / mm", "rms / mm", "rms / %", "max / mm", "rms x / mm",
         "rms y / mm", "rms z / mm", "samples"),
        tuple(rows),
    )  # fmt: skip


def _deviation(off: Floats, span: float) -> tuple[Entry, ...]:
    whole, each = rms(off), np.sqrt((off**2).mean(axis=0))
    largest = float(np.linalg.norm(off, axis=1).max())
    return (_MM * span, _MM * whole, 100 * whole / span, _MM * largest, *(_MM * each).tolist(),
            len(off))  # fmt: skip


def _curves(swing: Swing, runs: Mapping[str, MethodRun], j: int, axis: int) -> Chart:
    t = swing.t[swing.compared]
    y = swing.moved[swing.compared][:, j, axis]
    seen = np.isfinite(y)
    series = [Series("measured", t[seen], _MM * y[seen], "points")]
    series += [
        Series(_SHOWN[name], t, _MM * swing.aligned(f.run)[1][:, j, axis])
        for name, f in runs.items()
    ]
    marker, word = swing.names[j], {2: "Vertical displacement", 0: "Displacement along the beam"}
    return Chart(
        f"{quantity_of(marker)}_{_AXES[axis]}", f"{word[axis]} of {marker}",
        "time from the last sample at rest / s", f"u_{_AXES[axis]} / mm", tuple(series),
    )  # fmt: skip


def _spectra(swing: Swing, runs: Mapping[str, MethodRun]) -> Chart:
    moved = {"measured": swing.moved[swing.compared]}
    moved[_SHOWN["mixed"]] = swing.aligned(runs["mixed"].run)[1]
    late = swing.t[swing.compared] >= swing.ringing
    series = []
    for label, u in moved.items():
        z, t = u[late][..., 2].mean(axis=1), swing.t[swing.compared][late]
        seen = np.isfinite(z)
        f, amplitude = Ringing.spectrum(t[seen], z[seen])
        series.append(Series(label, f[f <= _TO], _MM * amplitude[f <= _TO]))
    return Chart(
        "spectrum", "Spectrum of the mean vertical motion", "frequency / Hz", "amplitude / mm",
        tuple(series), caption="Without a parabola, with a Hann window, which widens the peaks.",
    )  # fmt: skip


# --- at rest --------------------------------------------------------------------------------------


def _rest(f: MethodRun) -> Exhibit:
    seen = f.seen.of(Resting)[0]
    shown = seen.simulated(f.run.u[-1])
    rows = []
    for j, name in enumerate(seen.names):
        measured, ours = seen.x[-1, j] - seen.rest[j], shown[j] - seen.rest[j]
        numbers = np.stack([measured, ours, ours - measured], axis=1).ravel()
        rows.append((name, *(_MM * numbers).tolist()))
    headings = [f"{w} {c} / mm" for c in _AXES for w in ("measured", "ours", "off")]
    table = NumberTable(
        "rest", "Displacement of every marker from the straight beam to rest.",
        ("marker", *headings), tuple(rows),
    )  # fmt: skip
    return Exhibit(
        "rest-shape", "Rest position",
        ("Seen from the side: the beam's upper and lower edge in its middle plane, and the markers "
         "on their stalks 6 mm off the free end, before the release and at rest.",),
        (table,), (_side(f, seen, shown),),
    )  # fmt: skip


def _side(f: MethodRun, seen: Resting, shown: Floats) -> Chart:
    nodes, u = f.scene.mesh.nodes, f.run.u[-1]
    middle = np.median(np.unique(np.round(nodes[:, 1], 9)))
    series = []
    for label, moved in (("straight", np.zeros_like(u)), (f"{SETTLED}, simulated", u)):
        for of, z in (("lower edge", nodes[:, 2].min()), ("upper edge", nodes[:, 2].max())):
            on = np.flatnonzero((np.abs(nodes[:, 1] - middle) < 1e-9)
                                & (np.abs(nodes[:, 2] - z) < 1e-9))  # fmt: skip
            on = on[np.argsort(nodes[on, 0])]
            at = _MM * (nodes + moved)[on]
            series.append(Series(label, at[:, 0], at[:, 2], of=of))
    for label, x in (("markers before", seen.rest), ("markers at rest", seen.x[-1]),
                     ("markers at rest, simulated", shown)):  # fmt: skip
        series.append(Series(label, _MM * x[:, 0], _MM * x[:, 2], "points"))
    return Chart("side", "The beam and its markers from the side", "x / mm", "z / mm",
                 tuple(series))  # fmt: skip


def _printed(f: MethodRun) -> dict[str, float]:
    """Displacements m of the markers' feet on the beam at rest, by name and axis."""
    return {f"{foot}.{c}": float(f.run.traces[f"{foot}.{c}"].y[-1]) for foot in FEET for c in _AXES}
