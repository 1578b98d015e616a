"""The recorded motion as a report shows it: over time along where it is largest, its spectrum, and
its facts beside the body's first modes."""

from collections.abc import Mapping

import numpy as np

from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.errors import ValidateError
from validate.identify.ringing import spectrum
from validate.replay.experiment import Progress, Told
from validate.replay.first_modes import first_frequencies
from validate.replay.followed import MAIN, Cases, Followed
from validate.replay.likely_causes import Motions, motions_of
from validate.replay.measured_cards import MeasuredBody
from validate.replay.recorded_motion import FRACTION, RecordedMotion, recorded_motion
from validate.scene.scene import Scene

_MM = 1e3
_POINTS = 1500  # of a chart


def motion_exhibit(p: MeasuredBody, cases: Cases, tell: Progress) -> Told:
    """Nothing of a recording whose markers show no motion in time."""
    main = cases[MAIN]
    found = {name: m for name, f in main.items() if (m := motions_of(f, inertia=True))}
    if not found:
        return Told()
    first = next(iter(found.values()))
    try:
        named = {name: first.measured[:, j] for j, name in enumerate(first.names)}
        shown = recorded_motion(first.t, named, first.noise)
    except ValidateError:
        return Told()
    scene = next(iter(main.values())).scene
    facts = _facts(shown, _modes(scene) if isinstance(scene, Scene) else ())
    charts = (_over_time(shown, found, main), *_spectrum(shown))
    words = f"The marker that moves most, '{shown.marker}', along where it moves most."
    return Told((Exhibit("recorded-motion", "The recorded motion", (words,), (facts,), charts),))


def _modes(scene: Scene) -> tuple[float, ...]:
    try:
        return first_frequencies(scene)
    except (ValidateError, np.linalg.LinAlgError):
        return ()


def _facts(shown: RecordedMotion, modes: tuple[float, ...]) -> NumberTable:
    along = ", ".join(f"{x:+.3f}" for x in shown.direction)
    rings = shown.ringing
    rows: list[tuple[Entry, ...]] = [
        ("largest motion, peak to peak", _MM * shown.size, "mm",
         f"'{shown.marker}' along ({along})"),
        ("from first to last sample", _MM * shown.drift, "mm", "drift, or another rest"),
        ("samples a second", shown.rate, "Hz", ""),
        ("gaps", shown.gaps, "1", f"longest interval {shown.gap:.4g} s, "
                                  f"{100 * shown.missing:.2g} % of the samples missing"),
        ("rests from", shown.rests_from, "s", "" if shown.rests_from else "never until the end"),
        ("largest peak of the spectrum", shown.frequency, "Hz",
         f"resolved to {shown.resolution:.2g} Hz"),
        ("ring-down, frequency", rings.frequency if rings else None, "Hz",
         f"damping {rings.damping:.3g} (sd {rings.damping_sd:.1g})" if rings else "none seen"),
        *((f"natural frequency {i}", f, "Hz", "of the body as it is held, undamped")
          for i, f in enumerate(modes, 1)),
    ]  # fmt: skip
    if modes:
        share = shown.above(FRACTION * modes[0]) / shown.size
        word = "matters" if shown.inertia_matters(modes[0]) else "is small"
        rows.append(("motion above a third of the first", 100 * share, "%",
                     f"rms, of peak to peak: inertia {word}"))  # fmt: skip
    return NumberTable("recorded_motion", "What was recorded, and the body's first modes.",
                       ("what", "value", "unit", "note"), tuple(rows))  # fmt: skip


def _over_time(
    shown: RecordedMotion, found: Mapping[str, Motions], main: Mapping[str, Followed]
) -> Chart:
    kept = slice(None, None, max(1, len(shown.t) // _POINTS))
    series = [Series("measured", shown.t[kept], _MM * shown.y[kept], "points")]
    for name, motions in found.items():
        j = motions.names.index(shown.marker)
        u = motions.simulated[:, j] @ shown.direction
        seen = np.isfinite(u)
        series.append(Series(main[name].label, motions.t[seen], _MM * u[seen]))
    return Chart("recorded_motion", f"'{shown.marker}' along its largest motion", "time / s",
                 "displacement / mm", tuple(series))  # fmt: skip


def _spectrum(shown: RecordedMotion) -> tuple[Chart, ...]:
    if shown.resolution == 0:
        return ()
    t = np.linspace(shown.t[0], shown.t[-1], len(shown.t))
    f, amplitude = spectrum(t, np.interp(t, shown.t, shown.y))
    last = f <= max(10 * shown.frequency, 10 * shown.resolution)
    return (Chart("recorded_spectrum", f"Spectrum of '{shown.marker}'", "frequency / Hz",
                  "amplitude / mm", (Series("measured", f[last], _MM * amplitude[last]),),
                  caption="Under Hann's window, a parabola removed."),)  # fmt: skip
