"""Displacements of many points of a body at one instant, as from particle tracking."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats
from validate.fem.assembly.locate import Rows
from validate.register.draws import AnyDraw, from_rest
from validate.register.observation import Deviation, Role, Selection, Simulated, frame_at

_AXES = "xyz"


@dataclass(frozen=True)
class DisplacementObservation:
    """u (k, d) m measured at `points` (k, d) m of the mesh at t (1,) s; `sd` (d,) m of a component.

    Each axis is a quantity of its own, `<quantity>.x`: their noise differs.
    """

    name: str
    role: Role
    t: Floats
    points: Floats
    u: Floats
    positions: Rows
    sd: Floats
    quantity: str = "displacement"

    @property
    def units(self) -> Mapping[str, str]:
        return {f"{self.quantity}.{a}": "m" for a in _AXES[: self.u.shape[1]]}

    def simulated(self, u: Floats) -> Floats:
        """Displacements (k, d) m there under nodal ones (n, d) m."""
        return self.positions.apply(u)

    def deviations(self, run: Simulated, selection: Selection) -> tuple[Deviation, ...]:
        frame = frame_at(run, selection.instants(run))[-1]
        off = self.simulated(frame) - self.u
        return tuple(
            Deviation(
                quantity, off[:, [c]], "m", float(self.sd[c]), 0.0,
                f"displacement along {_AXES[c]} of the particles",
                scale=float(np.ptp(self.u[:, c])),
                reference=self.u[:, [c]],
                axes=(_AXES[c],),
            )
            for c, quantity in enumerate(self.units)
        )  # fmt: skip

    def left(self, run: Simulated) -> Floats:
        """Exact displacements less measured ones, flat (k d,) m."""
        moved = np.array([self.simulated(u).ravel() for u in run.u])
        return np.asarray(from_rest(run.t[run.at], moved, self.t)[-1] - self.u.ravel())

    def anew(self, left: Floats, draw: AnyDraw) -> "DisplacementObservation":
        """Return the points as far as `left` (k d,) m has them, noise drawn."""
        exact = self.u + left.reshape(self.u.shape)
        return replace(self, u=exact + draw.white(self.sd, exact.shape))

    def unanswered(self, run: Simulated) -> tuple[str, ...]:
        return ()

    def rows(self) -> Rows | None:
        return self.positions
