"""Programs of others that are guests here, run for real; skipped where they are not installed."""

import shlex
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from validate.solve.guests.guest import Guest
from validate.solve.guests.suite import OffBy, check_guest

STATICS = ("rigid motion", "rigid turn", "patch test", "uniaxial, linear", "hanging bar")


def checked(root: Path, script: str) -> dict[str, tuple[OffBy, ...]]:
    command = [sys.executable, str(root / "benchmarks" / "guests" / script)]
    guest = Guest(shlex.join(command), seconds=120.0)
    return {rows[0].scene: rows for rows in check_guest(guest)}


def off(rows: tuple[OffBy, ...]) -> float:
    """Of the displacement, relative to its largest value."""
    assert rows[0].error is not None, rows[0].why
    return rows[0].error / rows[0].exact


@pytest.mark.slow
@pytest.mark.skipif(find_spec("felupe") is None, reason="felupe absent: the extra 'peers' has it")
def test_felupe_solves_all_statics_and_says_that_it_has_no_dynamics(project_root: Path) -> None:
    found = checked(project_root, "felupe_guest.py")
    for name in (*STATICS, "uniaxial, neo-Hooke"):
        assert off(found[name]) < 1e-6
        assert found[name][0].why.startswith("guest: FElupe")
        assert "; " not in found[name][0].why  # nothing ignored, changed or out of balance
    ring = found["ring-down"][0]
    assert (ring.state, ring.error) == ("refused", None)
    assert "no dynamics" in ring.why
    force = found["uniaxial, neo-Hooke"][1]
    assert force.error is not None
    assert force.error < 1e-6 * force.exact


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ccx") is None, reason="ccx absent: apt-get calculix-ccx")
def test_calculix_solves_all_and_says_that_its_volume_term_is_another(project_root: Path) -> None:
    """Its own K/2 (J - 1)^2 costs about 1 % of the largest displacement at a stretch of 1.3."""
    found = checked(project_root, "calculix_guest.py")
    for name in STATICS:
        assert off(found[name]) < 1e-5
        assert "out of balance" not in found[name][0].why
    assert off(found["ring-down"]) < 1e-3
    other = found["uniaxial, neo-Hooke"]
    assert 1e-3 < off(other) < 2e-2
    assert "used volumetric = K/2 (J - 1)^2 instead of split" in other[0].why
