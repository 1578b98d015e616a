"""Tracker of a twin: named points, fixed fiducials, inputs and forces of a simulated motion.

What a camera sees are positions in its own frame, so such a recording is registered as a measured
one is (`MarkerObservation.placed`). Fiducials are points of a held face: they do not move, carry
the registration, and stand in the layout beside the tracked points.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints, checked
from validate.errors import RecordingError, UsageError
from validate.fem.system import build
from validate.recording.clocks.alignment import RECORD
from validate.recording.types import Markers, Record, Recording, Source
from validate.scene.scene import Scene
from validate.solve.march import march
from validate.solve.types import Run, Scheme
from validate.twin.sensors import signal, streams

_AT_REST = 1e-12  # m, what counts as no displacement in the first sample


@dataclass(frozen=True)
class Points:
    """Material points: t (nt,) s, rest (k, 3) m, displacements u (nt, k, 3) m."""

    t: Floats
    names: tuple[str, ...]
    rest: Floats
    u: Floats

    def __post_init__(self) -> None:
        k = len(self.names)
        for name, shape in (("t", (None,)), ("rest", (k, 3)), ("u", (len(self.t), k, 3))):
            value = checked(getattr(self, name), f"points {name}", shape, error=RecordingError)
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Reading:
    """A known input or a measured number at the points' times: y (nt,) in `unit`, white noise."""

    y: Floats
    unit: str
    sd: float = 0.0


@dataclass(frozen=True)
class Camera:
    """A tracker: noise sd m per axis, own frame (Euler angles in degrees, m).

    `every`: it looks at each that many steps. `missing`: share of the looks at which a point is not
    seen. `still`: looks at rest whose mean is the first sample, which the registration rests on; 1
    leaves the registration as uncertain as any look. `outliers`: share of the looks at which a
    point is taken for something else, `astray` m off in any direction. `late`: sd s by which the
    time of a look is off, the same for all points; the recording declares it as its clock's.
    """

    sd: float
    every: int = 1
    missing: float = 0.0
    still: int = 100
    outliers: float = 0.0
    astray: float = 1e-3
    late: float = 0.0
    turn: tuple[float, float, float] = (62.0, -17.0, 128.0)
    shift: tuple[float, float, float] = (0.412, -0.236, -1.137)

    def __post_init__(self) -> None:
        if not (self.sd >= 0 and self.every >= 1 and 0 <= self.missing < 1 and self.still >= 1):
            raise RecordingError(
                f"camera with sd {self.sd:g} m, every {self.every}, missing {self.missing:g}, "
                f"still {self.still}: expected sd >= 0, every and still >= 1, 0 <= missing < 1"
            )
        if not (0 <= self.outliers < 1 and self.astray > 0 and self.late >= 0):
            raise RecordingError(
                f"camera with outliers {self.outliers:g}, astray {self.astray:g} m, late "
                f"{self.late:g} s: expected 0 <= outliers < 1, astray > 0, late >= 0"
            )

    @property
    def rotation(self) -> Floats:
        """R (3, 3): scene directions in the camera's frame."""
        return np.asarray(Rotation.from_euler("xyz", self.turn, degrees=True).as_matrix())

    def looks(self, points: Points, seeds: Mapping[str, np.random.Generator]) -> Markers:
        """Every point at each `every`-th time; the first sample is seen whole."""
        pick = np.arange(0, len(points.t), self.every)
        u = points.u[pick]  # displacements (k, p, 3) m when the camera really looked
        if self.late:
            jitter = self.late * seeds["odd"].standard_normal(len(pick) - 1)
            t = points.t[pick] + np.append(0.0, jitter)
            t = np.clip(t, points.t[0], points.t[-1])
            flat = points.u.reshape(len(points.t), -1)
            late = np.stack([np.interp(t, points.t, column) for column in flat.T], axis=1)
            u = late.reshape(u.shape)
        x = points.rest + u
        noise = self.sd * seeds["markers"].standard_normal(x.shape)
        noise[0] /= np.sqrt(self.still)
        x = (x + noise) @ self.rotation.T + np.array(self.shift)
        # How far off (k, p, 3) m looks are; the first one is not
        rng = seeds["odd"]
        off = np.zeros(x.shape)
        if self.outliers:
            odd = rng.random(x.shape[:2]) < self.outliers
            odd[0] = False
            way = rng.standard_normal((int(odd.sum()), 3))
            off[odd] = self.astray * way / np.linalg.norm(way, axis=1)[:, None]
        x += off
        unseen = seeds["missing"].random(x.shape[:2]) < self.missing
        unseen[0] = False
        x[unseen] = np.nan
        return Markers(points.t[pick], points.names, x, self.sd, "camera")


def require_noise(variance: float) -> None:
    """Raise `UsageError` unless a tracker's variance m^2 is positive: filters divide by it."""
    if not variance > 0:
        raise UsageError(
            f"twin.noise = {variance:g} m2: expected a variance above 0; for a tracker without "
            "noise use 1e-16"
        )


