"""What the gates of filters rejected: how many looks, of which markers, when, and how far off."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from validate.compare.exhibit import Chart, Entry, Exhibit, NumberTable, Series
from validate.replay.followed import Cases, Followed

_FAR = "gate.far."
_DRAWN = 3  # rejected looks from which a picture says more than the table
_MOST = 0.5  # share of rejected looks from which a filter follows itself, not the recording


def gate_exhibit(main: Mapping[str, Followed], others: Cases) -> Exhibit | None:
    """None where no filter has a gate."""
    every = [*main.values(), *(f for case in others.values() for f in case.values())]
    gated = [f for f in every if "gate.rejected" in f.run.traces and len(f.run.t)]
    if not gated:
        return None
    table = NumberTable(
        "gate",
        "Samples of a marker with an innovation beyond the gate of the filter; they were treated "
        "as missing. Expected: number for a filter whose claimed errors hold. Far: largest "
        "rejected innovation, in its standard deviations.",
        ("case", "filter", "marker", "samples", "rejected", "expected / 1", "first / s", "last / s",
         "far / 1"),
        tuple(_row(f, marker) for f in gated for marker in _markers(f)),
        "NIS and whiteness above use the accepted samples.",
    )  # fmt: skip
    words = gate_warnings(main)
    charts = tuple(_chart(f) for f in gated if _rejected(f) >= _DRAWN)
    return Exhibit("gate", "Rejected measurements", words, (table,), charts)


def gate_warnings(main: Mapping[str, Followed]) -> tuple[str, ...]:
    """A sentence on every filter whose gate rejected more looks than it let pass."""
    found = []
    for f in main.values():
        tested = int(_sum(f, "gate.tested"))
        rejected = _rejected(f)
        if tested and rejected > _MOST * tested:
            found.append(
                f"{f.label}: its gate rejected {rejected} of {tested} samples, "
                f"{_sum(f, 'gate.expected'):.2g} expected: it follows its model, not the "
                f"recording; increase R or the process noise, or remove the gate"
            )
    return tuple(found)


def _markers(f: Followed) -> list[str]:
    return [n.removeprefix(_FAR) for n in f.run.traces if n.startswith(_FAR)]


def _sum(f: Followed, name: str) -> float:
    trace = f.run.traces.get(name)
    return 0.0 if trace is None else float(trace.y.sum())


def _rejected(f: Followed) -> int:
    return int(_sum(f, "gate.rejected"))


def _row(f: Followed, marker: str) -> tuple[Entry, ...]:
    far, t = f.run.traces[_FAR + marker].y, f.own_time
    off = far > 0
    looks = int((_passed(f, marker) | off).sum())
    share = _sum(f, "gate.expected") / max(_sum(f, "gate.tested"), 1.0)
    when: tuple[Entry, ...] = (None, None, None)
    if off.any():
        when = (float(t[off][0]), float(t[off][-1]), float(far.max()))
    return (f.case or "recorded", f.label, marker, looks, int(off.sum()), share * looks, *when)


def _passed(f: Followed, marker: str) -> NDArray[np.bool_]:
    """At which steps (nt,) a look of the marker reached the filter."""
    names = [f"innovation.{marker}.{c}.sd" for c in "xyz"]
    found = [f.run.traces[name].y > 0 for name in names if name in f.run.traces]
    return np.asarray(np.any(found, axis=0))


def _chart(f: Followed) -> Chart:
    series = []
    for marker in _markers(f):
        far = f.run.traces[_FAR + marker].y
        if (far > 0).any():
            series.append(Series(marker, f.own_time[far > 0], far[far > 0], "points"))
    return Chart(
        "_".join(("gate", f.method, *filter(None, [f.case]))),
        ", ".join((f"Rejected samples of {f.label}", *filter(None, [f.case]))), "recorded time / s",
        "standard deviations off / 1", tuple(series), log="y", scale=1.0,
    )  # fmt: skip
