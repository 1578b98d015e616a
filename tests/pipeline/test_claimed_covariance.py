"""What a filter claims of its own error, as an input of u_val."""

from types import SimpleNamespace

import numpy as np
import pytest

from validate.compare.residual import Residual
from validate.pipeline.checks import checks

# private: _own_doubt: called alone, on a method without a run.


def test_a_claimed_covariance_has_as_many_values_as_the_run_has_frames(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The residual's times are those of the samples: 500 samples, 200 frames stopped a run."""
    samples = Residual("a", "all", np.zeros((5, 1)), 1e-4, 0.0, "m", "", t=np.arange(5.0))
    rows = SimpleNamespace(apply=lambda sd: sd[:1])
    monkeypatch.setattr(checks, "claims_hold", lambda _: True)
    monkeypatch.setattr(checks, "probe_rows", lambda *_: rows)
    mine = SimpleNamespace(
        run=SimpleNamespace(sd=np.full((2, 3, 1), 2e-3)), whole=True, residuals={"a@all": samples},
        scene=SimpleNamespace(probes=(SimpleNamespace(name="a"),)), body=SimpleNamespace(mesh=None),
    )  # fmt: skip
    (found,) = checks._own_doubt(mine)["a@all"]  # type: ignore[arg-type]
    assert found.change.values.tolist() == [[2e-3], [2e-3]]
    assert found.change.t is None
