"""Near incompressibility linear elements lock; nodal mean dilatation and quadratic ones do not."""

import numpy as np
import pytest
from phantoms import COARSE_GRID, grid_mesh, phantom_responses
from scipy.sparse.linalg import spsolve

from validate.fem.assembly.assemble import stiffness
from validate.fem.system import Responses
from validate.scene.material import Material
from validate.scene.scene import Dilatation, Scene


def cantilever_tip(order: int, dilatation: Dilatation, nu: float) -> float:
    """Deflection of a 1 x 1 x 5 beam, E 1000, clamped at z = 0, under a unit end force."""
    mesh = grid_mesh((4, 4, 16), (1.0, 1.0, 5.0), kind="tet10" if order == 2 else "tet4")
    K = stiffness(Scene(mesh, Material(1e3, nu), dilatation=dilatation))
    end = mesh.facet_nodes("z1")
    free = np.repeat(mesh.nodes[:, 2] > 0, 3)
    load = np.zeros(mesh.nodes.size)
    load[3 * end] = 1 / len(end)
    return float(load[free] @ spsolve(K[free][:, free].tocsc(), load[free]))


def rest_slope(responses: Responses) -> float:
    """V0/(dV/dP) Pa."""
    form = responses.volumes[0]
    return float(form[0, 0, 0] / (3 * form[0, 0, -1]))


@pytest.mark.slow
def test_bending_of_a_beam() -> None:
    quadratic = cantilever_tip(2, "pointwise", 0.4999)
    linear = cantilever_tip(1, "pointwise", 0.4999)
    mean = cantilever_tip(1, "nodal_mean", 0.4999)
    # Bernoulli F L^3 / 3 E I is 0.5; shear adds, the clamped end takes away.
    assert quadratic == pytest.approx(0.5, rel=0.05)
    assert linear < 0.05 * quadratic
    assert mean > 0.7 * quadratic
    # Locking proper: what is lost on the way from nu .3, beyond what the coarse mesh loses there.
    assert linear < 0.1 * cantilever_tip(1, "pointwise", 0.3)
    assert mean > 0.8 * cantilever_tip(1, "nodal_mean", 0.3)


def test_compliance_of_the_cavity_on_the_paper_mesh() -> None:
    linear, nearly = (rest_slope(phantom_responses(nu=nu)) for nu in (0.485, 0.4999))
    mean, mean_nearly = (
        rest_slope(phantom_responses(nu=nu, dilatation="nodal_mean")) for nu in (0.485, 0.4999)
    )
    assert nearly / linear > 6
    assert mean_nearly / mean < 1.35
    assert linear / mean > 2


def test_compliance_of_the_cavity_against_quadratic_elements() -> None:
    """On one coarse mesh of the phantom, nu .4999."""
    quadratic = rest_slope(phantom_responses(COARSE_GRID, 2, nu=0.4999))
    linear = rest_slope(phantom_responses(COARSE_GRID, 1, nu=0.4999))
    mean = rest_slope(phantom_responses(COARSE_GRID, 1, nu=0.4999, dilatation="nodal_mean"))
    assert linear > 20 * quadratic
    assert quadratic < mean < 3 * quadratic


def test_a_material_without_volume_stiffness_contrast_is_left_nearly_alone() -> None:
    """At nu = 0 the mean costs a linear mesh little: it only averages what hardly varies."""
    pointwise, mean = (cantilever_tip(1, d, 0.0) for d in ("pointwise", "nodal_mean"))
    assert mean > pointwise
    assert mean == pytest.approx(pointwise, rel=0.15)
