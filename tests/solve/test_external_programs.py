"""Real runs of the shipped external simulators; skipped if a program is not installed."""

import shlex
import shutil
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.scene import Drive, Scene, Support, Weight
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.external.suite import OffBy, check_simulator
from validate.solve.march import run_scheme
from validate.solve.static.newton import StaticNewton

STATICS = ("rigid motion", "rigid turn", "patch test", "uniaxial, linear", "hanging bar")


def shipped(root: Path, script: str) -> ExternalSimulator:
    command = [sys.executable, str(root / "benchmarks" / "external" / script)]
    return ExternalSimulator(shlex.join(command), seconds=120.0)


def checked(root: Path, script: str) -> dict[str, tuple[OffBy, ...]]:
    return {rows[0].scene: rows for rows in check_simulator(shipped(root, script))}


def off(rows: tuple[OffBy, ...]) -> float:
    """Of the displacement, relative to its largest value."""
    assert rows[0].error is not None, rows[0].why
    return rows[0].error / rows[0].exact


@pytest.mark.slow
@pytest.mark.skipif(find_spec("felupe") is None, reason="felupe absent: the extra 'peers' has it")
def test_felupe_solves_all_statics_and_says_that_it_has_no_dynamics(project_root: Path) -> None:
    found = checked(project_root, "felupe_simulator.py")
    for name in (*STATICS, "uniaxial, neo-Hooke"):
        assert off(found[name]) < 1e-6
        assert found[name][0].why.startswith("external: FElupe")
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
    found = checked(project_root, "calculix_simulator.py")
    for name in STATICS:
        assert off(found[name]) < 1e-5
        assert "out of balance" not in found[name][0].why
    assert off(found["ring-down"]) < 1e-3
    other = found["uniaxial, neo-Hooke"]
    assert 1e-3 < off(other) < 2e-2
    assert "used volumetric = K/2 (J - 1)^2 instead of split" in other[0].why


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mujoco") is None, reason="mujoco absent: the extra 'peers' has it")
def test_mujoco_uses_one_law_and_reports_it(project_root: Path) -> None:
    """Exact where St. Venant-Kirchhoff's law is asked's own answer; far off where it is not."""
    found = checked(project_root, "mujoco_simulator.py")
    for name in ("rigid turn", "patch test"):
        assert off(found[name]) < 1e-6
    for rows in found.values():
        assert "used law = svk instead of" in rows[0].why
        assert "each was cut into six linear tetrahedra" in rows[0].why
        assert "out of balance" not in rows[0].why
    assert off(found["uniaxial, linear"]) < 1e-2
    force = found["uniaxial, neo-Hooke"][1]
    stretched = 10e3 / 2 * (1.3**2 - 1) * 1.3 * 0.02**2  # N: its own law's
    assert force.error == pytest.approx(stretched - force.exact, rel=1e-5)
    for name in ("hanging bar", "ring-down"):
        assert 0.1 < off(found[name]) < 0.2  # as its law is at a strain of 10 %


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mujoco") is None, reason="mujoco absent: the extra 'peers' has it")
@pytest.mark.parametrize("nu", [0.45, 0.499])
def test_mujoco_bends_a_beam_as_our_tetrahedra_of_its_law_do(project_root: Path, nu: float) -> None:
    """Locking and all: the measured beam's size and modulus, 10 x 3 x 3 cells."""
    simulator, weight = shipped(project_root, "mujoco_simulator.py"), np.full((1, 1), 9.80709)
    at, ends = np.zeros(1, int), []
    for make in (box, grid):  # its cut of hexahedra is our box's
        scene = Scene(
            make((0.1, 0.03, 0.03), (10, 3, 3)),
            Material(263_824.0, nu, "svk", 1070.0),
            (Support("x0", (0, 1, 2)),),
            loads=(Weight("gravity", (0.0, 0.0, -1.0)),),
        )
        run = simulator.solve(scene, np.ones(1), weight)
        assert run.finished, run.outcome.why
        ends.append(run.u[0, scene.mesh.facet_nodes("x1"), 2].mean())
        if make is box:
            assert run.said[1:] == ()  # nothing ignored, changed or out of balance
            own = run_scheme("own", StaticNewton("none"), scene, np.ones(1), weight, at).u[0]
            assert np.abs(run.u[0] - own).max() < 1e-5 * np.abs(own).max()
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)
    assert 1e3 * ends[0] == pytest.approx({0.45: -3.445, 0.499: -0.880}[nu], abs=1e-3)


@pytest.mark.slow
@pytest.mark.skipif(find_spec("mujoco") is None, reason="mujoco absent: the extra 'peers' has it")
@pytest.mark.parametrize(("count", "end"), [((4, 1, 1), -6.438), ((5, 2, 2), -6.641)])
def test_quadratic_cells_of_mujoco_do_not_lock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, count: tuple[int, int, int], end: float
) -> None:
    """The same beam at nu .45 by cells that its script does not use; mean motion of the end, mm."""
    mujoco = pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)  # it leaves a log where it runs
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 -9.80709" timestep="0.03" integrator="discrete"/>
        <worldbody><flexcomp name="beam" type="grid" dim="3" count="21 7 7" radius="1e-4"
        spacing=".005 .005 .005" mass="{0.1 * 0.03 * 0.03 * 1070.0}" dof="quadratic"
        cellcount="{" ".join(map(str, count))}"><elasticity young="263824" poisson="0.45"/>
        <contact selfcollide="none" contype="0" conaffinity="0"/>
        <pin gridrange="0 0 0 0 {2 * count[1]} {2 * count[2]}"/></flexcomp></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    x = data.flexvert_xpos.copy()
    for _ in range(100):  # long steps that keep no velocity
        mujoco.mj_step(model, data)
        data.qvel[:] = 0.0
    mujoco.mj_forward(model, data)
    moved = data.flexvert_xpos - x
    held, free = (np.isclose(x[:, 0], at, atol=1e-9) for at in (x[:, 0].min(), x[:, 0].max()))
    assert np.abs(moved[held]).max() == 0
    assert 1e3 * moved[free, 2].mean() == pytest.approx(end, abs=2e-3)


@pytest.mark.slow
@pytest.mark.skipif(
    find_spec("newton") is None, reason="newton absent: install it manually: pip install newton"
)
def test_newton_is_told_its_own_moduli(project_root: Path) -> None:
    """4/3 mu and lambda + 5/6 mu: given Lame's it would be a quarter too soft in shear."""
    scene = Scene(
        box((0.02, 0.02, 0.02), (2, 2, 2)),
        Material(10e3, 0.3),
        (Support("x0", (0,)), Support("y0", (1,)), Support("z0", (2,))),
        drives=(Drive("pull", "z1", (0.0, 0.0, 1.0)),),
    )
    strain = 1e-3
    run = shipped(project_root, "newton_simulator.py").solve(
        scene, np.ones(1), np.array([[strain * 0.02]])
    )
    assert run.finished, run.outcome.why
    assert "used law = neo_hooke instead of linear" in run.said
    exact = scene.mesh.nodes * strain * np.array([-0.3, -0.3, 1.0])
    assert np.abs(run.u[0] - exact).max() < 1e-2 * strain * 0.02
    assert run.traces["pull.force"].y[0] == pytest.approx(10e3 * strain * 0.02**2, rel=1e-2)
