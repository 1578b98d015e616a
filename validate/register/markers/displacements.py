"""Displacements of points of a body: at one instant, as from particle tracking, and since rest.

Marker displacements since rest: layout errors cancel; a wrong rotation does not.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import RegistrationError
from validate.fem.assembly.locate import Rows, require_inside
from validate.recording.scales import another_unit
from validate.recording.types import Markers
from validate.register.markers.markers import MarkerObservation
from validate.register.observation import (
    AnyDraw,
    Deviation,
    Role,
    Selection,
    Simulated,
    frame_at,
    from_rest,
)
from validate.scene.mesh import Mesh

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


def rested(markers: Markers, still: float) -> tuple[Markers, tuple[str, ...], int]:
    """Return the markers with their mean over the first `still` s as the first sample, those that
    were not seen then, and the fewest samples such a mean is of.

    Raises `RegistrationError` where none of them was seen.
    """
    early = markers.x[markers.t <= markers.t[0] + still]
    seen = np.isfinite(early).all(axis=2)
    kept: Ints = np.flatnonzero(seen.any(axis=0))
    if len(kept) == 0:
        raise RegistrationError(
            f"none of {len(markers.names)} markers is visible in the first {still:g} s, at rest; "
            "--set seen.still=LONGER, or start the recording where they are visible"
        )
    first = np.array([early[seen[:, j], j].mean(axis=0) for j in kept])
    x = markers.x[:, kept].copy()
    x[0] = first
    names = tuple(markers.names[j] for j in kept)
    unseen = tuple(n for n in markers.names if n not in names)
    return replace(markers, names=names, x=x), unseen, int(seen[:, kept].sum(axis=0).min())


def noise(markers: Markers) -> float:
    """m per axis: what was declared, or more, by the median of second differences."""
    bend = np.diff(markers.x, n=2, axis=0)
    seen = np.abs(bend[np.isfinite(bend)])
    estimated = 1.4826 * float(np.median(seen)) / np.sqrt(6) if len(seen) else 0.0
    return max(markers.sd, float(estimated))


def since_rest(
    whole: MarkerObservation, mesh: Mesh, sd: float, samples: int, stands: float
) -> MarkerObservation:
    """Return the registered markers from where they stood at rest, a mean of so many samples; `sd`
    m.

    Raises `RegistrationError` for one that stands off the body by more than `stands` m, with the
    factor where its unit is another one.
    """
    rest: Floats = whole.x[0]
    rows = Rows.standing(mesh, rest)
    try:
        require_inside(rows, whole.names, stands)
    except RegistrationError as error:
        size = float(np.ptp(mesh.nodes, axis=0).max())
        seen = Markers(np.arange(len(whole.x), dtype=float), whole.names, whole.x, 0.0, "body")
        unit = another_unit(seen, size)
        raise RegistrationError(
            f"{error}; {unit or 'for markers on stalks give their length: --set seen.stands=15mm'}"
        ) from None
    moved = np.nan_to_num(whole.x - rest)
    most = moved[np.linalg.norm(moved, axis=2).max(axis=1).argmax()]
    centre = np.broadcast_to(whole.rest.mean(axis=0), rest.shape)
    there, here = (whole.registration.tre_at(p) for p in (centre + most, centre))
    turned = np.sqrt(np.maximum(there**2 - here**2, 0.0))
    shared = np.full(len(rest), np.sqrt(3 / samples) * sd)
    return replace(
        whole, rest=rest, positions=rows, sd=max(sd, 1e-12), axis_sd=(),
        tre=np.hypot(turned, shared),
    )  # fmt: skip
