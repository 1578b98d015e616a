"""The silicone beam of srl-ethz/diffPD_sim2real: parameters, recording, scene and registration.

30 x 30 x 100 mm, clamped at one end, held straight and let go; a mass may hang at the upper edge of
its free end. Three markers stand 6 mm off that end. What is compared is where they come to rest.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validate.arrays import Floats
from validate.datasets.home import found
from validate.errors import RecordingError, UsageError
from validate.fem.locate import standing_rows
from validate.parameters import Ranges, part, quantity
from validate.recording.readers import recognised
from validate.recording.types import Markers, Recording
from validate.register.fitting import MarkerFit
from validate.register.markers import MarkerObservation, Together, observe_markers
from validate.register.observation import Selection
from validate.register.registered import Registered
from validate.register.signals import SignalObservation
from validate.scene.box import grid
from validate.scene.laws import Coefficients
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh, quadratic
from validate.scene.scene import Mass, Probe, Scene, Support, Weight
from validate.scene.select import Chosen, OnPlane

FOLDER = "markers/silicone-beam"
G = 9.80709  # m/s2, as the data set declares it
_STANDS = 0.012  # m: how far off the beam a marker of the layout may stand, and then some
_MOVED = 5e-4  # m: of a marker at the free end, when the beam has been let go
_BEFORE, _AFTER = 0.3, 1.0  # s: of rest before that, and of rest at the recording's end
_SAME = 1e-3  # m: how far positions may wander at rest
#: Markers m in the frame of the beam, x from the clamp, z up, as the data set places them.
LAYOUT: Mapping[str, tuple[float, float, float]] = {
    "Tip - 1": (0.1, 0.015, 0.036),
    "Tip - 2": (0.1, -0.006, 0.024),
    "Tip - 3": (0.1, 0.036, 0.006),
    "Base - 1": (0.006, -0.01, -0.001),
    "Base - 2": (0.006, 0.04, 0.0275),
    "Base - 3": (0.006, 0.04, 0.0),
}
TIPS = tuple(name for name in LAYOUT if name.startswith("Tip"))
TOGETHER = (
    Together("tip.vertical", (2,), "vertical displacement of the tip's markers, rest to rest"),
    Together("tip.axial", (0,), "displacement along the beam of the tip's markers, rest to rest"),
    Together("tip.lateral", (1,), "sideways displacement of the tip's markers, rest to rest"),
)


@dataclass(frozen=True)
class BeamSilicone:
    E: float = quantity(263_824.0, "Pa", "modulus that the data set declares")
    nu: float = quantity(0.499, "1", "Poisson ratio that the data set declares")
    rho: float = quantity(1070.0, "kg/m3", "density that the data set declares")
    coefficients: Coefficients = part(Coefficients(), "what the models' laws have beyond E and nu")


@dataclass(frozen=True)
class BeamSize:
    length: float = quantity(0.1, "m", "from the clamp to the free end")
    width: float = quantity(0.03, "m", "across, horizontally")
    height: float = quantity(0.03, "m", "across, vertically")


@dataclass(frozen=True)
class BeamGrid:
    along: int = quantity(12, "1", "cells along the beam")
    across: int = quantity(3, "1", "cells across it, both ways")


@dataclass(frozen=True)
class HungMass:
    mass: float = quantity(0.0, "kg", "hangs at the upper edge of the free end; 0: nothing")

    def __post_init__(self) -> None:
        if not 0 <= self.mass < 10:
            raise UsageError(f"load.mass = {self.mass:g} kg: from 0 to 10 kg; 52 g are 0.052")


@dataclass(frozen=True)
class BeamRanges(Ranges):
    modulus: float = quantity(0.03, "1", "relative, of the modulus")
    nu: float = quantity(0.0005, "1", "of the Poisson ratio")
    rho: float = quantity(0.02, "1", "relative, of the density")
    size: float = quantity(0.2e-3, "m", "of width and height")
    mass: float = quantity(1e-3, "kg", "of the mass that hangs there")
    repeats: float = quantity(
        0.3e-3, "m", "of a marker between repeats: two differ by 0.1 to 0.8 mm, over sqrt 2"
    )


@dataclass(frozen=True)
class ReleasedBeam:
    """`recording` is a file that any reader takes; none: the data set's own under gravity."""

    material: BeamSilicone = BeamSilicone()
    size: BeamSize = BeamSize()
    mesh: BeamGrid = BeamGrid()
    load: HungMass = HungMass()
    ranges: BeamRanges = BeamRanges()
    registration: MarkerFit = MarkerFit(sd=(0.8e-3,))
    recording: str | None = quantity(None, "1", "the recording; none: VALIDATE_SHARED_DATA")


@dataclass(frozen=True)
class BeamModel:
    """What a method's scene is built with."""

    law: LawName = quantity("neo_hooke", "1", "law of the material")
    order: int = quantity(2, "1", "of the hexahedra")
    mixed: bool = quantity(True, "1", "with a pressure of their own, so that they do not lock")
    along: int | None = quantity(None, "1", "cells along the beam; none: the mesh's")
    across: int | None = quantity(None, "1", "cells across it; none: the mesh's")


def load(parameters: ReleasedBeam, folder: Path) -> tuple[Recording, ...]:
    """The recording as two instants: before the beam is let go, and when it has come to rest."""
    path = found(FOLDER, "beam_gravity_V2_b.c3d", folder, parameters.recording)
    return (rest_to_rest(recognised(path).read(path, {})),)


