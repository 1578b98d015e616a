"""What the stylus' report shows: the fitted pose, what that leaves and predicts, a picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from validate.arrays import Floats, rms
from validate.compare.exhibit import Entry, Exhibit, NumberTable, Picture, TableCell
from validate.compare.score import Score
from validate.errors import RegistrationError
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
from validate.register.markers.transform import Similarity
from validate.register.tools.landmarks import Digitised

from .phantom import PUBLISHED, SEQUENCE, StylusPhantom, digitised, shaft_of
from .picture import points_picture
from .plus import by_plus
from .touched_landmarks import TouchedLandmarks

Part = Literal["touch", "whole"]
PARTS: Mapping[Part, str] = {"touch": "first touch", "whole": "whole dwell"}
_MM = 1e3
_AGAIN = 5e-3  # m: from a landmark that was touched already
_NEAR = (0.1, 0.3e-3)  # degrees and m within which two transforms are one


@dataclass(frozen=True)
class Apart:
    """How far two transforms are apart: degrees, m between the body's origins and its centres."""

    angle: float
    origin: float
    centre: float

    @property
    def same(self) -> bool:
        return self.angle <= _NEAR[0] and self.origin <= _NEAR[1]


def apart(one: Similarity, other: Similarity, centre: Floats) -> Apart:
    """`centre` (3,) m in the body's frame."""
    cosine = (np.trace(one.R.T @ other.R) - 1) / 2
    between = np.linalg.norm(one.apply(centre) - other.apply(centre))
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    return Apart(angle, float(np.linalg.norm(one.t - other.t)), float(between))


def mean_error(d: Digitised) -> float:
    """Mean distance m of the landmarks from the fitted pose, as PLUS prints it."""
    return float(np.linalg.norm(d.residuals, axis=1).mean())


def identified(
    recordings: Sequence[Recording], tree: Tree, methods: Mapping[str, Method]
) -> Identified:
    """The pose on all landmarks: fitted, and no evidence."""
    p: StylusPhantom = tree.settings
    recording = recordings[0]
    both = {part: digitised(recording, p, part) for part in PARTS}
    mine = both[p.dwell.part]
    notes = [_touched(mine), _better(both)]
    scores = [
        Score("registration.fitted_rms", rms(mine.residuals), "m", len(mine.body), "touched",
              "rms distance of the landmarks from the pose fitted on all of them"),
        Score("landmark.sd", mine.sd, "m", len(mine.body), "touched",
              "sd of a place along an axis: its wander over the samples that count"),
    ]  # fmt: skip
    for part, d in both.items():
        words = f"mean distance from the pose fitted on all landmarks, {PARTS[part]}"
        scores.append(Score(f"{part}.error", mean_error(d), "m", len(d.body), "touched", words))
        words = f"rms distance of each landmark from where the others put it, {PARTS[part]}"
        scores.append(
            Score(f"{part}.left_out", rms(d.left_out), "m", len(d.body), "touched", words)
        )
    for name, T, words in _others(recording, p, mine, notes):
        off = apart(mine.pose, T, mine.body.mean(axis=0))
        scores += [
            Score(f"{name}.angle", off.angle, "deg", 1, words, "angle between the two rotations"),
            Score(f"{name}.origin", off.origin, "m", 1, words, "between the body's origins"),
            Score(f"{name}.centre", off.centre, "m", 1, words, "between the landmarks' centres"),
        ]
    count = len(mine.body)
    headline = (
        f"fitted: the pose of the body on {count} landmarks, {_MM * mean_error(mine):.2f} mm mean "
        f"distance; predicted: each landmark from the {count - 1} others, "
        f"{_MM * rms(mine.left_out):.2f} mm rms"
    )
    return Identified(tree, (*scores, *_plus_scores(recording, p, mine)), tuple(notes), headline)


def _touched(d: Digitised) -> str:
    lost = [n for n in d.names if n not in d.touched]
    missing = f"; not touched: {', '.join(lost)}" if lost else ""
    order = "in the order of the list" if d.match.ordered else "in another order than the list's"
    return (
        f"The tip stands {len(d.dwells)} times; {len(d.body)} of them are landmarks, {order}, "
        f"recognised by their distances{missing}. The others are where it was parked, or "
        "touched one again."
    )


def _better(both: Mapping[Part, Digitised]) -> str:
    least = min(both, key=lambda part: rms(both[part].left_out))
    shown = ", ".join(f"{_MM * rms(d.left_out):.2f} mm by the {PARTS[k]}" for k, d in both.items())
    return (
        f"Left out one by one, landmarks are predicted to {shown}: the {PARTS[least]} predicts "
        "best here. As the stylus is turned, errors of its offset and of the tracker move the "
        "tip; --set dwell.part=whole takes the whole dwell."
    )


def _others(
    recording: Recording, p: StylusPhantom, mine: Digitised, notes: list[str]
) -> list[tuple[str, Similarity, str]]:
    """Transforms of others to hold ours against, by name."""
    found = []
    plus = _by_plus(recording, p, mine)
    if isinstance(plus, str):
        notes.append(plus)
    else:
        found.append(("plus", plus[0], "the detection of PLUS, done again on this recording"))
    record = recording.metadata.get(PUBLISHED)
    if record:
        T = np.array([float(word) for word in record["matrix"].split()]).reshape(4, 4)
        U, _, Vt = np.linalg.svd(T[:3, :3])  # printed with six digits
        published = Similarity(U @ Vt, T[:3, 3])
        off = apart(mine.pose, published, mine.body.mean(axis=0))
        found.append(("published", published, f"transform in {record['file']}"))
        notes.append(_beside_published(off, record))
    return found


