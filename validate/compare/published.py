"""Printed figures: declared before anything runs, computed from scores, shown with a verdict."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

PublishedVerdict = Literal[
    "reproduced", "not reproduced", "not reproducible as printed", "not comparable"
]
Values = Mapping[str, Mapping[str, float]]  # scores by owner (a method, "told", ...) and name


@dataclass(frozen=True)
class Published:
    """A printed figure beside ours: `verdict` says whether it reproduces and `reason` why not.

    `expected` is our own value when the verdict was written, good to `drift` (absolute, in `unit`).
    `missing` names what our value needs and nothing computed.
    """

    name: str
    ours: float | None
    theirs: float | None
    tolerance: float | None
    unit: str
    verdict: PublishedVerdict
    reason: str
    source: str
    expected: float | None = None
    drift: float | None = None
    missing: str = ""

    @property
    def fault(self) -> str:
        """Why the verdict no longer stands: ours moved, or it left its tolerance; else empty."""
        if self.missing:
            return f"not computed: {self.missing}"
        if self.verdict == "reproduced" and self.ours is None:
            return "marked reproduced, and compared nothing"
        if self.ours is None:
            return ""
        if self.expected is not None and abs(self.ours - self.expected) > (self.drift or 0.0):
            return f"ours moved from {self.expected:g} to {self.ours:g}, beyond {self.drift:g}"
        known = self.theirs is not None and self.tolerance is not None
        if self.verdict == "reproduced" and known:
            off = abs(self.ours - float(self.theirs or 0.0))
            if off > float(self.tolerance or 0.0):
                return f"off by {off:g}, beyond the tolerance {self.tolerance:g}"
        return ""


@dataclass(frozen=True)
class Figure:
    """A printed figure as an experiment declares it; the fields of `Published` with the same name.

    `of` is the score that stands beside it, "owner:score" (a method's, or "told:" for what the
    experiment's own exhibits computed, "identified:"), or a function of all values, which may find
    that there is none; None where nothing of ours can stand there. `reason` may be a function of
    the values too.
    """

    name: str
    of: str | Callable[[Values], float | None] | None
    theirs: float | None
    tolerance: float | None
    unit: str
    verdict: PublishedVerdict
    reason: str | Callable[[Values], str]
    source: str
    expected: float | None = None
    drift: float | None = None

    def beside(self, values: Values) -> Published:
        """The figure with our value; one that cannot be computed says what it lacks."""
        ours, reason, missing = None, "", ""
        try:
            ours = self._ours(values)
            reason = self.reason if isinstance(self.reason, str) else self.reason(values)
        except KeyError as absent:
            missing = f"no score {absent}"
        return Published(
            self.name, ours, self.theirs, self.tolerance, self.unit, self.verdict, reason,
            self.source, self.expected, self.drift, missing,
        )  # fmt: skip

    def _ours(self, values: Values) -> float | None:
        if self.of is None:
            return None
        if not isinstance(self.of, str):
            return self.of(values)
        owner, _, score = self.of.partition(":")
        return values[owner][score]
