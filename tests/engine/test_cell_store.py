"""What a record holds comes back as it was: arrays with their types, infinite numbers too."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from engine_samples import Waiting
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from validate.arrays import Floats, Ints
from validate.engine.cell import Record
from validate.engine.store import read_records, write_record


@dataclass(frozen=True)
class Held:
    """Each kind of part that a value may have."""

    name: str
    field: Floats
    at: Ints
    by_name: Mapping[str, Floats]
    limit: float | None = None
    inner: "Held | None" = None


def back(folder: Path, value: Held) -> Held:
    write_record(folder, Waiting("k"), Record("k", value, code="c"))
    found = read_records(folder, ("k",), Held, "c")
    assert found.doubts == ()
    got = found.records["k"].value
    assert got is not None
    return got


def same(one: Held, other: Held) -> bool:
    pairs = [(one.field, other.field), (one.at, other.at)]
    pairs += [(one.by_name[k], other.by_name[k]) for k in one.by_name]
    equal = all(
        a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype == float) for a, b in pairs
    )
    inner = (one.inner is None) == (other.inner is None)
    if one.inner is not None and other.inner is not None:
        inner = same(one.inner, other.inner)
    return equal and inner and repr(one.limit) == repr(other.limit) and one.name == other.name


FLOATS = arrays(np.float64, array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=9))
INTS = arrays(
    np.int64,
    array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=20),
    elements=st.integers(-(2**53), 2**53),
)


@given(FLOATS, INTS, FLOATS, st.none() | st.floats())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
def test_a_value_comes_back_bit_by_bit(
    tmp_path: Path, field: Floats, at: Ints, other: Floats, limit: float | None
) -> None:
    inner = Held("in", other, at, {}, limit)
    value = Held("out", field, at, {"a": other, "b": field}, limit, inner)
    assert same(back(tmp_path, value), value)


@pytest.mark.parametrize("damage", ["cut", "gone", "other"])
def test_arrays_that_are_not_as_written_make_the_cell_run_again(
    tmp_path: Path, damage: str
) -> None:
    value = Held("out", np.arange(900.0), np.arange(3), {})
    back(tmp_path, value)
    beside = tmp_path / "k.npz"
    if damage == "gone":
        beside.unlink()
    elif damage == "cut":
        beside.write_bytes(beside.read_bytes()[:-20])
    else:
        np.savez(beside, a0=np.arange(900.0) + 1e-9)
    found = read_records(tmp_path, ("k",), Held, "c")
    assert found.records == {}
    assert "computed again" in found.doubts[0]
