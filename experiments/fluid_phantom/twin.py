"""The twin of paper 000's phantom: finer quadratic elements, exact volume, slipping plates.

Gosline, Salcudean, Yan (2004), section 4. The image plane is horizontal through the inclusion's
middle, image x is the phantom's z, image y (depth) its x. Departures from the paper: the inclusion
is off-centre, so that a mirrored image cannot pass; a pressure transducer sits in the cavity.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats
from validate.fem.system import build
from validate.parameters import quantity
from validate.recording.types import Contours, Frames, Recording, Signal, Source
from validate.register.outlines.sections import SurfaceSampler
from validate.scene.geometries.inclusion import Block, Capsule
from validate.scene.material import LawName, Material
from validate.scene.scene import Scene
from validate.solve.fluid.cavities import ExactPressure
from validate.solve.march import march
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton
from validate.solve.types import Scheme
from validate.twin.sensors import signal, streams
from validate.twin.ultrasound import Scanner, Target

from .sensors import OutlineSensor, Pen, StageProfile

FRAME = "phantom"  # x from the probe to the stage, y up, z lateral
_LAWS = {
    "linear": "linear elasticity, small strain",
    "svk": "St. Venant-Kirchhoff",
    "neo_hooke": "compressible neo-Hookean",
}
IMAGE_POSE = np.array(
    [[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0225], [1.0, 0.0, 0.0, 0.015], [0.0, 0.0, 0.0, 1.0]]
)
PROFILE = StageProfile((0.0, 0.003, 0.006, 0.009), speed=1e-3, hold=7.0, rate=10.0)
PEN_TURN, PEN_SHIFT = (62.0, -17.0, 128.0), (0.412, -0.236, -1.137)
SENSORS = ("layout", "stage", "load_cell", "pressure", "outline", "markers", "b_mode", "sweep")
SLICES: Floats = 1e-3 * np.arange(-17.0, 18.0, 2.0)  # m, image plane along its normal (section 4.4)
SCANNER = Scanner(width=320, height=496, m_per_px=1.25e-4)


@dataclass(frozen=True)
class PhantomTwin:
    """What `validate record` makes: mesh, true inclusion, seed and the noise of every sensor."""

    nodes_x: int = quantity(13, "1", "nodes along x of the twin's quadratic mesh (by vertices)")
    nodes_y: int = quantity(15, "1", "nodes along y")
    nodes_z: int = quantity(23, "1", "nodes along z")
    centre_x: float = quantity(0.0284, "m", "true centre of the inclusion")
    centre_y: float = quantity(0.0225, "m", "true centre of the inclusion")
    centre_z: float = quantity(0.0356, "m", "true centre of the inclusion")
    radius: float = quantity(0.0085, "m", "true radius")
    length: float = quantity(0.028, "m", "true length")
    frames: bool = quantity(False, "1", "record B-mode images too")
    law: LawName = quantity("linear", "1", "law of the material")
    seed: int = quantity(20040327, "1", "seed of every sensor's noise")
    sd_outline: float = quantity(0.15e-3, "m", "noise of the outline along its normal")
    sd_tip: float = quantity(0.2e-3, "m", "pen tip, per axis")
    sd_hand: float = quantity(0.577e-3, "m", "manual placement, per axis (1 mm rms)")
    sd_force: float = quantity(0.02, "N", "load cell noise")
    sd_pressure: float = quantity(10.0, "Pa", "pressure transducer noise")
    sd_stage: float = quantity(2e-6, "m", "stage encoder noise")


def record_phantom(
    twin: PhantomTwin, declared: Scene, progress: Callable[[str], None]
) -> Recording:
    """The twin's recording: seeded, the same on every machine to 1e-9.

    Of the models' `declared` scene it has the block, material, supports and drive, with the twin's
    law and inclusion; its plates slip, and no membrane covers the wall.
    """
    size, material = declared.body.block, replace(declared.material, law=twin.law)
    capsule = Capsule((twin.centre_x, twin.centre_y, twin.centre_z), twin.radius, twin.length)
    progress("mesh")
    grid = (twin.nodes_x, twin.nodes_y, twin.nodes_z)
    mesh = size.around(grid, capsule).quadratic()
    slipping = replace(declared, material=material, foundations=(), membranes=())
    scene = replace(slipping, dilatation="pointwise").resolved(mesh)
    progress(f"factorise {mesh.nodes.size} unknowns")
    stepper = _scheme(material).prepare(build(scene))
    t, stage, middles = PROFILE.positions()
    at = np.searchsorted(t, middles)
    run = march("twin", stepper, t, stage[:, None], at, 0.0)
    progress("measure")
    rng = streams(twin.seed, SENSORS)
    layout = marker_layout(size, rng["layout"])
    pen = Pen(twin.sd_tip, twin.sd_hand, PEN_TURN, PEN_SHIFT)
    outline = OutlineSensor(IMAGE_POSE, points=72, sd=twin.sd_outline, frame=FRAME)
    wall = SurfaceSampler.of_cavity(mesh, "cavity", capsule)
    position, slices = _sweep(twin, run.u[:1], wall, rng["sweep"])
    force, pressure = (run.traces[n].y for n in ("stage.force", "inclusion.pressure"))
    return Recording(
        "fluid_phantom",
        Source("fluid_phantom", "", 0, "made in memory"),
        1_080_345_600_000_000_000,
        markers={"markers": pen.measure(middles, run.u, mesh, layout, rng["markers"])},
        signals={
            "stage": signal(t, stage, "m", twin.sd_stage, FRAME, rng["stage"]),
            "load_cell": signal(t, force, "N", twin.sd_force, FRAME, rng["load_cell"]),
            "pressure": signal(t, pressure, "Pa", twin.sd_pressure, FRAME, rng["pressure"]),
            "sweep_position": position,
        },
        frames={"b_mode": _b_mode(middles, run.u, wall, size, rng["b_mode"])}
        if twin.frames
        else {},
        contours={
            "outline": outline.measure(middles, run.u, wall, rng["outline"]),
            "sweep": slices,
        },
        metadata={
            "inclusion": _declared(capsule),
            "marker_layout": {k: " ".join(repr(float(c)) for c in v) for k, v in layout.items()},
            "pen": {"up": " ".join(repr(float(c)) for c in pen.direction((0.0, 1.0, 0.0)))},
            "provenance": _provenance(twin, material, mesh.nodes.size),
        },
    )


def _sweep(
    twin: PhantomTwin, rest: Floats, wall: SurfaceSampler, rng: np.random.Generator
) -> tuple[Signal, Contours]:
    """Position of the image plane and the outlines where it meets the inclusion, in field `rest`
    (1, n, d) m.

    Taken while the stage rests before the first load, an image each .3 s.
    """
    t = np.round(0.5 + 0.3 * np.arange(len(SLICES)), 6)
    height = (wall.rest - IMAGE_POSE[:3, 3]) @ IMAGE_POSE[:3, 2]
    met = (height - SLICES[:, None]).min(axis=1) * (height - SLICES[:, None]).max(axis=1) < 0
    outlines: list[Floats] = []
    for s in SLICES[met]:
        pose = IMAGE_POSE.copy()
        pose[:3, 3] += s * pose[:3, 2]
        sensor = OutlineSensor(pose, points=72, sd=twin.sd_outline, frame=FRAME)
        outlines += sensor.measure(t[:1], rest, wall, rng).outlines
    position = signal(t, SLICES, "m", twin.sd_stage, FRAME, rng)
    return position, Contours(t[met], tuple(outlines), twin.sd_outline, IMAGE_POSE, FRAME)


def _b_mode(
    t: Floats, u: Floats, wall: SurfaceSampler, size: Block, rng: np.random.Generator
) -> Frames:
    """An image per field of u (nt, n, d) m: fluid 30 dB below speckle, edge shadows, the plate."""
    images = []
    for load, ui in zip(PROFILE.loads, u, strict=True):
        outline = wall.section(ui, IMAGE_POSE)
        target = Target(outline, shadow=4.0, enhancement=3.0, texture=1.0, plate=size.size_x - load)
        images.append(SCANNER.b_mode(target, rng))
    pixel = SCANNER.m_per_px
    return Frames(t, tuple(images), (pixel, pixel), IMAGE_POSE, FRAME)


def _scheme(material: Material) -> Scheme:
    """Large strain is solved at every 3 mm and interpolated between (to 0.1 um, 0.01 Pa)."""
    return ExactPressure() if material.law == "linear" else Tabulated(StaticNewton(), 0.003)


def marker_layout(size: Block, rng: np.random.Generator) -> dict[str, Floats]:
    """42 markers drawn by hand on the top face: 7 x 6, each 0.8 mm off the regular grid."""
    x, z = np.linspace(0.006, size.size_x - 0.006, 7), np.linspace(0.008, size.size_z - 0.008, 6)
    places = np.array([(a, size.size_y, b) for a in x for b in z])
    places[:, [0, 2]] += 0.8e-3 * rng.standard_normal((len(places), 2))
    return {f"m{i + 1:02d}": place for i, place in enumerate(np.round(places, 5))}


def _declared(capsule: Capsule) -> dict[str, str]:
    x, y, z = capsule.centre
    return {
        "centre_x_m": repr(x),
        "centre_y_m": repr(y),
        "centre_z_m": repr(z),
        "radius_m": repr(capsule.radius),
        "length_m": repr(capsule.length),
        "sd_centre_m": "0.0002",
        "source": "parallel images at 2 mm steps, hand segmented (declared)",
    }


def _provenance(twin: PhantomTwin, material: Material, unknowns: int) -> dict[str, str]:
    return {
        "kind": "twin",
        "law": _LAWS[material.law],
        "element": f"P2 tetrahedra, {unknowns} unknowns",
        "plates": "slip",
        "fluid": "constant volume, exact",
        "E_Pa": repr(material.E),
        "nu": repr(material.nu),
        "seed": str(twin.seed),
    }
