"""Measurements of a filter: displacements, and the time steps that they belong to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints, checked
from validate.errors import ComparisonError
from validate.register.clocks import interpolated
from validate.register.markers.markers import MarkerObservation
from validate.register.outlines.outlines import OutlineObservation
from validate.register.registration import Registered
from validate.scene.mesh import Mesh

OFF_STEP = 0.01  # of a step: clock jitter that moves no estimate; more would be a wrong time
_FINEST = 1000  # parts of a sampling interval tried as a step when one is looked for
NORMALS = 24  # places of an outline that a filter is given, evenly in polar angle
_AXES = "xyz"


@dataclass(frozen=True)
class Measurements:
    """Displacements z (nt, m) m at times t (nt,) s, NaN = missing; H (m, N) reads them from u (N,).

    Unknowns are node-major; sd (m,) m are standard deviations of white noise, independent between
    components; names (m,) such as "top.z"; sd_t s is how uncertain their clock is. Raises
    `ComparisonError` for shapes that do not fit, times that do not rise, and an sd that is not
    positive.
    """

    t: Floats
    H: sparse.csr_array
    z: Floats
    sd: Floats
    names: tuple[str, ...]
    sd_t: float = 0.0

    def __post_init__(self) -> None:
        m, nt = self.H.shape[0], len(self.t)
        fail = ComparisonError
        object.__setattr__(self, "t", checked(self.t, "measurement t [s]", (None,), error=fail))
        z = checked(self.z, "measurement z [m]", (nt, m), nan=True, error=fail)
        object.__setattr__(self, "z", z)
        object.__setattr__(self, "sd", checked(self.sd, "measurement sd [m]", (m,), error=fail))
        if len(self.names) != m:
            raise ComparisonError(f"{len(self.names)} names for {m} measured components")
        if m == 0 or nt == 0:
            raise ComparisonError(f"{nt} times of {m} components: nothing measured")
        if nt > 1 and np.diff(self.t).min() <= 0:
            raise ComparisonError(
                "measurement times do not increase; sort the recording by its time stamps"
            )
        if self.sd.min() <= 0:
            raise ComparisonError(f"measurement sd {self.sd.min():g} m: it must be positive")

    def of(self, *markers: str) -> "Measurements":
        """What these markers or outlines measured: all that a filter is given of a recording.

        Raises `ComparisonError` naming one that was not measured.
        """
        owners = [name.rpartition(".")[0] for name in self.names]
        absent = [marker for marker in markers if marker not in owners]
        if absent:
            known = ", ".join(dict.fromkeys(owners))
            raise ComparisonError(f"marker '{absent[0]}' was not measured; there are {known}")
        return self._only(np.array([i for i, owner in enumerate(owners) if owner in markers]))

    def moving(self, free: Ints) -> "Measurements":
        """Return the components that any free unknown moves: what is held or driven teaches a
        filter nothing, and its noise would count as degrees of freedom.

        Raises `ComparisonError` when nothing is left.
        """
        reach = np.asarray(abs(self.H[:, free]).sum(axis=1)).ravel()
        pick = np.flatnonzero(reach > 0)
        if len(pick) == 0:
            raise ComparisonError(
                "every measured component is held or driven, so there is "
                "nothing to estimate; choose free nodes"
            )
        return self._only(pick)

    def _only(self, pick: Ints) -> "Measurements":
        names = tuple(self.names[i] for i in pick)
        H, z, sd = self.H[pick], self.z[:, pick], self.sd[pick]
        return Measurements(self.t, H, z, sd, names, self.sd_t)

    def variances(self, R: float | None) -> Floats:
        """R (m,) m^2 of the components: the one that is given, else their own sd squared."""
        return self.sd**2 if R is None else np.full(len(self.sd), R)

    def free(self, free: Ints) -> Floats:
        """H over the free unknowns, dense (m, free)."""
        return np.ascontiguousarray(self.H[:, free].toarray())

    @classmethod
    def taken(cls, registered: Registered, mesh: Mesh) -> "Measurements":
        """Displacements of the registered markers from their rest layout, and of outlines along
        their normals, from rest: `<outline>.<number>`.

        Samples of a jittering camera, which no step meets, are interpolated onto the steps; see
        `on_steps`. Raises `ComparisonError` without either and for rows of another mesh.
        """
        markers, outlines = registered.of(MarkerObservation), registered.of(OutlineObservation)
        found = [_of_markers(m, registered, mesh) for m in markers[:1]]
        for outline in outlines:
            along = outline.along_normals(NORMALS)
            names = tuple(f"{outline.name}.{i}" for i in range(NORMALS))
            t, z, sd = on_steps(outline.t, along.z, np.full(NORMALS, along.sd), registered.t)
            found.append(cls(t, along.H, z, sd, names, outline.sd_t))
        if not found:
            raise ComparisonError(
                "the recording has no markers and no outlines, so the filter has no measurements"
            )
        return together(found)

    def timetable(self, dt: float) -> "Timetable":
        """Land every measurement on the nearest of the steps at k dt s; rows all NaN are left out.

        Raises `ComparisonError` when one lies further off than a hundredth of a step (here a
        measurement is not interpolated) or two share a step.
        """
        t = self.t
        steps, off = _nearest(t, dt)
        if off.max() > OFF_STEP:
            i = int(off.argmax())
            # The largest step up to `dt` on which all times land, as advice
            step = _landed(t, dt)
            landing = "no step matches all of them" if step is None else f"take dt = {step:.6g} s"
            raise ComparisonError(
                f"measurement at t = {t[i]:g} s lies {off[i]:.2g} steps of {dt:g} s off its "
                f"nearest step; {landing}"
            )
        if len(np.unique(steps)) < len(steps):
            raise ComparisonError(
                f"{len(steps)} measurements lie on {len(np.unique(steps))} steps of {dt:g} s; "
                f"choose a step of at most {np.diff(t).min():g} s"
            )
        seen = np.isfinite(self.z).any(axis=1) & (steps > 0)
        rows = {int(steps[i]): self.z[i] for i in np.flatnonzero(seen)}
        later = steps > 0
        return Timetable(MappingProxyType(rows), int((~later).sum()), int(later.sum()) - len(rows))


@dataclass(frozen=True)
class Timetable:
    """Measured displacements (m,) m by step number (1, 2, ...); `at_rest` counts those at t = 0,
    where the state is known, `missing` those later on in which every component is."""

    z: Mapping[int, Floats]
    at_rest: int = 0
    missing: int = 0

    def at(self, step: int) -> Floats | None:
        """Return the measurement of a step, NaN = missing; None without one: predict only."""
        return self.z.get(step)

    def unheard(self, steps: int, numbers: Sequence[Mapping[str, float]]) -> str:
        """Why no measurement reached a filter in so many of these steps, by the numbers that its
        states told; empty where one did."""
        if any(told["nis.dof"] > 0 for told in numbers):
            return ""
        late = sum(k > steps for k in self.z)
        met = len(self.z) - late
        gated = int(sum(told.get("gate.rejected", 0.0) for told in numbers))
        reasons = (
            (self.missing, "have all components missing"),
            (self.at_rest, "lie at the start, where the state is known"),
            (late, f"come after the last of {steps} steps"),
            (met, f"were met, and the gate rejected {gated} marker samples" if gated
             else "were only partly complete, which this filter does not accept"),
        )  # fmt: skip
        told = ", ".join(f"{count} {words}" for count, words in reasons if count)
        total = self.missing + self.at_rest + len(self.z)
        return (
            f"0 of {total} measurements reached the filter ({told}), so the model ran without "
            "corrections; compare it with a method without markers"
        )


def _nearest(t: Floats, dt: float) -> tuple[Ints, Floats]:
    """Numbers of the nearest steps, and the distances from them in steps."""
    ratio = t / dt
    steps = np.rint(ratio).astype(np.int64)
    return steps, np.abs(ratio - steps)


def _landed(t: Floats, dt: float) -> float | None:
    """The largest step up to `dt`, of not too many in an interval, on which all times land."""
    gaps = np.diff(np.concatenate([[0.0], t]))
    gap = float(gaps[gaps > 0].min()) if (gaps > 0).any() else dt
    first = int(np.ceil(gap / dt))
    parts = range(first, first + _FINEST)
    return next((gap / n for n in parts if _nearest(t, gap / n)[1].max() <= OFF_STEP), None)


def together(every: Sequence[Measurements]) -> Measurements:
    """Measurements of several sensors as one, NaN where a sensor was not read at an instant."""
    if len(every) == 1:
        return every[0]
    t = np.unique(np.concatenate([m.t for m in every]))
    z = np.full((len(t), sum(len(m.names) for m in every)), np.nan)
    first = 0
    for m in every:
        z[np.searchsorted(t, m.t), first : first + len(m.names)] = m.z
        first += len(m.names)
    H = sparse.csr_array(sparse.vstack([m.H for m in every]))
    sd = np.concatenate([m.sd for m in every])
    names = tuple(name for m in every for name in m.names)
    return Measurements(t, H, z, sd, names, max(m.sd_t for m in every))


def _of_markers(seen: MarkerObservation, registered: Registered, mesh: Mesh) -> Measurements:
    n, d = mesh.nodes.shape
    weights = seen.positions.weights
    if weights.shape[1] != n:
        raise ComparisonError(
            f"marker rows of {weights.shape[1]} nodes on a mesh of {n}: register again"
        )
    H = sparse.csr_array(sparse.kron(weights, sparse.eye_array(d), format="csr"))
    z = (seen.x - seen.rest).reshape(len(seen.t), -1)
    names = tuple(f"{name}.{_AXES[c]}" for name in seen.names for c in range(d))
    t, z, sd = on_steps(
        seen.t, z, np.tile([seen.along([c]) for c in range(d)], len(seen.names)), registered.t
    )
    return Measurements(t, H, z, sd, names, seen.sd_t)


def on_steps(t: Floats, z: Floats, sd: Floats, steps: Floats) -> tuple[Floats, Floats, Floats]:
    """Return measurements z (nt, m) at t (nt,) s of sd (m,), interpolated onto the nearest of 0 and
    `steps` (n,).

    Only of times that jitter: those that a smaller step meets are left as they are, for the filter
    says which. What that adds to sd: `interpolated`. Steps beyond the looks get none.
    """
    dt = float(steps[0]) if len(steps) == 1 else float(np.diff(steps).min())
    if len(t) < 3 or _nearest(t, dt)[1].max() <= OFF_STEP or _landed(t, dt) is not None:
        return t, z, sd
    grid = np.concatenate([[0.0], steps[steps > 0]])
    s = np.unique(grid[np.searchsorted((grid[1:] + grid[:-1]) / 2, t)])
    s = s[(s >= t[0]) & (s <= t[-1])]
    shown, squared = interpolated(t, z, s)
    return s, shown, np.sqrt(sd**2 + squared)
