"""Residuals: simulated minus measured, one small array per quantity and load.

Everything else follows from these arrays: scores are their statistics, differences between models
are differences of residuals against the same measurement, and so are the sensitivities to the
mesh and to the inputs.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats, checked
from validate.compare.outline import angular_points, enclosed, normal_distances
from validate.errors import ComparisonError
from validate.register.observe import (
    Hold,
    MarkerObservation,
    OutlineObservation,
    Registered,
    SignalObservation,
    nearest_sample,
)
from validate.solve.types import Run

TOP_LEFT = np.deg2rad(225.0)  # image angle of the corner nearest the probe at low lateral values
_ANGLES = np.deg2rad(np.arange(0.0, 360.0, 10.0))


@dataclass(frozen=True)
class Residual:
    """Simulated minus measured, values (k, c) in `unit`.

    `sd` is the measurement's standard deviation per component, independent between points;
    `systematic` the part that all points share (registration), per component. `simulated` and
    `measured` are kept for scalar quantities.
    """

    quantity: str
    load: str
    values: Floats
    sd: float
    systematic: float
    unit: str
    definition: str
    simulated: float | None = None
    measured: float | None = None

    def __post_init__(self) -> None:
        values = checked(self.values, f"residual {self.name}", (None, None), error=ComparisonError)
        if len(values) == 0:
            raise ComparisonError(f"{self.name}: 0 matched samples; check names, clocks and frames")
        object.__setattr__(self, "values", values)

    @property
    def name(self) -> str:
        return f"{self.quantity}@{self.load}"

    @property
    def count(self) -> int:
        return len(self.values)


def static_residuals(registered: Registered, run: Run) -> tuple[Residual, ...]:
    """Residuals at every loaded hold: outlines, markers, plate force, pressure, volume.

    Raises `ComparisonError` when the run holds no output frame for a hold.
    """
    if len(run.at) < len(registered.holds):
        raise ComparisonError(
            f"{run.method}: {len(run.at)} output frames for {len(registered.holds)} loads; the run "
            f"ended {run.outcome.state} at step {run.outcome.step}"
        )
    found: list[Residual] = []
    for i, hold in enumerate(registered.holds):
        u, step = run.u[i], int(run.at[i])
        if registered.outline is not None:
            found += _outline(registered.outline, hold, registered.holds[0], u, run.u[0])
        if registered.markers is not None:
            found += _markers(registered.markers, hold, u)
        for signal in registered.signals:
            found.append(_signal(signal, hold, run, step))
        found += _volumes(run, hold, step)
    return tuple(r for r in found if r.load != registered.holds[0].label)


def rest_residuals(registered: Registered, run: Run) -> tuple[Residual, ...]:
    """Residuals of the undeformed state: what registration and geometry leave before any load."""
    hold, found = registered.holds[0], []
    if registered.outline is not None:
        found += _outline(registered.outline, hold, hold, run.u[0], run.u[0])[:1]
    if registered.markers is not None:
        found += _markers(registered.markers, hold, run.u[0])
    return tuple(found)


def _outline(
    seen: OutlineObservation, hold: Hold, rest: Hold, u: Floats, u_rest: Floats
) -> list[Residual]:
    measured = seen.outlines[nearest_sample(seen.t, hold.t, "outlines")]
    start = seen.outlines[nearest_sample(seen.t, rest.t, "outlines")]
    simulated, sim_start = seen.simulated(u), seen.simulated(u_rest)
    moved = _moved(sim_start, simulated, _ANGLES) - _moved(start, measured, _ANGLES)
    area = [enclosed(simulated), enclosed(measured)]
    radius = np.sqrt(area[1][0] / np.pi)
    k = len(measured)
    apart = normal_distances(simulated, measured)
    return [
        Residual(
            "contour", hold.label, apart[:, None], seen.sd, 0.0, "m",
            "distance of the simulated outline from each measured outline point, outward positive",
        ),
        Residual(
            "contour.material", hold.label, moved, np.sqrt(2.0) * seen.sd, 0.0, "m",
            "displacement of the outline at equal polar angle about its own centroid, every 10 deg",
        ),
        _top_left(hold, seen.sd, (start, measured), (sim_start, simulated)),
        Residual(
            "contour.area", hold.label, np.array([[area[0][0] - area[1][0]]]),
            seen.sd * 2 * np.pi * radius / np.sqrt(k), 0.0, "m2", "area inside the outline",
            area[0][0], area[1][0],
        ),
        Residual(
            "contour.centroid", hold.label, (area[0][1] - area[1][1])[None],
            seen.sd * np.sqrt(2 / k), 0.0, "m", "centroid of the area inside the outline",
        ),
    ]  # fmt: skip


def _moved(start: Floats, end: Floats, angles: Floats) -> Floats:
    return angular_points(end, angles) - angular_points(start, angles)


def _top_left(
    hold: Hold, sd: float, measured: tuple[Floats, Floats], simulated: tuple[Floats, Floats]
) -> Residual:
    angle = np.array([TOP_LEFT])
    lengths = [float(np.linalg.norm(_moved(*pair, angle))) for pair in (simulated, measured)]
    return Residual(
        "contour.top_left", hold.label, np.array([[lengths[0] - lengths[1]]]), np.sqrt(2.0) * sd,
        0.0, "m", "displacement of the corner nearest the probe and lowest in image x (225 deg)",
        *lengths,
    )  # fmt: skip


def _markers(seen: MarkerObservation, hold: Hold, u: Floats) -> list[Residual]:
    measured = seen.x[nearest_sample(seen.t, hold.t, "markers")]
    off = seen.simulated(u) - measured
    off = off[np.isfinite(off).all(axis=1)]
    tre = float(np.sqrt((seen.tre**2).mean() / 3))
    return [
        Residual("marker.inplane", hold.label, off[:, [0, 2]], seen.sd, tre, "m",
                 "position in the plane of the top face (x along the stage, z lateral)"),
        Residual("marker.vertical", hold.label, off[:, [1]], seen.sd, tre, "m",
                 "position along the vertical y"),
    ]  # fmt: skip


def _signal(seen: SignalObservation, hold: Hold, run: Run, step: int) -> Residual:
    trace = run.traces.get(seen.trace)
    if trace is None or trace.unit != seen.unit:
        raise ComparisonError(f"{run.method}: no trace '{seen.trace}' in {seen.unit}")
    simulated, measured = float(trace.y[step]), seen.at(hold.t)
    return Residual(
        seen.quantity, hold.label, np.array([[simulated - measured]]), seen.sd, 0.0, seen.unit,
        f"{seen.quantity}, one sample at the hold", simulated, measured,
    )  # fmt: skip


def _volumes(run: Run, hold: Hold, step: int) -> list[Residual]:
    """The fluid is incompressible: its reference volume is the one at rest, exactly."""
    return [
        Residual(
            "volume.relative_error", hold.label, np.array([[trace.y[step] - 1]]), 0.0, 0.0, "1",
            "cavity volume over its rest volume less one; reference: incompressible fluid",
            float(trace.y[step]), 1.0,
        )
        for name, trace in run.traces.items()
        if name.endswith(".volume_ratio")
    ]  # fmt: skip