def _beside_published(off: Apart, record: Mapping[str, str]) -> str:
    error = _MM * float(record["error"])
    off_by = f"{off.angle:.2f} deg and {_MM * off.origin:.2f} mm"
    where = f"The transform in {record['file']} (its error {error:.3g} mm)"
    if off.angle > 5 or off.origin > 20e-3:
        return f"{where} is {off_by} from ours: it belongs to another recording and is not used."
    same = "the same" if off.same else "another one"
    return f"{where} is {off_by} from ours: {same} within {_NEAR[0]:g} deg and .3 mm."


def _by_plus(
    recording: Recording, p: StylusPhantom, mine: Digitised
) -> tuple[Similarity, float] | str:
    try:
        found = by_plus(mine.t, mine.x, shaft_of(recording, p), mine.known)
    except RegistrationError as error:
        return f"The detection of PLUS is not compared with ours: {error}."
    return found.pose, found.error


def _plus_scores(recording: Recording, p: StylusPhantom, mine: Digitised) -> tuple[Score, ...]:
    plus = _by_plus(recording, p, mine)
    if isinstance(plus, str):
        return ()
    words = "mean distance from the pose fitted on the landmarks that the detection of PLUS finds"
    return (Score("plus.error", plus[1], "m", len(mine.known), "touched", words),)


def exhibits(tree: Tree, cases: Cases, tell: Progress) -> ReportAdditions:
    """Landmark by landmark, the transform, the dwells, and the picture in space."""
    (touched,) = next(iter(cases[MAIN].values())).seen.of(TouchedLandmarks)
    d = touched.digitised
    tell("landmarks in space")
    shown = Exhibit(
        "landmarks",
        "Landmarks: fitted, and predicted from the others",
        ("Residuals of the fit are no evidence; predictions of left-out landmarks are.",),
        tables=(_residuals(d), _matrix(d), _dwells(d)),
        pictures=(_picture(d),),
    )
    return ReportAdditions((shown,))


def _residuals(d: Digitised) -> NumberTable:
    rows = zip(d.touched, d.places, d.residuals, d.left_out, d.expected, strict=True)
    table: list[tuple[Entry, ...]] = [
        (name, *(_MM * at).tolist(), *(_MM * fit).tolist(), _length(fit), *(_MM * out).tolist(),
         _length(out), _MM * float(np.sqrt(3)) * float(sd))
        for name, at, fit, out, sd in rows
    ]  # fmt: skip
    return NumberTable(
        "landmarks",
        "Every landmark: where it was touched; fitted less touched; predicted from the others less "
        "touched, and the rms length that noise and their pose explain.",
        ("landmark", "x / mm", "y / mm", "z / mm", "fitted x / mm", "y / mm", "z / mm",
         "length / mm", "predicted x / mm", "y / mm", "z / mm", "length / mm", "expected / mm"),
        tuple(table),
    )  # fmt: skip


def _length(v: Floats) -> float:
    return _MM * float(np.linalg.norm(v))


def _matrix(d: Digitised) -> NumberTable:
    rows = tuple(
        (*(TableCell(float(v), text=f"{v:.6f}") for v in row[:3]),
         TableCell(_MM * float(row[3]), text=f"{_MM * row[3]:.4f}"))
        for row in d.pose.matrix[:3]
    )  # fmt: skip
    return NumberTable(
        "transform",
        "The fitted pose: from the body's frame to the reference's, rotation and translation.",
        ("R x / 1", "R y / 1", "R z / 1", "t / mm"),
        rows,
    )


def _dwells(d: Digitised) -> NumberTable:
    named = dict(zip(d.match.seen.tolist(), d.touched, strict=True))
    rows = tuple(
        (named.get(i) or _again(d, part.centre), float(w.t[0]), float(w.t[-1]), len(w.x),
         _MM * w.wander, len(part.x))
        for i, (w, part) in enumerate(zip(d.dwells, d.parts, strict=True))
    )  # fmt: skip
    return NumberTable(
        "dwells",
        "Positions and times at which the tip rests; wander is the rms distance from the mean "
        "along an axis.",
        ("landmark", "from / s", "to / s", "samples", "wander / mm", "samples that count"),
        rows,
    )


def _again(d: Digitised, centre: Floats) -> str:
    """What a place (3,) m is that is no landmark's own."""
    off = np.linalg.norm(d.pose.apply(d.body) - centre, axis=1)
    near = int(off.argmin())
    return f"{d.touched[near]}, again" if off[near] < _AGAIN else "none: parked"


def _picture(d: Digitised) -> Picture:
    return points_picture(
        "landmarks_in_space",
        "The path of the tip, its dwells, and the landmarks; arrows, 50 times as long, from where "
        "each was touched to where the others put it.",
        _MM * d.x,
        [_MM * w.x for w in d.dwells],
        d.touched,
        _MM * d.places,
        _MM * d.left_out,
        50.0,
    )


def follows(experiment: Experiment, recordings: Sequence[Recording], tree: Tree) -> Experiment:
    """Another recording has its own title, and no printed figure."""
    (recording,) = recordings
    if recording.name == SEQUENCE.partition(".")[0] and PUBLISHED in recording.metadata:
        return experiment
    other = f"printed for {SEQUENCE}; not compared with {recording.source.path}"
    return replace(
        experiment,
        title=f"{recording.name}: landmarks touched with a tracked stylus",
        source=f"{recording.source.path}",
        published=tuple(replace(f, other=other) for f in experiment.published),
    )
