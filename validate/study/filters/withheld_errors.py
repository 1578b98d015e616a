"""Errors of an estimate at withheld data: markers, later samples, outlines and forces.

Squared errors are summed over short segments of time, so that a ranking can put them together in
blocks as long as its innovations stay correlated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.estimate.measurements import NORMALS
from validate.fem.assembly.locate import Rows
from validate.fem.system import System
from validate.register.markers.markers import MarkerObservation
from validate.register.observation import Observation, Selection
from validate.register.outlines.outlines import NormalDistances, OutlineObservation
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.mesh import Mesh
from validate.solve.types import Run

SEGMENTS = 120  # of a recording, at most
_DECAYED = float(np.exp(-1))
_LONGEST = 4  # an autocorrelation is taken over this part of the samples


@dataclass(frozen=True)
class Withheld:
    """Sums of squared errors of one quantity over the segments, (seeds, segments) in `unit`^2, and
    how many samples each holds. `ahead`: the quantity was given, and each sample is predicted from
    those before it. `marker`: it is the place of a marker."""

    name: str
    unit: str
    squares: Floats
    counts: Floats
    ahead: bool = False
    marker: bool = False


@dataclass(frozen=True)
class Innovations:
    """Log-likelihood of the innovations of a filter and their degrees of freedom, summed by (seeds,
    segments). `correlation_s` is how long they stay correlated, `lag_1` the largest
    autocorrelation of neighbouring samples; medians over the seeds, None for too few samples."""

    log_likelihood: Floats
    dof: Floats
    correlation_s: float | None
    lag_1: float | None


@dataclass(frozen=True)
class PredictionErrors:
    """Prediction errors of a method without innovations, at the components that filters are given.

    Sums of `squares` (seeds, components, segments) m^2 over the samples of each segment, their
    `counts`, and the `noise` variance (seeds, components, segments) m^2 of one measurement.
    """

    squares: Floats
    counts: Floats
    noise: Floats


@dataclass(frozen=True)
class Segments:
    """Equal parts of the time from 0 to the end of a recording; a sample at t = 0 is in none."""

    edges: Floats

    @property
    def count(self) -> int:
        return len(self.edges) - 1

    @property
    def length(self) -> float:
        """Of one segment, in seconds."""
        return float(self.edges[1] - self.edges[0])

    def number(self, t: Floats) -> Ints:
        """Of the segment that every time (n,) s lies in, -1 for none."""
        segment = np.searchsorted(self.edges, t - 1e-9 * self.edges[-1], side="right") - 1
        inside = (t > 1e-9 * self.edges[-1]) & (segment < self.count)
        return np.asarray(np.where(inside, segment, -1), dtype=np.int64)

    def sums(self, t: Floats, values: Floats) -> Floats:
        """Return the sums (segments,) of values (n,) at times (n,) s."""
        at = self.number(t)
        return np.asarray(np.bincount(at[at >= 0], values[at >= 0], self.count), dtype=float)


def segments_of(registered: Registered) -> Segments:
    """As many as there are samples of what is compared, `SEGMENTS` at most."""
    samples = max((len(o.t) - 1 for o in registered.compared), default=1)
    return Segments(np.linspace(0.0, float(registered.t[-1]), max(1, min(SEGMENTS, samples)) + 1))


# --- markers --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MarkerTracks:
    """Displacements z (nt, k, d) m, NaN = not measured, at times t (nt,) s of markers that are free
    to move; `rows` read them from a field, `rest` (k, d) m are their places."""

    names: tuple[str, ...]
    t: Floats
    z: Floats
    rest: Floats
    rows: Rows

    def of(self, names: Sequence[str]) -> "MarkerTracks":
        """Those of the names that are tracked."""
        at = [self.names.index(n) for n in names if n in self.names]
        rows = Rows(self.rows.weights[at], self.rows.outside[at])
        picked = tuple(self.names[i] for i in at)
        return MarkerTracks(picked, self.t, self.z[:, at], self.rest[at], rows)

    def errors(
        self, t: Floats, u: Floats, segments: Segments, *, ahead: bool
    ) -> tuple[Withheld, ...]:
        """Of displacements u (nt, k, d) m at times t (nt,) s, zero at rest."""
        squared = ((self.estimated(t, u) - self.z) ** 2).sum(axis=2)
        return errors_of(self.names, self.t, squared, segments, ahead=ahead)

    def on(self, mesh: Mesh) -> "MarkerTracks":
        """The same markers, read from fields of another mesh of the body."""
        return replace(self, rows=Rows.barycentric(mesh, self.rest))

    def and_outlines(self, outlines: "Sequence[OutlineTracks]", mesh: Mesh) -> "MarkerTracks":
        """With the places of outlines, as last measured, as markers that move along normals."""
        tracks = self
        for one in outlines:
            last = np.searchsorted(one.t, self.t + 1e-9) - 1
            along = np.where(last[:, None] >= 0, one.distances.z[last], np.nan)
            names = tuple(f"{one.name}.{i}" for i in range(along.shape[1]))
            places = one.distances.rows
            weights = sparse.csr_array(sparse.vstack([tracks.rows.weights, places.weights]))
            tracks = MarkerTracks(
                (*tracks.names, *names), self.t,
                np.concatenate([tracks.z, along[:, :, None] * one.distances.normals], axis=1),
                np.concatenate([tracks.rest, places.apply(mesh.nodes)]),
                Rows(weights, np.concatenate([tracks.rows.outside, places.outside])),
            )  # fmt: skip
        return tracks

    def estimated(self, t: Floats, u: Floats) -> Floats:
        """u (nt, k, d) m at the times of the samples."""
        known, rest = np.append(0.0, t), np.zeros((1, *u.shape[1:]))
        flat = np.concatenate([rest, u]).reshape(len(known), -1)
        interpolated = np.stack([np.interp(self.t, known, y) for y in flat.T], axis=1)
        return interpolated.reshape(len(self.t), *u.shape[1:])

    def held(self, given: "MarkerTracks") -> Floats:
        """Persistence: at every sample the last displacement of the nearest of the markers `given`,
        (nt, k, d) m."""
        last = np.zeros_like(given.z)
        for i, z in enumerate(given.z):
            last[i] = np.where(np.isfinite(z), z, last[i - 1] if i else 0.0)
        away = np.linalg.norm(self.rest[:, None] - given.rest, axis=2)
        return np.asarray(last[:, away.argmin(axis=1)])


def marker_tracks(registered: Registered, system: System) -> MarkerTracks | None:
    """Return the markers that are free to move; None where there is none."""
    observations = registered.of(MarkerObservation)
    if not observations:
        return None
    markers, d = observations[0], system.scene.mesh.dimension
    free = np.zeros(system.scene.mesh.nodes.size)
    free[system.free] = 1.0
    reach = abs(markers.positions.weights) @ free.reshape(-1, d).max(axis=1)
    moving = np.flatnonzero(reach > 0)
    if not len(moving):
        return None
    names = tuple(markers.names[i] for i in moving)
    rows = Rows(markers.positions.weights[moving], markers.positions.outside[moving])
    z = (markers.x - markers.rest)[:, moving]
    return MarkerTracks(names, markers.t, z, markers.rest[moving], rows)


def errors_of(
    names: Sequence[str], t: Floats, squared: Floats, segments: Segments, *, ahead: bool
) -> tuple[Withheld, ...]:
    """Squared errors (n, k) m^2 at times (n,) s, NaN = no sample, by segment."""
    withheld = []
    for name, errors in zip(names, squared.T, strict=True):
        measured = np.isfinite(errors)
        squares = segments.sums(t[measured], errors[measured])
        counts = segments.sums(t[measured], np.ones(int(measured.sum())))
        withheld.append(Withheld(name, "m", squares[None], counts[None], ahead, True))
    return tuple(withheld)


# --- innovations ----------------------------------------------------------------------------------


def ahead_errors(
    t: Floats, names: Sequence[str], y: Floats, measured: Floats, segments: Segments
) -> tuple[Withheld, ...]:
    """Innovations y (nt, m) m of components such as "top.z" by marker; `measured` (nt, m) where
    there is one."""
    owners = [name.rpartition(".")[0] for name in names]
    markers = tuple(dict.fromkeys(owners))
    squared = np.full((len(t), len(markers)), np.nan)
    for j, marker in enumerate(markers):
        columns = np.array([owner == marker for owner in owners])
        sampled = measured[:, columns].any(axis=1)
        squared[sampled, j] = (y[sampled][:, columns] ** 2).sum(axis=1)
    return errors_of(markers, t, squared, segments, ahead=True)


def innovations_of(
    t: Floats, scaled: Floats, log_likelihood: Floats, dof: Floats, segments: Segments
) -> Innovations:
    """Of innovations over their standard deviations (nt, m), NaN = none."""
    # The lag in samples from which the autocorrelation of every component stays within 1/e, and
    # the largest of neighbours; none for fewer than 8 samples.
    lags, firsts = [], []
    for e in scaled.T:
        e = e[np.isfinite(e)]
        if len(e) < 8 or not e.any():
            continue
        most = max(2, len(e) // _LONGEST)
        r = np.array([e[k:] @ e[:-k] for k in range(1, most + 1)]) / (e @ e)
        beyond = np.flatnonzero(np.abs(r) > _DECAYED)
        lags.append(int(beyond[-1]) + 2 if len(beyond) else 1)
        firsts.append(float(r[0]))
    measured = t[np.isfinite(scaled).any(axis=1)]
    every = float(np.median(np.diff(measured))) if len(measured) > 1 else 0.0
    return Innovations(
        segments.sums(t, log_likelihood)[None],
        segments.sums(t, dof)[None],
        max(lags) * every if lags else None,
        max(firsts, key=abs, default=None),
    )


def read_innovations(run: Run, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Innovations (nt, m) m of a run and their standard deviations (nt, m) m, zero for none."""
    y = np.stack([run.traces[f"innovation.{n}"].y for n in names], axis=1)
    sd = np.stack([run.traces[f"innovation.{n}.sd"].y for n in names], axis=1)
    return y, sd


