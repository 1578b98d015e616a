"""Body between two plates or grips: its settings, contact, sizes, and the modulus of a model.

    Scene(
        body=Cylinder("25 mm", "20 mm", element="tet10", part="quarter"),
        material=Material(None, 0.499),                  # identified
        supports=(Support("lower_plate", (2,)),),        # a whole body: rests=True
        drives=(Drive("stage", "upper_plate", "-z"),),   # pulled: "+z"
    )

Such plates slip; `BONDED_PLATES` are what a method changes where they hold the body.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from math import hypot
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from validate.errors import ComparisonError, UsageError
from validate.identify.modulus import CylinderSize, ModulusFit, TestKind, loading, stated_test
from validate.parameters import Ranges, known, quantity
from validate.pipeline.bodies.mesh import DIAMETER, HEIGHT, PLATES, sizes_of_mesh
from validate.pipeline.calibration.fitted_moduli import modulus_in
from validate.pipeline.experiment.tree import Built, Meshes, Tree, changed_by, mesh_of
from validate.pipeline.plates.outline import PressedOutline
from validate.recording.readers import read_recording
from validate.recording.tables.specimens import loaded_area
from validate.recording.types import Recording
from validate.register.clocks import clock_sd
from validate.register.observation import Role
from validate.register.registration import Registered
from validate.register.signals import SignalObservation, windows_of
from validate.scene.geometries.specification import Cylinder, MeshFile
from validate.scene.scene import Scene, Support

# --- A log of a testing machine in the scene: displacement from contact, force from its zero.


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


# -------------------------------------------------------------------------------------------------

Ends = Literal["slip", "bonded"]

LOWER, UPPER = PLATES


def between(ends: Ends, tree: Tree) -> Mapping[str, Any]:
    """Return a method's changes for plates that slip or stick."""
    if ends == "bonded":
        return BONDED_PLATES
    whole = not getattr(tree.scene.body, "held", ())
    return {"supports": (Support(LOWER, (2,), rests=whole),)}


def ends_of(scene: Scene) -> Ends:
    """Return whether the moving plate holds the body sideways."""
    return "bonded" if any(s.facets == UPPER for s in scene.supports) else "slip"


def kind_of_test(tree: Tree) -> TestKind:
    """Return whether the upper plate presses or pulls; raises `UsageError` for another motion."""
    moved = {(d.name, d.facets, tuple(d.direction)) for d in tree.scene.drives}
    for kind, sign in (("compression", -1.0), ("tension", 1.0)):
        if moved == {("stage", UPPER, (0.0, 0.0, sign))}:
            return kind  # type: ignore[return-value]
    raise UsageError(
        f'drives: {len(moved)} that no test between plates has; declare Drive("stage", '
        f'"{UPPER}", "-z"), in tension "+z"'
    )


def pressed_size(tree: Tree, folder: Path) -> CylinderSize:
    """Height and diameter m of the cylinder, or those of equal area of a mesh file.

    Raises `UsageError` while a size is not set, and what `sizes_of_mesh` does.
    """
    body = tree.scene.body
    if isinstance(body, Cylinder):
        return CylinderSize(known(body.diameter, DIAMETER), known(body.height, HEIGHT))
    if isinstance(body, MeshFile):
        tree = tree.with_scene(body=replace(body, halvings=0, element="linear"))
    sizes = sizes_of_mesh(mesh_of(None, tree, folder), getattr(body, "file", "body"))
    return CylinderSize(sizes[DIAMETER], sizes[HEIGHT])


def model_name(law: str, ends: str, order: int) -> str:
    """Return the name of a model in parameters."""
    return f"{law}, {ends}, order {order}"


def by_model(scene: Scene) -> str:
    """Return the name of the model that a scene was built with."""
    return model_name(scene.material.law, ends_of(scene), scene.mesh.order)


