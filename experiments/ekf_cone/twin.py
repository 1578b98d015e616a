"""The twin of paper 003's Ecoflex cone on its testing machine (section 3.4).

A quarter of the cone in quadratic elements, neo-Hookean, both faces bonded to their plates, loaded
so slowly that every instant is static. The machine raises the force linearly; its crosshead shows
the compression plus its own compliance and the seating of the plate, while a camera follows the
plate (node_A) and the side (node_B to node_E).

Departures from the paper: nu 0.4995 for its 0.5, which only mixed cells have; a neo-Hookean
law for its St. Venant-Kirchhoff; a tracked plate, where the paper does not say what it measured.
Its 0.15 N compress this cone by a few hundredths of a millimetre at most: `force` is a setting.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.locate import Rows
from validate.fem.system import build
from validate.parameters import quantity
from validate.recording.types import Recording
from validate.scene.geometries.specification import Cone
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Drive, Scene, Support
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Stepper
from validate.twin.tracker import Camera, Origin, Points, Reading

_FIRST = 1e-4  # of the height: the compression that tells the stiffness at rest
# x, y of the markers on the side
_SIDES = {"node_B": (1, 0), "node_C": (0, 1), "node_D": (-1, 0), "node_E": (0, -1)}


@dataclass(frozen=True)
class ConeTwin:
    """Material, mesh, loading, machine and sensors of the cone's recording."""

    shear_modulus: float = quantity(22_081.0, "Pa", "of Ecoflex 00-30, paper 003")
    nu: float = quantity(0.4995, "1", "Poisson ratio, nearly incompressible silicone")
    rho: float = quantity(1060.0, "kg/m3", "density, paper 003")
    radial: int = quantity(7, "1", "quadratic elements from axis to side")
    axial: int = quantity(8, "1", "quadratic elements along the axis")
    grading: float = quantity(2.0, "1", "above 1: smaller cells towards side and plates")
    force: float = quantity(15.0, "N", "force at the end of the ramp")
    duration: float = quantity(15.0, "s", "of the ramp")
    rate: float = quantity(10.0, "Hz", "samples of machine and camera")
    loads: int = quantity(3, "1", "static solutions between which the ramp is interpolated")
    machine: float = quantity(2e5, "N/m", "stiffness of the machine's frame")
    toe: float = quantity(0.15e-3, "m", "crosshead travel while the plate seats")
    toe_force: float = quantity(0.5, "N", "force at which 63 % of the toe is gone")
    missing: float = quantity(0.03, "1", "share of samples in which a marker is not visible")
    seed: int = quantity(20220715, "1", "seed of every sensor's noise")
    sd_force: float = quantity(0.02, "N", "load cell noise")
    sd_stage: float = quantity(2e-6, "m", "crosshead jitter")
    sd_marker: float = quantity(0.02e-3, "m", "camera, per axis")

    @property
    def material(self) -> Material:
        """E = 2 mu (1 + nu)."""
        E = 2 * self.shear_modulus * (1 + self.nu)
        return Material(E, self.nu, "neo_hooke", self.rho)


@dataclass(frozen=True)
class LoadTable:
    """Static solutions: force (m,) N, compression (m,) m, displacements u (m, k, 3) m of k points.

    Row 0 is rest. Cubic splines over the force run through all of them.
    """

    force: Floats
    compression: Floats
    u: Floats

    def at(self, force: Floats) -> tuple[Floats, Floats]:
        """Compression (nt,) m and displacements (nt, k, 3) m under forces (nt,) N."""
        q, u = (CubicSpline(self.force, y)(force) for y in (self.compression, self.u))
        return np.asarray(q), np.asarray(u)


def record_cone(cone: Cone, settings: ConeTwin, progress: Callable[[str], None]) -> Recording:
    """The recording: "markers", "stage" m (crosshead), "load_cell" N; records beside the tracker's:
    "specimen" and "machine". Its displacements stand in a camera's frame.

    Raises `SceneError` where the cone has no static solution up to `force`.
    """
    progress("mesh")
    scene, markers = cone_scene(cone, settings), marker_places(cone)
    progress(f"solve {scene.mesh.nodes.size} unknowns at {settings.loads} loads")
    table = load_table(scene, np.array(list(markers.values())), settings.force, settings.loads)
    progress("measure")
    t = np.arange(round(settings.duration * settings.rate) + 1) / settings.rate
    force = settings.force * t / settings.duration
    compression, u = table.at(force)
    recording = Origin("ekf_cone", settings.seed, False, _declared(settings, scene.mesh)).record(
        Points(t, tuple(markers), np.array(list(markers.values())), u),
        fiducial_places(cone),
        Camera(settings.sd_marker, missing=settings.missing),
        {
            "stage": Reading(crosshead(settings, compression, force), "m", settings.sd_stage),
            "load_cell": Reading(force, "N", settings.sd_force),
        },
    )
    return replace(recording, metadata={**recording.metadata, **_records(cone, settings)})


