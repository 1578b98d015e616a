"""Machine compliance: correction of the displacement, measured on a rigid block.

Frame, load cell and grips yield in series with the specimen, so that u_specimen = u_recorded - C F.
"""

from dataclasses import replace
from functools import lru_cache
from math import hypot
from pathlib import Path

import numpy as np

from validate.errors import ComparisonError, UsageError
from validate.pipeline.experiment.tree import Tree
from validate.recording.readers import read_recording
from validate.recording.types import Recording
from validate.register.signals import SignalObservation

# What machines for soft materials yield, m/N: a stiff frame, and a small one with its load cell.
USUAL = (1e-7, 1e-6)
_SHARE = 0.03  # of the largest force: a shift above it is a doubt
_UPPER = 0.8  # of the largest force: above it the specimen's own slope is read
_FEWEST = 5  # samples of a slope


def yielding(p: Tree, folder: Path, displacement: str) -> Tree:
    """Return the parameters with the compliance that a recording of a rigid block shows, in the
    signals of these names.

    Raises `ComparisonError` where it shows none, `RecordingError` where it cannot be read.
    """
    card = p.settings.machine
    if card.measured is None:
        return p
    C, sd = _measured(folder / card.measured, displacement, str(p.settings.seen.force))
    return p.with_settings(machine=replace(card, compliance=C, sd=sd, measured=None))


@lru_cache(maxsize=4)
def _measured(path: Path, displacement: str, force: str) -> tuple[float, float]:
    """Slope m/N of displacement over force beyond a tenth of the largest force, and its standard
    uncertainty: the scatter about the line, and its bend (lower against upper half)."""
    recording = read_recording(path)
    u, F = recording.signal(displacement, "m"), recording.signal(force, "N")
    load = np.interp(u.t, F.t, F.y[:, 0])
    pressed = load > 0.1 * load.max()
    if load.max() <= 0 or pressed.sum() < 2 * _FEWEST:
        raise ComparisonError(
            f"machine.measured = {path.name}: {int(pressed.sum())} samples of '{displacement}' "
            f"beyond a tenth of the largest '{force}' ({load.max():.3g} N), {2 * _FEWEST} are "
            f"needed: press a rigid block, or give machine.compliance"
        )
    x, y = load[pressed], u.y[pressed, 0]
    middle = float(np.median(x))
    (C, _), cov = np.polyfit(x, y, 1, cov=True)
    halves = [np.polyfit(x[part], y[part], 1)[0] for part in (x <= middle, x > middle)]
    return float(C), hypot(float(np.sqrt(cov[0, 0])), abs(halves[1] - halves[0]) / 4)


def taken_off(
    drive: SignalObservation, p: Tree, force: SignalObservation | None
) -> SignalObservation:
    """Return the drive less what the machine yields; its sd has the force's in it.

    Raises `UsageError` for a compliance without a recorded force.
    """
    C = p.settings.machine.compliance
    if not C:
        return drive
    if force is None:
        raise UsageError(
            f"machine.compliance = {C:g} m/N needs the recorded force: set seen.force to its topic"
        )
    y = drive.y[:, 0] - C * np.interp(drive.t, force.t, force.y[:, 0])
    y[0] = 0.0
    return replace(drive, y=y[:, None], sd=hypot(drive.sd, C * force.sd))


def doubt(
    p: Tree, recording: Recording, displacement: str, limit: float | None
) -> str:  # fmt: skip
    """Return the doubt that the machine's compliance is not stated; "" where it does not matter.

    It matters where a usual machine shifts the largest force by more than the limit N, or by more
    than 3 % of it. To first order the shift is C F dF/du, with the slope of the recording itself.
    """
    if p.settings.machine.compliance is not None or not p.settings.seen.force:
        return ""
    u, F = recording.signal(displacement, "m"), recording.signal(p.settings.seen.force, "N")
    size = np.abs(np.interp(u.t, F.t, F.y[:, 0] - F.y[0, 0]))
    top, way = float(size.max()), np.abs(u.y[:, 0] - u.y[0, 0])
    # Stiffness N/m of specimen and machine together near the largest force
    upper = size >= _UPPER * size.max()
    if upper.sum() < _FEWEST or np.ptp(way[upper]) == 0:
        return ""
    slope = float(np.polyfit(way[upper], size[upper], 1)[0])
    if slope <= 0:
        return ""
    shifts = [C * top * slope for C in USUAL]
    if shifts[1] <= min(limit or np.inf, _SHARE * top):
        return ""
    shown = " to ".join(f"{100 * s / top:.2g}" for s in shifts)
    against = f"; the limit is {limit:.3g} N" if limit else ""
    return (
        f"machine.compliance is not set. The specimen yields {1 / slope:.2g} m/N at "
        f"{top:.3g} N; a machine of {USUAL[0]:g} to {USUAL[1]:g} m/N (assumed) yields up to "
        f"{1e3 * USUAL[1] * top:.2g} mm of {1e3 * float(np.ptp(way)):.3g} mm, which shifts the "
        f"force by {shown} % ({shifts[1]:.2g} N{against}). Press a rigid block and set "
        "machine.measured=FILE, or machine.compliance and machine.sd"
    )