@dataclass(frozen=True)
class Origin:
    """Where a recording comes from: its name, the noise's seed, and what is declared of it.

    `same_model`: the model that made it is the one it will judge (an inverse crime, to be printed).
    """

    #: Of every tracked recording: an arbitrary round moment.
    start_ns: ClassVar[int] = 1_700_000_000_000_000_000

    name: str
    seed: int
    same_model: bool
    declared: Record = field(default_factory=dict)

    def record(
        self,
        points: Points,
        fiducials: Mapping[str, Floats],
        camera: Camera,
        readings: Mapping[str, Reading],
    ) -> Recording:
        """Record markers "markers" (points, then fiducials (3,) m) and a signal for every reading.

        Rest at t = 0 is put in front of points that begin later (`march` gives the ends of steps);
        readings are zero there. Signals keep every step. Records: "marker_layout" (m, the scene's
        frame), "camera" ("up": the scene's z there), "provenance". Each sensor has its own stream.
        Raises `RecordingError` for points displaced at t = 0, names that clash and lengths that
        differ.
        """
        clash = sorted(set(points.names) & set(fiducials))
        if clash:
            raise RecordingError(
                f"markers {clash} are both tracked points and fiducials; rename them"
            )
        lead = 1 if points.t[0] > 0 else 0
        # The points at rest at t = 0, and the fiducials that never move
        nt, k, f = len(points.t), len(points.names), len(fiducials)
        u = np.zeros((nt + lead, k + f, 3))
        u[lead:, :k] = points.u
        fixed = np.array(list(fiducials.values())).reshape(f, 3)
        t = np.concatenate([np.zeros(lead), points.t])
        seen = Points(t, (*points.names, *fiducials), np.vstack([points.rest, fixed]), u)
        if np.abs(seen.u[0]).max() > _AT_REST:
            raise RecordingError(
                f"points are {1e3 * np.abs(seen.u[0]).max():.3g} mm away from their rest position "
                "at t = 0 s: the registration needs the body at rest first"
            )
        seeds = streams(self.seed, ("markers", "missing", *readings, "odd"))
        clock = {f"{RECORD}markers": {"sd": repr(camera.late)}} if camera.late else {}
        led = {}
        for name, reading in readings.items():
            what = f"reading '{name}'"
            y = checked(reading.y, what, (len(seen.t) - lead,), error=RecordingError)
            led[name] = np.concatenate([np.zeros(lead), y])
        return Recording(
            self.name,
            Source(self.name, "", 0, "made in memory"),
            self.start_ns,
            markers={"markers": camera.looks(seen, seeds)},
            signals={
                k: signal(seen.t, led[k], r.unit, r.sd, "scene", seeds[k])
                for k, r in readings.items()
            },
            metadata={
                "marker_layout": {k: _text(v) for k, v in zip(seen.names, seen.rest, strict=True)},
                "camera": {
                    "up": _text(camera.rotation @ np.array([0.0, 0.0, 1.0])),
                    "sd_m": repr(camera.sd),
                    "still": str(camera.still),
                    "missing": repr(camera.missing),
                },
                "provenance": {
                    "kind": "twin",
                    "same_model": str(self.same_model).lower(),
                    "seed": str(self.seed),
                    **self.declared,
                },
                **clock,
            },
        )


def points_of(run: Run, scene: Scene) -> Points:
    """All probes of a finished run; those of a 2-D scene lie in the plane z = 0.

    Raises `RecordingError` for a run that did not finish and for a scene without probes.
    """
    if not run.finished or not scene.probes:
        raise RecordingError(
            f"run '{run.method}' is {run.outcome.state} after {len(run.t)} steps with "
            f"{len(scene.probes)} probes: only a finished run with probes can be recorded"
        )
    axes = "xyz"[: scene.mesh.dimension]
    u = [[run.traces[f"{p.name}.{axis}"].y for axis in axes] for p in scene.probes]
    rest = np.array([p.point for p in scene.probes])
    moved = np.transpose(u, (2, 0, 1))
    flat = 3 - len(axes)
    return Points(
        run.t,
        tuple(p.name for p in scene.probes),
        np.pad(rest, ((0, 0), (0, flat))),
        np.pad(moved, ((0, 0), (0, 0), (0, flat))),
    )


def _text(vector: Floats) -> str:
    return " ".join(repr(float(c)) for c in vector)


# --- twin of a moving body: a scene solved at finer steps than the models', then tracked ---------


@dataclass(frozen=True)
class SteppedTwin:
    """A scene with one input, marched by `scheme(dt)`, dt in s.

    `inputs` gives (nt,) at times (nt,) s. The models take `steps` of `dt` s; the twin takes `finer`
    steps in one of theirs.
    """

    scene: Scene
    scheme: Callable[[float], Scheme]
    inputs: Callable[[Floats], Floats]
    dt: float
    steps: int
    finer: int = 1

    def run(self, at: Ints) -> Run:
        """Return the run at the ends of the models' steps; fields at those numbered `at` (no,)."""
        f = self.finer
        dt = self.dt / f
        t: Floats = dt * np.arange(1, self.steps * f + 1, dtype=np.float64)
        stepper = self.scheme(dt).prepare(build(self.scene))
        run = march("twin", stepper, t, self.inputs(t)[:, None], (at + 1) * f - 1, 0.0)
        traces = {name: replace(trace, y=trace.y[f - 1 :: f]) for name, trace in run.traces.items()}
        return replace(run, t=run.t[f - 1 :: f], at=at, traces=traces)

    def record(
        self,
        origin: Origin,
        fiducials: Mapping[str, tuple[float, ...]],
        camera: Camera,
        reading: Callable[[Run], Mapping[str, Reading]],
        progress: Callable[[str], None],
    ) -> Recording:
        """Record its probes and `fiducials` (d,) m as tracked, and what is read beside them.

        To what `origin` declares its modulus and Poisson ratio are added.
        """
        progress("simulate")
        run = self.run(np.array([0]))
        progress("measure")
        material, flat = self.scene.material, 3 - self.scene.mesh.dimension
        stiffness = {"E_Pa": repr(material.E), "nu": repr(material.nu)}
        return replace(origin, declared={**origin.declared, **stiffness}).record(
            points_of(run, self.scene),
            {k: np.array([*v, *[0.0] * flat]) for k, v in fiducials.items()},
            camera,
            reading(run),
        )
