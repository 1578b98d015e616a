"""Stiffness on facets: elastic foundations (partial friction) and membranes."""

import numpy as np
from scipy import sparse

from validate.arrays import Floats, Ints
from validate.scene.mesh import Mesh
from validate.scene.places import facets_of
from validate.scene.scene import Foundation, Membrane, Scene
from validate.scene.shape_functions import facet_rule


def surface_stiffness(scene: Scene) -> tuple[sparse.csr_array, ...]:
    """What the scene's foundations and membranes add to K; empty when it has none."""
    return (
        *(foundation_stiffness(scene.mesh, f) for f in scene.foundations),
        *(membrane_stiffness(scene.mesh, m) for m in scene.membranes),
    )


def foundation_stiffness(mesh: Mesh, foundation: Foundation) -> sparse.csr_array:
    """K (N, N) N/m of springs to the ground, k integral of N_a N_b dA per held component."""
    facets = facets_of(mesh, foundation.facets)
    rule = facet_rule(3, facets.shape[1])
    J = rule.jacobians(mesh.nodes[facets])
    area = np.linalg.norm(np.cross(J[..., 0], J[..., 1]), axis=2)
    mass = np.einsum("q,fq,qa,qb->fab", rule.weights, area, rule.N, rule.N)
    select = np.zeros((3, 3))
    select[foundation.components, foundation.components] = foundation.stiffness
    return _assembled(mesh, facets, np.einsum("fab,ij->faibj", mass, select))


def membrane_stiffness(mesh: Mesh, membrane: Membrane) -> sparse.csr_array:
    """K (N, N) N/m of a thin elastic sheet on facets, in plane stress, without bending.

    With surface gradients g_a and the tangent projector P, thickness t and plane-stress lambda',
    K_ab = t integral of lambda' g_a g_b^T + mu (g_b g_a^T + (g_a . g_b) P) dA. The sheet is taut:
    it carries compression too, where a slack one would wrinkle.
    """
    facets = facets_of(mesh, membrane.facets)
    rule = facet_rule(3, facets.shape[1])
    J = rule.jacobians(mesh.nodes[facets])
    e1, e2 = J[..., 0], J[..., 1]
    normal = np.cross(e1, e2)
    area = np.linalg.norm(normal, axis=2)
    n = normal / area[..., None]
    dual = np.stack([np.cross(e2, n), np.cross(n, e1)], axis=2) / area[..., None, None]
    g = np.einsum("qaj,fqji->fqai", rule.dN, dual)
    P = np.eye(3) - np.einsum("fqi,fqj->fqij", n, n)
    mu = membrane.material.shear_modulus
    nu = membrane.material.nu
    plane = 2 * mu * nu / (1 - nu)  # lambda' = E nu / (1 - nu^2)
    w = membrane.thickness * rule.weights * area
    K = plane * np.einsum("fq,fqai,fqbj->faibj", w, g, g)
    K += mu * np.einsum("fq,fqbi,fqaj->faibj", w, g, g)
    K += mu * np.einsum("fq,fqak,fqbk,fqij->faibj", w, g, g, P)
    return _assembled(mesh, facets, K)


def _assembled(mesh: Mesh, facets: Ints, K: Floats) -> sparse.csr_array:
    """Element matrices (f, a, i, b, j) summed into (N, N), node-major."""
    dofs = (3 * facets[:, :, None] + np.arange(3)).reshape(len(facets), -1)
    size = dofs.shape[1]
    rows = np.repeat(dofs, size, axis=1).ravel()
    columns = np.tile(dofs, (1, size)).ravel()
    shape = (mesh.nodes.size, mesh.nodes.size)
    return sparse.csr_array((K.ravel(), (rows, columns)), shape=shape)