def prediction_errors(
    t: Floats, errors: Floats, noise: Floats, segments: Segments
) -> PredictionErrors:
    """Of errors (nt, m) m at times t (nt,) s, NaN = no sample, of components whose measurements
    have the noise variance (m,) m^2."""
    squares, counts = [], []
    for error in errors.T:
        measured = np.isfinite(error)
        squares.append(segments.sums(t[measured], error[measured] ** 2))
        counts.append(segments.sums(t[measured], np.ones(int(measured.sum()))))
    variances = np.tile(noise[:, None], (1, segments.count))
    return PredictionErrors(np.array([squares]), np.array([counts]), variances[None])


# --- other sensors --------------------------------------------------------------------------------


@dataclass(frozen=True)
class OutlineTracks:
    """An outline's displacements along its normals, at times t (nt,) s, that filters are given."""

    name: str
    t: Floats
    distances: NormalDistances

    def errors(self, t: Floats, u: Floats, segments: Segments) -> tuple[Withheld, ...]:
        """Of displacements u (nt, m, 3) m of its places at times t (nt,) s."""
        along = (u * self.distances.normals).sum(axis=2)
        known = np.append(0.0, t)
        simulated = np.stack([np.interp(self.t, known, np.append(0.0, y)) for y in along.T], axis=1)
        squared = ((simulated - self.distances.z) ** 2).sum(axis=1, keepdims=True)
        return errors_of((self.name,), self.t, squared, segments, ahead=True)


