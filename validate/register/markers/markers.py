"""Tracked markers: registered at rest, interpolated from a run at their material points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from scipy.optimize import linear_sum_assignment

from validate.arrays import Floats, Ints, rms
from validate.errors import RegistrationError
from validate.fem.assembly.locate import Rows, nearest_node_rows, require_inside
from validate.recording.types import Markers, Recording
from validate.register.clocks import SAME, clock_sd, interpolated, slopes, with_clock
from validate.register.markers.quality import LINE, MarkerFit, Registration
from validate.register.markers.transform import spread
from validate.register.observation import (
    AnyDraw,
    Deviation,
    History,
    Role,
    Selection,
    Simulated,
    frame_at,
    from_rest,
    shifted,
)
from validate.scene.mesh import Mesh

# --- Labels that change during a recording: markers swapped at a load though right at rest.

CLEARLY = 3.0  # times nearer under another label
BEYOND = 6.0  # standard deviations per axis that noise does not explain


def require_steady_labels(
    names: tuple[str, ...], rest: Floats, x: Floats, t: Floats, sd: float
) -> None:
    """Raise `RegistrationError` naming markers of x (nt, k, 3) m that changed places.

    A compressed body moves its surface nearly affinely: rest (k, 3) m is carried to every instant
    by the affine map that fits best, and each marker must lie nearest to its own image, unless the
    difference is within the noise sd m. Markers not seen (NaN) are left out. One that is mistaken
    for an instant pulls that map towards it, too: other labels do not mend it, and nothing is said.
    """
    for ti, frame in zip(t, x, strict=True):
        seen = np.flatnonzero(np.isfinite(frame).all(axis=1))
        if len(seen) < 6:
            continue
        start = np.hstack([rest[seen], np.ones((len(seen), 1))])
        expected = start @ np.linalg.lstsq(start, frame[seen], rcond=None)[0]
        apart = np.linalg.norm(expected[:, None] - frame[seen][None], axis=2)
        own = np.diag(apart)
        _, nearest = linear_sum_assignment(apart**2)
        best = apart[np.arange(len(seen)), nearest]
        moved = (nearest != np.arange(len(seen))) & (own > BEYOND * sd) & (own > CLEARLY * best)
        if moved.any() and _mended(rest[seen], frame[seen], nearest):
            shown = ", ".join(names[i] for i in seen[moved][:6])
            raise RegistrationError(
                f"markers {shown} seem swapped at t = {ti:.2f} s: {1e3 * own[moved].max():.1f} mm "
                f"from the positions predicted by the others, {1e3 * best[moved].max():.1f} mm "
                f"after relabelling; correct their names"
            )


def _mended(rest: Floats, x: Floats, labels: Ints) -> bool:
    """Whether the markers that get other `labels` lie clearly nearer to where the rest put them, or
    where hardly one keeps its label, all to an affine image."""
    changed = labels != np.arange(len(labels))
    start = np.hstack([rest, np.ones((len(rest), 1))])
    if (~changed).sum() > start.shape[1]:
        expected = start @ np.linalg.lstsq(start[~changed], x[~changed], rcond=None)[0]
        before, after = (expected - x)[changed], (expected - x[labels])[changed]
    else:
        before, after = (
            y - start @ np.linalg.lstsq(start, y, rcond=None)[0] for y in (x, x[labels])
        )
    return bool(np.linalg.norm(before) > CLEARLY * np.linalg.norm(after))


# -------------------------------------------------------------------------------------------------

Sampling = Literal["barycentric", "nearest_node"]
_INSIDE = 1e-4  # m: a marker further out belongs to another body or frame
_FLAT = 1e-6  # third over first rms spread of exact points in a plane
_AXES = "xyz"


@dataclass(frozen=True)
class Together:
    """All markers' components along some axes as one quantity, in words."""

    quantity: str
    axes: tuple[int, ...]
    words: str


