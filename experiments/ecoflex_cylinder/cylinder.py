"""The cylinders of Dawood et al. (2026): settings, logs and registration."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from validate.datasets.home import data_path
from validate.errors import RecordingError
from validate.fem.system import Responses
from validate.fem.system import build as build_system
from validate.identify.modulus import CylinderSize, ModulusFit
from validate.parameters import Ranges, known, quantity
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Built, Tree
from validate.pipeline.plates.scene import pressed_log
from validate.recording.readers import recognised
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.scene.scene import Scene

from .specimens import specimen_of

DATA_SET = "abubakardawood/tissue-phantom-material-database (CC BY 4.0)"
FOLDER = "force/ecoflex-compression"


@dataclass(frozen=True)
class SiliconeModuli:
    """Open until identified; each method names its own."""

    E_slip: float | None = quantity(None, "Pa", "modulus if plates slip; none: identified")
    E_bonded: float | None = quantity(None, "Pa", "modulus if plates hold; none: identified")
    E_svk_slip: float | None = quantity(None, "Pa", "St. Venant-Kirchhoff, slipping plates")
    E_neo_slip: float | None = quantity(None, "Pa", "neo-Hooke, slipping plates")
    E_neo_bonded: float | None = quantity(None, "Pa", "neo-Hooke, bonded plates")


@dataclass(frozen=True)
class SiliconeRanges(Ranges):
    specimen: float = quantity(
        0.043, "1", "relative scatter of E between specimens, where these logs do not say (4.5/104)"
    )
    modulus: float = quantity(0.0, "1", "relative, of the modulus; 0: as identified")
    nu: float = quantity(0.0004, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class LoggedCylinder:
    material: SiliconeModuli = SiliconeModuli()
    ranges: SiliconeRanges = SiliconeRanges()
    fit_from: float = quantity(0.005, "1", "strain from which the modulus is fitted")
    fit_to: float = quantity(0.05, "1", "strain to which the modulus is fitted")
    limit_linear: float = quantity(0.10, "1", "strain to which the linear law is shown")
    limit_svk: float = quantity(0.25, "1", "strain to which St. Venant-Kirchhoff is shown")
    limit_neo_hooke: float = quantity(0.50, "1", "strain to which neo-Hooke is shown")
    data: str | None = quantity(None, "1", "folder of the logs; none: VALIDATE_SHARED_DATA")
    logs: str = quantity("EF30_0T_*.csv", "1", "file name pattern of the logs")
    judged: str | None = quantity(
        None, "1", "specimen that is left out and predicted; none: the last of several"
    )


def window(strain: float) -> str:
    """The name of the window that ends at a strain."""
    return f"{100 * strain:g}pct"


def _limits(p: LoggedCylinder) -> tuple[float, float, float]:
    """Strains to which the three laws are shown."""
    return (p.limit_linear, p.limit_svk, p.limit_neo_hooke)


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    p: LoggedCylinder = tree.settings
    where = data_path(FOLDER, None, folder, p.data)
    files = sorted(where.glob(p.logs))
    if not files:
        raise RecordingError(f"no logs '{p.logs}' in {where}; pass --set logs=PATTERN")
    return tuple(recognised(f).read(f, {}) for f in files)


def size(tree: Tree) -> CylinderSize:
    """Raises `UsageError` while a size is not set."""
    body = tree.scene.body
    return CylinderSize(known(body.diameter, "body.diameter"), known(body.height, "body.height"))


def model_scene(tree: Tree, method: Method, **material: Any) -> Scene:
    """The scene of a method with another `E` Pa, or another `law`."""
    own = {f"material.{name}": value for name, value in material.items()}
    return Built()(None, tree, {**(method.scene or {}), **own})


def place(recording: Recording, tree: Tree, scene: Scene) -> Registered:
    """To the law's limit, in windows that end where one of the laws does and the log reaches.

    Other specimens than the one that is judged calibrate, in windows of their own.
    """
    p: LoggedCylinder = tree.settings
    limit: float = getattr(p, f"limit_{scene.material.law}")
    fit, height = ModulusFit.of(recording, size(tree), (p.fit_from, p.fit_to)), size(tree).height
    d = recording.signal("displacement", "m").y
    reached = float(d.max() - fit.contact) / height - fit.toe
    strains = pairwise((p.fit_from, p.fit_to, *_limits(p)))
    shown = {window(b): (a, b) for a, b in strains if b <= min(limit, reached)}
    if p.judged in (None, specimen_of(recording)):
        return pressed_log(recording, fit, height, limit, shown, fit.noise, share=p.ranges.specimen)
    shown = {f"{label} of those that calibrate": span for label, span in shown.items()}
    return pressed_log(recording, fit, height, limit, shown, fit.noise, "calibrates")


def stiffening(tree: Tree, method: Method) -> float:
    """Apparent over true modulus of a method's meshed cylinder: E_app = F h / (A d) at E = 1 Pa.

    At small strain, where every law is the linear one.
    """
    scene = model_scene(tree, method, E=1.0, law="linear")
    force = Responses.of(build_system(scene)).reactions[0, 0]
    return float(force * size(tree).height / size(tree).area)
