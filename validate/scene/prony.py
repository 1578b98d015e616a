"""Viscoelasticity as a Prony series: how the isochoric stress of a law relaxes."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.errors import SceneError
from validate.parameters import quantity


@dataclass(frozen=True)
class Prony:
    """G(t) = G (1 + sum g_i exp(-t/tau_i)): the material's E and law are the relaxed ones.

    Codes whose series is of the instantaneous modulus, G_0 (1 - sum h_i (1 - exp(-t/tau_i))), print
    h_i = g_i/(1 + sum g), and E_0 = (1 + sum g) E of an incompressible body. `statics` says which
    limit schemes without time stand for; those with time walk through both.
    """

    g: tuple[float, ...] = quantity((), "1", "moduli of the branches over the relaxed one")
    tau: tuple[float, ...] = quantity((), "s", "relaxation times of the branches")
    statics: Literal["relaxed", "instantaneous"] = quantity(
        "relaxed", "1", "limit that statics use: long-term or instantaneous"
    )

    def __post_init__(self) -> None:
        numbers = np.array([*self.g, *self.tau])
        if len(self.g) != len(self.tau):
            raise SceneError(
                f"Prony series of {len(self.g)} moduli and {len(self.tau)} times: expected one "
                "of each for every branch"
            )
        if not (np.isfinite(numbers).all() and (numbers > 0).all()):
            raise SceneError(
                f"Prony series g = {self.g}, tau = {self.tau} s: expected positive numbers, "
                "otherwise a branch creates energy"
            )

    @property
    def instant(self) -> float:
        """Instantaneous over relaxed modulus."""
        return 1 + sum(self.g)
