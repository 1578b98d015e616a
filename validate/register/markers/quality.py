"""Registration of named markers: fit, quality, and suspicious points.

Fit on the rest state once, rigid, then freeze: refitting at every step, or fitting a free matrix,
absorbs the deformation that is to be compared. Nothing is dropped or relabelled in silence: markers
not seen, excluded or outlying are named; mirrored and permuted markers are errors.

What the points cannot show: a planar 3-D set mirrored within its plane (unless `up` declares its
side), labels wrong by a symmetry of the set, an offset common to all markers (with a free scale, a
common stretch too), and any error of the frame the target is given in.
"""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike

from validate.arrays import Floats, checked, rms
from validate.errors import RegistrationError
from validate.parameters import quantity
from validate.register.markers import measures
from validate.register.markers.measures import (
    FEWEST,
    Fit,
    Mask,
    Outlier,
    Reflection,
    Scale,
    label_fault,
)
from validate.register.markers.transform import (
    Similarity,
    Up,
    check_spread,
    covariance_of,
    fit_plane,
    fit_two_step,
    fit_weighted,
    spread,
    weighted_covariance,
)

# --- settings of the fit of markers to their layout ----------------------------------------------

Method = Literal["rigid", "similarity", "two_step", "two_step_scaled"]


@dataclass(frozen=True)
class MarkerFit:
    """Fitted once, on the rest state. What is left out of the fit is compared like any other."""

    method: Method = quantity("rigid", "1", "marker registration, on the rest state only")
    sd: tuple[float, ...] = quantity(
        (), "m", "noise of a marker along each axis of the tracker's frame; none: as recorded"
    )
    exclude: tuple[str, ...] = quantity((), "1", "markers left out of the fit, still compared")
    robust: bool = quantity(False, "1", "leave outliers out of the fit, still compared")

    def noise(self, recorded: float) -> float | tuple[float, ...]:
        """Return the noise m that is used: one for all axes, or one for each."""
        return self.sd if len(self.sd) > 1 else (*self.sd, recorded)[0]


# --- registration of named markers: fit, quality, and suspicious points --------------------------

LINE = 3.0  # spread across the markers' line, over the noise, that a rotation about it needs