def rest_to_rest(recording: Recording) -> Recording:
    """Markers at 0 s, before the release, and at the recording's end: means over what is at rest.

    Raises `RecordingError` for markers that are missing or never seen, a beam that is not let go,
    and one that still moves at the end.
    """
    markers = recording.marker("markers")
    absent = [name for name in LAYOUT if name not in markers.names]
    if absent:
        raise RecordingError(
            f"{recording.name}: no marker {absent}; it has {list(markers.names)[:8]}"
        )
    kept = [markers.names.index(name) for name in LAYOUT]
    x, t = markers.x[:, kept], markers.t
    before = _before_release(recording.name, x[:, : len(TIPS)], t)
    after = t > t[-1] - _AFTER
    ends = [_at_rest(recording.name, x[part], word) for part, word in
            ((before, "before the release"), (after, "at the end"))]  # fmt: skip
    still = Markers(np.array([0.0, t[-1]]), tuple(LAYOUT), np.array(ends), markers.sd,
                    markers.frame)  # fmt: skip
    return replace(recording, markers={"markers": still})


def _before_release(name: str, tips: Floats, t: Floats) -> Floats:
    """The samples (nt,) of the last `_BEFORE` s before a tip marker moves off for good."""
    start = np.nanmedian(tips[t < t[0] + _BEFORE / 2], axis=0)
    moved = (np.linalg.norm(tips - start, axis=2) > _MOVED).any(axis=1)
    if not moved.any():
        raise RecordingError(
            f"{name}: no marker at the tip moves by {1e3 * _MOVED:g} mm: the beam is not let go"
        )
    release = int(np.argmax(moved))
    if t[release] < _BEFORE / 2:
        raise RecordingError(
            f"{name}: the beam moves at {t[release]:.2f} s; {_BEFORE / 2:g} s of rest before it is "
            "let go are needed, to know where it was"
        )
    return np.asarray((t >= t[release] - _BEFORE) & (t < t[release] - 0.03))


def _at_rest(name: str, x: Floats, when: str) -> Floats:
    seen = np.isfinite(x).all(axis=2).sum(axis=0)
    for marker, count in zip(LAYOUT, seen, strict=True):
        if count < 3:
            raise RecordingError(
                f"{name}: '{marker}' is seen at {count} of {len(x)} samples {when}; 3 are needed"
            )
    wander = float(np.nanmax(np.nanstd(x, axis=0)))
    if wander > _SAME:
        raise RecordingError(
            f"{name}: markers wander by {1e3 * wander:.2f} mm {when}, at most {1e3 * _SAME:g} mm "
            "are rest; record longer"
        )
    return np.asarray(np.nanmean(x, axis=0))


def build(recording: Recording, parameters: ReleasedBeam, model: BeamModel) -> Scene:
    """Clamped at x = 0, x along the beam, z up; the markers of the tip are probes on stalks."""
    p, s = parameters, parameters.size
    hung = (Mass("load", _upper_edge(s), p.load.mass),) if p.load.mass else ()
    return Scene(
        _mesh(p, model),
        Material(
            p.material.E,
            p.material.nu,
            model.law,
            p.material.rho,
            coefficients=p.material.coefficients.known_to(model.law),
        ),
        (Support("x0", (0, 1, 2)),),
        loads=(Weight("gravity", (0.0, 0.0, -1.0)),),
        masses=hung,
        probes=tuple(Probe(name, LAYOUT[name], stands=True) for name in TIPS),
        dilatation="mixed" if model.mixed else "pointwise",
    )


def _upper_edge(s: BeamSize) -> Chosen:
    end, top = (
        OnPlane((s.length, 0.0, 0.0), (1.0, 0.0, 0.0)),
        OnPlane((0.0, 0.0, s.height), (0.0, 0.0, 1.0)),
    )
    return (end & top).edges


def _mesh(p: ReleasedBeam, model: BeamModel) -> Mesh:
    across = model.across or p.mesh.across
    cells = (model.along or p.mesh.along, across, across)
    mesh = grid((p.size.length, p.size.width, p.size.height), cells)
    return quadratic(mesh) if model.order == 2 else mesh


def place(recording: Recording, parameters: ReleasedBeam, scene: Scene) -> Registered:
    """Six markers fitted to the layout, once, at rest; those of the tip are compared from where
    they were seen to stand, so that the layout's own errors do not enter displacements."""
    markers = recording.marker("markers")
    layout = {name: np.array(at) for name, at in LAYOUT.items()}
    whole = observe_markers(
        markers, layout, scene.mesh, how=parameters.registration, stands=_STANDS
    )
    end = float(markers.t[-1])
    gravity = SignalObservation("gravity", "drives", np.array([end]), np.array([[G]]), "m/s^2", 0.0)
    tips = _from_where_they_stand(whole, scene.mesh, markers.sd, parameters.ranges.repeats)
    rest = Selection("settled", np.array([end]), "means over the last second")
    return Registered((gravity, tips), (rest,))


def _from_where_they_stand(
    whole: MarkerObservation, mesh: Mesh, sd: float, repeats: float
) -> MarkerObservation:
    """The tip's markers, their rest as registered; what a wrong rotation does to displacements and
    what repeats differ by is their systematic uncertainty."""
    kept = [whole.names.index(name) for name in TIPS]
    x = whole.x[:, kept]
    rest = x[0]
    centre = np.array([list(at) for at in LAYOUT.values()]).mean(axis=0)
    moved = x[-1] - rest
    turned = np.sqrt(
        whole.registration.tre_at(centre + moved) ** 2
        - whole.registration.tre_at(np.broadcast_to(centre, moved.shape)) ** 2
    )
    return replace(
        whole, names=TIPS, x=x, rest=rest, positions=standing_rows(mesh, rest), sd=sd, axis_sd=(),
        tre=np.hypot(turned, np.sqrt(3) * repeats), together=TOGETHER,
    )  # fmt: skip
