"""Type of a metric: name, formula, unit, inputs and definition."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from validate.compare.score import Score


class Compared(Protocol):
    """What a metric is taken of: a run beside its reference."""

    @property
    def against(self) -> str:
        """Name of the reference."""
        ...

    @property
    def where(self) -> str:
        """On what the two are compared, in words."""
        ...

    @property
    def units(self) -> Mapping[str, object]:
        """What stands for the names in braces of a metric's unit."""
        ...


C_contra = TypeVar("C_contra", bound=Compared, contravariant=True)


@dataclass(frozen=True)
class Counted(Generic[C_contra]):
    """`number` of things of a kind `of` that a metric rests on."""

    of: str
    number: Callable[[C_contra], int]


@dataclass(frozen=True)
class Metric(Generic[C_contra]):
    """`value(compared)` in `unit`, as "m", or "m^{dimension}" filled in by what is compared.

    `symmetric`: the same when run and reference change places. `value` raises `ComparisonError`
    where the metric does not exist (0/0, a crossing boundary), with the reason.
    """

    name: str
    value: Callable[[C_contra], float]
    unit: str
    definition: str
    counted: Counted[C_contra]
    symmetric: bool = False

    def unit_of(self, compared: C_contra) -> str:
        return self.unit.format(**compared.units)

    def score(self, compared: C_contra, prefix: str = "") -> Score:
        """Return the score `<prefix><name>` against the reference."""
        words = f"{self.definition}; {compared.where}; counted: {self.counted.of}"
        value, count = self.value(compared), self.counted.number(compared)
        unit = self.unit_of(compared)
        return Score(prefix + self.name, value, unit, count, compared.against, words)
