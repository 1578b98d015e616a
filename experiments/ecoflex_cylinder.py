"""Ecoflex 00-30 cylinders compressed on an Instron: real logs made by others.

Five logs of one specimen, 50 mm x 30 mm, 10 mm/min, from the public data set
abubakardawood/tissue-phantom-material-database (Dawood et al. 2026, CC BY 4.0). Whether the plates
slipped was not recorded, so linear FEM brackets it: slipping plates take the apparent modulus as
the material's, bonded ones divide it by the stiffening that the same mesh shows.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from validate.arrays import rms
from validate.compare.published import Published
from validate.compare.score import Score
from validate.compare.verdict import Accept
from validate.errors import RecordingError
from validate.fem.system import build as build_system
from validate.fem.system import responses
from validate.identify.law import LawFit, fit_scale
from validate.identify.modulus import (
    Cylinder,
    ModulusSummary,
    apparent_to_material,
    cylinder_of,
    fit_modulus,
    gent_correction,
    identify_modulus,
)
from validate.parameters import quantity, require_ranges
from validate.recording.exports.instron import read_instron
from validate.recording.types import Recording
from validate.register.registered import Registered
from validate.register.signals import SignalObservation, windows_of
from validate.replay.experiment import Experiment, Identified, Input, Uncertainty
from validate.replay.method import Method
from validate.scene.cylinder import quarter_cylinder
from validate.scene.mesh import quadratic
from validate.scene.plates import Contact
from validate.scene.scene import Drive, LawName, Material, Scene, Support
from validate.solve.fluid import NoFluid
from validate.solve.newton import StaticNewton
from validate.solve.tabulated import Tabulated

DATA_SET = "abubakardawood/tissue-phantom-material-database (CC BY 4.0)"
FOLDER = "force/ecoflex-compression"


@dataclass(frozen=True)
class MaterialCard:
    E_slip: float | None = quantity(None, "Pa", "modulus if plates slip; none: identified")
    E_bonded: float | None = quantity(None, "Pa", "modulus if plates hold; none: identified")
    E_svk_slip: float | None = quantity(None, "Pa", "St. Venant-Kirchhoff, slipping plates")
    E_neo_slip: float | None = quantity(None, "Pa", "neo-Hooke, slipping plates")
    E_neo_bonded: float | None = quantity(None, "Pa", "neo-Hooke, bonded plates")
    nu: float = quantity(0.4995, "1", "Poisson ratio, nearly incompressible silicone")


@dataclass(frozen=True)
class Specimen:
    diameter: float | None = quantity(None, "m", "diameter; none: from the logs' header")
    height: float | None = quantity(None, "m", "height; none: from the logs' header")


@dataclass(frozen=True)
class Grid:
    radial: int = quantity(6, "1", "quadratic elements from axis to rim")
    axial: int = quantity(8, "1", "quadratic elements along the axis")
    grading: float = quantity(2.0, "1", "above 1: smaller cells towards rim and plates")
    finer_radial: int = quantity(8, "1", "the second mesh, for u_num")
    finer_axial: int = quantity(10, "1", "the second mesh, for u_num")


@dataclass(frozen=True)
class Ranges:
    """Standard uncertainties of the inputs, declared before the comparison."""

    specimen: float = quantity(0.043, "1", "relative scatter of E between specimens (4.5 of 104)")
    nu: float = quantity(0.0004, "1", "of the Poisson ratio")

    def __post_init__(self) -> None:
        require_ranges(self)


@dataclass(frozen=True)
class Parameters:
    material: MaterialCard = MaterialCard()
    specimen: Specimen = Specimen()
    mesh: Grid = Grid()
    ranges: Ranges = Ranges()
    fit_from: float = quantity(0.005, "1", "strain from which the modulus is fitted")
    fit_to: float = quantity(0.05, "1", "strain to which the modulus is fitted")
    limit_linear: float = quantity(0.10, "1", "strain to which the linear law is shown")
    limit_svk: float = quantity(0.25, "1", "strain to which St. Venant-Kirchhoff is shown")
    limit_neo_hooke: float = quantity(0.50, "1", "strain to which neo-Hooke is shown")
    data: str | None = quantity(None, "1", "folder of the logs; none: VALIDATE_SHARED_DATA")
    logs: str = quantity("EF30_0T_A*.csv", "1", "file name pattern of the logs")


@dataclass(frozen=True)
class Model:
    """What a method's scene is built with."""

    plates: Contact = quantity("slip", "1", "contact of both plates")
    modulus: Literal["slip", "bonded", "svk_slip", "neo_slip", "neo_bonded"] = quantity(
        "slip", "1", "modulus identified for"
    )
    law: LawName = quantity("linear", "1", "linear, or at large strain svk or neo_hooke")
    radial: int | None = quantity(None, "1", "elements from axis to rim; none: the mesh's")
    axial: int | None = quantity(None, "1", "elements along the axis; none: the mesh's")
    order: Literal[1, 2] = quantity(2, "1", "element order; 1 means nodal mean dilatation")


