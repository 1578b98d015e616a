"""Taylor-Hood statics: exact fields, agreement where nothing locks, and what locking costs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from experiments.bending_rod.body import GRAVITY, bending_rod
from experiments.needle_block.body import MP2, needle_block
from validate.errors import SceneError
from validate.fem.assembly import volume_constraints as mixed
from validate.fem.assembly.volume_constraints import mixed_static
from validate.fem.locking import locking_notes
from validate.fem.system import build
from validate.scene.geometries.box import box, grid
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.scene import Load, Mass, Membrane, Pin, Scene, Support

# private: _require_plain: called alone, case by case.


def compliance(scene: Scene) -> float:
    """f u J of the scene's own elements under one unit of its first load."""
    system = build(scene)
    f = system.loads[system.free, 0]
    return float(f @ system.factor().solve(f))


def pushed(n: int, nu: float) -> Scene:
    """The needle's block with a uniform traction on the middle fifth of its free side."""
    scene = needle_block(n)
    mesh = scene.mesh
    side = mesh.facets["x1"]
    middle = side[np.abs(mesh.nodes[side].mean(axis=1)[:, 1] - 0.5) < 0.1]
    return replace(
        scene,
        body=Mesh(mesh.nodes, mesh.cells, mesh.kind, {**mesh.facets, "middle": middle}),
        material=replace(scene.material, nu=nu),
        drives=(),
        loads=(Load("push", "middle", (-1.0, 0.0)),),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("nu", "printed"), [(0.47, 0.930), (0.495, 0.759), (0.4999, 0.134)])
def test_bilinear_quadrilaterals_lock(nu: float, printed: float) -> None:
    """n = 20: numbers of an independent reconstruction of paper 002, three digits.

    The traction ends within the side, where stresses are singular: the reference is refined.
    """
    reference = mixed_static(pushed(40, nu)).compliances[0]
    assert compliance(pushed(20, nu)) / reference == pytest.approx(printed, abs=1e-3)


@pytest.mark.parametrize("kind", [grid, box])
@pytest.mark.parametrize("size", [(1.0, 2.0), (1.0, 2.0, 1.5)])
@pytest.mark.parametrize("nu", [0.3, 0.4999])
def test_a_bar_between_rollers_is_exact(kind: object, size: tuple[float, ...], nu: float) -> None:
    """Uniaxial stress (plane strain in 2-D): the end moves F L/(E' A), at any nu."""
    d = len(size)
    mesh = (grid if kind is grid else box)(size, (2,) * d)
    rollers = tuple(Support(f"{'xyz'[c]}0", (c,)) for c in range(d))
    pull = (1.0,) + (0.0,) * (d - 1)
    scene = Scene(mesh, Material(500.0, nu), rollers, loads=(Load("pull", "x1", pull),))
    solved = mixed_static(scene)
    modulus = 500.0 / (1 - nu**2) if d == 2 else 500.0
    expected = size[0] / modulus / float(np.prod(size[1:]))
    assert solved.compliances[0] == pytest.approx(expected, rel=1e-10)
    assert solved.u[0, mesh.facet_nodes("x1"), 0] == pytest.approx(expected, rel=1e-10)


def test_far_from_incompressible_it_agrees_with_quadratic_elements() -> None:
    """Both converge; at nu = 0.2 on the same triangles they differ by far less than linear ones."""
    material = Material(500.0, 0.2)
    supports = (Support("x0", (0, 1)),)
    scene = Scene(
        box((2.0, 1.0), (12, 6)), material, supports, loads=(Load("q", "x1", (0.0, 1.0)),)
    )
    mixed = mixed_static(scene).compliances[0]
    assert compliance(replace(scene, body=scene.mesh.quadratic())) == pytest.approx(mixed, rel=2e-3)
    assert compliance(scene) < 0.97 * mixed


def test_the_rods_weight_bends_it_to_the_converged_tip() -> None:
    """0.13037 m is the mesh-converged mean tip of an independent reconstruction."""
    scene = bending_rod(3)
    end = scene.mesh.facet_nodes("x1")
    tip = GRAVITY * mixed_static(scene).u[0, end, 2].mean()
    assert -tip == pytest.approx(0.13037, rel=5e-3)


def test_the_warning_names_the_cells_and_leaves_plane_stress_alone() -> None:
    block = needle_block(4, MP2)
    (warning,) = locking_notes([("fem", block)])
    assert warning.startswith("linear quadrilaterals lock near incompressibility")
    assert "compare with mixed dilatation: nu = 0.495 (fem)" in warning
    assert locking_notes([("fem", replace(block, plane="stress"))]) == ()


def test_pins_and_drives_are_held() -> None:
    mesh = grid((1.0, 1.0), (2, 2))
    load = (Load("pull", "x1", (1.0, 0.0)),)
    rollers = (Support("x0", (0,)),)
    pinned = Scene(mesh, Material(500.0, 0.3), rollers, (Pin((0.0, 0.0), (1,)),), loads=load)
    u = mixed_static(pinned).u[0]
    assert u[0] == pytest.approx([0.0, 0.0])
    driven = replace(needle_block(4), loads=(Load("pull", "x1", (0.0, 1.0)),))
    needle = driven.mesh.nearest_node(np.array([1.0, 0.5]))
    moved = mixed_static(driven).u[0, needle]
    assert moved[0] == 0.0
    assert moved[1] > 0


def test_what_it_cannot_do_is_refused() -> None:
    scene = pushed(10, 0.3)
    with pytest.raises(SceneError, match="not quad4 in plane stress"):
        mixed_static(replace(scene, plane="stress"))
    with pytest.raises(SceneError, match="got none"):
        mixed_static(replace(scene, loads=()))
    with pytest.raises(SceneError, match=r"got \['push'\]"):
        mixed_static(replace(scene, loads=(replace(scene.loads[0], spread="nodal"),)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"masses": (Mass("m", "x1", 1.0),)}, "support faces only, no edges, points, mas"),
        (
            {"membranes": (Membrane("x1", 1e-3, Material(1.0, 0.3)),)},
            "support supports, pins, drives and loads",
        ),
        ({"loads": ()}, "mixed elements need consistent loads or weights, got none"),
    ],
)
def test_what_mixed_elements_do_not_know_is_refused(changed: dict[str, object], says: str) -> None:
    whole = pushed(6, 0.3)
    scene = SimpleNamespace(**{**vars(whole), "mesh": whole.mesh, **changed})
    with pytest.raises(SceneError, match=says):
        mixed._require_plain(scene)  # type: ignore[arg-type]
