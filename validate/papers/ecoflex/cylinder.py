"""The cylinders of Dawood et al. (2026): parameters, logs, scene and registration."""

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

from validate.datasets.home import found
from validate.errors import RecordingError
from validate.fem.system import build as build_system
from validate.fem.system import responses
from validate.identify.modulus import CylinderSize, fit_modulus
from validate.papers.ecoflex.specimens import specimen_of
from validate.parameters import Ranges, quantity
from validate.recording.exports.instron import read_instron
from validate.recording.types import Recording
from validate.register.registered import Registered
from validate.replay.cards import QuarterGrid
from validate.replay.compression import STAGE, SYMMETRY, between
from validate.replay.compression_cards import size_of
from validate.replay.pressed import pressed_log
from validate.scene.cylinder import quarter_cylinder
from validate.scene.material import LawName, Material
from validate.scene.plates import Contact
from validate.scene.refine import of_element
from validate.scene.scene import Scene

DATA_SET = "abubakardawood/tissue-phantom-material-database (CC BY 4.0)"
FOLDER = "force/ecoflex-compression"


@dataclass(frozen=True)
class SiliconeCard:
    E_slip: float | None = quantity(None, "Pa", "modulus if plates slip; none: identified")
    E_bonded: float | None = quantity(None, "Pa", "modulus if plates hold; none: identified")
    E_svk_slip: float | None = quantity(None, "Pa", "St. Venant-Kirchhoff, slipping plates")
    E_neo_slip: float | None = quantity(None, "Pa", "neo-Hooke, slipping plates")
    E_neo_bonded: float | None = quantity(None, "Pa", "neo-Hooke, bonded plates")
    nu: float = quantity(0.4995, "1", "Poisson ratio, nearly incompressible silicone")


@dataclass(frozen=True)
class LoggedSpecimen:
    diameter: float | None = quantity(None, "m", "diameter; none: the logs'", asked=True)
    height: float | None = quantity(None, "m", "height; none: the logs'", asked=True)

    @property
    def size(self) -> CylinderSize:
        """Raises `UsageError` while a size is not set."""
        return size_of(self.diameter, self.height)


@dataclass(frozen=True)
class SiliconeRanges(Ranges):
    specimen: float = quantity(
        0.043, "1", "relative scatter of E between specimens, where these logs do not say (4.5/104)"
    )
    modulus: float = quantity(0.0, "1", "relative, of the modulus; 0: as identified")
    nu: float = quantity(0.0004, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class LoggedCylinder:
    material: SiliconeCard = SiliconeCard()
    specimen: LoggedSpecimen = LoggedSpecimen()
    mesh: QuarterGrid = QuarterGrid()
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


@dataclass(frozen=True)
class CylinderModel:
    """What a method's scene is built with."""

    plates: Contact = quantity("slip", "1", "contact of both plates")
    modulus: Literal["slip", "bonded", "svk_slip", "neo_slip", "neo_bonded"] = quantity(
        "slip", "1", "modulus identified for"
    )
    law: LawName = quantity("linear", "1", "linear, or at large strain svk or neo_hooke")
    radial: int | None = quantity(None, "1", "elements from axis to rim; none: the mesh's")
    axial: int | None = quantity(None, "1", "elements along the axis; none: the mesh's")
    order: Literal[1, 2] = quantity(2, "1", "element order; 1 means nodal mean dilatation")


def window(strain: float) -> str:
    """The name of the window that ends at a strain."""
    return f"{100 * strain:g}pct"


def _limits(p: LoggedCylinder) -> tuple[float, float, float]:
    """Strains to which the three laws are shown."""
    return (p.limit_linear, p.limit_svk, p.limit_neo_hooke)


def load(parameters: LoggedCylinder, folder: Path) -> tuple[Recording, ...]:
    where = found(FOLDER, None, folder, parameters.data)
    files = sorted(where.glob(parameters.logs))
    if not files:
        raise RecordingError(f"no logs '{parameters.logs}' in {where}; pass --set logs=PATTERN")
    return tuple(read_instron(f) for f in files)


def build(recording: Recording, parameters: LoggedCylinder, model: CylinderModel) -> Scene:
    p = parameters
    E: float | None = getattr(p.material, f"E_{model.modulus}")
    if E is None:
        raise RecordingError(f"no modulus identified; set material.E_{model.modulus}")
    return model_scene(p, model, E)


def model_scene(p: LoggedCylinder, model: CylinderModel, E: float) -> Scene:
    """A quarter of the cylinder with its planes of symmetry, the upper plate driven down."""
    size = p.specimen.size
    mesh = quarter_cylinder(size.diameter, size.height, *grid_of(p, model), p.mesh.grading)
    supports = (*between(model.plates), *SYMMETRY)
    material = Material(E, p.material.nu, model.law)
    scene = Scene(mesh, material, supports, drives=(STAGE,), copies=4)
    return of_element(scene, "P2" if model.order == 2 else "MD")


def grid_of(p: LoggedCylinder, model: CylinderModel) -> tuple[int, int]:
    """Elements from axis to rim and along the axis: the method's own, else the mesh's."""
    return model.radial or p.mesh.radial, model.axial or p.mesh.axial


def place(recording: Recording, parameters: LoggedCylinder, scene: Scene) -> Registered:
    """To the law's limit, in windows that end where one of the laws does and the log reaches.

    Other specimens than the one that is judged calibrate, in windows of their own.
    """
    p = parameters
    limit: float = getattr(p, f"limit_{scene.material.law}")
    fit = fit_modulus(recording, p.specimen.size, (p.fit_from, p.fit_to))
    height = p.specimen.size.height
    d = recording.signal("displacement", "m").y
    reached = float(d.max() - fit.contact) / height - fit.toe
    strains = pairwise((p.fit_from, p.fit_to, *_limits(p)))
    shown = {window(b): (a, b) for a, b in strains if b <= min(limit, reached)}
    if p.judged in (None, specimen_of(recording)):
        return pressed_log(recording, fit, height, limit, shown, fit.noise, share=p.ranges.specimen)
    shown = {f"{label} of those that calibrate": span for label, span in shown.items()}
    return pressed_log(recording, fit, height, limit, shown, fit.noise, "calibrates")


def stiffening(p: LoggedCylinder, model: CylinderModel) -> float:
    """Apparent over true modulus of a method's meshed cylinder: E_app = F h / (A d) at E = 1 Pa.

    At small strain, where every law is the linear one.
    """
    scene = model_scene(p, replace(model, law="linear"), 1.0)
    force = responses(build_system(scene)).reactions[0, 0]
    return float(force * p.specimen.size.height / p.specimen.size.area)
