"""Published figures, declared before a run and checked against its values.

A figure belongs to the data it was printed for: beside other data it is not compared at all.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal, Self

from validate.errors import ComparisonError

Claim = Literal["reproduced", "not reproduced", "not reproducible as printed", "not comparable"]
PublishedVerdict = Claim | Literal["moved", "not computed", "other data"]
Values = Mapping[str, Mapping[str, float]]  # scores by owner (a method, "told", ...) and name
_WIDEST = 0.1  # of a reference's scale; a wider tolerance decides nothing


@dataclass(frozen=True)
class Published:
    """A printed figure beside ours: `verdict` follows from today's value, `claim` was declared.

    `expected` is our own value when the claim was written, good to `drift` (absolute, in `unit`).
    `missing` names what our value needs and nothing computed; `other` what the figure was printed
    for, where this data is not that; `window` where of a run the value was counted. `setting`: a
    number of the set-up, a machine, a sketch or a citation, which no run can reproduce.
    """

    name: str
    ours: float | None
    theirs: float | None
    tolerance: float | None
    unit: str
    claim: Claim
    reason: str
    source: str
    expected: float | None = None
    drift: float | None = None
    missing: str = ""
    window: str = ""
    other: str = ""
    setting: bool = False

    @property
    def result(self) -> bool:
        """Whether a result was printed that a run could reproduce: settings and pictures without
        numbers are none, and leave the count of figures."""
        printed = self.theirs is not None or self.claim != "not comparable"
        return printed and not self.setting

    @property
    def verdict(self) -> PublishedVerdict:
        return self._judged[0]

    @property
    def fault(self) -> str:
        """Why the claim does not stand today; else empty."""
        return self._judged[1]

    @property
    def line(self) -> str:
        """The verdict as it is shown, with the window that it rests on."""
        return f"{self.verdict} (within {self.window})" if self.window else self.verdict

    @property
    def why(self) -> str:
        """Text beside the verdict."""
        return "; ".join(part for part in (self.fault, self.other or self.reason) if part)

    @property
    def _judged(self) -> tuple[PublishedVerdict, str]:
        ours = self.ours
        if self.other:
            return "other data", ""
        if self.missing:
            return "not computed", f"not computed: {self.missing}"
        if ours is None:
            nothing = self.claim == "reproduced"
            return ("not computed", "compared nothing") if nothing else (self.claim, "")
        if not math.isfinite(ours):
            return "not computed", f"not computed: our value is {ours}"
        if self.expected is not None and abs(ours - self.expected) > (self.drift or 0.0):
            return "moved", (
                f"our value moved from {self.expected:g} to {ours:g}, beyond {self.drift:g}"
            )
        # A finite value of ours against theirs, where both claim and tolerance compare them
        if self.theirs is None or self.tolerance is None:
            return self.claim, ""
        off = abs(ours - self.theirs)
        if self.claim == "reproduced" and off > self.tolerance:
            return "not reproduced", f"error {off:g}, outside the tolerance {self.tolerance:g}"
        if self.claim == "not reproduced" and off <= self.tolerance:
            return "reproduced", f"error {off:g}, within the tolerance {self.tolerance:g}"
        return self.claim, ""


@dataclass(frozen=True)
class Figure:
    """A printed figure as an experiment declares it; the fields of `Published` with the same name.

    `of` is the score that stands beside it, "owner:score" (a method's, or "told:" for what the
    experiment's own exhibits computed, "identified:"), or a function of all values, which may find
    that there is none; None where nothing of ours can stand there. `reason` may be a function of
    the values too. `scale` is what the tolerance is held against (0: the printed number itself).

    Raises `ComparisonError` for a number that is not finite, and for a claim that could not fail:
    reproduced without a printed number, a value of ours or a tolerance; a tolerance wider than a
    tenth of the scale; an expected value without the drift it is good to.
    """

    name: str
    of: str | Callable[[Values], float | None] | None
    theirs: float | None
    tolerance: float | None
    unit: str
    claim: Claim
    reason: str | Callable[[Values], str]
    source: str
    expected: float | None = None
    drift: float | None = None
    window: str = ""
    scale: float = 0.0
    other: str = ""
    setting: bool = False

    #: Reasons why a printed number is no result that a run could reproduce.
    INPUT: ClassVar[str] = "an input, taken as printed"
    CITED: ClassVar[str] = "cited from other work, not a result of the paper"
    MACHINE: ClassVar[str] = "another machine: ours is in the environment section of the report"

    @classmethod
    def of_setup(
        cls, name: str, theirs: float, ours: float, unit: str, source: str, reason: str = INPUT
    ) -> Self:
        """Return the row of a printed number of the set-up, with the one that is used here."""
        return cls(
            name, lambda _: ours, theirs, None, unit, "not comparable", reason, source, ours,
            1e-12 * max(1.0, abs(ours)), setting=True,
        )  # fmt: skip

    @classmethod
    def uncompared(
        cls, name: str, theirs: float | None, unit: str, source: str, reason: str
    ) -> Self:
        """Return the row of a printed number or picture without a value of ours beside it."""
        return cls(
            name, None, theirs, None, unit, "not comparable", reason, source, setting=True
        )  # fmt: skip

    @classmethod
    def drawn(cls, name: str, score: str, unit: str, source: str, reason: str) -> Self:
        """Return the row of a curve or picture without a printed number, with a score of ours."""
        return cls(name, score, None, None, unit, "not comparable", reason, source)

    def __post_init__(self) -> None:
        numbers = (self.theirs, self.tolerance, self.expected, self.drift)
        if not all(x is None or math.isfinite(x) for x in numbers):
            raise ComparisonError(
                f"figure '{self.name}': theirs, tolerance, expected and drift are {numbers}; a "
                "number that is not finite cannot be compared"
            )
        held = (self.of, self.theirs, self.tolerance)
        if self.claim == "reproduced" and None in held:
            raise ComparisonError(
                f"figure '{self.name}': reproduced needs a printed number, a value of ours and a "
                f"tolerance, found theirs = {self.theirs}, of = {self.of}, tolerance = "
                f"{self.tolerance}; without them it is 'not comparable'"
            )
        if (self.expected is None) != (self.drift is None):
            raise ComparisonError(
                f"figure '{self.name}': expected = {self.expected} with drift = {self.drift}; "
                "give both or neither"
            )
        if self.tolerance is not None:
            scale = self.scale or abs(self.theirs or 0.0)
            if not self.tolerance <= _WIDEST * scale * (1 + 1e-9):
                raise ComparisonError(
                    f"figure '{self.name}': a tolerance of {self.tolerance:g} {self.unit} is wider "
                    f"than a tenth of the scale of its reference, {scale:g} {self.unit}; it must "
                    f"be at most {_WIDEST * scale:g}, or the figure could not fail"
                )

    def beside(self, values: Values) -> Published:
        """Return the figure with our value; one that cannot be computed says what it lacks."""
        ours, reason, missing = None, "", ""
        try:
            if not self.other:
                if isinstance(self.of, str):
                    owner, _, score = self.of.partition(":")
                    ours = values[owner][score]
                elif self.of is not None:
                    ours = self.of(values)
                reason = self.reason if isinstance(self.reason, str) else self.reason(values)
        except KeyError as absent:
            missing = f"no score {absent}"
        return Published(
            self.name, ours, self.theirs, self.tolerance, self.unit, self.claim, reason,
            self.source, self.expected, self.drift, missing, self.window, self.other, self.setting,
        )  # fmt: skip