@dataclass(frozen=True)
class Registration:
    """T_target_from_source with the residuals of the k markers that entered the fit.

    names (k,), markers (k, d) m their positions in the target frame, residuals (k, d) m mapped
    source minus target. `missing` were NaN, `excluded` were asked for, `rejected` are outliers that
    a robust fit left out; other `outliers` stay in it. `scale` is fitted whether it is used or not.
    `noise` (3, 3) m^2, in the source frame, where it differs between directions.
    """

    transform: Similarity
    names: tuple[str, ...]
    markers: Floats
    residuals: Floats
    expected_sd: float
    method: Method
    reflection: Reflection
    scale: Scale
    noise: Floats | None = None
    outliers: tuple[Outlier, ...] = ()
    missing: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    rejected: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        shape = (len(self.names), len(self.transform.t))
        for name in ("markers", "residuals"):
            value = checked(getattr(self, name), f"{name} [m]", shape, error=RegistrationError)
            object.__setattr__(self, name, value)

    @property
    def k_effective(self) -> int:
        """Markers in the fit."""
        return len(self.names)

    @property
    def fre(self) -> float:
        """Fiducial registration error: rms length of the residuals, m. No measure of accuracy."""
        return rms(self.residuals)

    @property
    def fle(self) -> float:
        """Fiducial localisation error estimated from the FRE, rms length, m."""
        k, d = self.residuals.shape
        return measures.localisation_error(self.fre, k, d, _scaled(self.method))

    def tre_at(self, points: ArrayLike) -> Floats:
        """Predicted target registration error, rms (m,) m, at points (m, d) m of the target frame.

        Fitzpatrick 1998 with the estimated FLE; excludes what the points cannot show.
        """
        error: Floats = np.sqrt(np.trace(self._covariance(points), axis1=1, axis2=2))
        return error

    def _covariance(self, points: ArrayLike) -> Floats:
        d = len(self.transform.t)
        at = checked(points, "target points [m]", (None, d), error=RegistrationError)
        if self.noise is not None:
            return weighted_covariance(at, self.markers, self.noise, self.transform)
        return measures.target_covariance(at, self.markers, self.fle, _scaled(self.method))

    @classmethod
    def of(
        cls,
        names: Sequence[str],
        source: ArrayLike,
        target: ArrayLike,
        *,
        method: Method = "rigid",
        expected_sd: ArrayLike,
        exclude: Sequence[str] = (),
        robust: bool = False,
        up: Up | None = None,
    ) -> Self:
        """Register named markers: source (k, d) m measured, target (k, d) m, NaN rows = not seen.

        expected_sd: declared measurement noise, m per axis, 0 for exact data; or for the rigid
        method three along the source's axes, or a covariance (3, 3) m^2: the fit is then weighted,
        and what may be noise is judged by the worst direction. `up`: directions in the source and
        target frame to the same side of a planar marker set; it alone reveals a mirror within the
        plane. Methods: rigid; similarity (scale free); two_step and two_step_scaled (paper 000;
        3-D, planar).

        A residual that noise exceeds with probability `P_EXCESS` is explained in this order:
        mirrored or permuted markers raise `RegistrationError` with both residuals; outliers and an
        unexplained excess are findings. An outlier that moves the others by more than twice the
        uncertainty of the fit without it raises `RegistrationError`, unless `robust`: least squares
        are then repeated without the outliers, weights 0 or 1 (Rousseeuw & Leroy (1987), reweighted
        least squares). Raises `RegistrationError` also for fewer than `FEWEST` markers, degenerate
        sets, a set no thicker across its line than `LINE` times the noise, and unknown names.
        """
        x, y, kept, missing = _used(names, source, target, exclude)
        C = _anisotropic(expected_sd, method)
        declared = (
            float(np.sqrt(np.linalg.eigvalsh(C)[-1]))
            if C is not None
            else float(np.asarray(expected_sd))
        )
        _check_settings(method, declared, x, y)
        plain = _fitter(method, up)
        fit = plain if C is None else partial(_weighted, first=plain, C=C)
        noise = max(declared, measures.ROUNDING * float(spread(y)[0]))
        mirror = measures.reflection(x, y, plain, _across(x.shape[1], up))
        bound = noise * np.sqrt(measures.chi_square_bound(_freedom(y, method)) / len(y))
        if mirror.proper > bound:
            if measures.looks_mirrored(mirror, bound):
                raise RegistrationError(
                    f"markers seem mirrored: residual {1e3 * mirror.proper:.3g} mm by a rotation, "
                    f"{1e3 * mirror.improper:.3g} mm by a reflection; check axis signs "
                    "and handedness"
                )
            fault = label_fault(kept, x, y, plain, noise)
            if fault is not None:
                raise RegistrationError(fault)
        outliers = measures.find_outliers(kept, x, y, noise, _scaled(method))
        regular = ~np.isin(kept, [o.name for o in outliers])
        if outliers and not robust:
            _refuse_moved(outliers, x, y, regular, fit, noise, _scaled(method))
        scale = measures.fitted_scale(x[regular], y[regular], noise)
        findings = [
            *_left_out(len(names), missing, tuple(exclude)),
            *_outlying(outliers, robust),
            *_other_size(scale, _scaled(method)),
            *_excess(x[regular], y[regular], fit, noise, len(outliers), method),
        ]
        used = regular if robust else np.ones(len(kept), bool)
        transform = fit(x[used], y[used])
        return cls(
            transform=transform,
            names=tuple(n for n, use in zip(kept, used, strict=True) if use),
            markers=y[used],
            residuals=transform.apply(x[used]) - y[used],
            expected_sd=declared,
            method=method,
            reflection=mirror,
            scale=scale,
            noise=C,
            outliers=outliers,
            missing=missing,
            excluded=tuple(exclude),
            rejected=tuple(o.name for o in outliers) if robust else (),
            findings=tuple(findings),
        )


