"""What is identified of every law, on which mode, within which bounds: from the curves given."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from validate.compare.verdict import Accept
from validate.pipeline.calibration.calibration import Calibrates, Calibration, Free
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording
from validate.scene.material import Material
from validate.scene.meshless import MaterialPoint, StretchMode
from validate.solve.static.stretch_test import StretchTest

from .curves import Multimode, material_of, mode_of, principal
from .laws import LawCard

LIMIT = 0.1  # of the measured stress
_WIDE = 100.0  # a modulus lies within so many times the one that neo-Hooke shows
_SHARE = 3.0  # a further coefficient brings at most so many times neo-Hooke's stress
_POWERS = (0.3, 30.0)  # of Ogden's terms
_HELPS = "a curve in a second mode, equibiaxial best"


def follows(experiment: Experiment, recordings: Sequence[Recording], tree: Tree) -> Experiment:
    """The experiment for these curves: the first calibrates, all others are predicted."""
    p: Multimode = tree.settings
    fitted, *others = (mode_of(r) for r in recordings)
    shown = ", ".join(words_of(m) for m in others) or "nothing else"
    title = f"{material_of(recordings[0])}: identified in {words_of(fitted)}, predicted in {shown}"
    return replace(
        experiment,
        title=title,
        accept=tuple(accepted(m) for m in others),
        calibrations=calibrations(fitted, *_seen(recordings[0], p)),
    )


def words_of(mode: StretchMode) -> str:
    """A mode in words."""
    return {"uniaxial": "uniaxial tension", "equibiaxial": "equibiaxial tension",
            "pure_shear": "pure shear", "biaxial": "biaxial tension"}[mode]  # fmt: skip


def accepted(mode: StretchMode) -> Accept:
    return Accept(f"stress.{mode}", LIMIT, "a tenth of the measured stress")


def _seen(recording: Recording, p: Multimode) -> tuple[float, float]:
    """The shear modulus Pa that neo-Hooke has on the median row, and the largest I1 - 3."""
    mode, l = mode_of(recording), recording.signal("stretch", "1").y
    unit = Material(2 * (1 + p.nu), p.nu, "neo_hooke")
    t = np.arange(len(l), dtype=np.float64)
    shape = StretchTest().solve(MaterialPoint(unit, mode), t, l).traces["nominal_stress"].y
    stress = recording.signal("stress", "Pa").y[:, 0]
    pulled = np.abs(shape) > 0.01 * np.abs(shape).max()
    far = float(((principal(mode, l) ** 2).sum(axis=1) - 3).max())
    return float(np.median(stress[pulled] / shape[pulled])), far


def calibrations(fitted: StretchMode, mu: float, far: float) -> tuple[Calibration, ...]:
    """One of every law: around a shear modulus mu Pa, for I1 - 3 up to `far`."""
    on = (Calibrates((f"stress.{fitted}",), name=f"the {words_of(fitted)} curve"),)
    modulus = "0.01 to 100 times neo-Hooke's modulus on the same curve"
    share = f"{_SHARE:g} times neo-Hooke's stress at the largest stretch of the curve"

    def moduli(law: LawCard, *names: str) -> list[Free]:
        return [Free(f"{law}.{n}", mu / _WIDE, mu * _WIDE, modulus, _HELPS) for n in names]

    def further(path: str, most: float) -> Free:
        return Free(path, -most, most, share, _HELPS)

    def power(path: str, sign: int) -> Free:
        low, high = sorted(sign * x for x in _POWERS)
        return Free(path, low, high, "assumed: rubbers and tissues have 1 to 25", _HELPS)

    most = _SHARE * mu
    laws: dict[LawCard, list[Free]] = {
        "svk": moduli("svk", "mu"),
        "neo_hooke": moduli("neo_hooke", "mu"),
        "mooney_rivlin": [
            Free("mooney_rivlin.C10", mu / 20, 5 * mu, "0.1 to 10 times neo-Hooke's", _HELPS),
            Free("mooney_rivlin.C01", -mu / 2, most / 2, share, _HELPS),
        ],
        "yeoh": [
            *moduli("yeoh", "C10"), further("yeoh.C20", most / far),
            further("yeoh.C30", most / far**2),
        ],
        "ogden": [*moduli("ogden", "G"), power("ogden.alpha", 1)],
        "ogden_two": [
            *moduli("ogden_two", "G_1", "G_2"), power("ogden_two.alpha_1", 1),
            power("ogden_two.alpha_2", -1),
        ],
    }  # fmt: skip
    return tuple(Calibration(law, tuple(free), on) for law, free in laws.items())
