"""Curves of one material in several modes: parameters, files, scenes and registration."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.datasets.home import data_path
from validate.errors import RecordingError, UsageError
from validate.parameters import Ranges, quantity
from validate.pipeline.experiment.tree import Tree
from validate.recording.tables.stretch import read_stretch_stress
from validate.recording.types import Recording, Signal
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.scene.meshless import MaterialPoint, StretchMode

from .laws import (
    LawCard,
    MooneyRivlin,
    OgdenTerm,
    OgdenTerms,
    ShearModulus,
    Yeoh,
    material,
)
from .stress_observation import StressObservation

FOLDER = "force/multimode"
MODES: tuple[StretchMode, ...] = get_args(StretchMode)
_FIRST = "treloar"  # of the shared folder, which holds several materials
_SAME = 1e-3  # of stretches that are one
Rows = NDArray[np.bool_]


@dataclass(frozen=True)
class CurveRanges(Ranges):
    reading: float = quantity(
        0.03, "1", "relative, of one stress: three digitisations of one figure differ by it (sd)"
    )
    axis: float = quantity(
        0.03, "1", "relative, of all stresses of a figure: its axis; assumed as large as a reading"
    )
    nu: float = quantity(0.0004, "1", "of the Poisson ratio")


@dataclass(frozen=True)
class Multimode:
    """`data` is a folder of files MATERIAL_MODE.csv; `fit` the mode that calibrates."""

    svk: ShearModulus = field(default_factory=ShearModulus)
    neo_hooke: ShearModulus = field(default_factory=ShearModulus)
    mooney_rivlin: MooneyRivlin = field(default_factory=MooneyRivlin)
    yeoh: Yeoh = field(default_factory=Yeoh)
    ogden: OgdenTerm = field(default_factory=OgdenTerm)
    ogden_two: OgdenTerms = field(default_factory=OgdenTerms)
    nu: float = quantity(0.4999, "1", "Poisson ratio: rubber, nearly incompressible")
    fit: StretchMode | None = quantity(
        None, "1", "mode that calibrates; none: uniaxial, of a plane its diagonal"
    )
    unit: str | None = quantity(None, "1", "unit of the stresses; none: that of the files' header")
    data: str | None = quantity(None, "1", "folder of the curves; none: VALIDATE_SHARED_DATA")
    material: str | None = quantity(None, "1", "MATERIAL of the files MATERIAL_MODE.csv")
    ranges: CurveRanges = CurveRanges()


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """A recording for every mode of the material, the one that calibrates first."""
    p: Multimode = tree.settings
    where = data_path(FOLDER, None, folder, p.data)
    files = _files(where)
    name = _material(p, files, where)
    recordings = [r for path in files[name] for r in _by_mode(path, name, p.unit)]
    modes = [mode_of(r) for r in recordings]
    if len(set(modes)) != len(modes):
        raise RecordingError(f"{where}: '{name}' has {sorted(modes)}; one curve a mode")
    fitted = _fitted(p, recordings)
    recordings.sort(key=lambda r: (mode_of(r) != fitted, MODES.index(mode_of(r))))
    return tuple(
        _with_role(r, "validates" if k else "calibrates") for k, r in enumerate(recordings)
    )


def _with_role(recording: Recording, role: str) -> Recording:
    test = {**recording.record("test"), "role": role}
    return replace(recording, metadata={**recording.metadata, "test": test})


def mode_of(recording: Recording) -> StretchMode:
    return as_mode(recording.record("test")["mode"])


def as_mode(name: str) -> StretchMode:
    return next(m for m in MODES if m == name)


def material_of(recording: Recording) -> str:
    return recording.record("test")["material"]


def _files(where: Path) -> dict[str, list[Path]]:
    """Files by material. Raises `RecordingError` where none is named as they must be."""
    named: dict[str, list[Path]] = {}
    for path in sorted(where.glob("*.csv")):
        if any(path.stem.endswith(f"_{m}") for m in MODES):
            named.setdefault(path.stem.removesuffix(f"_{_said_mode(path)}"), []).append(path)
    if not named:
        raise RecordingError(
            f"no curves in {where}: files are called MATERIAL_MODE.csv, MODE one of "
            f"{', '.join(MODES)}; pass --set data=FOLDER"
        )
    return named


def _said_mode(path: Path) -> StretchMode:
    return next(m for m in MODES if path.stem.endswith(f"_{m}"))


def _material(p: Multimode, files: Mapping[str, list[Path]], where: Path) -> str:
    name = p.material or (_FIRST if _FIRST in files and not p.data else "")
    if not name and len(files) == 1:
        return next(iter(files))
    if name not in files:
        raise UsageError(
            f"{f'no curves of {name}' if name else f'{len(files)} materials'} in {where}: "
            f"--set material={'|'.join(files)}"
        )
    return name


def _fitted(p: Multimode, recordings: list[Recording]) -> StretchMode:
    """The mode that calibrates. Raises `UsageError` for one that the material has not."""
    modes = [mode_of(r) for r in recordings]
    usual: StretchMode = "equibiaxial" if "biaxial" in modes else "uniaxial"
    wanted = p.fit or next((m for m in (usual, *MODES) if m in modes), usual)
    if wanted not in modes:
        raise UsageError(
            f"no {wanted} curve of '{material_of(recordings[0])}' to identify on; --set "
            f"fit={'|'.join(modes)}"
        )
    return wanted


def _by_mode(path: Path, name: str, unit: str | None) -> list[Recording]:
    """One curve as it is; a plane of two stretches as its lines and what lies between them."""
    whole = read_stretch_stress(path, unit)
    l, P = whole.signal("stretch", "1").y, whole.signal("stress", "Pa").y
    mode = _said_mode(path)
    if l.shape[1] == 1:
        return [_of_mode(whole, name, "equibiaxial" if mode == "biaxial" else mode, l, P)]
    if mode != "biaxial":
        raise RecordingError(f"{path.name}: two stretches in mode {mode}; only a plane has two")
    return [
        _of_mode(whole, name, line, *_line(line, l[rows], P[rows]))
        for line, rows in _lines(l, P).items()
        if rows.any()
    ]


def _of_mode(
    whole: Recording, name: str, mode: StretchMode, stretch: Floats, stress: Floats
) -> Recording:
    rows = np.arange(len(stretch), dtype=np.float64)
    signals = {
        "stretch": Signal(rows, stretch, "1", 0.0, "specimen"),
        "stress": Signal(rows, stress, "Pa", 0.0, "specimen"),
    }
    test = {"mode": mode, "material": name}
    return replace(
        whole,
        name=f"{name}, {mode}",
        signals=signals,
        metadata={**whole.metadata, "test": test},
    )


def _lines(l: Floats, P: Floats) -> dict[StretchMode, Rows]:
    """Which rows of a plane lie on which of its lines: free of stress 2, equal, or held."""
    free = np.abs(P[:, 1]) <= _SAME * np.abs(P[:, 0])
    equal, held = np.abs(l[:, 0] - l[:, 1]) < _SAME, np.abs(l[:, 1] - 1) < _SAME
    on: dict[StretchMode, Rows] = {
        "uniaxial": free, "equibiaxial": equal & ~free, "pure_shear": held & ~equal & ~free,
    }  # fmt: skip
    return {**on, "biaxial": ~(free | equal | held)}


def _line(mode: StretchMode, l: Floats, P: Floats) -> tuple[Floats, Floats]:
    """The stretches that the mode's inputs are; both stresses but where one is free."""
    driven = l if mode == "biaxial" else l[:, :1]
    return driven, P[:, :1] if mode in ("uniaxial", "equibiaxial") else P