@dataclass(frozen=True)
class MarkerObservation:
    """Markers in the scene's frame: x (nt, k, d) m with NaN = not seen, rest layout (k, d) m.

    `sd` m per axis; `tre` (k,) m, the predicted registration error at every marker. Each marker is
    a quantity of its own, read from the run's probe of its name, unless `together` gathers them:
    then the run's fields are read at their places. `sd_t` s: how uncertain their clock is.
    `axis_sd` (d,) m where the noise differs between the scene's axes; `sd` is then their rms.
    """

    name: str
    role: Role
    t: Floats
    names: tuple[str, ...]
    x: Floats
    rest: Floats
    positions: Rows
    sd: float
    tre: Floats
    registration: Registration
    together: tuple[Together, ...] = ()
    sd_t: float = 0.0
    axis_sd: tuple[float, ...] = ()

    def simulated(self, u: Floats) -> Floats:
        """Marker positions (k, d) m under nodal displacements u (n, d) m."""
        return self.rest + self.positions.apply(u)

    def along(self, axes: Sequence[int]) -> float:
        """Standard deviation m per component along some axes."""
        return rms([self.axis_sd[a] for a in axes]) if self.axis_sd else self.sd

    def rows(self) -> Rows | None:
        return self.positions

    def within(self, mesh: Mesh) -> "MarkerObservation":
        """Return the markers that lie in a mesh of part of the body (within 0.1 mm); the
        registration stays that of all of them."""
        rows = Rows.barycentric(mesh, self.rest)
        kept = np.flatnonzero(rows.outside <= _INSIDE)
        return replace(
            self,
            names=tuple(self.names[i] for i in kept),
            x=self.x[:, kept],
            rest=self.rest[kept],
            positions=Rows(rows.weights[kept], rows.outside[kept]),
            tre=self.tre[kept],
        )

    # --- comparison -------------------------------------------------------------------------------

    @property
    def units(self) -> Mapping[str, str]:
        return dict.fromkeys([g.quantity for g in self.together] or self.names, "m")

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        if self.together:
            selection = selection.instants(run)
            samples = selection.samples(self.t, run.t, self.name)
            shown = np.array([self.simulated(u) for u in frame_at(run, selection)])
            # Positions (m, k, d) m at the instants t (m,) s, the rms error (d,) m of interpolating
            # them, and s by which the sample of a hold lies off it: there the body stands, and what
            # lies between two holds says nothing of them.
            t = np.asarray(selection.t)
            if len(t) == 1:
                x, error = self.x[samples], np.zeros(self.x.shape[2])
                late = abs(float(self.t[samples][0] - t[0]))
                late = late if late > SAME else 0.0
            else:
                x, squared = interpolated(self.t, self.x.reshape(len(self.t), -1), t)
                error = np.sqrt(squared.reshape(self.x.shape[1:]).mean(axis=0))
                x, late = x.reshape(len(t), *self.x.shape[1:]), 0.0
            off = (shown - x).reshape(-1, self.x.shape[2])
            kept = np.isfinite(off).all(axis=1)
            off, moved = off[kept], (x - self.rest).reshape(off.shape)[kept]
            t = np.repeat(np.asarray(selection.t), self.x.shape[1])[kept]
            tre = rms(self.tre) / float(np.sqrt(3))
            found = (
                Deviation(
                    g.quantity, off[:, list(g.axes)], "m",
                    float(np.hypot(self.along(g.axes), rms(error[list(g.axes)]))), tre, g.words,
                    scale=_largest((self.x - self.rest)[..., list(g.axes)]),
                    reference=moved[:, list(g.axes)],
                    t=t if len(samples) > 1 else None,
                    axes=tuple(_AXES[a] for a in g.axes),
                )
                for g in self.together
            )  # fmt: skip
            sd_t = float(np.sqrt(self.sd_t**2 + selection.sd_t**2 + late**2))
            if sd_t == 0:
                return tuple(found)
            speed = self._speed(slice(None), samples, sd_t)
            axes = (list(g.axes) for g in self.together)
            return tuple(
                with_clock(d, sd_t, speed[..., a]) for d, a in zip(found, axes, strict=True)
            )
        each = (self._one(run, selection, j) for j in range(len(self.names)))
        return tuple(d for d in each if d is not None)

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        if self.together:
            return ()
        return tuple(n for n in self.names if f"{n}.x" not in run.traces)

    def left(self, run: Simulated) -> Floats:
        """Exact position less measured one, flat (nt k d,) m; 0 where a marker was not seen, or
        nothing of the run is compared with it."""
        off = np.nan_to_num(self._exact(run) - self.x)
        return np.asarray(off.ravel())

    def history(self, run: Simulated) -> History:
        """Displacements since rest."""
        measured = self.x - self.rest
        simulated = measured + self.left(run).reshape(measured.shape)
        return History(self.name, self.t, self.names, measured, simulated, "m", self.sd, each=True)

    def anew(self, left: Floats, draw: AnyDraw) -> "MarkerObservation":
        """Return the markers where `left` (nt k d,) m has them; registration, which all samples
        share, clock and noise drawn."""
        nt, _, d = self.x.shape
        exact = (self.x + left.reshape(self.x.shape)).reshape(nt, -1)
        x = shifted(self.t, exact, draw.lateness(self.sd_t)).reshape(self.x.shape)
        registered = draw.white(1.0, (d,)) * self.tre[:, None] / np.sqrt(3)
        noise = draw.white(np.array(self.axis_sd) if self.axis_sd else self.sd, x.shape)
        return replace(self, x=x + registered + noise)

    def _exact(self, run: Simulated) -> Floats:
        """Positions (nt, k, d) m at the samples' times: of the kept fields, or by the probes."""
        nt, k, d = self.x.shape
        if self.together:
            moved = np.array([self.positions.apply(u) for u in run.u]).reshape(len(run.u), k * d)
            return self.rest + from_rest(run.t[run.at], moved, self.t).reshape(nt, k, d)
        x = self.x.copy()
        for j, name in enumerate(self.names):
            if f"{name}.x" in run.traces:
                probe = np.stack([run.traces[f"{name}.{c}"].y for c in _AXES[:d]], axis=1)
                x[:, j] = self.rest[j] + from_rest(run.t, probe, self.t)
        return x

    def _one(self, run: Simulated, selection: Selection, j: int) -> Deviation | None:
        """One marker's displacement, by the run's probe of its name."""
        name, axes = self.names[j], _AXES[: self.x.shape[2]]
        if f"{name}.x" not in run.traces:
            return None
        moved = self.x[:, j] - self.rest[j]
        samples = selection.samples(self.t, run.t, self.name)
        seen = np.isfinite(moved[samples]).all(axis=1)
        if not seen.any():
            return None
        t = self.t[samples]
        probe = [selection.read(run.t, run.traces[f"{name}.{c}"].y, t) for c in axes]
        words = "estimated minus measured displacement of the marker, at its visible samples"
        off = (np.stack(probe, axis=1) - moved[samples])[seen]
        # The tre is a length over three axes, the systematic part is per axis.
        tre, sd = float(self.tre[j] / np.sqrt(3)), self.along(range(len(axes)))
        found = Deviation(name, off, "m", sd, tre, words, scale=_largest(moved),
                          reference=moved[samples][seen],
                          t=t[seen] if len(t) > 1 else None, axes=tuple(axes))  # fmt: skip
        sd_t = float(np.hypot(self.sd_t, selection.sd_t))
        return with_clock(found, sd_t, self._speed(j, samples, sd_t)) if sd_t > 0 else found

    def _speed(self, which: int | slice, samples: Ints, sd_t: float) -> Floats:
        """Velocities (m, ..., d) m/s of a marker or of all of them at the samples (m,)."""
        x = self.x[:, which]
        flat = slopes(self.t, x.reshape(len(x), -1), samples, sd_t)
        return flat.reshape(len(samples), *x.shape[1:])

    @classmethod
    def placed(
        cls,
        recording: Recording,
        mesh: Mesh,
        *,
        topic: str = "markers",
        how: MarkerFit = MarkerFit(),
        sampling: Sampling = "barycentric",
        together: tuple[Together, ...] = (),
        tracker: str = "camera",
        up: tuple[float, float, float] = (0.0, 0.0, 1.0),
    ) -> Self:
        """Register by the recording's own records: "marker_layout" (m), and `tracker`, whose
        "up" in the markers' frame is the scene's direction `up`.

        `up` is used for a layout that is a plane within the noise; any other shows a mirror itself.
        Raises `RecordingError` for an absent record, `RegistrationError` for one that is no vector,
        and whatever `of` does.
        """
        layout = {
            name: vector(text, f"marker_layout '{name}'")
            for name, text in recording.record("marker_layout").items()
        }
        markers = recording.marker(topic)
        seen_up = vector(recording.record(tracker).get("up", ""), f"{tracker} 'up'")
        axes = (seen_up, np.array(up)) if _planar(layout, markers.sd) else None
        return cls.of(
            markers, layout, mesh, how=how, sampling=sampling, up=axes, name=topic,
            together=together, sd_t=clock_sd(recording, topic),
        )  # fmt: skip

    @classmethod
    def of(
        cls,
        markers: Markers,
        layout: Mapping[str, Floats],
        mesh: Mesh,
        *,
        how: MarkerFit = MarkerFit(),
        sampling: Sampling = "barycentric",
        up: tuple[Floats, Floats] | None = None,
        name: str = "markers",
        role: Role = "validates",
        together: tuple[Together, ...] = (),
        sd_t: float = 0.0,
        stands: float = 0.0,
        registration: Registration | None = None,
    ) -> Self:
        """Register the markers' first instant (rest) to their layout (3,) m; frozen for the rest. A
        `registration` that is known already is taken as it is.

        `up` is one direction in the markers' frame and in the scene's: without it a planar set that
        was mirrored within its plane could not be told from the true one. A 2-D mesh lies in the
        plane z = 0 of the layout: what markers do across it is dropped. Markers on stalks may stand
        `stands` m off the surface and turn with it. Raises `RegistrationError` for names that the
        layout lacks, for markers outside the mesh, and for whatever `Registration.of` finds.
        """
        unknown = [marker for marker in markers.names if marker not in layout]
        if unknown:
            raise RegistrationError(
                f"{len(unknown)} of {len(markers.names)} markers are not in the layout: "
                f"{unknown[:5]}"
            )
        rest = np.array([layout[marker] for marker in markers.names])
        _require_scale(markers.x[0], rest)
        if registration is None:
            registration = Registration.of(
                markers.names, markers.x[0], rest, method=how.method, exclude=how.exclude,
                robust=how.robust, expected_sd=how.noise(markers.sd), up=up,
            )  # fmt: skip
        d = mesh.dimension
        # Noise m along the first d axes of the scene where it differs between directions.
        if registration.noise is None:
            sds = ()
        else:
            R = registration.transform.R
            sds = tuple(np.sqrt(np.diag(R @ registration.noise @ R.T))[:d].tolist())
        places = rest[:, :d]
        if sampling == "nearest_node":
            rows = nearest_node_rows(mesh, places)
        else:
            rows = (Rows.standing if stands else Rows.barycentric)(mesh, places)
        if sampling == "barycentric":
            require_inside(rows, markers.names, max(stands, _INSIDE))
        x = np.array([registration.transform.apply(frame) for frame in markers.x])
        require_steady_labels(markers.names, rest, x, markers.t, markers.sd)
        return cls(
            name, role, markers.t, markers.names, x[..., :d], places, rows,
            rms(sds) if sds else registration.expected_sd,
            registration.tre_at(rest), registration, together, sd_t, sds,
        )  # fmt: skip


