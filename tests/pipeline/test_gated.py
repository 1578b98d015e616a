"""What a gate rejected, told from hand-made traces."""

import numpy as np
from test_consistency_tables import STEPS, T, followed

from validate.pipeline.exhibits.standard import gate_exhibit, gate_warnings
from validate.pipeline.run.method_run import MethodRun
from validate.solve.types import Trace


def gated(rejected: slice) -> MethodRun:
    """A marker that is seen at every second step, and rejected at some of those."""
    far, sd = np.zeros(STEPS), np.zeros(STEPS)
    seen = np.arange(0, STEPS, 2)
    sd[seen] = 2.0
    far[seen[rejected]], sd[seen[rejected]] = 7.0, 0.0
    f = followed(np.ones(STEPS), (sd > 0).astype(float))
    traces = {
        "gate.tested": (np.arange(STEPS) % 2 == 0).astype(float),
        "gate.rejected": (far > 0).astype(float),
        "gate.expected": 0.01 * (np.arange(STEPS) % 2 == 0),
        "gate.far.tip": far,
    }
    given = {name: Trace(y, "1") for name, y in traces.items()}
    given["innovation.tip.x.sd"] = Trace(sd, "m")
    f.run.__dict__["traces"] = {**f.run.traces, **given}
    return f


def test_the_table_counts_looks_and_says_when() -> None:
    found = gate_exhibit({"kf": gated(slice(3, 6))}, {})
    assert found is not None
    (row,) = found.tables[0].rows
    assert row[:5] == ("recorded", "filter", "tip", 20, 3)
    assert np.allclose([float(str(v)) for v in row[5:]], [0.2, T[6], T[10], 7.0])
    assert found.words == ()
    (chart,) = found.charts
    assert chart.series[0].y.tolist() == [7.0] * 3


def test_a_filter_that_rejects_most_of_its_looks_is_warned_of() -> None:
    assert gate_warnings({"kf": gated(slice(0, 10))}) == ()
    (words,) = gate_warnings({"kf": gated(slice(0, 11))})
    assert "its gate rejected 11 of 20 samples, 0.2 expected" in words
    found = gate_exhibit({"kf": gated(slice(0, 11))}, {})
    assert found is not None
    assert found.words == (words,)


def test_without_a_gate_nothing_is_shown() -> None:
    one = np.ones(STEPS)
    assert gate_exhibit({"kf": followed(one, one), "fem": followed(None, None)}, {}) is None
    quiet = gate_exhibit({}, {"late": {"kf": gated(slice(0, 0))}})
    assert quiet is not None
    assert quiet.charts == ()
    assert quiet.tables[0].rows[0][6:] == (None, None, None)
