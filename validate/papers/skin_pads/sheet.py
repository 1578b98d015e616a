"""The sheet of skin: parameters, mesh and scene. Its middle is the origin, x from pad to pad."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.datasets.home import found
from validate.errors import UsageError
from validate.papers.skin_pads.files import FORCE, Follow, read_folder
from validate.parameters import Ranges, known, quantity
from validate.recording.types import Recording
from validate.scene.box import box
from validate.scene.laws import Coefficients
from validate.scene.material import LawName, Material
from validate.scene.mesh import Mesh, quadratic
from validate.scene.scene import Drive, Scene, Support
from validate.scene.select import Chosen, InBox

FOLDER = "force/skin-pads"
_GROWTH = 2.0  # logarithm of how much larger cells at the far boundary are than at the pads
_TOUCH = 1e-7  # m
PADS = ("moving", "fixed")


def _stiffness(law: str) -> float | None:
    value: float | None = quantity(
        None, f"{FORCE}/m", f"modulus times thickness, {law}; none: identified"
    )
    return value


@dataclass(frozen=True)
class Skin:
    """The thickness is not known: every modulus is one times that, in a unit nobody stated."""

    E_linear: float | None = _stiffness("linear")
    E_svk: float | None = _stiffness("St. Venant-Kirchhoff")
    E_neo: float | None = _stiffness("neo-Hooke")
    E_yeoh: float | None = _stiffness("Yeoh")
    E_ogden: float | None = _stiffness("Ogden")
    E_held: float | None = _stiffness("neo-Hooke, far boundary held")
    nu: float = quantity(0.45, "1", "Poisson ratio, assumed")
    C30: float = quantity(5.0, "1", "Yeoh: of (I1 - 3)^3 over the shear modulus, assumed")
    alpha: float = quantity(8.0, "1", "Ogden: power of the one term, assumed")


@dataclass(frozen=True)
class Pads:
    length: float | None = quantity(None, "m", "of a pad along the pull", asked=True)
    width: float | None = quantity(None, "m", "of a pad across it", asked=True)
    gap: float | None = quantity(None, "m", "between the pads at rest", asked=True)
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
class Sheet:
    length: float | None = quantity(None, "m", "of what is simulated, along the pull", asked=True)
    width: float | None = quantity(None, "m", "of what is simulated, across it", asked=True)


@dataclass(frozen=True)
class SheetMesh:
    cells: int = quantity(2, "1", "across half of a pad's width")


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
    material: Skin = Skin()
    pads: Pads = Pads()
    sheet: Sheet = Sheet()
    mesh: SheetMesh = SheetMesh()
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


@dataclass(frozen=True)
class SheetModel:
    """What a method's scene is built with."""

    law: LawName = quantity("neo_hooke", "1", "law of the skin")
    stiffness: Literal["linear", "svk", "neo", "yeoh", "ogden", "held"] = quantity(
        "neo", "1", "which of the identified moduli"
    )
    far: Literal["free", "held"] = quantity("free", "1", "boundary of what is simulated")


def load(parameters: PulledSkin, folder: Path) -> tuple[Recording, ...]:
    where = found(FOLDER, None, folder, parameters.data)
    signs, pads = parameters.signs, parameters.pads
    return (read_folder(where, (signs.displacement, signs.force), pads.follow, pads.window),)


def stated(recording: Recording) -> dict[str, float]:
    """Lengths m that the recording's Gmsh script has."""
    return {path: float(text) for path, text in recording.record("geometry").items()}


def build(recording: Recording, parameters: PulledSkin, model: SheetModel) -> Scene:
    """A sheet in plane stress; both pads are driven apart and let nothing turn."""
    p = parameters
    mesh, boxes = sheet_mesh(p), pad_boxes(p)
    far = [Support(side, (0, 1)) for side in ("x0", "x1", "y0", "y1")]
    return Scene(
        mesh,
        material_of(p, model),
        (*(far if model.far == "held" else []), *(Support(box, (1,)) for box in boxes)),
        drives=tuple(
            Drive(name, box, (sign, 0.0))
            for name, box, sign in zip(PADS, boxes, (-1.0, 1.0), strict=True)
        ),
        plane="stress",
        force_unit=FORCE,
    )