def _used(
    names: Sequence[str], source: ArrayLike, target: ArrayLike, exclude: Sequence[str]
) -> tuple[Floats, Floats, tuple[str, ...], tuple[str, ...]]:
    """Points and names that enter the fit, and the names that were not seen."""
    k = len(names)
    if len(set(names)) != k:
        raise RegistrationError(f"markers: {k} names, {len(set(names))} different ones")
    for name in exclude:
        if name not in names:
            near = difflib.get_close_matches(name, names, 1) or list(names[:1])
            raise RegistrationError(f"exclude: no marker '{name}' among {k}; nearest is {near}")
    x = checked(source, "source markers [m]", (k, None), nan=True, error=RegistrationError)
    y = checked(target, "target markers [m]", x.shape, nan=True, error=RegistrationError)
    seen = [bool(row.all()) for row in np.isfinite(np.hstack([x, y]))]
    wanted = [name not in exclude for name in names]
    use = np.array([ok and want for ok, want in zip(seen, wanted, strict=True)])
    missing = tuple(n for n, ok, want in zip(names, seen, wanted, strict=True) if want and not ok)
    if use.sum() < FEWEST:
        raise RegistrationError(
            f"markers: {int(use.sum())} of {k} usable ({len(missing)} not visible, {len(exclude)} "
            f"excluded); a registration with a residual needs {FEWEST}: add markers"
        )
    return x[use], y[use], tuple(n for n, ok in zip(names, use, strict=True) if ok), missing


def _check_settings(method: str, expected_sd: float, x: Floats, y: Floats) -> None:
    if method not in get_args(Method):
        raise RegistrationError(f"method '{method}': expected one of {get_args(Method)}")
    if not (np.isfinite(expected_sd) and expected_sd >= 0):
        raise RegistrationError(f"expected_sd {expected_sd:g} m is not a number >= 0")
    for points, name in ((x, "source markers"), (y, "target markers")):
        check_spread(points, name)
        values = spread(points)
        across = float(values[points.shape[1] - 2])
        if across < LINE * expected_sd:
            shown = ", ".join(f"{1e3 * v:.3g}" for v in values)
            raise RegistrationError(
                f"{name}: {len(points)} points on a line within the noise (spread {shown} mm, "
                f"noise {1e3 * expected_sd:.3g} mm, needed {LINE:g} times it): add one off the line"
            )


def _anisotropic(sd: ArrayLike, method: Method) -> Floats | None:
    """The noise's covariance (3, 3) m^2, None for one sd."""
    given = np.asarray(sd, dtype=np.float64)
    if given.ndim == 0:
        return None
    if method != "rigid":
        raise RegistrationError(f"noise by direction with method '{method}': use method rigid")
    return covariance_of(given)


def _weighted(source: Floats, target: Floats, *, first: Fit, C: Floats) -> Similarity:
    return fit_weighted(source, target, C, first(source, target))


def _fitter(method: Method, up: Up | None) -> Fit:
    if method.startswith("two_step"):
        return partial(fit_two_step, up=up, scale=_scaled(method))
    free = measures.least_squares(_scaled(method))
    if up is None:
        return free
    return partial(_keep_side, free=free, up=up, scaled=_scaled(method))


def _keep_side(source: Floats, target: Floats, *, free: Fit, up: Up, scaled: bool) -> Similarity:
    """The free fit, unless it turns the marker plane over: then the two-step one, which cannot."""
    onto = fit_plane(target, "target markers", up[1]).axes[:, 2]
    transform = free(source, target)
    side = transform.R @ fit_plane(source, "source markers", up[0]).axes[:, 2]
    return transform if side @ onto > 0 else fit_two_step(source, target, up=up, scale=scaled)


def _scaled(method: Method) -> bool:
    return method in ("similarity", "two_step_scaled")


def _freedom(y: Floats, method: Method) -> int:
    return int(y.size) - measures.fit_parameters(y.shape[1], _scaled(method))


