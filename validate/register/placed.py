"""Tracked markers placed in the scene by the records of their own recording."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.errors import RegistrationError
from validate.recording.types import Recording
from validate.register.observe import MarkerObservation, Sampling, observe_markers
from validate.register.quality import LINE
from validate.register.transform import spread
from validate.scene.mesh import Mesh

_FLAT = 1e-6  # third over first rms spread of exact points in a plane


def placed(
    recording: Recording,
    mesh: Mesh,
    *,
    topic: str = "markers",
    method: Literal["rigid", "similarity"] = "rigid",
    sampling: Sampling = "barycentric",
) -> MarkerObservation:
    """`observe_markers` with the records "marker_layout" (m) and "camera" ("up" is the scene's z).

    `up` is used for a layout that is a plane within the noise; any other shows a mirror itself.
    Raises `RecordingError` for an absent record, `RegistrationError` for one that is no vector, and
    whatever `observe_markers` does.
    """
    layout = {
        name: _vector(text, f"marker_layout '{name}'")
        for name, text in recording.record("marker_layout").items()
    }
    up = _vector(recording.record("camera").get("up", ""), "camera 'up'")
    markers = recording.marker(topic)
    axes = (up, np.array([0.0, 0.0, 1.0])) if _planar(layout, markers.sd) else None
    return observe_markers(markers, layout, mesh, method=method, sampling=sampling, up=axes)


def _planar(layout: Mapping[str, Floats], sd: float) -> bool:
    points = np.array(list(layout.values()))
    return len(points) >= 3 and bool(spread(points)[2] <= LINE * sd + _FLAT * spread(points)[0])


def _vector(text: str, what: str) -> Floats:
    try:
        values = np.array([float(part) for part in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise RegistrationError(f"{what} is '{text[:60]}': expected three numbers")
    return values
