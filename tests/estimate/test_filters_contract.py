"""The contract of every filter: prepare, rest, step, field, sd, traces; it never sees the truth."""

import ast
import re
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from validate.errors import UsageError
from validate.estimate.ensemble.ensemble_kf import EnsembleKf
from validate.estimate.ensemble.member_filter import MemberModel
from validate.estimate.ensemble.roukf import Roukf
from validate.estimate.filters import FILTERS, Filter
from validate.estimate.kalman.kf_fem import KfFem
from validate.estimate.kalman.modal_kf import ModalKf
from validate.estimate.measurements import Measurements
from validate.estimate.reduced.reduced_kf import ReducedKf
from validate.solve.types import Uncertain
from validate.testing import filter_contract
from validate.testing.pulled_cube import DT, PulledCase, case

SETTINGS: tuple[Filter, ...] = (
    *(make() for make in FILTERS if "linear" in make.handles.law),
    KfFem(gains="every_step"),
    KfFem(structure="load"),
    ModalKf(gains="shared", recursion="posterior"),
    ReducedKf(gains="steady"),
    Roukf(points="canonical", parameters=("stiffness", "load.pull"), sd=(0.2, 0.1)),
    EnsembleKf(update="deterministic", inflation=1.02),
    EnsembleKf(
        parameters=("bias.pull",), bias_sd=1e-3, bias_walk=1e-2, coordinates="nodes", radius=0.002
    ),
)


@pytest.fixture(scope="module")
def pulled() -> PulledCase:
    return case()


def without(measurements: Measurements, steps: slice | None = None) -> Measurements:
    """The same with nothing seen at all, or not at some of its times."""
    z = measurements.z.copy()
    z[steps if steps is not None else slice(None)] = np.nan
    return replace(measurements, z=z)