def cone_scene(cone: Cone, settings: ConeTwin) -> Scene:
    """The twin's own mesh of the quarter between bonded plates, driven from its top."""
    own = replace(
        cone, cells=(settings.radial, settings.axial), grading=settings.grading, element="tet10"
    )
    declared = Scene(
        own,
        settings.material,
        (Support("bottom", (0, 1, 2)), Support("top", (0, 1))),
        drives=(Drive("stage", "top", (0.0, 0.0, -1.0)),),
    )
    return declared.resolved(own.resolved(Path()))


def marker_places(cone: Cone) -> dict[str, Floats]:
    """node_A at the top's centre, on the plate; others around the side at half height (3,) m."""
    r, z = (cone.bottom + cone.top) / 4, cone.height / 2
    sides = {name: np.array([r * x, r * y, z]) for name, (x, y) in _SIDES.items()}
    return {"node_A": np.array([0.0, 0.0, cone.height]), **sides}


def fiducial_places(cone: Cone) -> dict[str, Floats]:
    """Three marks at the foot of the cone, where it is held (3,) m; a fourth would make the set
    symmetric, and labels turned by a quarter would pass."""
    r = cone.bottom / 2
    return {
        f"base{i + 1}": np.array([r * x, r * y, 0.0])
        for i, (x, y) in enumerate(list(_SIDES.values())[:3])
    }


def load_table(scene: Scene, points: Floats, force: float, loads: int) -> LoadTable:
    """At least `loads` solutions up to a force N or just above, at equal steps of compression.

    `points` (k, 3) m of the whole cone; those outside the quarter are its mirror images. Raises
    `SceneError` naming the last force where no further solution is found.
    """
    if not (force > 0 and loads >= 3):
        raise SceneError(f"ramp to {force:g} N in {loads} loads: above 0 N, at least 3 loads")
    # Factorisations cost far more here than iterations do.
    stepper = StaticNewton(contraction=0.5, max_iterations=60).prepare(build(scene))
    step = _compression(stepper, force) / loads
    rows, signs = Rows.barycentric(scene.mesh, np.abs(points)), np.where(points < 0, -1.0, 1.0)
    state = stepper.rest()
    found = [(0.0, 0.0, np.zeros(points.shape))]
    while found[-1][0] < force:
        state = stepper.step(state, np.array([len(found) * step]))
        if state.failure:
            raise SceneError(f"cone beyond {found[-1][0]:.4g} N of {force:g} N: {state.failure[1]}")
        u = signs * rows.apply(stepper.field(state))
        found.append((state.numbers["stage.force"], len(found) * step, u))
    f, q, u_found = zip(*found, strict=True)
    return LoadTable(np.array(f), np.array(q), np.array(u_found))


def _compression(stepper: Stepper, force: float) -> float:
    """What `force` N would compress the body by, m, were it as stiff as at rest."""
    probe = _FIRST * float(np.ptp(stepper.scene.mesh.nodes[:, 2]))
    state = stepper.step(stepper.rest(), np.array([probe]))
    return probe * force / state.numbers["stage.force"]


def crosshead(settings: ConeTwin, compression: Floats, force: Floats) -> Floats:
    """What the machine shows (nt,) m: compression, its own compliance, and the plate's seating."""
    seating = settings.toe * (1 - np.exp(-force / settings.toe_force))
    return np.asarray(compression + force / settings.machine + seating)


def _declared(settings: ConeTwin, mesh: Mesh) -> Mapping[str, str]:
    material = settings.material
    return {
        "law": "compressible neo-Hookean",
        "element": f"P2 tetrahedra, {mesh.nodes.size} unknowns, a quarter",
        "plates": "bonded",
        "time": "static at every instant",
        "E_Pa": repr(material.E),
        "nu": repr(material.nu),
        "rho_kg_per_m3": repr(settings.rho),
    }


def _records(cone: Cone, settings: ConeTwin) -> dict[str, Mapping[str, str]]:
    s = settings
    return {
        "specimen": {
            "bottom_diameter_m": repr(cone.bottom),
            "top_diameter_m": repr(cone.top),
            "height_m": repr(cone.height),
        },
        "machine": {
            "control": f"force, linear from 0 to {s.force:g} N in {s.duration:g} s",
            "stiffness_N_per_m": repr(s.machine),
            "toe_m": repr(s.toe),
            "toe_force_N": repr(s.toe_force),
        },
    }
