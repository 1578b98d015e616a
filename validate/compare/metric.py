"""What a metric of two fields is: a name, a formula, units, what it rests on, a definition."""

from collections.abc import Callable
from dataclasses import dataclass

from validate.compare.pair import Pair
from validate.compare.score import Score


@dataclass(frozen=True)
class Metric:
    """`value(pair)` in `units` (2-D, 3-D), resting on `count(pair)` points of a kind `of`.

    `symmetric`: the same when run and reference change places. `value` raises `ComparisonError`
    where the metric does not exist (0/0, a crossing boundary), with the reason.
    """

    name: str
    value: Callable[[Pair], float]
    units: tuple[str, str]
    count: Callable[[Pair], int]
    of: str
    definition: str
    symmetric: bool

    def score(self, pair: Pair) -> Score:
        """The metric of the pair as a score against the reference."""
        unit = self.units[pair.on.dimension - 2]
        words = f"{self.definition}; {pair.where}; counted: {self.of}"
        return Score(self.name, self.value(pair), unit, self.count(pair), pair.other.name, words)


def count_nodes(pair: Pair) -> int:
    return len(pair.on.nodes)