def outline_tracks(registered: Registered, given: Sequence[str]) -> tuple[OutlineTracks, ...]:
    """Return the outlines among what filters are given."""
    return tuple(
        OutlineTracks(o.name, o.t, o.along_normals(NORMALS))
        for o in registered.of(OutlineObservation)
        if o.name in given
    )


def other_errors(
    run: Run, registered: Registered, segments: Segments, given: Sequence[str]
) -> tuple[Withheld, ...]:
    """Of outlines (distance to the simulated wall) and signals that are compared and not `given`,
    at their own samples."""
    others = [o for o in _others(registered) if o.name not in given]
    return tuple(w for o in others for w in _of_sensor(o, run, segments))


def _others(registered: Registered) -> list[Observation]:
    """Those that were sampled over time; sensors of one experiment alone are left out."""
    return [o for o in registered.compared if isinstance(o, OutlineObservation | SignalObservation)]


def other_times(registered: Registered) -> Floats | None:
    """Times (n,) s at which fields are needed to compare sensors other than markers."""
    if not (others := _others(registered)):
        return None
    t = np.unique(np.concatenate([o.t for o in others]))
    return np.asarray(t[(t >= registered.t[0] / 2) & (t <= registered.t[-1])])


def _of_sensor(sensor: Observation, run: Run, segments: Segments) -> list[Withheld]:
    withheld: dict[str, Withheld] = {}
    at = np.where(sensor.t <= run.t[-1], segments.number(sensor.t), -1)
    for i in range(segments.count):
        t = sensor.t[(at == i) & (sensor.t >= run.t[0] / 2)]
        if not len(t):
            continue
        for d in sensor.deviations(run, Selection(f"part {i + 1}", t)):
            none = np.zeros((2, 1, segments.count))
            one = withheld.setdefault(d.quantity, Withheld(d.quantity, d.unit, *none))
            one.squares[0, i] = float((d.values**2).sum())
            one.counts[0, i] = len(d.values)
    return [w for w in withheld.values() if w.counts.any()]


