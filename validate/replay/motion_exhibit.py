"""The recorded motion as a report shows it: over time along where it is largest, its spectrum, and
its facts beside the body's first modes."""

from collections.abc import Mapping

import numpy as np

from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.errors import ValidateError
from validate.identify.recorded_motion import FRACTION, RecordedMotion, recorded_motion
from validate.identify.ringing import spectrum
from validate.replay.experiment import Progress, Told
from validate.replay.first_modes import assumed_density, first_frequencies
from validate.replay.followed import MAIN, Cases, Followed
from validate.replay.tree import Tree
from validate.report.motion_words import rests
from validate.report.numbers import scale, shown_unit
from validate.scene.scene import Scene

_POINTS = 1500  # of a chart


def motion_exhibit(p: Tree, cases: Cases, tell: Progress, *, shown: RecordedMotion) -> Told:
    """The recorded motion `shown`, and the runs of its marker where they are compared with it."""
    main = cases[MAIN]
    scene = next(iter(main.values())).scene
    modes = _modes(scene) if isinstance(scene, Scene) else ()
    facts = _facts(shown, modes, assumed_density(p))
    charts = (*_over_time(shown, main), *_spectrum(shown))
    words = f"'{shown.marker}' moves most; along its direction, in the recording's frame."
    return Told((Exhibit("recorded-motion", "The recorded motion", (words,), (facts,), charts),))


def _modes(scene: Scene) -> tuple[float, ...]:
    try:
        return first_frequencies(scene)
    except (ValidateError, np.linalg.LinAlgError):
        return ()


def _facts(shown: RecordedMotion, modes: tuple[float, ...], assumed: str) -> NumberTable:
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
    return NumberTable("recorded_motion", "The recorded motion, and the body's first modes.",
                       ("what", "value", "unit", "note"), tuple(rows))  # fmt: skip


def _over_time(shown: RecordedMotion, main: Mapping[str, Followed]) -> tuple[Chart, ...]:
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
    f, amplitude = spectrum(t, np.interp(t, shown.t, shown.y))
    last = f <= max(10 * shown.frequency, 10 * shown.resolution)
    return (Chart("recorded_spectrum", f"Spectrum of '{shown.marker}'", "frequency / Hz",
                  f"amplitude / {unit}", (Series("measured", f[last], size * amplitude[last]),),
                  caption="Under Hann's window, a parabola removed."),)  # fmt: skip