TABLE = Tabulated(StaticNewton("none"), 0.0015)
METHODS: Mapping[str, Method] = {
    "slip": Method("linear, slipping plates", NoFluid(), Model()),
    "bonded": Method("linear, bonded plates", NoFluid(), Model("bonded", "bonded")),
    "bonded_upper": Method(
        "linear, bonded plates, modulus of slipping ones", NoFluid(), Model("bonded", "slip")
    ),
    "slip_lower": Method(
        "linear, slipping plates, modulus of bonded ones", NoFluid(), Model("slip", "bonded")
    ),
    # Slipping plates leave the deformation homogeneous: two elements are exact.
    "svk_slip": Method("SVK, slipping plates", TABLE, Model("slip", "svk_slip", "svk", 2, 2)),
    "neo_slip": Method(
        "neo-Hooke, slipping plates", TABLE, Model("slip", "neo_slip", "neo_hooke", 2, 2)
    ),
    "neo_bonded": Method(
        "neo-Hooke, bonded plates", TABLE, Model("bonded", "neo_bonded", "neo_hooke", 5, 6, 1)
    ),
    "svk_bonded": Method("SVK, bonded plates", TABLE, Model("bonded", "bonded", "svk", 5, 6, 1)),
}


WINDOWS = ("5pct", "10pct", "25pct", "50pct")


def _limits(p: Parameters) -> tuple[float, float, float]:
    """Strains to which the three laws are shown."""
    return (p.limit_linear, p.limit_svk, p.limit_neo_hooke)


def load(parameters: Parameters, folder: Path) -> tuple[Recording, ...]:
    where = _data_folder(parameters, folder)
    files = sorted(where.glob(parameters.logs))
    if not files:
        raise RecordingError(
            f"no logs {parameters.logs} in {where}: get {DATA_SET} and pass --set data=FOLDER or "
            "set VALIDATE_SHARED_DATA to the folder above force/"
        )
    return tuple(read_instron(f) for f in files)


def _data_folder(parameters: Parameters, folder: Path) -> Path:
    if parameters.data:
        return Path(parameters.data)
    shared = os.environ.get("VALIDATE_SHARED_DATA")
    return (Path(shared) if shared else folder.parents[1] / "shared" / "data") / FOLDER


def build(recording: Recording, parameters: Parameters, model: Model) -> Scene:
    p = parameters
    E: float | None = getattr(p.material, f"E_{model.modulus}")
    if E is None:
        raise RecordingError(f"no modulus identified; set material.E_{model.modulus}")
    return _model_scene(_size(recording, p), p, model, E)


def _model_scene(size: tuple[float, float], p: Parameters, model: Model, E: float) -> Scene:
    grid = replace(p.mesh, radial=model.radial or p.mesh.radial, axial=model.axial or p.mesh.axial)
    material = Material(E, p.material.nu, model.law)
    scene = cylinder_scene(*size, grid, material, model.plates)
    if model.order == 2:
        return scene
    linear = quarter_cylinder(*size, grid.radial, grid.axial, grid.grading)
    return replace(scene, mesh=linear, dilatation="nodal_mean")


def cylinder_scene(
    diameter: float, height: float, grid: Grid, material: Material, contact: Contact
) -> Scene:
    """A quarter of the cylinder with its two planes of symmetry, the upper plate driven down."""
    mesh = quadratic(quarter_cylinder(diameter, height, grid.radial, grid.axial, grid.grading))
    held = (2,) if contact == "slip" else (0, 1, 2)
    supports = [
        Support("lower_plate", held),
        Support("symmetry_x", (0,)),
        Support("symmetry_y", (1,)),
    ]
    if contact == "bonded":
        supports.append(Support("upper_plate", (0, 1)))
    drive = Drive("stage", "upper_plate", (0.0, 0.0, -1.0))
    return Scene(mesh, material, tuple(supports), drives=(drive,), copies=4)