# --- several recordings ---------------------------------------------------------------------------


def by_seed(every: Sequence[tuple[Withheld, ...]]) -> tuple[Withheld, ...]:
    """Return the errors of all seeds, one row each."""
    return _joined(every, 0)


def in_a_row(every: Sequence[tuple[Withheld, ...]]) -> tuple[Withheld, ...]:
    """Return the errors on several recordings, one after the other."""
    return _joined(every, 1)


def _joined(every: Sequence[tuple[Withheld, ...]], axis: int) -> tuple[Withheld, ...]:
    keyed: list[Mapping[tuple[str, bool], Withheld]] = [
        {(w.name, w.ahead): w for w in one} for one in every
    ]
    common = [key for key in keyed[0] if all(key in one for one in keyed)]
    return tuple(
        replace(
            keyed[0][key],
            squares=np.concatenate([one[key].squares for one in keyed], axis=axis),
            counts=np.concatenate([one[key].counts for one in keyed], axis=axis),
        )
        for key in common
    )


def joined_predictions(
    every: Sequence[PredictionErrors | None], axis: int
) -> PredictionErrors | None:
    """Of all seeds (axis 0) or recordings (axis 2); None where any has none, or has other
    components."""
    present = [p for p in every if p is not None]
    components = {p.squares.shape[1] for p in present}
    if len(present) < len(every) or len(components) != 1:
        return None
    return PredictionErrors(
        np.concatenate([p.squares for p in present], axis=axis),
        np.concatenate([p.counts for p in present], axis=axis),
        np.concatenate([p.noise for p in present], axis=axis),
    )


def joined_innovations(every: Sequence[Innovations | None], axis: int) -> Innovations | None:
    """Of all seeds (axis 0) or recordings (axis 1); None where any has none."""
    present = [i for i in every if i is not None]
    if not present or len(present) < len(every):
        return None

    def median(values: list[float | None]) -> float | None:
        known = [v for v in values if v is not None]
        return float(np.median(known)) if known else None

    return Innovations(
        np.concatenate([i.log_likelihood for i in present], axis=axis),
        np.concatenate([i.dof for i in present], axis=axis),
        median([i.correlation_s for i in present]),
        median([i.lag_1 for i in present]),
    )
