"""What was measured, in the scene's frame, with the rows that read the same from a simulation.

Departure from the design's single Observation type: markers, outlines and signals are compared
differently, so each is its own small type; `Registered` holds them together.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import ComparisonError, RegistrationError
from validate.fem.locate import Rows, barycentric_rows, nearest_node_rows, require_inside
from validate.recording.types import Contours, Markers, Signal
from validate.register.labels import require_steady_labels
from validate.register.plane import SurfaceSampler, require_rigid, section
from validate.register.quality import Registration, register_points
from validate.scene.mesh import Mesh

Sampling = Literal["barycentric", "nearest_node"]
_INSIDE = 1e-4  # m: a marker further out belongs to another body or frame


@dataclass(frozen=True)
class MarkerObservation:
    """Markers in the scene's frame: x (nt, k, 3) m with NaN = not seen, rest layout (k, 3) m.

    `sd` m per axis; `tre` (k,) m, the predicted registration error at every marker.
    """

    t: Floats
    names: tuple[str, ...]
    x: Floats
    rest: Floats
    rows: Rows
    sd: float
    tre: Floats
    registration: Registration

    def simulated(self, u: Floats) -> Floats:
        """Marker positions (k, 3) m under nodal displacements u (n, 3) m."""
        return self.rest + self.rows.apply(u)

    def within(self, mesh: Mesh) -> "MarkerObservation":
        """The markers that lie in a mesh of part of the body (within 0.1 mm); the registration
        stays that of all of them."""
        rows = barycentric_rows(mesh, self.rest)
        kept = np.flatnonzero(rows.outside <= _INSIDE)
        return replace(
            self,
            names=tuple(self.names[i] for i in kept),
            x=self.x[:, kept],
            rest=self.rest[kept],
            rows=Rows(rows.weights[kept], rows.outside[kept]),
            tre=self.tre[kept],
        )


@dataclass(frozen=True)
class OutlineObservation:
    """Outlines (k_i, 2) m in image coordinates, and the wall that the simulation moves."""

    t: Floats
    outlines: tuple[Floats, ...]
    pose: Floats
    sd: float
    wall: SurfaceSampler

    def simulated(self, u: Floats) -> Floats:
        """The section (k, 2) m of the deformed wall with the image plane."""
        return section(self.wall.deformed(u), self.wall.triangles, self.pose)


@dataclass(frozen=True)
class SignalObservation:
    """A scalar signal y (nt,) in `unit` that the run's trace of that name predicts."""

    quantity: str
    trace: str
    t: Floats
    y: Floats
    unit: str
    sd: float

    def at(self, t: float) -> float:
        """The sample nearest in time; raises `ComparisonError` when none is within a second."""
        return float(self.y[nearest_sample(self.t, t, f"signal '{self.quantity}'")])


@dataclass(frozen=True)
class Hold:
    """A load at which everything was measured: label such as "3mm", stage m, time s."""

    label: str
    stage: float
    t: float


@dataclass(frozen=True)
class Registered:
    """All observations of a recording in the scene's frame, and the drive that was measured.

    `windows` are ranges (from, to] m of the stage by label, for curves without holds; `outside`
    counts the samples left out because they lie beyond the law's validity. `time_scale` are the
    recorded seconds in one second of these times, where a slow recording is walked faster.
    """

    stage: Signal
    holds: tuple[Hold, ...]
    markers: MarkerObservation | None
    outline: OutlineObservation | None
    signals: tuple[SignalObservation, ...]
    windows: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    outside: int = 0
    findings: tuple[str, ...] = ()
    time_scale: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "windows", MappingProxyType(dict(self.windows)))

    def steps_at_holds(self) -> Ints:
        """Indices (h,) into the stage's samples at the holds."""
        return np.array([nearest_sample(self.stage.t, h.t, "stage") for h in self.holds])


def nearest_sample(times: Floats, t: float, name: str, within: float = 1.0) -> int:
    """Index of the sample nearest to t s; `ComparisonError` beyond `within` s: nothing matches."""
    index = int(np.argmin(np.abs(times - t)))
    off = abs(float(times[index]) - t)
    if off > within:
        raise ComparisonError(
            f"{name} has no sample within {within:g} s of t = {t:.3f} s (nearest {off:.3f} s off): "
            "0 matched samples; check the clocks with `validate inspect`"
        )
    return index