def place(recording: Recording, parameters: Parameters, scene: Scene) -> Registered:
    """Displacement less contact and toe, force less the cell's offset, to the law's limit."""
    p = parameters
    limit: float = getattr(p, f"limit_{scene.material.law}")
    fit = fit_modulus(recording, window=(p.fit_from, p.fit_to))
    _, height = _size(recording, p)
    d, force = recording.signal("displacement", "m"), recording.signal("force", "N")
    moved = d.y - fit.contact - fit.toe * height
    last = int(np.argmax(moved[:, 0] > limit * height)) or len(moved)
    t, offset = d.t[:last], force.y[:last] - fit.offset
    stage = SignalObservation("displacement", "drives", t, moved[:last], "m", d.sd)
    cell = SignalObservation(
        "force", "validates", t, offset, "N", fit.noise, "force", "stage.force"
    )
    strains = zip(WINDOWS, pairwise((p.fit_from, p.fit_to, *_limits(p))), strict=True)
    windows = {label: (a * height, b * height) for label, (a, b) in strains if b <= limit}
    return Registered((stage, cell), windows_of(stage, windows), outside=len(d.t) - last)


def _size(recording: Recording, p: Parameters) -> tuple[float, float]:
    """Diameter and height m: what the user set, else the header's."""
    stated = cylinder_of(recording)
    own = p.specimen
    return (
        stated.diameter if own.diameter is None else own.diameter,
        stated.height if own.height is None else own.height,
    )


# --- identification ------------------------------------------------------------------------------


def stiffening(diameter: float, height: float, grid: Grid, nu: float, contact: Contact) -> float:
    """Apparent over true modulus of the meshed cylinder: E_app = F h / (A d) at E = 1 Pa."""
    scene = cylinder_scene(diameter, height, grid, Material(1.0, nu), contact)
    force = responses(build_system(scene)).reactions[0, 0]
    return float(force * height / (np.pi * diameter**2 / 4))


def identify(recordings: Sequence[Recording], parameters: Parameters) -> Identified:
    """The modulus for which this mesh has the measured slope, slipping and bonded."""
    p = parameters
    window = (p.fit_from, p.fit_to)
    diameter, height = _size(recordings[0], p)
    found = identify_modulus(recordings, Cylinder(diameter, height), window)
    slip, bonded = (
        stiffening(diameter, height, p.mesh, p.material.nu, c) for c in ("slip", "bonded")
    )
    half = stiffening(diameter, height / 2, p.mesh, p.material.nu, "bonded")
    laws = {
        name: _law_fit(recordings, p, METHODS[name])
        for name in ("svk_slip", "neo_slip", "neo_bonded")
    }
    material = replace(
        p.material,
        E_slip=p.material.E_slip or found.mean / slip,
        E_bonded=p.material.E_bonded or found.mean / bonded,
        **{f"E_{k}": getattr(p.material, f"E_{k}") or fit.scale for k, fit in laws.items()},
    )
    scores = _scores(found, bonded, gent_correction(diameter, height))
    scores += tuple(
        s for name, fit in laws.items() for s in _law_scores(name, fit, len(recordings))
    )
    headline = (
        f"The modulus lies between {found.mean / bonded / 1e3:.1f} kPa (bonded plates) and "
        f"{found.mean / 1e3:.1f} kPa (slipping): force alone cannot say which"
    )
    notes = _notes(found, bonded, half, height)
    return Identified(replace(p, material=material), scores, notes, headline)


def _law_fit(recordings: Sequence[Recording], p: Parameters, method: Method) -> LawFit:
    """The law's modulus over its whole range, by the method's own mesh."""
    scene = _model_scene(_size(recordings[0], p), p, method.scene, 1.0)
    stepper = method.settings.prepare(build_system(scene))
    curves, forces = [], []
    for recording in recordings:
        seen = place(recording, p, scene)
        states = [stepper.step(stepper.rest(), q) for q in seen.inputs]
        good = [s.failure is None for s in states]
        found = [s.numbers["stage.force"] for s in states if s.failure is None]
        curves.append(np.array(found))
        forces.append(seen.of(SignalObservation)[0].y[good, 0])
    return fit_scale(curves, forces)


def _law_scores(name: str, fit: LawFit, logs: int) -> tuple[Score, ...]:
    words = f"modulus over the law's whole range, {METHODS[name].label}; shear modulus is a third"
    rows = [(f"modulus.{name}", fit.scale, "Pa", words)]
    if fit.sd_repeats is not None:
        rows.append((f"modulus.{name}.sd_repeats", fit.sd_repeats, "Pa", "sd of one log's modulus"))
        band = fit.confidence(logs) or 0.0
        rows.append((f"modulus.{name}.confidence", band, "Pa", "two sd of the mean over the logs"))
    rows.append((f"force.fit_rms.{name}", fit.residual_rms, "N", "rms residual of the fitted law"))
    return tuple(Score(n, v, unit, fit.count, "measured logs", w) for n, v, unit, w in rows)


