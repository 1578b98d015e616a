"""Labels that change during a recording: markers swapped at a load though right at rest."""

import numpy as np
from scipy.optimize import linear_sum_assignment

from validate.arrays import Floats, Ints
from validate.errors import RegistrationError

CLEARLY = 3.0  # times nearer under another label
BEYOND = 6.0  # standard deviations per axis that noise does not explain


def require_steady_labels(
    names: tuple[str, ...], rest: Floats, x: Floats, t: Floats, sd: float
) -> None:
    """Raises `RegistrationError` naming markers of x (nt, k, 3) m that changed places.

    A compressed body moves its surface nearly affinely: rest (k, 3) m is carried to every instant
    by the affine map that fits best, and each marker must lie nearest to its own image, unless the
    difference is within the noise sd m. Markers not seen (NaN) are left out. One that is mistaken
    for an instant pulls that map towards it, too: other labels do not mend it, and nothing is said.
    """
    for ti, frame in zip(t, x, strict=True):
        seen = np.flatnonzero(np.isfinite(frame).all(axis=1))
        if len(seen) < 6:
            continue
        start = np.hstack([rest[seen], np.ones((len(seen), 1))])
        expected = start @ np.linalg.lstsq(start, frame[seen], rcond=None)[0]
        apart = np.linalg.norm(expected[:, None] - frame[seen][None], axis=2)
        own = np.diag(apart)
        _, nearest = linear_sum_assignment(apart**2)
        best = apart[np.arange(len(seen)), nearest]
        moved = (nearest != np.arange(len(seen))) & (own > BEYOND * sd) & (own > CLEARLY * best)
        if moved.any() and _mended(rest[seen], frame[seen], nearest):
            shown = ", ".join(names[i] for i in seen[moved][:6])
            raise RegistrationError(
                f"markers {shown} seem swapped at t = {ti:.2f} s: {1e3 * own[moved].max():.1f} mm "
                f"from the positions predicted by the others, {1e3 * best[moved].max():.1f} mm "
                f"after relabelling; correct their names"
            )


def _mended(rest: Floats, x: Floats, labels: Ints) -> bool:
    """Whether the markers that get other `labels` lie clearly nearer to where the rest put them, or
    where hardly one keeps its label, all to an affine image."""
    changed = labels != np.arange(len(labels))
    start = np.hstack([rest, np.ones((len(rest), 1))])
    if (~changed).sum() > start.shape[1]:
        expected = start @ np.linalg.lstsq(start[~changed], x[~changed], rcond=None)[0]
        before, after = (expected - x)[changed], (expected - x[labels])[changed]
    else:
        before, after = (
            y - start @ np.linalg.lstsq(start, y, rcond=None)[0] for y in (x, x[labels])
        )
    return bool(np.linalg.norm(before) > CLEARLY * np.linalg.norm(after))
