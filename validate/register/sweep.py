"""From a sweep of parallel images to the inclusion's surface (paper 000, section 4.4).

The paper takes images at 2 mm steps across the inclusion's long axis and reads centre and radius
off each by hand. Here each slice keeps its free outline beside, because the circle is an assumption
whose error is to be reported. Where the inclusion vanishes between two slices is estimated from
the two outermost ones as the end of a sphere.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from validate.arrays import Floats, checked, rms
from validate.errors import RecordingError, RegistrationError
from validate.recording.images.outline import Outline, extract_outline
from validate.recording.types import Frames
from validate.register.plane import require_rigid
from validate.scene.inclusion_shape import SlicedShape

_ANGLES = 72
_LEAST = 3  # slices with the inclusion
_BEYOND = 1.5  # steps the inclusion may go on behind its last outline


@dataclass(frozen=True)
class Stack:
    """Outlines of parallel slices: positions (n,) m along the image normal, centres (n, 2) m,

    radii (n,) m of equal area, outlines n x (k, 2) m in image coordinates, ends (2,) m where the
    inclusion vanishes, sd m of the outlines, sd_ends m. pose is T_frame_from_image at position 0.
    `empty` counts the images before and behind in which nothing was found.
    """

    pose: Floats
    positions: Floats
    centres: Floats
    radii: Floats
    outlines: tuple[Floats, ...]
    ends: Floats
    sd: float
    sd_ends: float
    empty: tuple[int, int]

    def __post_init__(self) -> None:
        n = len(self.positions)
        shapes = {"pose": (4, 4), "positions": (n,), "centres": (n, 2), "radii": (n,), "ends": (2,)}
        for name, shape in shapes.items():
            value = checked(getattr(self, name), f"stack {name}", shape, error=RegistrationError)
            object.__setattr__(self, name, value)


def sweep_stack(
    frames: Frames,
    positions: Floats,
    *,
    centre: Sequence[float] | Floats | None = None,
    radius: float | None = None,
    bright: bool = False,
) -> Stack:
    """The stack of a sweep: frame i lies at positions[i] m along the image normal of frames.pose.

    The clearest of six slices is outlined first (with the rough centre and radius, if given), the
    others from there to both ends, each near its neighbour. Raises `RegistrationError` for
    positions that do not grow, fewer than 3 slices with an inclusion, or an inclusion that reaches
    the first or last image.
    """
    require_rigid(frames.pose, "sweep")
    positions = checked(positions, "positions", (len(frames.images),), error=RegistrationError)
    if (np.diff(positions) <= 0).any():
        raise RegistrationError("positions of the slices do not grow; order the images along them")
    found = _tracked(frames, centre, radius, bright)
    kept = sorted(found)
    if len(kept) < _LEAST:
        raise RegistrationError(
            f"{len(kept)} of {len(frames.images)} slices show the inclusion, {_LEAST} are needed; "
            "sweep in smaller steps or give its rough centre and radius"
        )
    if kept[0] == 0 or kept[-1] == len(frames.images) - 1:
        raise RegistrationError(
            "the inclusion reaches the first or last image of the sweep; its end is not seen"
        )
    return _stack(frames, positions, [(i, found[i]) for i in kept])


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


def _stack(frames: Frames, positions: Floats, kept: list[tuple[int, Outline]]) -> Stack:
    at = positions[[i for i, _ in kept]]
    radii = np.array([o.radius for _, o in kept])
    first, last = kept[0][0], kept[-1][0]
    ends = [
        _end(at[:2][::-1], radii[:2][::-1], float(positions[first] - positions[first - 1])),
        _end(at[-2:], radii[-2:], float(positions[last + 1] - positions[last])),
    ]
    return Stack(
        frames.pose,
        at,
        np.array([o.centre for _, o in kept]),
        radii,
        tuple(o.points for _, o in kept),
        np.array(ends),
        rms([o.sd for _, o in kept]),
        float(np.diff(positions).max() / np.sqrt(12)),
        (first, len(frames.images) - 1 - last),
    )


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


def surface_of(stack: Stack, sections: Literal["circle", "free"] = "circle") -> SlicedShape:
    """The inclusion's surface in scene coordinates: circles as in the paper, or free outlines."""
    radii = np.repeat(stack.radii[:, None], _ANGLES, axis=1)
    if sections == "free":
        pairs = zip(stack.outlines, stack.centres, strict=True)
        radii = np.array([_polar(outline, centre) for outline, centre in pairs])
    return SlicedShape(stack.pose, stack.positions, stack.centres, radii, stack.ends)


def _polar(outline: Floats, centre: Floats) -> Floats:
    """Radii (72,) m of an outline about its centre at equal angles."""
    away = outline - centre
    angle = np.mod(np.arctan2(away[:, 1], away[:, 0]), 2 * np.pi)
    order = np.argsort(angle, kind="stable")
    angles = np.arange(_ANGLES) * (2 * np.pi / _ANGLES)
    radius = np.linalg.norm(away, axis=1)[order]
    return np.asarray(np.interp(angles, angle[order], radius, period=2 * np.pi))
