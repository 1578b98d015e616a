"""A log of a testing machine in the scene: displacement from contact, force from its zero."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from validate.identify.modulus import ModulusFit, TestKind, loading
from validate.recording.types import Recording
from validate.register.clock import clock_sd
from validate.register.observation import Role
from validate.register.registered import Registered
from validate.register.signals import SignalObservation, windows_of


def pressed_log(
    recording: Recording,
    fit: ModulusFit,
    height: float,
    limit: float,
    strains: Mapping[str, tuple[float, float]],
    noise: float,
    role: Role = "validates",
    share: float = 0.0,
    test: TestKind = "compression",
    toe: float | None = None,
) -> Registered:
    """Displacement less contact and toe, force less the cell's offset, to the strain `limit`.

    The force, of sd `noise` N, is read at the displacement's times and compared in the windows of
    strain; what an uncertain clock of either makes of it is counted. `share` is how far specimens
    differ, relative, one standard uncertainty. `toe` m is where a method's own law begins to carry
    load, counted from contact (none: where the fitted line does); windows are the same for all.
    """
    log = loading(recording, test)
    moved = log.d[:, None] - fit.contact - fit.toe * height
    last = int(np.argmax(moved[:, 0] > limit * height)) or len(moved)
    stage = SignalObservation(
        "displacement", "drives", log.t[:last], moved[:last], "m",
        recording.signal("displacement", "m").sd, sd_t=clock_sd(recording, "displacement"),
    )  # fmt: skip
    cell = SignalObservation(
        "force", role, log.t[:last], log.force[:last, None] - fit.offset, "N",
        float(np.hypot(noise, log.error)), "force", "stage.force", clock_sd(recording, "force"),
        share,
    )  # fmt: skip
    windows = {label: (a * height, b * height) for label, (a, b) in strains.items()}
    selections = windows_of(stage, windows)
    if toe is not None:
        stage = replace(stage, y=stage.y + fit.toe * height - toe)
    return Registered((stage, cell), selections, outside=len(log.t) - last)