def find_holds(
    stage: Signal, t: Floats, loads: tuple[float, ...], within: float
) -> tuple[Hold, ...]:
    """The measurement times t (nt,) s whose stage position is a load, rest first.

    Raises `ComparisonError` when a load has no measurement within `within` m of it.
    """
    reached = [float(stage.y[nearest_sample(stage.t, ti, "stage"), 0]) for ti in t]
    if min(loads, default=1.0) <= 0 or len(set(loads)) != len(loads):
        shown = ", ".join(f"{1e3 * load:g}" for load in loads)
        raise ComparisonError(f"loads {shown} mm: each must be above 0 (rest) and stand once")
    holds = []
    for load in (0.0, *loads):
        off = np.abs(np.array(reached) - load)
        if off.min() > within:
            seen = ", ".join(f"{1e3 * r:.2f}" for r in reached)
            raise ComparisonError(
                f"no measurement at {1e3 * load:g} mm: 0 matched samples, the stage was at {seen} "
                "mm; set the loads to those"
            )
        i = int(off.argmin())
        holds.append(Hold(f"{1e3 * load:g}mm", reached[i], float(t[i])))
    return tuple(holds)


def observe_markers(
    markers: Markers,
    layout: dict[str, Floats],
    mesh: Mesh,
    *,
    method: Literal["rigid", "similarity", "two_step"],
    sampling: Sampling,
    up: tuple[Floats, Floats] | None = None,
) -> MarkerObservation:
    """Registers the markers' first instant (rest) to their layout (3,) m; frozen for the rest.

    `up` is one direction in the markers' frame and in the scene's: without it a planar set that
    was mirrored within its plane could not be told from the true one. A 2-D mesh lies in the plane
    z = 0 of the layout: what markers do across it is dropped.
    Raises `RegistrationError` for names that the layout lacks, for markers outside the mesh, and
    for whatever `register_points` finds.
    """
    unknown = [name for name in markers.names if name not in layout]
    if unknown:
        raise RegistrationError(
            f"{len(unknown)} of {len(markers.names)} markers are not in the layout: {unknown[:5]}"
        )
    rest = np.array([layout[name] for name in markers.names])
    _require_scale(markers.x[0], rest)
    registration = register_points(
        markers.names, markers.x[0], rest, method=method, expected_sd=markers.sd, up=up
    )
    d = mesh.dimension
    places = rest[:, :d]
    rows = (barycentric_rows if sampling == "barycentric" else nearest_node_rows)(mesh, places)
    if sampling == "barycentric":
        require_inside(rows, markers.names, _INSIDE)
    x = np.array([registration.transform.apply(frame) for frame in markers.x])
    require_steady_labels(markers.names, rest, x, markers.t, markers.sd)
    tre = registration.tre_at(rest)
    return MarkerObservation(
        markers.t, markers.names, x[..., :d], places, rows, markers.sd, tre, registration
    )


def _require_scale(x: Floats, rest: Floats) -> None:
    """A layout of another size is a wrong unit, not a bad fit."""
    seen = np.isfinite(x).all(axis=1)
    if seen.sum() < 3:
        return
    size, known = _spread(x[seen]), _spread(rest[seen])
    if not 0.5 < size / known < 2:
        raise RegistrationError(
            f"the markers spread over {1e3 * size:.4g} mm, their layout over {1e3 * known:.4g} mm: "
            f"{size / known:.4g} times as much; wrong unit? positions are metres"
        )


def _spread(points: Floats) -> float:
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))


def require_rising(stage: Signal, seen: SignalObservation) -> None:
    """Raises `RegistrationError` when a signal falls as the stage closes."""
    most = int(np.argmax(stage.y[:, 0]))
    least = int(np.argmin(stage.y[:, 0]))
    change = seen.at(float(stage.t[most])) - seen.at(float(stage.t[least]))
    if change < -5 * seen.sd:
        raise RegistrationError(
            f"'{seen.quantity}' falls by {-change:.4g} {seen.unit} as the stage closes by "
            f"{1e3 * np.ptp(stage.y):.3g} mm; compression and pressure are positive: turn its sign"
        )


def observe_outlines(contours: Contours, wall: SurfaceSampler) -> OutlineObservation:
    """Outlines with their pose checked; raises `RegistrationError` for an improper pose."""
    require_rigid(contours.pose, "outline")
    return OutlineObservation(contours.t, contours.outlines, contours.pose, contours.sd, wall)
