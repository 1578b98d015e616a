"""Surface of an inclusion from a sweep of parallel images (paper 000, section 4.4).

The paper takes images at 2 mm steps across the inclusion's long axis and reads centre and radius
off each by hand. Here each slice keeps its free outline beside, because the circle is an assumption
whose error is to be reported. Where the inclusion vanishes between two slices is estimated from
the two outermost ones as the end of a sphere.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from validate.arrays import Floats, checked, rms
from validate.errors import RecordingError, RegistrationError
from validate.recording.outlines.outline import Outline, extract_outline
from validate.recording.types import Contours, Frames
from validate.register.outlines.sections import require_rigid
from validate.scene.geometries.inclusion import SlicedShape

_ANGLES = 72
_LEAST = 3  # slices with the inclusion
_BEYOND = 1.5  # steps the inclusion may go on behind its last outline
_GAP = 1.5  # median steps between neighbouring slices: above, one is missing
_OUT_OF_ROUND = 0.3  # of the radius, rms: above, the outline is no section of an inclusion
_ORDERS = 6  # of the harmonics that an outline is smoothed to


@dataclass(frozen=True)
class Stack:
    """Outlines of parallel slices: positions (n,) m along the image normal, centres (n, 2) m,

    radii (n,) m of equal area, outlines n x (k, 2) m in image coordinates, ends (2,) m where the
    inclusion vanishes, sd m of the outlines, sd_ends m. pose is T_frame_from_image at position 0.
    """

    pose: Floats
    positions: Floats
    centres: Floats
    radii: Floats
    outlines: tuple[Floats, ...]
    ends: Floats
    sd: float
    sd_ends: float

    def __post_init__(self) -> None:
        n = len(self.positions)
        shapes = {"pose": (4, 4), "positions": (n,), "centres": (n, 2), "radii": (n,), "ends": (2,)}
        for name, shape in shapes.items():
            value = checked(getattr(self, name), f"stack {name}", shape, error=RegistrationError)
            object.__setattr__(self, name, value)

    @property
    def off_round(self) -> Floats:
        """Radial distance rms (n,) m of every outline from its circle: what the circle leaves."""
        rings = zip(self.outlines, self.centres, self.radii, strict=True)
        return np.array([rms(np.linalg.norm(o - c, axis=1) - r) for o, c, r in rings])


def stacked(sweep: Contours, t: Floats, positions: Floats) -> Stack:
    """Return the stack of outlines whose image plane lay at positions (m,) m along its normal at
    times t (m,) s; `sweep.pose` is that at position 0.

    Raises `RegistrationError` for fewer than 3 slices, two at one place, one missing between
    others, neighbours that share no point, outlines far from a circle, or an inclusion that is
    still seen where the sweep begins or ends.
    """
    require_rigid(sweep.pose, "sweep")
    at = _placed(sweep.t, t, positions)
    order = np.argsort(at, kind="stable")
    at, outlines = at[order], tuple(sweep.outlines[i] for i in order)
    # The step m between slices at growing positions `at` (n,) m, none missing, none twice.
    gaps = np.diff(at)
    step = float(np.median(gaps))
    near, far = int(gaps.argmin()), int(gaps.argmax())
    if gaps[near] <= 0.1 * step:
        raise RegistrationError(
            f"two slices lie at {1e3 * at[near]:.2f} and {1e3 * at[near + 1]:.2f} mm, in "
            f"steps of {1e3 * step:.2f} mm otherwise; keep one of them"
        )
    if gaps[far] > _GAP * step:
        raise RegistrationError(
            f"no slice between {1e3 * at[far]:.2f} and {1e3 * at[far + 1]:.2f} mm, and "
            f"steps of {1e3 * step:.2f} mm otherwise; outline the missing image"
        )

    discs = [shapely.Polygon(o) for o in outlines]
    centres = np.array([shapely.get_coordinates(d.centroid)[0] for d in discs])
    radii = np.sqrt([d.area / np.pi for d in discs])
    ends = np.array([_end(at[:2][::-1], radii[:2][::-1], step), _end(at[-2:], radii[-2:], step)])
    if positions.min() >= at[0] or positions.max() <= at[-1]:
        raise RegistrationError(
            "the inclusion reaches the first or last image of the sweep; its end is not visible"
        )
    stack = Stack(
        sweep.pose, at, centres, radii, outlines, ends, sweep.sd, float(step / np.sqrt(12))
    )
    worst = int((stack.off_round / stack.radii).argmax())
    if stack.off_round[worst] > _OUT_OF_ROUND * stack.radii[worst]:
        raise RegistrationError(
            f"the slice at {1e3 * stack.positions[worst]:.2f} mm is not a section of an inclusion: "
            f"{1e3 * stack.off_round[worst]:.2f} mm rms off a radius of "
            f"{1e3 * stack.radii[worst]:.2f} mm; repeat its outline"
        )
    moved = np.linalg.norm(np.diff(stack.centres, axis=0), axis=1)
    apart = moved - np.minimum(stack.radii[:-1], stack.radii[1:])
    i = int(apart.argmax())
    if apart[i] > 0:
        raise RegistrationError(
            f"the slices at {1e3 * stack.positions[i]:.2f} and {1e3 * stack.positions[i + 1]:.2f} "
            f"mm cross: their centres lie {1e3 * moved[i]:.2f} mm from each other, more than a "
            f"radius; outline them again"
        )
    return stack


def _placed(seen: Floats, t: Floats, positions: Floats) -> Floats:
    """Positions (n,) m at the times (n,) s of the outlines."""
    positions = checked(positions, "positions", (len(t),), error=RegistrationError)
    if len(seen) < _LEAST:
        raise RegistrationError(
            f"{len(seen)} slices show the inclusion; {_LEAST} are needed: sweep in smaller steps "
            "or give its rough centre and radius"
        )
    if seen.min() < t[0] or seen.max() > t[-1]:
        raise RegistrationError(
            f"slices at {seen.min():.2f}..{seen.max():.2f} s, but the position of the plane is "
            f"known at {t[0]:.2f}..{t[-1]:.2f} s; record it over the whole sweep"
        )
    return np.asarray(np.interp(seen, t, positions))


def sweep_outlines(
    frames: Frames,
    *,
    centre: Sequence[float] | Floats | None = None,
    radius: float | None = None,
    bright: bool = False,
) -> Contours:
    """Outlines of the images of a sweep that show the inclusion, which lie side by side.

    The clearest of six slices is outlined first (with the rough centre and radius, if given), the
    others from there to both ends, each near its neighbour. Raises `RegistrationError` where no
    image shows an inclusion.
    """
    found = _tracked(frames, centre, radius, bright)
    kept = sorted(found)
    outlines = tuple(found[i].points for i in kept)
    sd = rms([found[i].sd for i in kept])
    return Contours(frames.t[kept], outlines, sd, frames.pose, frames.frame)


def _tracked(
    frames: Frames, centre: Sequence[float] | Floats | None, radius: float | None, bright: bool
) -> dict[int, Outline]:
    """Outlines by image: from the clearest one outward until nothing is found."""
    first, found = _clearest(frames, centre, radius, bright)
    outlines = {first: found}
    for direction in (1, -1):
        near, i = found, first + direction
        while 0 <= i < len(frames.images):
            here = _beside(frames, i, near, bright)
            if here is None:
                break
            outlines[i] = near = here
            i += direction
    return outlines


def _clearest(
    frames: Frames, centre: Sequence[float] | Floats | None, radius: float | None, bright: bool
) -> tuple[int, Outline]:
    """The image and outline of largest contrast and radius among some six images."""
    found: dict[int, Outline] = {}
    reason = ""
    step = max(len(frames.images) // 6, 1)
    for i in range(step // 2, len(frames.images), step):
        try:
            found[i] = extract_outline(
                frames.images[i], frames.m_per_px, centre=centre, radius=radius, bright=bright
            )
        except RecordingError as error:
            reason = str(error)
    if not found:
        raise RegistrationError(f"no slice shows an inclusion; the last one: {reason}")
    return max(found.items(), key=lambda pair: pair[1].contrast * pair[1].radius)


def _beside(frames: Frames, i: int, near: Outline, bright: bool) -> Outline | None:
    """The outline of image i that goes on from its neighbour's; None where there is none."""
    for shrink in (1.0, 0.7, 0.45):
        try:
            here = extract_outline(
                frames.images[i],
                frames.m_per_px,
                centre=near.centre,
                radius=shrink * near.radius,
                bright=bright,
            )
        except RecordingError:
            continue
        off = float(np.linalg.norm(here.centre - near.centre))
        if off < near.radius and here.radius < 1.6 * near.radius:
            return here
    return None