@pytest.mark.parametrize("check", filter_contract, ids=lambda check: check.__name__)
@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_a_filter_keeps_its_contract(settings: Filter, check: Callable[[Filter], None]) -> None:
    check(settings)


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_every_filter_of_the_package_says_how_sure_it_is(
    settings: Filter, pulled: PulledCase
) -> None:
    assert isinstance(settings.prepare(pulled.system, pulled.measured(1)), Uncertain)


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_traces_hold_nis_and_innovations(settings: Filter, pulled: PulledCase) -> None:
    seen = pulled.measured(1, every=3)
    z = seen.z.copy()
    z[4] = np.nan
    run = pulled.march(settings.prepare(pulled.system, replace(seen, z=z)))
    assert run.outcome.state == "finished"
    dof = run.traces["nis.dof"].y
    assert dof.sum() == 3 * (len(pulled.t) // 3 - 1)
    assert set(np.flatnonzero(dof)) == {k for k in range(2, 60, 3) if k != 14}
    assert (run.traces["nis"].y[dof == 0] == 0).all()
    assert (run.traces["nis"].y[dof > 0] > 0).all()
    for name in seen.names:
        sd = run.traces[f"innovation.{name}.sd"]
        assert sd.unit == "m"
        assert ((sd.y > 0) == (dof > 0)).all()
        assert np.abs(run.traces[f"innovation.{name}"].y).max() > 0


def still(settings: MemberModel) -> dict[str, float]:
    """Nothing walks."""
    return {"walk": 0.0, "bias_walk": 0.0} if isinstance(settings, EnsembleKf) else {}


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_without_a_measurement_a_filter_is_its_model(settings: Filter, pulled: PulledCase) -> None:
    """The displacement filters are Newmark itself; the reduced ones have its static end. The mean
    of members is not the member of the mean: they are taken as sure."""
    if isinstance(settings, MemberModel):
        settings = replace(settings, sd=(1e-6,), bias_sd=1e-9, **still(settings))
    plain = pulled.march(settings.prepare(pulled.system, without(pulled.measured(1))))
    other = pulled.march(settings.prepare(pulled.system, without(pulled.measured(2, every=2))))
    assert np.array_equal(plain.u, other.u)
    exact = isinstance(settings, KfFem | ModalKf)
    off = np.abs(plain.u - pulled.truth.u).max() / np.abs(pulled.truth.u).max()
    assert off < (1e-10 if exact else 0.02)


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_a_filter_that_no_measurement_reaches_is_invalid(
    settings: Filter, pulled: PulledCase
) -> None:
    """All missing, all too late, all rejected: an outcome that says so, not a plain run."""
    seen = pulled.measured(1)
    closed = replace(settings, gate=1e-300)  # type: ignore[type-var]
    why = "measurements reached the filter"
    for filter_, given, says in (
        (
            settings,
            without(seen),
            rf"0 of 60 {why} \(60 have all components missing\), so the model ran",
        ),
        (settings, replace(seen, t=seen.t + 60 * DT), rf"0 of 60 {why} \(60 come after the last"),
        (settings, replace(seen, t=seen.t - 60 * DT), rf"0 of 60 {why} \(60 lie at the start"),
        (closed, seen, rf"0 of 60 {why} \(60 were met, and the gate rejected 60 marker samples"),
    ):
        if "start" in says and getattr(settings, "gains", "") == "steady":
            continue  # without any look there is nothing that it could settle on
        run = pulled.march(filter_.prepare(pulled.system, given))
        assert run.outcome.state == "invalid"
        assert re.match(says, run.outcome.why), run.outcome.why
        assert run.traces["nis.dof"].y.max() == 0


@pytest.mark.slow
@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_a_gated_outlier_changes_as_much_as_a_missing_look(
    settings: Filter, pulled: PulledCase
) -> None:
    """A marker that jumps by 1 m for one look, beside another that does not; without a gate the
    estimate follows it."""
    seen = pulled.two_measured(1)
    z, gone = seen.z.copy(), seen.z.copy()
    z[20, 4] += 1.0
    gone[20, 3:] = np.nan
    gated = replace(settings, gate=0.9999)  # type: ignore[type-var]
    jumped, missing = (
        pulled.march(gated.prepare(pulled.system, replace(seen, z=y)), at=(19, 20, 21, 59))
        for y in (z, gone)
    )
    assert np.array_equal(jumped.u, missing.u)
    assert jumped.sd is not None
    assert np.array_equal(jumped.sd, missing.sd)
    far = jumped.traces["gate.far.corner"].y
    assert far[20] > 100
    assert missing.traces["gate.far.corner"].y[20] == 0
    rejected = [run.traces["gate.rejected"].y for run in (jumped, missing)]
    assert rejected[0][20] == 1 + rejected[1][20]
    assert jumped.traces["gate.tested"].y.sum() == 120
    free = pulled.march(settings.prepare(pulled.system, replace(seen, z=z)), at=(20,))
    if isinstance(settings, MemberModel) and not free.finished:  # a constant does not come back
        assert "set a gate against outliers" in free.outcome.why
        return
    if not free.finished:
        assert free.outcome.state == "diverged"
        return
    assert np.abs(free.u[0] - missing.u[1]).max() > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_a_sure_clock_changes_nothing_and_a_doubtful_one_the_claims(
    settings: Filter, pulled: PulledCase
) -> None:
    """The recording's own sd_t is used unless the filter has one; at the start the top moves."""
    seen = pulled.measured(1)
    doubtful = replace(seen, sd_t=0.01)
    sure = replace(settings, clock=0.0)  # type: ignore[type-var]
    plain, same, wide = (
        pulled.march(f.prepare(pulled.system, m), at=(5,))
        for f, m in ((settings, seen), (sure, doubtful), (settings, doubtful))
    )
    assert np.array_equal(plain.u, same.u)
    assert all(np.array_equal(t.y, same.traces[name].y) for name, t in plain.traces.items())
    name = "innovation.top.z.sd"
    assert wide.traces[name].y[5] > 1.05 * plain.traces[name].y[5]


@pytest.mark.slow
@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
def test_an_open_gate_leaves_the_estimate(settings: Filter, pulled: PulledCase) -> None:
    """Gains as they go are those beforehand, to what `settled` leaves."""
    seen = pulled.measured(1, every=2)
    wide = replace(settings, gate=1 - 1e-15)  # type: ignore[type-var]
    runs = [pulled.march(f.prepare(pulled.system, seen), at=(9, 59)) for f in (settings, wide)]
    assert runs[0].u == pytest.approx(runs[1].u, rel=1e-4, abs=1e-8)
    assert runs[1].traces["gate.rejected"].y.sum() == 0


def test_a_gate_and_a_clock_that_are_none_are_refused(pulled: PulledCase) -> None:
    seen = pulled.measured(1)
    for wrong, says in (
        ({"gate": 1.0}, "gate = 1: expected a share of good samples between 0 and 1"),
        ({"clock": -1.0}, "clock = -1 s: expected a standard deviation"),
    ):
        with pytest.raises(UsageError, match=says):
            ReducedKf(**wrong).prepare(pulled.system, seen)  # type: ignore[arg-type]


@pytest.mark.parametrize("settings", SETTINGS, ids=repr)
@pytest.mark.parametrize("sd", [1e-9, 1.0])
def test_extreme_noise_leaves_a_filter_finite(
    settings: Filter, sd: float, pulled: PulledCase
) -> None:
    """R of 1e-18 and of 1 m^2: finite, and a claim that is finite too. Constant parameters that are
    told 30 000 sd of noise to be truth may run away: that is an outcome."""
    seen = pulled.measured(1, every=2)
    stepper = settings.prepare(pulled.system, replace(seen, sd=np.full(3, sd)))
    run = pulled.march(stepper, at=(9, 59))
    away = isinstance(settings, MemberModel) and sd < 1 and run.outcome.state == "diverged"
    assert run.finished or (away and "a member of" in run.outcome.why)
    assert run.sd is not None
    assert np.isfinite(run.sd).all()


def test_every_filter_is_in_the_tuple(project_root: Path) -> None:
    """A class with `prepare` is a filter; other floors find it in FILTERS."""
    written = {
        node.name
        for path in (project_root / "validate" / "estimate").rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
        and any(isinstance(f, ast.FunctionDef) and f.name == "prepare" for f in node.body)
        and "Protocol" not in [ast.unparse(b) for b in node.bases]
    }
    assert written == {f.__name__ for f in FILTERS}


def test_a_variance_is_in_square_metres() -> None:
    for filter_ in FILTERS:
        for f in fields(filter_):  # type: ignore[arg-type]
            variance = f.name in ("Q", "R", "P0", "Qp", "Qm")
            assert (f.metadata["unit"] == "m2") == variance, f"{filter_.__name__}.{f.name}"
