"""Pressure-volume curve of a cavity in a linear body: exact cubic, linearisation, slopes.

With fixed normals the volume is a polynomial in the amounts z of the response columns; along one
pressure it is a cubic (a quadratic in the plane). Source: paper 000, section 3.3.
"""

from dataclasses import dataclass

import numpy as np

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.system import Responses

ROUNDING = 4e-15  # relative volume error that rounding alone leaves
NEWTON_STEPS = 30
RATIOS = np.linspace(0.7, 1.3, 61)  # of the volume, over which the paper fits its line


def still(responses: Responses) -> Floats:
    """(1, z) (1 + m,) with every drive and pressure at zero."""
    return np.asarray(np.eye(1 + len(responses.fields))[0])


def cubic(form: Floats, z: Floats, p: int) -> tuple[float, float, float, float]:
    """Coefficients of V m^3 in the amount at `p`, highest first, the others of (1, z) as they
    are."""
    rest = z.copy()
    rest[p] = 0.0
    W = form @ rest
    y = W @ rest
    return float(form[p, p, p]), 3 * float(W[p, p]), 3 * float(y[p]), float(y @ rest)


def slopes(responses: Responses, z: Floats) -> Floats:
    """d(V_i/V0_i)/dP_j (c, c) in 1/Pa at (1, z)."""
    own = responses.volumes @ z @ z
    return np.asarray(3 * own[:, responses.drives + 1 :] / responses.rest_volumes[:, None])


def tuned_gain(responses: Responses, cavity: int = 0, z: Floats | None = None) -> float:
    """Kp Pa: least-squares slope of P over V/V0, 61 points uniform in V/V0 from 0.7 to 1.3.

    Drives and other cavities stand at (1, z), at zero where none is given.
    """
    pressures = pressure_at_volume(responses, RATIOS, cavity, z)
    return float(np.polyfit(RATIOS, pressures, 1)[0])


def pressure_at_volume(
    responses: Responses, ratios: Floats, cavity: int = 0, z: Floats | None = None
) -> Floats:
    """P (k,) Pa that gives V/V0 = ratios (k,) (Fig. 4a), drives and other cavities at (1, z).

    Raises `SceneError` when no pressure does: a ratio of zero or less, or below the smallest.
    """
    amounts = still(responses) if z is None else z
    return pressure_of(responses.volumes[cavity], responses.drives + 1 + cavity, ratios, amounts)


def pressure_of(form: Floats, p: int, ratios: Floats, z: Floats | None = None) -> Floats:
    """The same from a volume polynomial, whose amount `p` is the pressure."""
    amounts = np.eye(len(form))[0] if z is None else z
    terms, V0 = np.array(cubic(form, amounts, p)), float(form[0, 0, 0])
    return np.array([_cubic_root(terms, float(ratio), V0) for ratio in ratios])


def _cubic_root(terms: Floats, ratio: float, V0: float) -> float:
    """The root on the branch through zero: no turning point of the cubic lies in between."""
    shifted = terms.copy()
    shifted[3] -= ratio * V0
    turns = _real_roots(np.asarray(np.polyder(terms), dtype=np.float64))
    roots = [
        p for p in _real_roots(shifted) if not ((turns > min(p, 0.0)) & (turns < max(p, 0.0))).any()
    ]
    if ratio <= 0 or not roots:
        raise SceneError(f"no pressure gives V/V0 = {ratio:g}; use a ratio nearer to 1")
    return float(min(roots, key=abs))


def _real_roots(polynomial: Floats) -> Floats:
    roots = np.roots(polynomial)
    return np.asarray(roots.real[np.abs(roots.imag) <= 1e-9 * (1 + np.abs(roots.real))])


@dataclass(frozen=True)
class Root:
    """A pressure P Pa, the updates it took, the volume m^3 there; `failed` says why it is none."""

    P: float
    updates: int
    volume: float
    failed: str


def root_of(
    terms: tuple[float, float, float, float],
    V0: float,
    start: float = 0.0,
    ratio: float = 1.0,
    softness: float = 0.0,
) -> Root:
    """Where the cubic `terms` is (ratio - softness P) V0, by Newton from `start` Pa, on the branch
    through P = 0; softness in 1/Pa. A negative softness is a pressure that grows with the volume:
    stable where the body's own grows faster, which is where the left side falls with P."""
    a, b, own, V = terms
    c, d = own + softness * V0, V - ratio * V0
    scale = V0 * max(1.0, abs(ratio)) if softness else V0 * ratio
    P, failed = start, ""
    for updates in range(NEWTON_STEPS):
        error = ((a * P + b) * P + c) * P + d
        slope = (3 * a * P + 2 * b) * P + c
        if abs(error) <= ROUNDING * scale or slope == 0:
            break
        step = error / slope
        P -= step
        if abs(step) <= 1e-14 * abs(P):
            updates += 1
            break
    if not abs(error) <= 1e-9 * scale:
        failed = f"error {error / scale:.2%} after {updates} Newton steps"
    elif softness < 0 and not rises(-a, -b, -c, P):
        failed = (
            f"P = {P:.4g} Pa is unstable: it rises faster with the volume than the "
            "pressure of the body"
        )
    elif softness >= 0 and not rises(a, b, c, P):
        failed = (
            f"P = {P:.4g} Pa is a spurious root: at lower pressures the volume falls as "
            "pressure rises"
        )
    return Root(P, updates, ((a * P + b) * P + own) * P + V, failed)


def rises(a: float, b: float, c: float, P: float) -> bool:
    """Return whether a P^3 + b P^2 + c P + d grows with P all the way from 0 to P."""
    turn = -b / (3 * a) if a else 0.0
    places = [0.0, P, *([turn] if min(P, 0.0) < turn < max(P, 0.0) else [])]
    return all((3 * a * x + 2 * b) * x + c > 0 for x in places)


def least_slope(responses: Responses, z: Floats, softness: float = 0.0) -> float:
    """Return the least dV_i/dP_i of any cavity, `softness` V0 m^3/Pa added, on the way t P, 0 <= t
    <= 1: a quadratic in t, exactly. Of a negative softness it is what that leaves: less than 0
    where a pressure that grows with the volume outweighs the body."""
    drives = responses.drives
    empty = z.copy()
    empty[drives + 1 :] = 0
    least, sign = np.inf, -1.0 if softness < 0 else 1.0
    for i, (form, V0) in enumerate(zip(responses.volumes, responses.rest_volumes, strict=True)):
        own = form[drives + 1 + i]
        more = softness * float(V0) / 3
        start, middle, end = (
            sign * (float(y @ own @ y) + more) for y in (empty, (empty + z) / 2, z)
        )
        b, c = 4 * middle - 3 * start - end, 2 * (start + end) - 4 * middle
        t = min(max(-b / (2 * c), 0.0), 1.0) if c > 0 else 0.0
        least = min(least, start, end, start + t * (b + t * c))
    return least
