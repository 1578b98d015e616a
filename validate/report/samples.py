"""Recorded samples and each method's values there, as rows of the long table."""

from collections.abc import Iterator

import numpy as np

from validate.arrays import Floats
from validate.compare.result import Result
from validate.compare.row import MEASURED, SAMPLE, LongRow, RowBlock
from validate.report.sections.observations import signals

_VOLUME = ".volume_ratio"


def samples(result: Result) -> Iterator[RowBlock]:
    """Of every recording its drives, its signals, and every method's values at their times.

    A drive has the role `drives`: what lies across in curves. Cavities' volumes are sampled, too.
    """
    for i, registered in enumerate(result.registered):
        name = result.recordings[i].name if i < len(result.recordings) else str(i + 1)
        one = LongRow(recording=name, part=SAMPLE, method=MEASURED)
        times = {tuple(s.t.tolist()): s.t for s in signals(registered)}
        for t in times.values():
            for drive, values in zip(registered.drives, registered.inputs.T, strict=False):
                q = np.interp(t, registered.t, values)
                yield RowBlock(one._replace(quantity=drive.name, unit=drive.unit, role="drives"),
                               q, t)  # fmt: skip
        for s in signals(registered):
            of = one._replace(quantity=s.quantity, unit=s.unit, role=s.role)
            yield RowBlock(of._replace(sd=float(s.sd)), s.y[:, 0], s.t)
            for method in result.methods:
                run = method.runs[i]
                if run.finished and s.trace in run.traces:
                    y = np.interp(s.t, run.t, run.traces[s.trace].y)
                    sd: Floats | None = method.band * np.abs(y) if method.band else None
                    yield RowBlock(of._replace(method=method.name), y, s.t, sd)
        t = next(iter(times.values()), registered.t)
        for method in result.methods:
            run = method.runs[i]
            for trace, found in run.traces.items() if run.finished else ():
                if trace.endswith(_VOLUME):
                    row = one._replace(method=method.name, quantity=trace, unit=found.unit)
                    yield RowBlock(row, np.interp(t, run.t, found.y), t)
