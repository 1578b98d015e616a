"""Stiffness of linear elasticity (paper 000, eqs 1-5), pointwise or with nodal mean dilatation."""

import numpy as np
from scipy import sparse
from skfem import (
    Basis,
    ElementTetP1,
    ElementTetP2,
    ElementTriP1,
    ElementTriP2,
    ElementVector,
    MeshTet,
    MeshTri,
    asm,
)
from skfem.models.elasticity import lame_parameters, linear_elasticity

from validate.arrays import Floats, Ints
from validate.fem.surface import surface_stiffness
from validate.scene.mesh import Mesh, cell_volumes, require_positive_cells
from validate.scene.scene import Material, Scene

_ELEMENTS = {
    "tri3": (MeshTri, ElementTriP1, 1),
    "tri6": (MeshTri, ElementTriP2, 2),
    "tet4": (MeshTet, ElementTetP1, 1),
    "tet10": (MeshTet, ElementTetP2, 2),
}


def stiffness(scene: Scene) -> sparse.csr_array:
    """K (N, N) N/m of the scene's mesh and material, N = n d, node-major.

    In 2-D plane strain, N/m per metre of thickness.

    Raises `SceneError` for an inverted element, named, or an element kind that is not assembled.
    """
    require_positive_cells(scene.mesh)
    if scene.dilatation == "nodal_mean":
        K = _nodal_mean_stiffness(scene.mesh, scene.material)
    else:
        K = _assembled(scene.mesh, scene.material.E, scene.material.nu)
    for part in surface_stiffness(scene):
        K = K + part
    return sparse.csr_array(K)


def _assembled(mesh: Mesh, E: float, nu: float) -> sparse.csr_array:
    library_mesh, element, degree = _ELEMENTS[mesh.kind]
    corners = np.ascontiguousarray(mesh.corners.T)
    vertices = int(mesh.corners.max()) + 1
    domain = library_mesh(np.ascontiguousarray(mesh.nodes[:vertices].T), corners)
    basis = Basis(domain, ElementVector(element()), intorder=degree)
    _require_node_major(basis.doflocs, mesh.nodes)
    K = asm(linear_elasticity(*lame_parameters(E, nu)), basis)
    return sparse.csr_array(K)


def _require_node_major(places: Floats, nodes: Floats) -> None:
    """The library's unknowns must lie where ours do, or every result would be permuted."""
    if not np.allclose(
        places, np.repeat(nodes, nodes.shape[1], axis=0).T, atol=1e-9 * np.ptp(nodes)
    ):
        raise AssertionError("scikit-fem numbers its unknowns differently from the mesh")


def _nodal_mean_stiffness(mesh: Mesh, material: Material) -> sparse.csr_array:
    """K = K_dev + D^T kappa V D: the volume strain is averaged over the cells around each node.

    D (n, N) maps displacements to nodal dilatations theta_a = sum_e V_e/4 div_e / V_a. The
    deviatoric part is the full stiffness less its pointwise volumetric part.
    Source: nodal averaging after Bonet & Burton (1998), for small strain.
    """
    B, volumes = divergence(mesh)
    kappa = material.bulk_modulus
    # A material without volume stiffness shares its deviatoric part with this one.
    pointwise = B.T @ sparse.diags_array(kappa * volumes) @ B
    K_dev = _assembled(mesh, material.E, material.nu) - pointwise
    share = _cell_to_node(mesh.corners, volumes, len(mesh.nodes))
    V = np.asarray(share.sum(axis=1))
    D = sparse.diags_array(1 / V) @ share @ B
    return sparse.csr_array(K_dev + D.T @ sparse.diags_array(kappa * V) @ D)


def divergence(mesh: Mesh) -> tuple[sparse.csr_array, Floats]:
    """B (e, N) so that B u is the volume strain of every linear cell, and volumes (e,) m^d."""
    gradients = shape_gradients(mesh)
    cells, d = mesh.corners, mesh.dimension
    columns = (cells[..., None] * d + np.arange(d)).reshape(len(cells), -1)
    rows = np.repeat(np.arange(len(cells)), columns.shape[1])
    shape = (len(cells), len(mesh.nodes) * d)
    values = gradients.reshape(len(cells), -1).ravel()
    return sparse.csr_array((values, (rows, columns.ravel())), shape=shape), cell_volumes(mesh)


def shape_gradients(mesh: Mesh) -> Floats:
    """dN_a/dx (e, d + 1, d) 1/m of the linear shape functions of every cell."""
    x = mesh.nodes[mesh.corners]
    inverse = np.linalg.inv(x[:, 1:] - x[:, :1])
    rest = np.swapaxes(inverse, 1, 2)
    return np.concatenate([-rest.sum(axis=1, keepdims=True), rest], axis=1)


def _cell_to_node(corners: Ints, volumes: Floats, n: int) -> sparse.csr_array:
    per = corners.shape[1]
    columns = np.repeat(np.arange(len(corners)), per)
    values = np.repeat(volumes / per, per)
    return sparse.csr_array((values, (corners.ravel(), columns)), shape=(n, len(corners)))
