"""Which material and specimen a log is of, and the modulus by specimen: repeats count once.

The data set names a log `<material>_<specimen>_sample_<repeat>` in its first line and
`<material>_<specimen><repeat>` as a file.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validate.compare.score import Score
from validate.errors import RecordingError, UsageError
from validate.identify.budget import Votes
from validate.identify.modulus import ModulusFit
from validate.recording.types import Recording

_NAMES = (re.compile(r"(.+)_([A-Za-z]+)_sample_\d+"), re.compile(r"(.+)_([A-Z]+)\d+"))


def named(recording: Recording) -> tuple[str, str]:
    """Material and specimen, by the log's first line, else by its file, else the recording's
    name."""
    line = recording.metadata.get("header", {}).get("line 1", "").strip()
    for text in (line, Path(recording.source.path).stem):
        for name in _NAMES:
            found = name.fullmatch(text)
            if found:
                return found[1], found[2]
    return recording.name, ""


def material_of(recording: Recording) -> str:
    return named(recording)[0]


def specimen_of(recording: Recording) -> str:
    """The specimen, with its material: A of one grade is not A of another."""
    return "_".join(part for part in named(recording) if part)


@dataclass(frozen=True)
class HeldOut:
    """The specimen that is judged, and those that calibrate: itself where there is no other."""

    judged: str
    calibrating: tuple[str, ...]

    @property
    def apart(self) -> bool:
        return self.judged not in self.calibrating

    @property
    def words(self) -> str:
        """Fitted on what, predicted what."""
        if self.apart:
            return f"Fitted on {', '.join(self.calibrating)}, predicted: {self.judged}, left out"
        return f"Fitted on {self.judged}, predicted: larger strains of the same logs"

    def calibrates(self, recording: Recording) -> bool:
        return specimen_of(recording) in self.calibrating


def split(recordings: Sequence[Recording], judged: str | None) -> HeldOut:
    """Leaves `judged` out (its name or its letter; none: the last specimen).

    Raises `RecordingError` for logs of several materials, `UsageError` for an unknown specimen.
    """
    materials = sorted({material_of(r) for r in recordings})
    if len(materials) > 1:
        raise RecordingError(
            f"logs of {len(materials)} materials ({', '.join(materials[:4])}): their moduli "
            f"are unrelated; choose one material, for example --set logs='{materials[0]}_*.csv'"
        )
    every = tuple(dict.fromkeys(specimen_of(r) for r in recordings))
    chosen = [s for s in every if judged in (s, s.removeprefix(f"{materials[0]}_"))]
    if judged and not chosen:
        raise UsageError(
            f"judged = {judged}: no specimen has that name; expected one of {', '.join(every)}"
        )
    out = chosen[0] if chosen else every[-1]
    return HeldOut(out, tuple(s for s in every if s != out) or every)


@dataclass(frozen=True)
class ModulusSummary:
    """Mean over repeats, Pa. The scatter of repeats on one specimen understates that of specimens.

    `sd_repeats` is None for a single log; `sd_mean` is then that fit's own standard error.
    """

    mean: float
    sd_repeats: float | None
    sd_mean: float
    fits: tuple[ModulusFit, ...]


def summarised(fits: Sequence[ModulusFit], specimens: Sequence[str]) -> ModulusSummary:
    """The mean over specimens, and its sd by what scatters most: specimens, repeats, the fit."""
    found = Votes.by_specimen([f.E_apparent for f in fits], specimens)
    sd_mean = fits[0].sd if found.sd_mean is None else found.sd_mean
    return ModulusSummary(found.mean, found.within, sd_mean, tuple(fits))


def left_out(values: Sequence[float], specimens: Sequence[str]) -> tuple[Score, ...]:
    """What the others say of every specimen less its own, relative: leave one specimen out."""
    means = Votes.by_specimen(values, specimens).means
    found = []
    for name, own in means.items():
        others = [E for other, E in means.items() if other != name]
        if others:
            off = float(np.mean(others)) / own - 1
            words = f"modulus of the other {len(others)} minus that of {name}, over the latter"
            found.append(Score(f"left_out.{name}", off, "1", len(others), "measured logs", words))
    return tuple(found)


def apart_notes(apart: HeldOut, own: Votes, scatter: float) -> tuple[str, ...]:
    """Fitted on what, predicted what, and whose scatter stands in u_D."""
    k = len(own.means)
    if apart.apart:
        first = (
            f"Fitted on {', '.join(apart.calibrating)}; predicted: {apart.judged}, which was "
            "left out. Repeats of one specimen count once."
        )
    else:
        first = (
            f"All {own.logs} log{'s are' if own.logs > 1 else ' is'} of one specimen, "
            f"{apart.judged}. The prediction extrapolates in strain the same logs whose first "
            "part was fitted. It is no evidence for another specimen."
        )
    if own.between is not None:
        second = (
            f"Scatter between specimens {100 * own.between / own.mean:.2g} %, of the {k} that "
            "calibrate; it is included in u_D."
        )
    else:
        second = (
            f"The scatter between specimens is unknown: {k} specimen calibrates, and repeats "
            f"of one understate it. The declared {100 * scatter:.2g} % is included in u_D."
        )
    return first, second
