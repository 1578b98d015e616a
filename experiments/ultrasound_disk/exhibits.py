"""What the disk's report shows: the outline over every image, diameters, roundness, the scale."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import (
    Chart,
    Entry,
    Exhibit,
    ImageSeries,
    NumberTable,
    Picture,
    Series,
    TableCell,
)
from validate.compare.score import Score
from validate.pipeline.experiment.experiment import (
    Experiment,
    Identified,
    Progress,
    ReportAdditions,
)
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import MAIN, Cases
from validate.recording.types import Recording
from validate.report.scenes.outline_images import outlines_over

from .disk import FILE, FOUND, OUTLINES, ImagedDisk, outlined
from .round_outlines import RoundOutlines

_MM = 1e3
_SHOWN = 6  # images of the picture


def identified(
    recordings: Sequence[Recording], tree: Tree, methods: Mapping[str, Method]
) -> Identified:
    """Circles through the outlines, and the scale that the nominal diameter asks for."""
    p: ImagedDisk = tree.settings
    seen = outlined(recordings[0], p)
    mean, count = float(seen.diameters.mean()), len(seen.t)
    sd_mean = float(np.hypot(seen.wall, seen.scatter / np.sqrt(count)))
    factor = p.disk.diameter / mean
    sd_factor = factor * float(np.hypot(sd_mean / mean, p.ranges.diameter / p.disk.diameter))
    scores = (
        Score("diameter.mean", mean, "m", count, "images", "mean over the images"),
        Score("diameter.sd", seen.scatter, "m", count, "images", "sd of one image's diameter"),
        Score("diameter.sd_wall", seen.wall, "m", count, "images",
              "sd of every diameter caused by the uncertainty of the wall"),
        Score("diameter.confidence", 2 * sd_mean, "m", count, "images", "two sd of the mean"),
        Score("scale.factor", factor, "1", count, "nominal diameter",
              "true lengths over those of the images, if the diameter is nominal"),
        Score("scale.confidence", 2 * sd_factor, "1", count, "nominal diameter", "two sd of it"),
    )  # fmt: skip
    refused = {k: v for k, v in recordings[0].record(FOUND).items() if k.startswith("image ")}
    headline = (
        f"fitted: the disk's centre, image by image; predicted: its diameter, "
        f"{_MM * p.disk.diameter:.2f} mm, measured {_MM * mean:.2f} ± {_MM * 2 * sd_mean:.2f} mm "
        f"over {count} images, and ± {200 * p.ranges.scale:.1f} % of the images' scale"
    )
    notes = (
        "If the disk has its nominal diameter, true lengths are those of the images times "
        f"{factor:.4f} ± {2 * sd_factor:.4f} (two sd). The error of the speed of sound that "
        "the scanner assumed is not larger.",
        f"{len(refused)} of {len(refused) + count} images show no outline"
        + "".join(f"; {k}: {v}" for k, v in list(refused.items())[:5])
        + ".",
    )
    return Identified(tree, scores, notes, headline)


def exhibits(tree: Tree, cases: Cases, tell: Progress) -> ReportAdditions:
    p: ImagedDisk = tree.settings
    (seen,) = next(iter(cases[MAIN].values())).seen.of(RoundOutlines)
    tell("outlines over the images")
    series, picture = _images(seen)
    return ReportAdditions((
        Exhibit(
            "disk",
            "The disk in every image",
            ("The nominal diameter is not used to fit an outline.",),
            tables=(_table(seen),),
            charts=(_chart(seen, p),),
            pictures=(series,),
            files=(picture,),
        ),
    ))  # fmt: skip


def _images(seen: RoundOutlines) -> tuple[ImageSeries, Picture]:
    """Evenly spaced images, and those of the least and the largest diameter."""
    even = np.linspace(0, len(seen.t) - 1, min(_SHOWN - 2, len(seen.t))).round().astype(int)
    ends = (int(seen.diameters.argmin()), int(seen.diameters.argmax()))
    at = sorted({*even.tolist(), *ends})
    instants = [(f"{_MM * seen.diameters[i]:.2f} mm", float(seen.t[i])) for i in at]
    words = "Those of the least and of the largest diameter are among them."
    return outlines_over(seen.frames, seen.contours, instants, "of the disk", words)


def _table(seen: RoundOutlines) -> NumberTable:
    rows: list[tuple[Entry | TableCell, ...]] = []
    for i, (outline, circle) in enumerate(zip(seen.outlines, seen.circles, strict=True)):
        off = np.linalg.norm(outline - circle.centre, axis=1) - circle.radius
        wide, tall = np.ptp(outline, axis=0)
        rows.append((
            i, *(_hundredths(_MM * v) for v in (2 * circle.radius, *circle.centre, wide, tall)),
            _MM * circle.rms, _MM * float(np.ptp(off)), _axes(outline),
        ))  # fmt: skip
    return NumberTable(
        "diameters",
        "Every image with an outline: the circle through it, extents along and across the image, "
        "roundness (rms and range of the distances from that circle), and the ratio of the axes of "
        "the ellipse through it.",
        ("image", "diameter / mm", "centre x / mm", "centre y / mm", "width / mm", "height / mm",
         "off circle / mm", "range / mm", "axes / 1"),
        tuple(rows),
        folded=len(rows) > 40,
    )  # fmt: skip


def _axes(outline: Floats) -> float:
    """Long over short axis of the least-squares ellipse through an outline (k, 2) m."""
    off = outline - outline.mean(axis=0)
    _, axes, _ = cv2.fitEllipseDirect((off / np.abs(off).max()).astype(np.float32))
    return float(max(axes) / min(axes))


def _hundredths(value: float) -> TableCell:
    return TableCell(float(value), text=f"{value:.2f}")


def _chart(seen: RoundOutlines, p: ImagedDisk) -> Chart:
    number = np.arange(len(seen.t), dtype=float)
    mean = float(seen.diameters.mean())
    band = np.full(len(number), _MM * (mean - 2 * seen.wall))
    ends = Series("two sd of the wall about the mean", number, band, "band",
                  np.full(len(number), _MM * (mean + 2 * seen.wall)))  # fmt: skip
    each = Series("image by image", number, _MM * seen.diameters, "points")
    levels = (("nominal", _MM * p.disk.diameter), ("mean", _MM * mean))
    return Chart(
        "diameters", "Diameter, image by image", "image", "diameter / mm", (ends, each), levels
    )


def follows(experiment: Experiment, recordings: Sequence[Recording], tree: Tree) -> Experiment:
    """Other images have their own title."""
    (recording,) = recordings
    if recording.source.path == FILE:
        return experiment
    title = f"{recording.name}: a disk in {len(recording.contour(OUTLINES).t)} B-mode images"
    return replace(experiment, title=title, source=recording.source.path)
