"""Contour extraction on synthetic frames of known outline, by contrast and edge shadow.

python benchmarks/contours.py [COUNT]    COUNT frames (default 200) and as many without a region
"""

import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats
from validate.errors import RecordingError
from validate.recording.images.image import coverage
from validate.recording.outlines.outline import extract_outline
from validate.register.outlines.outlines import normal_distances
from validate.twin.ultrasound import Scanner, Target

LEVELS = (-12.0, -18.0, -24.0, -30.0)  # dB of the inclusion below tissue
SHADOWS = (0.0, 6.0, 12.0)  # dB in the middle of an edge shadow
SIZE = 30e-3  # m, both sides of the image
ANGLES = np.linspace(0, 2 * np.pi, 240, endpoint=False)


@dataclass(frozen=True)
class CystFrame:
    """An image (h, w) uint8 with its pixel size (x, y) m and true outline (240, 2) m."""

    image: NDArray[np.uint8]
    m_per_px: tuple[float, float]
    outline: Floats
    level: float
    shadow: float


def cyst_frame(seed: int, level: float, shadow: float) -> CystFrame:
    """A frame of `level` and `shadow` dB; size, shape, place, scanner and tissue are drawn.

    Equal radius 2.5-8 mm, axes ratio down to 0.6 with a bulge or two, pixels 0.07-0.15 mm, point
    spread 0.08-0.18 x 0.2-0.45 mm, 50-75 dB shown, tissue uneven by 1.5 dB, 3 dB brighter behind;
    every second frame has another region 12 dB below tissue, every third a bright plate at the top.
    """
    rng = np.random.default_rng([seed, int(-10 * level), int(10 * shadow)])
    radius = float(rng.uniform(2.5e-3, 8e-3))
    room = SIZE / 2 - 1.45 * radius
    centre = SIZE / 2 + rng.uniform(-1, 1, 2) * room * np.array([1.0, 0.8])
    outline = cyst_outline(centre, radius, rng)
    m_per_px = float(rng.uniform(0.07e-3, 0.15e-3))
    scanner = Scanner(
        width=round(SIZE / m_per_px),
        height=round(SIZE / m_per_px),
        m_per_px=m_per_px,
        axial=float(rng.uniform(0.08e-3, 0.18e-3)),
        lateral=float(rng.uniform(0.2e-3, 0.45e-3)),
        dynamic_range=float(rng.uniform(50, 75)),
    )
    corner = np.where(centre > SIZE / 2, 3.5e-3, SIZE - 3.5e-3)
    apart = float(np.linalg.norm(corner - centre)) > 1.45 * radius + 3e-3
    target = Target(
        outline,
        level=level,
        shadow=shadow,
        enhancement=3.0,
        texture=1.5,
        second=cyst_outline(corner, 2e-3, rng) if seed % 2 and apart else None,
        plate=0.6e-3 if seed % 3 == 0 else None,
    )
    image = scanner.b_mode(target, rng)
    return CystFrame(image, (m_per_px, m_per_px), outline, level, shadow)


def cyst_outline(centre: Floats, radius: float, rng: np.random.Generator) -> Floats:
    """A star-shaped outline (240, 2) m: a tilted ellipse with harmonics 2 to 5."""
    ratio, tilt = rng.uniform(0.6, 1.0), rng.normal(0, 0.4)
    along, across = np.cos(ANGLES - tilt), np.sin(ANGLES - tilt)
    r = radius / np.sqrt(ratio * along**2 + across**2 / ratio)
    for k in range(2, 6):
        height, phase = 0.1 * rng.normal() / k**1.5, rng.uniform(0, 2 * np.pi)
        r = r * (1 + height * np.cos(k * ANGLES + phase))
    return np.asarray(centre + r[:, None] * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1))


@dataclass(frozen=True)
class Judged:
    """Distances m of an outline from the truth, its Dice index, and rms distance / declared sd."""

    level: float
    shadow: float
    rms: float
    worst: float
    bias: float
    dice: float
    sd_ratio: float


def dice(a: Floats, b: Floats, shape: tuple[int, int], m_per_px: tuple[float, float]) -> float:
    """Twice the common area over the sum of both areas of two outlines (k, 2) m."""
    one, two = (coverage(o / np.array(m_per_px), shape) for o in (a, b))
    return float(2 * np.minimum(one, two).sum() / (one.sum() + two.sum()))


def judged(frame: CystFrame) -> Judged | None:
    """The extraction without any hint against the truth; None where it refuses."""
    try:
        found = extract_outline(frame.image, frame.m_per_px)
    except RecordingError:
        return None
    off = -normal_distances(frame.outline, found.points)
    rms = float(np.sqrt((off**2).mean()))
    score = dice(found.points, frame.outline, frame.image.shape, frame.m_per_px)
    worst, bias = float(np.abs(off).max()), float(off.mean())
    return Judged(frame.level, frame.shadow, rms, worst, bias, score, rms / found.sd)


def frames(count: int) -> list[CystFrame]:
    """`count` frames, taking turns in contrast and shadow."""
    kinds = [(level, shadow) for level in LEVELS for shadow in SHADOWS]
    return [cyst_frame(i, *kinds[i % len(kinds)]) for i in range(count)]


def false_alarms(count: int) -> int:
    """How many images of tissue alone are given an outline."""
    found = 0
    for i in range(count):
        image = Scanner().b_mode(Target(None, texture=1.5), np.random.default_rng([7, i]))
        try:
            extract_outline(image, (1e-4, 1e-4))
            found += 1
        except RecordingError:
            continue
    return found


def line(name: str, results: list[Judged | None]) -> str:
    kept = [r for r in results if r is not None]
    refused = len(results) - len(kept)
    mm = 1e3 * np.array([[r.rms, r.worst, r.bias] for r in kept])
    scores, ratios = (np.array([getattr(r, k) for r in kept]) for k in ("dice", "sd_ratio"))
    cells = [
        name,
        str(len(results)),
        str(refused),
        f"{np.median(mm[:, 0]):.3f}",
        f"{mm[:, 0].max():.3f}",
        f"{mm[:, 1].max():.3f}",
        f"{np.median(mm[:, 2]):+.3f}",
        f"{np.median(scores):.3f}",
        f"{scores.min():.3f}",
        f"{np.median(ratios):.2f}",
        f"{np.percentile(ratios, 95):.2f}",
    ]
    return "| " + " | ".join(cells) + " |"


def table(count: int) -> str:
    """The whole table in Markdown."""
    made = frames(count)
    results = [(f.level, f.shadow, judged(f)) for f in made]
    head = (
        "frames", "count", "refused", "rms mm median", "rms mm worst", "farthest mm", "bias mm",
        "Dice median", "Dice worst", "rms / sd median", "95 %",
    )  # fmt: skip
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for level in LEVELS:
        lines.append(line(f"inclusion {level:g} dB", [r for a, _, r in results if a == level]))
    for shadow in SHADOWS:
        lines.append(line(f"edge shadow {shadow:g} dB", [r for _, b, r in results if b == shadow]))
    lines.append(line("all", [r for _, _, r in results]))
    return "\n".join(lines)


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print(table(count))
    print(f"\ntissue without a region: {false_alarms(count)} of {count} images given an outline")


if __name__ == "__main__":
    main()