def build(recording: Recording, tree: Tree, model: LawCard) -> MaterialPoint:
    p: Multimode = tree.settings
    return point(p, model, mode_of(recording))


def point(p: Multimode, law: LawCard, mode: StretchMode) -> MaterialPoint:
    """The law at a point that is stretched so."""
    return MaterialPoint(material(law, getattr(p, law), p.nu), mode)


def principal(mode: StretchMode, stretches: Floats) -> Floats:
    """The three principal stretches (n, 3) of an incompressible body under inputs (n, k)."""
    first = stretches[:, 0]
    second = {
        "uniaxial": first**-0.5, "equibiaxial": first, "pure_shear": np.ones(len(first)),
    }.get(mode, stretches[:, -1])  # fmt: skip
    return np.stack([first, second, 1 / (first * second)], axis=1)


def place(recording: Recording, tree: Tree, scene: MaterialPoint) -> Registered:
    """What a figure's axis is off by scales the moduli that are identified on it, not the fit; a
    predicted figure is off by its own axis and by that one."""
    p: Multimode = tree.settings
    stress, ranges = recording.signal("stress", "Pa"), p.ranges
    fitted = recording.record("test")["role"] == "calibrates"
    seen = StressObservation(
        "stress", "validates", stress.t, stress.y, ranges.reading,
        0.0 if fitted else float(np.sqrt(2)) * ranges.axis, f"stress.{scene.mode}",
    )  # fmt: skip
    return Registered((SignalObservation.driving(recording, "stretch", "1"), seen), timed=False)
