"""Declaration of a calibration: free parameters and the residuals that identify them.

A parameter that stands open (None) is identified before anything is predicted; one with a value is
taken as it is. What calibrated is shown as fitted and is never evidence.
"""

import math
from dataclasses import dataclass

from validate.errors import UsageError
from validate.pipeline.experiment.variation import Change, change_of, unchanged


@dataclass(frozen=True)
class Free:
    """A parameter that may be identified: its path as --set spells it, and the SI bounds searched.

    `on` names the residuals that identify it, where it is declared among the variations.
    `source` says where the bounds come from, or "assumed"; `helps` which measurement would identify
    it where these recordings cannot. Raises `UsageError` for bounds that are none.
    """

    path: str
    low: float
    high: float
    source: str
    helps: str = ""
    on: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise UsageError(
                f"free parameter {self.path}: bounds {self.low:g} to {self.high:g}; give two "
                "finite numbers, the lower one first"
            )
        if not self.source.strip():
            raise UsageError(
                f"free parameter {self.path} has no source; cite what its bounds come from, or "
                "'assumed'"
            )


@dataclass(frozen=True)
class Calibrates:
    """Which residuals of which recording calibrate.

    `quantities` are names of residuals (quantity, or quantity@load). `change` turns the parameters
    into those of the recording that calibrates (its file, its load); unchanged: the recording that
    is judged. `name` is what sentences call it.
    """

    quantities: tuple[str, ...]
    change: Change = unchanged
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "change", change_of(self.change))

    @property
    def judged(self) -> bool:
        """Whether it is the recording that is judged."""
        return self.change is unchanged


@dataclass(frozen=True)
class Calibration:
    """What is identified, by which method, on what; the parameters are those that stand open.

    `shared`: what it finds is every method's, whichever else are calibrated each by itself.
    Raises `UsageError` for a calibration without parameters or residuals, and for a parameter that
    stands twice.
    """

    method: str
    free: tuple[Free, ...]
    on: tuple[Calibrates, ...]
    shared: bool = False

    def __post_init__(self) -> None:
        if not self.free or not any(on.quantities for on in self.on):
            raise UsageError(
                f"calibration of '{self.method}': {len(self.free)} parameters on "
                f"{sum(len(on.quantities) for on in self.on)} quantities; name at least one of each"
            )
        paths = self.paths
        twice = [p for i, p in enumerate(paths) if p in paths[:i]]
        if twice:
            raise UsageError(f"calibration of '{self.method}': {twice[0]} is free twice")

    @property
    def paths(self) -> tuple[str, ...]:
        return tuple(f.path for f in self.free)
