"""Which settings of a filter say how noisy its model and its measurements are."""

from dataclasses import dataclass


@dataclass(frozen=True)
class NoiseSettings:
    """Names of a filter's settings: of the `process`, of a `measurement` and at the `start`; ""
    where it has none."""

    process: str = ""
    measurement: str = "R"
    start: str = ""
