"""docs/developers/plugins.md: its examples run, and the contracts find a part that is broken."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from validate.fem.laws.law import NeoHooke
from validate.recording.reader import Reader
from validate.recording.readers import with_tables
from validate.scene.laws import LAWS, LawKind
from validate.scene.material import Material
from validate.solve.dynamic.newmark import Newmark
from validate.solve.external.program import SIMULATORS
from validate.solve.types import State
from validate.testing import (
    ReaderSample,
    filter_contract,
    law_contract,
    reader_contract,
    scheme_contract,
)

# private: _added: plug-ins of the test are taken out again.

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "developers" / "plugins.md"
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)


@pytest.fixture
def page() -> dict[str, Any]:
    """The names of the page's blocks, run in order as one module."""
    found: dict[str, Any] = {}
    added = [(registry, list(registry._added)) for registry in (LAWS, SIMULATORS)]
    exec(compile("\n\n".join(BLOCKS), "plugins.md", "exec"), found)
    for registry, before in added:
        registry._added[:] = before
    return found


def test_the_examples_run_and_a_reader_is_tested_in_thirty_lines(
    page: dict[str, Any], tmp_path: Path
) -> None:
    test = next(block for block in BLOCKS if "reader_contract" in block)
    assert len(test.strip().splitlines()) <= 30
    for i, check in enumerate(reader_contract):
        (tmp_path / f"{i}").mkdir()
        check(ReaderSample(page["GAUGE"], page["make"]), tmp_path / f"{i}")
    page["test_the_force_is_read"](tmp_path)


def fails(contract: tuple[Callable[..., None], ...], *arguments: Any) -> set[str]:
    """Names of the checks that a part does not pass."""
    found = set()
    for check in contract:
        try:
            check(*arguments)
        except AssertionError:
            found.add(check.__name__)
    return found


def test_the_contract_of_readers_finds_what_is_broken(page: dict[str, Any], tmp_path: Path) -> None:
    good: Reader = page["GAUGE"]

    def broken(name: str, **changes: Any) -> set[str]:
        (tmp_path / name).mkdir()
        found = set()
        for check in reader_contract:
            folder = tmp_path / name / check.__name__
            folder.mkdir()
            found |= fails((check,), ReaderSample(replace(good, **changes), page["make"]), folder)
        return found

    assert broken("good") == set()
    assert broken("silent", sign="") == {"specifies_itself"}
    assert broken("any", recognises=lambda path: True) == {"recognises_its_files_only"}

    def late(path: Path, options: Any) -> Any:
        got = page["read_gauge"](path, options)
        force = replace(got.signals["force"], t=got.signals["force"].t + 1)
        return replace(got, signals={"force": force})

    assert broken("late", read=late) == {"gives_a_recording_that_can_be_written"}


def test_the_contract_of_laws_finds_what_is_broken(page: dict[str, Any]) -> None:
    def broken(at_point: Callable[..., Any]) -> set[str]:
        kind = LawKind("odd", "odd", (), ("split",), ranged=False, at_point=at_point)
        LAWS.add(kind)
        try:
            return fails(law_contract, Material(1e4, 0.45, "odd"))  # type: ignore[arg-type]
        finally:
            LAWS._added.remove(kind)

    class WrongTangent(NeoHooke):
        def tangent(self, H: Any) -> Any:
            return 1.01 * super().tangent(H)

    class Anisotropic(NeoHooke):
        def energy(self, H: Any) -> Any:
            return super().energy(H) * (1 + H[..., 0, 0])

    assert broken(lambda mu, kappa, c: NeoHooke(mu, kappa)) == set()
    assert broken(lambda mu, kappa, c: NeoHooke(2 * mu, kappa)) == {"small_strains_are_linear"}
    assert broken(lambda mu, kappa, c: NeoHooke(mu, kappa + mu)) == {
        "small_strains_are_linear", "isochoric_and_volumetric_part_add_up",
    }  # fmt: skip
    assert "stress_and_tangent_are_derivatives" in broken(lambda mu, k, c: WrongTangent(mu, k))
    assert "it_is_objective_and_isotropic" in broken(lambda mu, k, c: Anisotropic(mu, k))


def test_the_contracts_of_schemes_and_filters_find_what_is_broken(page: dict[str, Any]) -> None:
    class Drifting(Newmark):
        def prepare(self, system: Any) -> Any:
            return Wrapped(super().prepare(system), np.full(system.scene.mesh.nodes.shape, 1e-6))

    class Wrapped:
        def __init__(self, inner: Any, drift: Any) -> None:
            self.inner, self.drift, self.units, self.scene = inner, drift, inner.units, inner.scene

        def rest(self) -> State:
            return self.inner.rest()  # type: ignore[no-any-return]

        def step(self, state: State, inputs: Any) -> State:
            return self.inner.step(state, inputs)  # type: ignore[no-any-return]

        def field(self, state: State) -> Any:
            return self.inner.field(state) + state.k * self.drift

    assert fails(scheme_contract, Newmark()) == set()
    assert fails(scheme_contract, Drifting()) == {
        "steps_from_rest", "without_inputs_it_stays_at_rest",
    }  # fmt: skip

    from validate.estimate.kalman.kf_fem import KfFem

    class Clairvoyant(KfFem):
        """It is given the last measurement at every step."""

        def prepare(self, system: Any, measurements: Any) -> Any:
            z = np.broadcast_to(measurements.z[-1], measurements.z.shape)
            return super().prepare(system, replace(measurements, z=z))

    assert fails(filter_contract, KfFem()) == set()
    assert fails(filter_contract, Clairvoyant()) == {
        "it_is_given_measurements_only", "it_uses_what_is_measured_and_no_later",
    }  # fmt: skip


def test_the_page_of_formats_is_what_the_readers_specify() -> None:
    page = (ROOT / "docs" / "reference" / "formats.md").read_text("utf-8")
    assert with_tables(page) == page
    assert with_tables(page.replace("| `c3d` | motion", "| `c3d` | slow motion")) == page