def _scores(found: ModulusSummary, bonded: float, gent: float) -> tuple[Score, ...]:
    logs, samples = len(found.fits), sum(f.count for f in found.fits)
    bracket = apparent_to_material(found, bonded)
    noise = rms([f.noise for f in found.fits])
    rows = [
        ("modulus.E", found.mean, "Pa", samples, "apparent modulus, mean over the logs"),
        ("modulus.E.sd_repeats", found.sd_repeats or 0.0, "Pa", logs, "sd of one log's modulus"),
        ("modulus.E.sd_mean", found.sd_mean, "Pa", logs, "sd of the mean over the logs"),
        ("modulus.E_slip", bracket.slip, "Pa", samples, "material's, if the plates slip"),
        ("modulus.E_bonded", bracket.bonded, "Pa", samples, "material's, if the plates hold"),
        ("modulus.bonded_factor", bonded, "1", 1, "apparent over true modulus, bonded, this mesh"),
        ("modulus.gent_factor", gent, "1", 1, "the same by Gent's formula"),
        ("load_cell.noise", noise, "N", samples, "sd of the load cell's noise, from the logs"),
    ]
    return tuple(
        Score(name, v, unit, n, "measured logs", words) for name, v, unit, n, words in rows
    )


def _notes(found: ModulusSummary, bonded: float, half: float, height: float) -> tuple[str, ...]:
    offsets = [f.offset for f in found.fits]
    toes = [1e3 * height * f.toe for f in found.fits]
    return (
        f"Whether the plates slipped was not recorded. The material's modulus lies between "
        f"{found.mean / bonded / 1e3:.1f} kPa (bonded) and {found.mean / 1e3:.1f} kPa (slipping).",
        f"Force alone cannot tell the two apart. A cylinder of {500 * height:.0f} mm height would: "
        f"its apparent modulus would be {half / bonded:.2f} times this one's with bonded plates "
        "and the same with slipping ones.",
        f"Load cell offsets of {min(offsets):.3f}..{max(offsets):.3f} N and toes of "
        f"{min(toes):.3f}..{max(toes):.3f} mm (seating of the plate: where the fitted line reaches "
        "zero force) were taken off. The modulus is fitted in the window 5pct, so only 10pct is a "
        "prediction.",
        "The scatter of repeats on one specimen understates that between specimens; the range "
        "declared for the modulus is the latter.",
    )


# --- what is judged ------------------------------------------------------------------------------


def _scaled(p: Parameters) -> Parameters:
    m, by = p.material, 1 + p.ranges.specimen
    moduli = ("E_slip", "E_bonded", "E_svk_slip", "E_neo_slip", "E_neo_bonded")
    return replace(
        p, material=replace(m, **{name: (getattr(m, name) or 0.0) * by for name in moduli})
    )


def _softer(p: Parameters) -> Parameters:
    return replace(p, material=replace(p.material, nu=p.material.nu - p.ranges.nu))


def _finer(p: Parameters) -> Parameters:
    g = p.mesh
    return replace(p, mesh=replace(g, radial=g.finer_radial, axial=g.finer_axial))


def _refinement(p: Parameters) -> float:
    return float((p.mesh.finer_radial / p.mesh.radial) ** 2 - 1)


def _one(_: Parameters) -> float:
    return 1.0


INPUTS = (
    Input("modulus", _scaled, _one, "E within its declared scatter between specimens"),
    Input("Poisson ratio", _softer, _one, "nu within its declared uncertainty"),
)


def published(values: Mapping[str, Mapping[str, float]]) -> tuple[Published, ...]:
    E = values["identified"]["modulus.E"]
    return (
        Published(
            "modulus.E, 0.5-5 % strain", E, 104e3, 9e3, "Pa", "reproduced",
            "within two sd (4.5 kPa) of the scatter between specimens",
            f"{DATA_SET}: ten repeats, two specimens", 107.666e3, 10.0,
        ),
    )  # fmt: skip


EXPERIMENT = Experiment(
    name="ecoflex_cylinder",
    title="Ecoflex 00-30 cylinder compressed between plates, five logs",
    source=f"{DATA_SET}; Dawood et al. (2026)",
    parameters=Parameters(),
    methods=METHODS,
    accepted=("slip", "bonded"),
    accept=(Accept("force", 2.1, "a tenth of the force at 10 % strain (ours)", ("10pct",)),),
    load=load,
    build=build,
    place=place,
    uncertainty=Uncertainty(_finer, _refinement, INPUTS, surrogate="slip"),
    published=published,
    identify=identify,
    band=lambda p: float(p.ranges.specimen),
    frames=2,
)
