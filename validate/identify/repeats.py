"""Repeated tests of one or several specimens as one recording: mean and scatter.

Each log is counted from contact, its cell's offset taken off, and its first loading is read at
displacements that all share. Every specimen has one vote. The logs themselves stay beside.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from validate.arrays import Floats, Ints, rms
from validate.errors import RecordingError, UsageError
from validate.identify.budget import Votes, by_specimen
from validate.identify.modulus import MIN_SAMPLES, TestKind, load_noise, loading, zero_of
from validate.recording.merge import REPEATS, SHARE
from validate.recording.motion_capture.text_rows import ASSUMED
from validate.recording.types import Record, Recording, Signal, Source, clock_of

_TOE = 0.01  # of the way: where contact is told apart, see `zero_of`
_ALIKE = 0.01  # sizes and speeds of repeats differ by less, relative
_ASK = "--specimens one (all of one specimen), each, or a label for every log, as A,A,B"


@dataclass(frozen=True)
class Loading:
    """A log's loading from contact: t s, displacement m and force N (n,), displacement rising."""

    t: Floats
    d: Floats
    force: Floats
    words: str


def labels_of(said: str | None, logs: Sequence[Recording]) -> tuple[str, ...]:
    """Return the specimen of each log, as the user says; raises `UsageError` where nobody says it,
    and for recordings that are no logs of a testing machine."""
    names = [log.name for log in logs]
    for log in logs:
        if not {"displacement", "force"} <= set(log.signals) or "specimen" not in log.metadata:
            raise UsageError(
                f"{log.name} is not a log of a testing machine; only such logs can be repeats. "
                "Import one file at a time, and combine their streams with `validate merge`"
            )
    if said is None:
        raise UsageError(
            f"{len(logs)} logs, {', '.join(names[:8])}: their specimens are not declared; {_ASK}"
        )
    if said in ("one", "each"):
        return tuple("1" if said == "one" else str(i + 1) for i in range(len(logs)))
    labels = tuple(label.strip() for label in said.split(","))
    if len(labels) != len(logs) or not all(labels):
        raise UsageError(
            f"--specimens {said}: {len(labels)} labels for {len(logs)} logs, in the order "
            f"{', '.join(names[:8])}; {_ASK}"
        )
    return labels


def averaged(logs: Sequence[Recording], labels: Sequence[str], name: str) -> Recording:
    """One recording of at least two logs of one test.

    Signals `displacement` (n, 1) m and `force` (n, 1) N are the mean over specimens on the common
    path, compression positive, `force/sd` the sd of the mean at each point, and
    `displacement/<log>`, `force/<log>` the logs as they were read. The record `repeats` holds their
    counts and the relative standard uncertainty that judges the mean. Raises `RecordingError` for
    logs of different tests or sizes, and for less than 10 samples in common.
    """
    if len(logs) < 2:
        raise RecordingError(f"{len(logs)} logs; a mean needs at least 2")
    test, sizes = _alike(logs)
    names = tuple(log.name for log in logs)
    alone = len(set(names)) == len(names)
    names = names if alone else tuple(f"{i + 1}-{name}" for i, name in enumerate(names))
    paths = [_loaded(log, test) for log in logs]
    start, end = max(p.d[0] for p in paths), min(p.d[-1] for p in paths)
    count = min(int(((p.d >= start) & (p.d <= end)).sum()) for p in paths)
    if not end > start or count < MIN_SAMPLES:
        raise RecordingError(
            f"the logs share the displacements {1e3 * start:.4g} to {1e3 * end:.4g} mm with "
            f"{count} samples, at least {MIN_SAMPLES} are needed"
        )
    d = np.linspace(start, end, count)
    forces = np.array([np.interp(d, p.d, p.force) for p in paths])
    votes = [by_specimen(column, labels) for column in forces.T.tolist()]
    mean, sd = np.array([v.mean for v in votes]), np.array([v.sd_mean or 0.0 for v in votes])
    t = np.mean([np.interp(d, p.d, p.t) for p in paths], axis=0)
    sign = 1.0 if test == "compression" else -1.0
    # Of the mean: each log counts one over its specimen's logs, over the specimens.
    often = Counter(labels)
    each = [
        load_noise(log.signals["force"].y[:, 0]) / (often[label] * len(often))
        for log, label in zip(logs, labels, strict=True)
    ]
    signals = {
        "displacement": Signal(t, sign * d[:, None], "m", 0.0, "machine"),
        "force": Signal(t, sign * mean[:, None], "N", float(np.linalg.norm(each)), "machine"),
        "force/sd": Signal(t, sd[:, None], "N", 0.0, "machine"),
    }
    signals |= {
        f"{topic}/{own}": log.signals[topic]
        for own, log in zip(names, logs, strict=True) for topic in ("displacement", "force")
    }  # fmt: skip
    share = rms(sd[:, None]) / rms(mean[:, None])
    told = _told(votes[-1], labels, share, paths, names, float(d[-1]))
    return _recording(name, logs, names, signals, {"specimen": sizes, **told})