def _end(at: Floats, radii: Floats, step: float) -> float:
    """Where a sphere through the two outermost sections ends, not far behind the last of them.

    Squared radii are r^2 - (s - s0)^2: two sections give s0 and r. The end is kept between a tenth
    and `_BEYOND` of a step behind the last section.
    """
    outward = float(np.sign(at[1] - at[0]))
    apart = abs(float(at[1] - at[0]))
    fall = float(radii[0] ** 2 - radii[1] ** 2)
    middle = (fall / apart + apart) / 2  # of the sphere, behind the outer section, inward positive
    tip = -middle + float(np.sqrt(radii[1] ** 2 + middle**2))
    return float(at[1] + outward * np.clip(tip, 0.1 * step, _BEYOND * step))


def surface_of(stack: Stack, free: float = 0.0) -> SlicedShape:
    """Return the inclusion's surface in scene coordinates: circles as in the paper (0), the
    outlines (1),

    smoothed, or what lies between and beyond. Every section keeps its area.
    """
    rings = zip(stack.outlines, stack.centres, stack.radii, strict=True)
    away = np.array([_out_of_round(outline, centre) for outline, centre, _ in rings])
    squares = stack.radii[:, None] ** 2 + free * away
    radii = np.sqrt(np.maximum(squares, 0.0))
    return SlicedShape(stack.pose, stack.positions, stack.centres, radii, stack.ends)


def _out_of_round(outline: Floats, centre: Floats) -> Floats:
    """Squared radii (_ANGLES,) m^2 of an outline about its centre at equal angles, less their mean:
    harmonics 2 to `_ORDERS`, so that noise of single points stays out."""
    away = outline - centre
    angle = np.mod(np.arctan2(away[:, 1], away[:, 0]), 2 * np.pi)
    order = np.argsort(angle, kind="stable")
    angles = np.arange(_ANGLES) * (2 * np.pi / _ANGLES)
    squares = np.interp(angles, angle[order], (away**2).sum(axis=1)[order], period=2 * np.pi)
    waves = np.fft.rfft(squares)
    waves[:2], waves[_ORDERS + 1 :] = 0.0, 0.0
    return np.asarray(np.fft.irfft(waves, _ANGLES))