def material_of(p: PulledSkin, model: SheetModel) -> Material:
    """The skin per metre of thickness; coefficients are in proportion to the modulus."""
    E = known(getattr(p.material, f"E_{model.stiffness}"), f"material.E_{model.stiffness}")
    mu = E / (2 * (1 + p.material.nu))
    coefficients = {
        "yeoh": Coefficients(C30=p.material.C30 * mu, stretches=(0.5, 2.0)),
        "ogden": Coefficients(ogden_alpha=(p.material.alpha,), stretches=(0.5, 2.0)),
    }
    return Material(
        E, p.material.nu, model.law, coefficients=coefficients.get(model.law, Coefficients())
    )


def pad_boxes(p: PulledSkin) -> tuple[Chosen, Chosen]:
    """The points under the moving pad, to the left, and under the fixed one."""
    low, high, half = _pad_lines(p)
    return (
        InBox((-high - _TOUCH, -half - _TOUCH), (-low + _TOUCH, half + _TOUCH)).points,
        InBox((low - _TOUCH, -half - _TOUCH), (high + _TOUCH, half + _TOUCH)).points,
    )


def _pad_lines(p: PulledSkin) -> tuple[float, float, float]:
    """Where a pad begins and ends along the pull, and its half width, m from the middle."""
    low = known(p.pads.gap, "pads.gap") / 2
    return low, low + known(p.pads.length, "pads.length"), known(p.pads.width, "pads.width") / 2


def sheet_mesh(p: PulledSkin) -> Mesh:
    """Quadratic triangles with the edges of the pads among their lines, larger outside.

    Raises `UsageError` for a sheet that ends within its pads.
    """
    low, high, half = _pad_lines(p)
    ends = known(p.sheet.length, "sheet.length") / 2, known(p.sheet.width, "sheet.width") / 2
    if ends[0] <= high or ends[1] <= half or min(low, half) <= 0:
        raise UsageError(
            f"a sheet of {2e3 * ends[0]:g} x {2e3 * ends[1]:g} mm with pads that end "
            f"{1e3 * high:g} mm from its middle and are {2e3 * half:g} mm wide: it must reach "
            "beyond them"
        )
    x = _mirrored(_even(0.0, low, p), _even(low, high, p), _growing(high, ends[0], p))
    y = _mirrored(_even(0.0, half, p), _growing(half, ends[1], p))
    flat = box((1.0, 1.0), (len(x) - 1, len(y) - 1))
    column, row = (
        np.rint(flat.nodes[:, c] * (len(a) - 1)).astype(int) for c, a in enumerate((x, y))
    )
    nodes = np.stack([x[column], y[row]], axis=1)
    return quadratic(Mesh(nodes, flat.cells, "tri3", flat.facets))


def _count(length: float, p: PulledSkin) -> int:
    """Cells in a length m, in proportion to those of half a pad: every mesh is a part of a finer
    one."""
    return p.mesh.cells * max(1, round(length / _pad_lines(p)[2]))


def _even(a: float, b: float, p: PulledSkin) -> Floats:
    return np.linspace(a, b, _count(b - a, p) + 1)


def _growing(a: float, b: float, p: PulledSkin) -> Floats:
    """From a to b m in cells that begin as large as those inside."""
    s = np.linspace(0.0, 1.0, _count((b - a) * _GROWTH / np.expm1(_GROWTH), p) + 1)
    return np.asarray(a + (b - a) * np.expm1(_GROWTH * s) / np.expm1(_GROWTH))


def _mirrored(*parts: Floats) -> Floats:
    """Lines from the middle outwards, and their mirror images."""
    half = np.unique(np.concatenate(parts))
    return np.concatenate([-half[:0:-1], half])
