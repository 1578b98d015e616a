"""Implausible scales of images, outlines and markers, and the unit that may be meant.

A recording whose metres are millimetres agrees with itself as well as any other, so it is asked
back where images enter.
"""

from dataclasses import replace

import numpy as np

from validate.arrays import Floats
from validate.recording.types import Contours, Frames, Markers, Recording

_PIXELS = (1e-6, 1e-2)  # m: sides of a pixel from a microscope's to a photograph's of a table
_EXTENTS = (1e-4, 5.0)  # m: of an image, from a cell's to a room's
_OUTLINES = (1e-5, 5.0)  # m: of an outline in such an image
_SPREADS = (1e-3, 50.0)  # m: of markers, from a biopsy's to a hall's
_UNITS = (("mm", 1e-3), ("um", 1e-6))
_OF_BODY = (0.01, 5.0)  # of a body's size: what its markers span or move, in the right unit


def odd_pixel(m_per_px: tuple[float, float], shape: tuple[int, int] | None = None) -> str:
    """What is odd about the size of a pixel, or of an image (h, w) of such; "" for nothing."""
    inside = _within(m_per_px, shape)
    if inside:
        return ""
    low, high = _PIXELS
    sides = " x ".join(f"{side:g}" for side in dict.fromkeys(m_per_px))
    found = f"{sides} m per pixel is outside {low:g} to {high:g} m"
    if all(low <= side <= high for side in m_per_px):
        found = f"{sides} m per pixel"
    if extents := _extents(m_per_px, shape):
        found += f": an image of {' x '.join(f'{e:.3g}' for e in extents)} m"
    # The units whose name would make it reasonable, each with its factor
    x, y = m_per_px
    fit = [(unit, f) for unit, f in _UNITS if _within((x * f, y * f), shape)]
    said = " or ".join(f"{round(1 / f)} ({x:g}{unit})" for unit, f in fit)
    return f"{found}; a factor {said}?" if fit else found


def odd_scales(recording: Recording) -> tuple[str, ...]:
    """Return a line for every stream of images, outlines or markers whose metres may be something
    else."""
    odd = {topic: odd_stream(stream) for topic, stream in recording.streams.items()}
    return tuple(f"'{topic}': {text}" for topic, text in odd.items() if text)


def odd_stream(stream: object) -> str:
    """Return the fault of one stream's scale; "" for none, and for other streams."""
    if isinstance(stream, Frames):
        height, width = stream.images[0].shape
        return odd_pixel(stream.m_per_px, (height, width))
    if isinstance(stream, Markers):
        # Of markers x (nt, k, d) m.
        size = _spread(stream.x)
        low, high = _SPREADS
        if low <= size <= high or size == 0:
            return ""
        return (
            f"marker distances of {size:.3g} m are outside {low:g} to {high:g} m"
            f"{_factor(size, _SPREADS)}"
        )
    if isinstance(stream, Contours):
        size = _extent(stream)
        low, high = _OUTLINES
        if low <= size <= high:
            return ""
        return (
            f"outlines of {size:.3g} m are outside {low:g} to {high:g} m{_factor(size, _OUTLINES)}"
        )
    return ""


def another_unit(stream: object, size: float) -> str:
    """Which unit the metres of markers or outlines may be, on a body of `size` m; "" where they fit
    it, and for other streams."""
    if isinstance(stream, Markers):
        # Peak to peak of the marker that moves most along an axis.
        x = stream.x
        seen = [x[np.isfinite(x[:, j]).all(axis=1), j] for j in range(x.shape[1])]
        moved = max((float(np.ptp(one, axis=0).max()) for one in seen if len(one)), default=0.0)
        what, span = max(("move by", moved), ("span", _spread(x)), key=lambda found: found[1])
    elif isinstance(stream, Contours):
        what, span = "span", _extent(stream)
    else:
        return ""
    low, high = (share * size for share in _OF_BODY)
    meant = [(unit, f) for unit, f in _UNITS if low <= span * f <= high]
    if span <= high or not meant:
        return ""
    unit, f = meant[0]
    kind = "markers" if isinstance(stream, Markers) else "outlines"
    return (
        f"{kind} {what} {span:.3g} m, the body is {size:.3g} m: {unit} declared as m, a factor "
        f"{round(1 / f)}? `validate import FILE --map unit={unit} -o NEW.mcap`"
    )


def in_unit(recording: Recording, unit: str, factor: float) -> Recording:
    """Return the recording with markers and outlines that were declared in m taken as in `unit`, of
    `factor` m; the record "taken_as" says so."""
    markers = {
        n: replace(m, x=factor * m.x, sd=factor * m.sd) for n, m in recording.markers.items()
    }
    contours = {n: _scaled(c, factor) for n, c in recording.contours.items()}
    told = dict.fromkeys((*markers, *contours), f"declared in m, taken as {unit}")
    records = {**recording.metadata, "taken_as": told}
    return replace(recording, markers=markers, contours=contours, metadata=records)


def _scaled(c: Contours, factor: float) -> Contours:
    each = None if c.each is None else c.each * (factor, 1.0)
    return replace(
        c, outlines=tuple(factor * o for o in c.outlines), sd=factor * c.sd, each=each
    )  # fmt: skip


def _spread(x: Floats) -> float:
    """m between markers x (nt, k, d) m at the first instant at which two are seen; 0: never."""
    seen = np.asarray(np.isfinite(x).all(axis=2))
    at = np.flatnonzero(seen.sum(axis=1) >= 2)
    return float(np.ptp(x[at[0]][seen[at[0]]], axis=0).max()) if len(at) else 0.0


def _extent(contours: Contours) -> float:
    return max(float(np.ptp(outline, axis=0).max()) for outline in contours.outlines)


def _within(m_per_px: tuple[float, float], shape: tuple[int, int] | None) -> bool:
    pixel = all(_PIXELS[0] <= side <= _PIXELS[1] for side in m_per_px)
    return pixel and all(_EXTENTS[0] <= e <= _EXTENTS[1] for e in _extents(m_per_px, shape))


def _extents(m_per_px: tuple[float, float], shape: tuple[int, int] | None) -> tuple[float, ...]:
    """Width and height of an image, m; of a few pixels nothing is said."""
    if shape is None or min(shape) < 64:
        return ()
    return m_per_px[0] * shape[1], m_per_px[1] * shape[0]


def _factor(size: float, within: tuple[float, float]) -> str:
    fit = [f for _, f in _UNITS if within[0] <= size * f <= within[1]]
    return f"; a factor {' or '.join(str(round(1 / f)) for f in fit)}?" if fit else ""