@dataclass(frozen=True)
class BuiltPressed(Built):
    """As `Built`; the modulus is the method's own, else that which the run identified its model
    with, else the declared one; 1 Pa while none is known, when only memory is asked for."""

    def __call__(
        self, recording: Recording | None, tree: Tree, changes: Mapping[str, Any] | None = None
    ) -> Scene:
        own = dict(changes or {})
        if "material.E" not in own:
            tree = changed_by(tree, own)
            p, scene = tree.settings, tree.scene
            held: float | None = p.E_bonded if ends_of(scene) == "bonded" else None
            identified = modulus_in(p.by_method, self.model(tree))
            own["material.E"] = float(identified or held or scene.material.E or 1.0)
        return super().__call__(recording, tree, own)

    def model(self, tree: Tree) -> str:
        """Return the name of the model with these parameters, a method's changes among them."""
        order = mesh_of(None, tree, self.folder).order
        return model_name(tree.scene.material.law, ends_of(tree.scene), order)


# --- settings of a body between plates or grips: uncertainties, strain windows, images -----------

#: What a method changes of a declared scene where both plates, or grips, hold the body.
BONDED_PLATES: Mapping[str, Any] = MappingProxyType(
    {"supports": (Support(PLATES[0]), Support(PLATES[1], (0, 1)))}
)


def stated_sizes(recording: Recording) -> dict[str, float]:
    """What a recording's record `specimen` says of a cylinder, m, by path.

    Another cross-section has the diameter of the circle of its area.
    """
    found = _record(recording)
    area, sizes = loaded_area(found, stated_test(recording)), {}
    if "diameter_m" in found:
        sizes[DIAMETER] = found["diameter_m"]
    elif area is not None:
        sizes[DIAMETER] = 2 * math.sqrt(area / math.pi)
    if "height_m" in found:
        sizes[HEIGHT] = found["height_m"]
    return sizes


def recorded_sides(recording: Recording) -> dict[str, float]:
    """Return the sides m in a recording's record `specimen` by name: diameter, width, thickness,
    height."""
    names = ("diameter", "width", "thickness", "height")
    found = _record(recording)
    return {name: found[f"{name}_m"] for name in names if f"{name}_m" in found}


def _record(recording: Recording) -> dict[str, float]:
    """The numbers above zero of the record `specimen`."""
    numbers = {}
    for key, text in recording.metadata.get("specimen", {}).items():
        with suppress(ValueError):
            numbers[key] = float(text)
    return {k: v for k, v in numbers.items() if math.isfinite(v) and v > 0}


@dataclass(frozen=True)
class CompressionRanges(Ranges):
    E: float = quantity(0.05, "1", "relative, of a given modulus")
    diameter: float = quantity(0.005, "1", "relative, of the diameter")
    height: float = quantity(0.005, "1", "relative, of the height; of outlines or an identified E")
    nu: float = quantity(0.01, "1", "of the Poisson ratio; of outlines or an identified E")
    friction: float = quantity(
        0.05, "1", "of an identified E: share of the way from slipping to bonded ends, or back"
    )
    load: float = quantity(0.005, "1", "relative, of the load cell's scale; of an identified E")


@dataclass(frozen=True)
class Compression:
    """A test between plates or grips, besides its scene (`pipeline.plates.scene`)."""

    ranges: CompressionRanges = CompressionRanges()
    outline: PressedOutline = PressedOutline()
    fit_from: float = quantity(0.005, "1", "strain from which the modulus is fitted")
    fit_to: float = quantity(0.05, "1", "strain to which the modulus is fitted")
    limit: float = quantity(0.10, "1", "largest strain compared; linear laws hold to about 0.1")
    mesh: Meshes = Meshes()
    E_bonded: float | None = quantity(
        None, "Pa", "of models with bonded plates; none: material.E, or identified with them"
    )
    by_method: tuple[tuple[str, float, float], ...] = quantity(
        (), "1", "set by the run: modulus (Pa) and start of the load (m) of each model"
    )


# --- machine compliance: correction of the displacement, measured on a rigid block ---------------

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