def _largest(moved: Floats) -> float | None:
    """The longest displacement m of (..., d) that was seen."""
    lengths = np.linalg.norm(moved, axis=-1)
    return float(np.nanmax(lengths)) if np.isfinite(lengths).any() else None


def vector(text: str, what: str) -> Floats:
    """Three numbers of a record; raises `RegistrationError` naming `what`."""
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise RegistrationError(f"{what} is '{text[:60]}': expected three numbers")
    return values


def _planar(layout: Mapping[str, Floats], sd: float) -> bool:
    points = np.array(list(layout.values()))
    return len(points) >= 3 and bool(spread(points)[2] <= LINE * sd + _FLAT * spread(points)[0])


def _require_scale(x: Floats, rest: Floats) -> None:
    """A layout of another size is a wrong unit, not a bad fit."""
    seen = np.isfinite(x).all(axis=1)
    if seen.sum() < 3:
        return
    size, known = _spread(x[seen]), _spread(rest[seen])
    if not 0.5 < size / known < 2:
        raise RegistrationError(
            f"the markers spread over {1e3 * size:.4g} mm, their layout over {1e3 * known:.4g} mm: "
            f"{size / known:.4g} times as much; check the unit, positions are in metres"
        )


def _spread(points: Floats) -> float:
    return rms(points - points.mean(axis=0))