def _alike(logs: Sequence[Recording]) -> tuple[TestKind, Record]:
    """The one test, and the sizes of all logs, their means where they hardly differ."""
    records = [dict(log.record("specimen")) for log in logs]
    tests = {r.get("test", "") for r in records}
    if len(tests) > 1 or not tests <= {"compression", "tension"}:
        raise RecordingError(
            f"repeats must be of one test, these are of {', '.join(sorted(tests))}; import "
            "each separately with --map test=compression or --map test=tension"
        )
    found: dict[str, str] = {}
    for key in sorted({k for r in records for k in r} - {"test", "speed_m_per_s"}):
        values = [float(r[key]) for r in records if key in r]
        if len(values) < len(logs) or np.ptp(values) > _ALIKE * np.mean(values):
            shown = ", ".join(f"{v:.6g}" for v in values[:8])
            raise RecordingError(
                f"repeats must be of one size, but {key} of {len(values)} of {len(logs)} logs "
                f"is {shown}; leave the others out"
            )
        found[key] = repr(float(np.mean(values)))
    (test,) = tests
    return cast("TestKind", test), {**found, "test": test}


def _loaded(recording: Recording, test: TestKind) -> Loading:
    log = loading(recording, test)
    way = float(np.ptp(log.d))
    near = log.force[: max(MIN_SAMPLES, int(np.argmax(log.d - log.d[0] > _TOE * way)))]
    offset, contact = zero_of(log.d, log.force, load_noise(near), _TOE * way)
    last = int(np.argmax(log.d)) + 1
    # Indices of the first loading whose displacement exceeds every one before.
    before = np.maximum.accumulate(np.append(-np.inf, log.d[: last - 1]))
    kept: Ints = np.flatnonzero((log.d[:last] > before) & (log.d[:last] >= contact))

    words = f"contact at {1e3 * contact + 0.0:.4g} mm, {offset:.4g} N taken off"
    if last < len(log.d):
        words += f", {len(log.d) - last} rows after the largest displacement not in the mean"
    return Loading(
        log.t[kept] - log.t[kept][0], log.d[kept] - contact, log.force[kept] - offset, words
    )


def _told(
    last: Votes,
    labels: Sequence[str],
    share: float,
    paths: Sequence[Loading],
    names: Sequence[str],
    end: float,
) -> dict[str, Record]:
    specimens = len(last.means)
    of = (
        "specimens"
        if specimens > 1
        else ("repeats of one specimen: the scatter between specimens is unknown")
    )
    many = "specimens" if specimens > 1 else "specimen"
    what = f"mean of {len(paths)} logs of {specimens} {many} to {1e3 * end:.4g} mm"
    durations = [float(np.interp(end, p.d, p.t)) for p in paths]
    speeds = np.ptp(durations) / np.mean(durations)
    about = {
        "repeats": f"{what}; {100 * share:.3g} % sd of the mean, of the scatter of {of}",
        **{f"zero of {own}": path.words for own, path in zip(names, paths, strict=True)},
    }
    if speeds > _ALIKE:
        about["speeds"] = f"differ: {min(durations):.4g} to {max(durations):.4g} s for one way"
    record = {
        "logs": str(len(paths)),
        "specimens": str(specimens),
        "specimen of each": ", ".join(f"{n}: {s}" for n, s in zip(names, labels, strict=True)),
        SHARE: repr(share),
    }
    return {REPEATS: record, ASSUMED: about}


def _recording(
    name: str,
    logs: Sequence[Recording],
    names: Sequence[str],
    signals: Mapping[str, Signal],
    records: Mapping[str, Record],
) -> Recording:
    stamps = {k: np.round(s.t * 1e9).astype(np.int64) for k, s in signals.items()}
    own = {
        f"{key}/{log_name}": record
        for log_name, log in zip(names, logs, strict=True)
        for key, record in log.metadata.items()
    }
    return Recording(
        name=name,
        source=Source(" + ".join(log.source.path for log in logs), "", 0, "mean of repeats"),
        t0_ns=0,
        signals=signals,
        clock={k: clock_of(k, None, ns, ns) for k, ns in stamps.items()},
        metadata={**records, **own},
    )