def _across(d: int, up: Up | None) -> Floats:
    """A mirror plane's normal; with `up` one that keeps the declared side."""
    if up is None:
        first: Floats = np.eye(d)[0]
        return first
    direction = np.asarray(up[0], dtype=np.float64)
    across: Floats = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    return across


def _left_out(k: int, missing: tuple[str, ...], excluded: tuple[str, ...]) -> list[str]:
    said = ((missing, "not visible (NaN), left out"), (excluded, "excluded on request"))
    return [f"{len(who)} of {k} markers {what}: {', '.join(who)}" for who, what in said if who]


def _refuse_moved(
    outliers: Sequence[Outlier], x: Floats, y: Floats, regular: Mask, fit: Fit, noise: float,
    scaled: bool,
) -> None:  # fmt: skip
    """How far the outliers move the other markers, against what the fit without them leaves."""
    whole, x, y = fit(x, y), x[regular], y[regular]
    without = fit(x, y)
    k, d = x.shape
    fle = measures.localisation_error(rms(without.apply(x) - y), k, d, scaled)
    own = max(noise * np.sqrt(d), fle)
    covariance = measures.target_covariance(y, y, own, scaled)
    doubt = float(np.sqrt(np.trace(covariance, axis1=1, axis2=2).mean()))
    moved = rms(whole.apply(x) - without.apply(x))
    if moved > 2 * doubt:
        names = ",".join(o.name for o in outliers)
        far = ", ".join(f"{o.name} by {1e3 * o.residual:.3g} mm" for o in outliers)
        raise RegistrationError(
            f"outliers among the markers ({far}) shift the others by {1e3 * moved:.3g} mm, "
            f"twice the registration's uncertainty is {2e3 * doubt:.3g} mm; leave them out of the "
            f"fit: set registration.exclude={names} or registration.robust=true"
        )


def _outlying(outliers: Sequence[Outlier], robust: bool) -> list[str]:
    fate = "left out by the robust fit" if robust else "in the fit (exclude it to leave it out)"
    return [
        f"marker {o.name} is an outlier: {1e3 * o.residual:.3g} mm from the position predicted by "
        f"the others; it is {fate}"
        for o in outliers
    ]


def _other_size(scale: Scale, used: bool) -> list[str]:
    if abs(scale.value - 1) <= scale.half:
        return []
    return [
        f"the markers are {scale.value:.5f} +- {scale.half:.2g} times (99.9 %) as large as their "
        f"layout, and this scale is {'used' if used else 'not used'}; check units and calibration"
    ]


def _excess(
    x: Floats, y: Floats, fit: Fit, noise: float, outliers: int, method: Method
) -> list[str]:
    """The excess that the outliers, already left out of x and y, do not explain."""
    squared = len(y) * rms(fit(x, y).apply(x) - y) ** 2
    dof = _freedom(y, method)
    if squared <= noise**2 * measures.chi_square_bound(dof):
        return []
    per_axis = float(np.sqrt(squared / dof))
    without = f" without {outliers} outliers" if outliers else ""
    return [
        f"residual{without} {1e3 * per_axis:.3g} mm per axis is {per_axis / noise:.3g} times the "
        f"noise of {1e3 * noise:.3g} mm (declared, or rounding); check marker names and layout"
    ]


@dataclass(frozen=True)
class AsDeclared(Registration):
    """The identity, without residuals: how well the frames agree is the word of who declared it."""

    @property
    def fle(self) -> float:
        return 0.0

    def tre_at(self, points: ArrayLike) -> Floats:
        """Zeros (m,) m at points (m, d) m: what was declared has no error of a fit."""
        return np.zeros(len(np.asarray(points)))


def as_declared(names: Sequence[str], places: Floats, sd: float) -> AsDeclared:
    """Return the markers at places (k, 3) m of both frames, with noise `sd` m per axis."""
    return AsDeclared(
        Similarity(np.eye(3), np.zeros(3)), tuple(names), places, np.zeros_like(places), sd,
        "rigid", Reflection(0.0, np.inf), Scale(1.0, 0.0),
    )  # fmt: skip
