"""What the scene of the skin does not hold: open moduli, the reading of the files, the windows."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from validate.datasets.home import data_path
from validate.errors import UsageError
from validate.parameters import Ranges, quantity
from validate.pipeline.experiment.tree import Built, Tree
from validate.recording.types import Recording
from validate.scene.laws import Coefficients
from validate.scene.scene import Scene

from .files import FORCE, Follow, read_folder

FOLDER = "force/skin-pads"
PADS = ("moving", "fixed")
_BUILT = Built(Path(__file__).parent)


def _stiffness(law: str) -> float | None:
    value: float | None = quantity(
        None, f"{FORCE}/m", f"modulus times thickness, {law}; none: identified"
    )
    return value


@dataclass(frozen=True)
class SkinModuli:
    """The thickness is not known: every modulus is one times that, in a unit nobody stated. Each
    method has its own."""

    E_linear: float | None = _stiffness("linear")
    E_svk: float | None = _stiffness("St. Venant-Kirchhoff")
    E_neo: float | None = _stiffness("neo-Hooke")
    E_yeoh: float | None = _stiffness("Yeoh")
    E_ogden: float | None = _stiffness("Ogden")
    E_held: float | None = _stiffness("neo-Hooke, far boundary held")
    C30_over_mu: float = quantity(5.0, "1", "Yeoh: of (I1 - 3)^3 over the shear modulus, assumed")


@dataclass(frozen=True)
class PadMarks:
    follow: Follow = quantity(
        "marks", "1", "what a pad moves with: its marks, or the points at the field's edge"
    )
    window: float | None = quantity(
        None, "m", "between the outermost marks of a pad at rest; none: 24 mm for two marks"
    )

    def __post_init__(self) -> None:
        if self.window is not None and not self.window > 0:
            raise UsageError(
                f"pads.window = {1e3 * self.window:g} mm: must be above 0 mm; give the distance "
                "between the outermost marks of a pad"
            )


@dataclass(frozen=True)
class PullSigns:
    displacement: float = quantity(1.0, "1", "1 or -1: makes separation of the pads positive")
    force: float = quantity(1.0, "1", "1 or -1: makes separation of the pads positive")

    def __post_init__(self) -> None:
        if not {self.displacement, self.force} <= {1.0, -1.0}:
            raise UsageError(f"signs {self.displacement:g} and {self.force:g}: each 1 or -1")


@dataclass(frozen=True)
class SkinRanges(Ranges):
    nu: float = quantity(0.1, "1", "of the Poisson ratio")
    pads: float = quantity(0.5e-3, "m", "of length and width of the pads")
    gap: float = quantity(1e-3, "m", "of the distance between them, which was not measured")


@dataclass(frozen=True)
class PulledSkin:
    material: SkinModuli = SkinModuli()
    pads: PadMarks = PadMarks()
    signs: PullSigns = PullSigns()
    ranges: SkinRanges = SkinRanges()
    bin: float = quantity(0.3e-3, "m", "of displacement, over which force is averaged")
    fit_to: float = quantity(4e-3, "m", "pad displacement to which force calibrates")
    predict_to: float = quantity(8.4e-3, "m", "pad displacement to which force is predicted")
    limit_svk: float = quantity(
        7.5e-3, "m", "the same for St. Venant-Kirchhoff, which ends where corners are compressed"
    )
    field: tuple[float, ...] = quantity(
        (1e-3, 2e-3, 3e-3, 3.8e-3), "m", "pad displacements at which points are compared"
    )
    data: str | None = quantity(None, "1", "folder of the files; none: VALIDATE_SHARED_DATA")


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    own: PulledSkin = tree.settings
    where = data_path(FOLDER, None, folder, own.data)
    signs = own.signs.displacement, own.signs.force
    return (read_folder(where, signs, own.pads.follow, own.pads.window),)


def stated(recording: Recording) -> dict[str, float]:
    """Lengths m that the recording's Gmsh script has."""
    return {path: float(text) for path, text in recording.record("geometry").items()}


def build(recording: Recording, tree: Tree, changes: Mapping[str, Any] | None) -> Scene:
    """The declared scene; Yeoh's coefficient is in proportion to the modulus."""
    scene = _BUILT(recording, tree, changes)
    if scene.material.law != "yeoh":
        return scene
    C30 = tree.settings.material.C30_over_mu * scene.material.shear_modulus
    coefficients = Coefficients(C30=C30, stretches=(0.5, 2.0))
    return replace(scene, material=replace(scene.material, coefficients=coefficients))
