"""Apparent compressive modulus of a cylinder from force-displacement logs.

Definition. Stress is F / A0 and strain (d - d_contact) / h0 (engineering, on the undeformed
cylinder). E_apparent is the least-squares slope of stress over strain, with free intercept, over
the samples of the first loading whose strain lies in the window (0.5-5 % unless told otherwise).

Departures. The free intercept takes out the load cell's zero offset, where a chord or a line
through the origin would not. Curvature inside the window stays: for a material that stiffens,
E_apparent is a mean tangent and grows with the window.

Compression of a cylinder between plates it cannot slip on is stiffer than its material:
E_apparent = E * correction. Whether plates slip is seldom recorded.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats, rms
from validate.errors import RecordingError, UsageError
from validate.recording.types import Recording, Signal
from validate.register.clocks import SAME, interpolated

TestKind = Literal["compression", "tension"]
WINDOW = (0.005, 0.05)
MIN_SAMPLES = 10
PLATEAU = 5  # samples of unloaded approach from which a contact point is told from noise
BEYOND_NOISE = 5.0  # a force this many noise sd off the unloaded one is contact


@dataclass(frozen=True)
class CylinderSize:
    """An undeformed cylinder compressed along its axis; diameter and height in m."""

    diameter: float
    height: float

    def __post_init__(self) -> None:
        for name, size in (("diameter", self.diameter), ("height", self.height)):
            if not (math.isfinite(size) and size > 0):
                raise RecordingError(f"cylinder {name} {size} m: expected a size above 0")

    @property
    def area(self) -> float:
        """Undeformed cross-section, m2."""
        return math.pi * self.diameter**2 / 4


@dataclass(frozen=True)
class ModulusFit:
    """One log's apparent modulus and what it rests on.

    `sd` is the standard error of the slope from the scatter of the residuals, taken as independent:
    with curvature in the window they are not, and `residual_rms` exceeds `noise`. `r_squared` is
    given because it is asked for; it proves nothing: it nears 1 for any steady rise, whatever the
    window, offset or curvature.
    """

    name: str
    E_apparent: float  # Pa
    sd: float  # Pa
    offset: float  # N, force of the unloaded cell
    contact: float  # m, displacement at which the plate meets the cylinder
    toe: float  # strain from contact at which the fitted line reaches the unloaded force
    noise: float  # N, sd of the load cell's noise
    window: tuple[float, float]  # strain
    count: int  # samples in the window
    residual_rms: float  # N
    r_squared: float

    @classmethod
    def of(
        cls,
        recording: Recording,
        cylinder: CylinderSize | None = None,
        window: tuple[float, float] = WINDOW,
        test: TestKind = "compression",
    ) -> "ModulusFit":
        """E over a strain window of one log with signals `displacement` (m) and `force` (N).

        `cylinder` None: the one in the recording. Raises `UsageError` for an
        empty window and `RecordingError` when the log does not cover it with 10 samples.
        """
        low, high = window
        if not (math.isfinite(high) and 0 <= low < high):
            raise UsageError(f"strain window {window}: expected 0 <= low < high, e.g. {WINDOW}")
        cylinder = cylinder or cylinder_of(recording)
        log = loading(recording, test)
        d, force = log.d, log.force
        # Noise of the log's first part, up to `reach` (m) from its first displacement.
        beyond = d - d[0] > (cylinder.height * high)
        count = int(np.argmax(beyond)) if beyond.any() else len(d)
        noise = load_noise(force[: max(count, MIN_SAMPLES)])
        offset, contact = zero_of(d, force, noise, cylinder.height * low)
        strain = (d - contact) / cylinder.height
        # The first loading: samples before the first beyond the window, else to the largest
        # strain.
        beyond = strain > high
        end = int(np.argmax(beyond)) if beyond.any() else int(np.argmax(strain)) + 1
        used = np.arange(len(strain)) < end
        used &= (strain >= low) & (strain <= high)
        low, high = window
        count = int(used.sum())
        if float(strain.max()) < high * (1 - 1e-9) or count < MIN_SAMPLES:
            raise RecordingError(
                f"{recording.name}: strain from {strain.min():.4f} to {strain.max():.4f} with "
                f"{count} samples in the window {low}-{high}; expected to cover it with "
                f"{MIN_SAMPLES}: choose another"
            )
        return _fit(
            recording.name, strain[used], force[used], cylinder.area, offset, contact, window
        )


def cylinder_of(recording: Recording) -> CylinderSize:
    """Return the cylinder in the recording's `specimen` record (`diameter_m`, `height_m`).

    Raises `RecordingError` when one of them is absent or not a number.
    """
    record = recording.record("specimen")
    sizes = []
    for name in ("diameter_m", "height_m"):
        try:
            sizes.append(float(record[name]))
        except (KeyError, ValueError) as error:
            raise RecordingError(
                f"{recording.name}: no number '{name}' in its specimen record {dict(record)}; "
                "declare the size of the cylinder"
            ) from error
    return CylinderSize(*sizes)


def load_noise(force: Floats) -> float:
    """Noise sd (N) of a smooth force (n,) with independent noise, from its second differences.

    The second difference of white noise of variance s^2 has variance 6 s^2; a smooth curve sampled
    finely adds next to nothing. Raises `RecordingError` for fewer than 10 samples.
    """
    if len(force) < MIN_SAMPLES:
        raise RecordingError(
            f"{len(force)} forces for a noise estimate: at least {MIN_SAMPLES} are needed; record "
            "more samples, or state the force's standard deviation in the recording"
        )
    return rms(np.diff(force, 2)) / float(np.sqrt(6))


@dataclass(frozen=True)
class Log:
    """Displacement d m and force N (n,) at the same times t s; `error` N is what putting the force
    there adds to its noise."""

    t: Floats
    d: Floats
    force: Floats
    error: float


def loading(recording: Recording, test: TestKind = "compression") -> Log:
    """Signals `displacement` and `force` at the displacement's times, by their clocks; both grow
    as the specimen is pressed, or in a test in tension as it is pulled.

    Raises `RecordingError` where they have fewer than 10 samples in common, and for a recording of
    the other test.
    """
    require_test(recording, test)
    moved, force = (_samples(recording, *s) for s in (("displacement", "m"), ("force", "N")))
    sign = 1.0
    if test == "tension":  # imported logs have compression positive
        pulled = moved.y[:, 0] - moved.y[0, 0]
        sign = float(np.sign(pulled[np.abs(pulled).argmax()])) or 1.0
    if len(moved.t) == len(force.t) and np.abs(moved.t - force.t).max(initial=0.0) <= SAME:
        return Log(moved.t, sign * moved.y[:, 0], sign * force.y[:, 0], 0.0)
    shown, squared = interpolated(force.t, force.y, moved.t)
    both = np.isfinite(shown[:, 0])
    if both.sum() < MIN_SAMPLES:
        raise RecordingError(
            f"{recording.name}: force from {force.t[0]:.3f} to {force.t[-1]:.3f} s covers "
            f"{both.sum()} of the displacement's samples ({moved.t[0]:.3f} to {moved.t[-1]:.3f} s),"
            f" at least {MIN_SAMPLES} needed; check the clocks with `validate inspect`"
        )
    error = float(np.sqrt(squared[0]))
    return Log(moved.t[both], sign * moved.y[both, 0], sign * shown[both, 0], error)


def stated_test(recording: Recording) -> str:
    """What the recording says that it is, "compression" or "tension"; "" where it does not."""
    said = recording.metadata.get("specimen", {}).get("test", "")
    return said if said in ("compression", "tension") else ""


def require_test(recording: Recording, test: TestKind) -> None:
    """Raise `RecordingError` for a recording that says of itself that it is the other test."""
    said = stated_test(recording)
    if said and said != test:
        presses = "presses" if test == "compression" else "pulls"
        raise RecordingError(
            f"{recording.name} is a test in {said}, but the experiment is one in {test}: its "
            f"drive is along '{'+z' if said == 'tension' else '-z'}'; or if it {presses}, import "
            f"it again with --map test={test}"
        )


def _samples(recording: Recording, topic: str, unit: str) -> Signal:
    found = recording.signal(topic, unit)
    if found.y.shape[1] != 1:
        raise RecordingError(
            f"{recording.name}: '{topic}' has {found.y.shape[1]} columns, expected 1"
        )
    return found


def zero_of(d: Floats, force: Floats, noise: float, toe: float) -> tuple[float, float]:
    """Force offset (N) and contact displacement (m).

    With an unloaded approach the offset is its mean and contact where the line through the toe
    (m) behind it meets that mean. Without one the first displacement is contact, and the offset the
    value there of a parabola through the toe. Raises `RecordingError` where nothing was loaded.
    """
    loaded = np.flatnonzero(np.abs(force - np.median(force[:PLATEAU])) > _threshold(force, noise))
    if len(loaded) == 0:
        raise RecordingError(
            f"no contact in {len(force)} samples: no force is {_threshold(force, noise):.3g} N "
            "(5 sd of the noise) away from the unloaded force, and all lie within "
            f"{np.ptp(force):.3g} N; check the load cell's channel, unit and range"
        )
    start = int(loaded[0])
    if start < 2 * PLATEAU:
        return _parabola_start(d, force, toe), float(d[0])
    offset = float(force[: start - 1].mean())
    near = slice(start, start + max(PLATEAU, int(np.sum(d[start:] - d[start] <= toe))))
    if np.ptp(d[near]) == 0:
        return offset, float(d[start])
    slope, at_zero = np.polyfit(d[near], force[near], 1)
    contact = (offset - at_zero) / slope if slope > 0 else d[start]
    return offset, float(np.clip(contact, d[0], d[start]))


def _threshold(force: Floats, noise: float) -> float:
    """How far off the unloaded force contact is; above rounding where there is no noise."""
    return BEYOND_NOISE * noise + 1e-9 * float(np.ptp(force))


def _parabola_start(d: Floats, force: Floats, toe: float) -> float:
    count = max(PLATEAU, int(np.argmax(d - d[0] > toe)))
    if len(np.unique(d[:count])) < 3:  # too few places for a parabola
        return float(force[:count][d[:count] == d[0]].mean())
    x = (d[:count] - d[0]) / np.ptp(d[:count])
    return float(np.polyfit(x, force[:count], 2)[-1])


def _fit(
    name: str,
    strain: Floats,
    force: Floats,
    area: float,
    offset: float,
    contact: float,
    window: tuple[float, float],
) -> ModulusFit:
    """E = sum (e - e_mean) F / (A0 sum (e - e_mean)^2), its sd from n - 2 degrees of freedom."""
    e = strain - strain.mean()
    spread = float(e @ e)
    if spread == 0:
        raise RecordingError(f"{name}: {len(strain)} samples at one strain {strain[0]:.6f}")
    slope = float(e @ force) / spread
    if slope <= 0:
        raise RecordingError(
            f"{name}: force falls with strain ({slope:.3g} N per unit strain) in the window "
            f"{window}; check sign and columns"
        )
    rest = force - force.mean() - slope * e
    left, whole = float(rest @ rest), float(np.sum((force - force.mean()) ** 2))
    return ModulusFit(
        name=name,
        E_apparent=slope / area,
        sd=math.sqrt(left / (len(e) - 2) / spread) / area,
        offset=offset,
        contact=contact,
        toe=float(strain.mean() - (force.mean() - offset) / slope),
        noise=load_noise(force),
        window=window,
        count=len(e),
        residual_rms=math.sqrt(left / len(e)),
        r_squared=1 - left / whole if whole > 0 else 0.0,
    )
