"""Two-step least-squares registration of planar markers (paper 000).

Gosline, Salcudean, Yan, "Haptic simulation of linear elastic media with fluid pockets" (2004),
section 4.5: the undeformed markers are fitted to a plane, then linear least squares compensates
for rotation and scaling within it.

Step 1: total least squares plane through each set (smallest singular vector of the centred points)
and the proper rotation that lays the source plane on the target plane.
Step 2: with in-plane coordinates as complex numbers a (source) and b (target), the linear least
squares factor z of  b = z a  is  z = a^H b / a^H a : angle arg z, scale |z|.

A plane has two sides, and only one of the two normals gives the right handedness. `up` declares
the side; without it the proper rotation with the lower residual of the two is taken. Laying the
plane on its wrong side fits a set mirrored within its plane, exactly: without `up` that mirror
cannot be seen from the points.

Departures: the paper fits a scale, and so lets its scale and shift enter the comparison; here the
scale is off unless asked for (`scale=True` replays the paper), and it acts along the normal too.
The paper does not say how it chooses the side of the plane.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from validate.arrays import Floats, checked
from validate.errors import RegistrationError
from validate.register.markers.transform import Similarity, check_spread

PLANAR = 0.5  # third over second rms spread above which a set has no plane to speak of

Up = tuple[ArrayLike, ArrayLike]


class Plane(NamedTuple):
    """Centroid (3,) m; `axes` (3, 3) right-handed columns: two in the plane, then the normal."""

    centre: Floats
    axes: Floats


def fit_plane(points: ArrayLike, name: str = "points", up: ArrayLike | None = None) -> Plane:
    """Return the total least squares plane of points (k, 3) m, its normal on the side of `up` (3,).

    Raises `RegistrationError` for degenerate sets, a set without a plane (third over second rms
    spread above `PLANAR`) and an `up` within the plane.
    """
    x = checked(points, f"{name} [m]", (None, 3), error=RegistrationError)
    check_spread(x, name)
    centre = x.mean(axis=0)
    _, values, Vt = np.linalg.svd(x - centre, full_matrices=True)
    if len(values) == 3 and values[2] > PLANAR * values[1]:
        shown = ", ".join(f"{1e3 * v / np.sqrt(len(x)):.3g}" for v in values)
        raise RegistrationError(
            f"{name}: not a plane (spread {shown} mm along principal axes, third over second above "
            f"{PLANAR:g}): use the rigid method, without `up`"
        )
    axes = Vt.T * np.array([1.0, 1.0, np.sign(np.linalg.det(Vt))])
    return _on_side(Plane(centre, axes), name, up)


def fit_two_step(
    source: ArrayLike, target: ArrayLike, *, up: Up | None = None, scale: bool = False
) -> Similarity:
    """T_target_from_source of planar markers by plane, then in-plane rotation (and scale).

    source, target (k, 3) m row by row the same points; `up`: directions (3,), (3,) in the source
    and in the target frame to the same side of the marker plane, e.g. that of the pen or camera.
    Raises `RegistrationError` as `fit_plane`, or when the in-plane angle is not determined.
    Source: paper 000, section 4.5; equal to `fit_rigid` on exactly planar data.
    """
    x = checked(source, "source points [m]", (None, 3), error=RegistrationError)
    y = checked(target, "target points [m]", x.shape, error=RegistrationError)
    up_source, up_target = up or (None, None)
    onto = fit_plane(y, "target points", up_target)
    side = fit_plane(x, "source points", up_source)
    first = _lay(x, y, side, onto, scale)
    if up is not None:
        return first
    second = _lay(x, y, _turned(side), onto, scale)
    return min((first, second), key=lambda T: float(((T.apply(x) - y) ** 2).sum()))


def _lay(x: Floats, y: Floats, side: Plane, onto: Plane, scale: bool) -> Similarity:
    """The fit that lays normal on normal."""
    a, b = _in_plane(x, side), _in_plane(y, onto)
    z = np.vdot(a, b) / np.vdot(a, a)
    if abs(z) ** 2 * np.vdot(a, a).real <= 1e-24 * np.vdot(b, b).real:
        raise RegistrationError(
            f"in-plane angle of {len(x)} points not determined (factor {abs(z):.1e}): check labels"
        )
    s = float(abs(z)) if scale else 1.0
    c, n = z.real / abs(z), z.imag / abs(z)
    turn = np.array([[c, -n, 0.0], [n, c, 0.0], [0.0, 0.0, 1.0]])
    R = onto.axes @ turn @ side.axes.T
    return Similarity(R, onto.centre - s * R @ side.centre, s)


def _in_plane(points: Floats, plane: Plane) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    local = (points - plane.centre) @ plane.axes
    complex_points: np.ndarray[tuple[int], np.dtype[np.complex128]] = local[:, 0] + 1j * local[:, 1]
    return complex_points


def _turned(plane: Plane) -> Plane:
    """The same plane seen from its other side; the axes stay right-handed."""
    return Plane(plane.centre, plane.axes * np.array([1.0, -1.0, -1.0]))


def _on_side(plane: Plane, name: str, up: ArrayLike | None) -> Plane:
    if up is None:
        return plane
    direction = checked(up, f"{name}: up", (3,), error=RegistrationError)
    along = float(plane.axes[:, 2] @ direction)
    if abs(along) <= 0.1 * np.linalg.norm(direction):
        angle = f"normal part {abs(along):.2g} of length {np.linalg.norm(direction):.2g}"
        raise RegistrationError(
            f"{name}: `up` lies in the marker plane ({angle}): point it to the side of the pen"
        )
    return plane if along > 0 else _turned(plane)
