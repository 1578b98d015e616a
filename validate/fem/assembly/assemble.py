"""Stiffness, mass and damping matrices, nodal loads, and integrals over cells.

The stiffness is pointwise, mixed or with nodal mean dilatation; materials may differ from cell to
cell.

Integrals over the cells of a mesh of any kind, deformed or at rest.

Mean dilatation of mixed cells: projection of volume change on constants or linear fields. Three
fields u, p, theta with p and theta of their own in every cell and eliminated there (Simo, Taylor &
Pister 1985): theta is the projection of the law's measure of volume change, and the energy is W(F)
of the isochoric part plus U(theta). Constants on hex8 (mean dilatation, Nagtegaal, Parks & Rice
1974), tet10 and tri6; linear fields of the place on hex27 (Boffi, Brezzi & Fortin 2013, 8.6), which
keep its order up to nu -> 1/2; on tet10 constants leave order 2 there.

Foundations (partial friction) and membranes add a stiffness on facets.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree
from skfem import (
    Basis,
    BilinearForm,
    ElementHex1,
    ElementHex2,
    ElementQuad1,
    ElementTetP1,
    ElementTetP2,
    ElementTriP1,
    ElementTriP2,
    MeshHex,
    MeshQuad,
    MeshTet,
    MeshTri,
    asm,
)
from skfem.models.elasticity import lame_parameters

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.material import Material
from validate.scene.mesh import Mesh, require_positive_cells
from validate.scene.places import Place, facets_of, kind_of, nodes_of
from validate.scene.scene import Foundation, Membrane, Pressure, Scene, Weight
from validate.scene.shape_functions import (
    CORNERS,
    EDGES,
    LATTICE,
    Quadrature,
    barycentric,
    brick_rule,
    collapsed_points,
    facet_rule,
    gauss_points,
    simplex_rule,
    simplex_slopes,
    symmetric_points,
)


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
    return _on_facets(mesh, facets, np.einsum("fab,ij->faibj", mass, select))


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
    return _on_facets(mesh, facets, K)


def _on_facets(mesh: Mesh, facets: Ints, K: Floats) -> sparse.csr_array:
    """Element matrices (f, a, i, b, j) summed into (N, N), node-major."""
    dofs = (3 * facets[:, :, None] + np.arange(3)).reshape(len(facets), -1)
    size = dofs.shape[1]
    rows = np.repeat(dofs, size, axis=1).ravel()
    columns = np.tile(dofs, (1, size)).ravel()
    shape = (mesh.nodes.size, mesh.nodes.size)
    return sparse.csr_array((K.ravel(), (rows, columns)), shape=shape)


def rule(mesh: Mesh, points: int) -> Quadrature:
    """`points` Gauss points along each axis: exact to degree 2 points - 1."""
    inside = gauss_points if mesh.bricks else collapsed_points
    return _rule_at(mesh, *inside(mesh.dimension, points))


def nodal_rule(mesh: Mesh) -> Quadrature:
    """Shapes at the nodes of a cell, without weights: where slopes of linear fields peak."""
    if mesh.bricks:
        xi: Floats = (CORNERS if mesh.order == 1 else LATTICE)[mesh.dimension]
    else:
        xi = np.vstack([np.zeros(mesh.dimension), np.eye(mesh.dimension)])
        if mesh.order == 2:
            xi = np.vstack([xi, xi[np.array(EDGES[mesh.dimension])].mean(axis=1)])
    return _rule_at(mesh, xi, np.zeros(len(xi)))


def _rule_at(mesh: Mesh, xi: Floats, weights: Floats) -> Quadrature:
    if mesh.bricks:
        return brick_rule(xi, weights, mesh.order)
    return simplex_rule(mesh.order, barycentric(xi), weights)


def jacobians(mesh: Mesh, rule: Quadrature, u: Floats | None = None) -> Floats:
    """det dx/dxi (e, q) of the mesh, moved by u (n, d) m when given; not positive = inverted."""
    x = mesh.nodes if u is None else mesh.nodes + u
    return np.asarray(np.linalg.det(rule.jacobians(x[mesh.cells])))


def volumes_at(mesh: Mesh, rule: Quadrature) -> Floats:
    """Weight times volume (e, q) m^d: an integral is the sum of these times the integrand."""
    return rule.weights * jacobians(mesh, rule)


def values_at(mesh: Mesh, rule: Quadrature, nodal: Floats) -> Floats:
    """Nodal values (n, c) interpolated at the quadrature points (e, q, c)."""
    return rule.at(nodal[mesh.cells])


def projections(mesh: Mesh, places: Floats, weights: Floats) -> Floats:
    """Pi (e, q, q): what values at the points of every cell become, in the mean with `weights`.

    `places` (e, q, d) m and `weights` (e, q) m^d are those of the points. Pi is symmetric in the
    scalar product of the weights, so that it is its own adjoint.
    """
    volume = weights.sum(axis=1)[:, None, None]
    middle = (weights[..., None] * places).sum(axis=1, keepdims=True) / volume
    fields = np.ones((*weights.shape, 1))
    if mesh.kind == "hex27":
        fields = np.concatenate([fields, (places - middle) / np.cbrt(volume)], axis=2)
    weighted = np.swapaxes(fields * weights[..., None], 1, 2)
    return np.asarray(fields @ np.linalg.solve(weighted @ fields, weighted))


# The library's mesh and element, and the degree that a mass is integrated to.
_ELEMENTS = {
    "tri3": (MeshTri, ElementTriP1, 2),
    "tri6": (MeshTri, ElementTriP2, 4),
    "tet4": (MeshTet, ElementTetP1, 2),
    "tet10": (MeshTet, ElementTetP2, 4),
    "quad4": (MeshQuad, ElementQuad1, 3),
    "hex8": (MeshHex, ElementHex1, 3),
    "hex27": (MeshHex, ElementHex2, 5),
}
# Our corners in the order in which the library lists a hexahedron's.
_HEXAHEDRON = (0, 4, 3, 1, 7, 5, 2, 6)


def stiffness(scene: Scene) -> sparse.csr_array:
    """K (N, N) N/m of the scene's mesh and material, N = n d, node-major.

    In 2-D of the scene's plane state and thickness (1 m: N/m per metre).

    Raises `SceneError` for an inverted element, named, or an element kind that is not assembled.
    """
    require_positive_cells(scene.mesh)
    if scene.dilatation == "nodal_mean":
        K = _nodal_mean_stiffness(scene)
    else:
        K = _assembled(scene, *(scene.thickness * c for c in lame_constants(scene)))
    for part in surface_stiffness(scene):
        K = K + part
    return sparse.csr_array(K)


def harmonic(scene: Scene) -> sparse.csr_array:
    """grad v : grad u (N, N) m of the scene's mesh, for unknowns that a boundary held all round
    leaves free: 2 eps : eps less div v div u, which differs from it by a surface integral alone."""
    shear, both = (
        stiffness(replace(scene, material=Material(E, nu), regions=(), dilatation="pointwise"))
        for E, nu in ((2.0, 0.0), (2.5, 0.25))  # Lame's (0, 1) and (1, 1) Pa
    )
    return sparse.csr_array(2 * shear - both)


def stiffness_damping(scene: Scene) -> sparse.csr_array:
    """Return the share of C (N, N) N s/m that is proportional to K: sum over cells of beta_e
    K_e."""
    if scene.dilatation == "nodal_mean":
        return sparse.csr_array(scene.material.stiffness_damping * stiffness(scene))
    beta = scene.thickness * scene.per_cell(lambda m: m.stiffness_damping)
    return _assembled(scene, *(beta * c for c in lame_constants(scene)))


def mass(scene: Scene, *, damping: bool = False) -> sparse.csr_array:
    """Consistent M (N, N) kg, in 2-D of the thickness; with `damping`, its share of C in N s/m.

    Raises `SceneError` where a material has no density.
    """
    materials = (scene.material, *(r.material for r in scene.regions))
    if any(m.rho is None for m in materials):
        raise SceneError("a dynamic scheme needs the density; set rho kg/m3 of every material")
    weight = scene.per_cell(lambda m: (m.rho or 0.0) * (m.mass_damping if damping else 1.0))
    _, element, degree = _ELEMENTS[scene.mesh.kind]
    weight = scene.thickness * weight
    basis = Basis(library_mesh(scene.mesh), element(), intorder=degree)
    scalar = asm(BilinearForm(_weighted_mass), basis, weight=weight[:, None])
    if scene.mesh.kind == "hex27":
        theirs = _renumbered(basis.doflocs.T, scene.mesh.nodes)
        scalar = scalar[theirs][:, theirs]
    else:
        _require_node_major(basis.doflocs, scene.mesh.nodes, 1)
    return sparse.csr_array(sparse.kron(scalar, np.eye(scene.mesh.dimension)))


def _weighted_mass(u: Any, v: Any, w: Any) -> Any:
    return w["weight"] * u * v


def lumped(scene: Scene, M: sparse.csr_array) -> Floats:
    """Diagonal masses (N,) kg with the body's mass: row sums, for quadratic elements HRZ.

    Row sums of quadratic elements are zero or negative at vertices; Hinton, Rock & Zienkiewicz
    (1976) scale the diagonal instead.
    """
    if scene.mesh.order == 1:
        return np.asarray(M.sum(axis=1), dtype=np.float64).ravel()
    diagonal: Floats = M.diagonal()
    if not diagonal.any():  # the damping of a body without mass damping
        return diagonal
    return np.asarray(diagonal * (M.sum() / diagonal.sum()))


def lame_constants(scene: Scene) -> tuple[Floats, Floats]:
    """lambda and mu (e,) Pa of every cell; in plane stress lambda' = E nu/(1 - nu^2). At nu = 0.5
    lambda is that of the penalty beside unknown pressures (`fem.assembly.volume_constraints`)."""
    if scene.plane == "stress":
        lam = scene.per_cell(lambda m: m.E * m.nu / (1 - m.nu**2))
    else:
        lam = scene.per_cell(_lambda)
    return lam, scene.per_cell(_mu)


def _lambda(m: Material) -> float:
    if m.incompressible:
        return m.assembled_bulk_modulus - 2 / 3 * m.shear_modulus
    return float(lame_parameters(m.E, m.nu)[0])


def _mu(m: Material) -> float:
    return m.shear_modulus


def library_mesh(mesh: Mesh) -> Any:
    """Return the vertices and cells as scikit-fem has them, its order of corners included."""
    order = _HEXAHEDRON if mesh.bricks and mesh.dimension == 3 else slice(None)
    corners = np.ascontiguousarray(mesh.corners[:, order].T)
    vertices = int(mesh.corners.max()) + 1
    return _ELEMENTS[mesh.kind][0](np.ascontiguousarray(mesh.nodes[:vertices].T), corners)


def _assembled(scene: Scene, lam: Floats, mu: Floats) -> sparse.csr_array:
    """Stiffness with the Lame constants (e,) Pa of every cell.

    For shapes a, b with slopes g: K_ab = sum of w (lam g_a g_b^T + mu g_b g_a^T + mu g_a.g_b 1),
    all of it from the sums of w g_ai g_bj. As scikit-fem's `linear_elasticity`, five times as fast.
    Mixed cells take kappa = lam + 2 mu/3 with the projected volume strain, -2 mu/3 with its own.
    """
    mesh = scene.mesh
    points = stiffness_points(mesh)
    slopes, weights = points.slopes, points.weights
    e, q, a, d = slopes.shape
    g = slopes.reshape(e, q, a * d)
    mixed = scene.dilatation == "mixed"
    if mixed:
        mean = projections(mesh, points.places, weights) @ g
        volume = np.swapaxes(mean * weights[..., None], 1, 2) @ mean
        volume *= (lam + 2 / 3 * mu)[:, None, None]
        lam = -2 / 3 * mu
    outer = (np.swapaxes(g * weights[..., None], 1, 2) @ g).reshape(e, a, d, a, d)
    dots = np.einsum("eaibi->eab", outer)[:, :, None, :, None] * np.eye(d)[:, None, :]
    lam, mu = (c[:, None, None, None, None] for c in (lam, mu))
    cells = lam * outer + mu * (np.swapaxes(outer, 2, 4) + dots)
    cells = cells.reshape(e, a * d, a * d)
    # The matrices (e, k, k) of all cells in one (N, N), N = n d, node-major
    K = cells + volume if mixed else cells
    d = mesh.dimension
    unknowns = (mesh.cells[..., None] * d + np.arange(d)).reshape(len(K), -1).astype(np.int32)
    rows, columns = (np.broadcast_to(u, K.shape).ravel()
                     for u in (unknowns[:, :, None], unknowns[:, None, :]))  # fmt: skip
    entries = sparse.coo_array((K.ravel(), (rows, columns)), shape=2 * (mesh.nodes.size,))
    return sparse.csr_array(entries)


def mean_divergence(scene: Scene) -> tuple[sparse.csr_array, Floats]:
    """D (e q, N) so that D u is the projected volume strain of mixed cells at their points, and the
    points' weights (e, q) m^d."""
    points, mesh = stiffness_points(scene.mesh), scene.mesh
    e, q, a, d = points.slopes.shape
    mean = projections(mesh, points.places, points.weights) @ points.slopes.reshape(e, q, a * d)
    unknowns = (mesh.cells[..., None] * d + np.arange(d)).reshape(e, 1, a * d)
    columns = np.broadcast_to(unknowns, mean.shape).ravel()
    starts = np.arange(0, mean.size + 1, a * d)
    D = sparse.csr_array((mean.ravel(), columns, starts), shape=(e * q, mesh.nodes.size))
    return D, points.weights


@dataclass(frozen=True)
class StiffnessPoints:
    """The points that integrate a stiffness: dN/dx (e, q, a, d) 1/m, weights times volume (e, q)
    m^d, places (e, q, d) m."""

    slopes: Floats
    weights: Floats
    places: Floats


def stiffness_points(mesh: Mesh) -> StiffnessPoints:
    """Bricks at order + 1 Gauss points along each axis; straight-sided simplices at one point, or
    quadratic at the points of equal weight that integrate products of slopes."""
    if mesh.bricks:
        at = rule(mesh, mesh.order + 1)
        dxi = np.linalg.inv(at.jacobians(mesh.nodes[mesh.cells]))
        slopes = np.einsum("qaj,eqji->eqai", at.dN, dxi)
        return StiffnessPoints(slopes, volumes_at(mesh, at), values_at(mesh, at, mesh.nodes))
    d, dL = mesh.dimension, shape_gradients(mesh)
    L = np.full((1, d + 1), 1 / (d + 1)) if mesh.order == 1 else symmetric_points(d, 2)[0]
    slopes = simplex_slopes(mesh.order, L)
    slopes = (slopes.reshape(-1, d + 1) @ dL).reshape(len(dL), *slopes.shape[:2], d)
    weights = np.repeat(mesh.cell_volumes()[:, None] / len(L), len(L), axis=1)
    return StiffnessPoints(slopes, weights, L @ mesh.nodes[mesh.corners])


def _renumbered(places: Floats, nodes: Floats) -> Ints:
    """The library's unknown at each of our nodes; it numbers edges and faces in its own order."""
    distance, theirs = cKDTree(places).query(nodes)
    if np.max(distance) > 1e-9 * np.ptp(nodes) or len(np.unique(theirs)) != len(nodes):
        raise AssertionError("scikit-fem has unknowns at other places than the nodes of the mesh")
    return np.asarray(theirs, dtype=np.int64)


def _require_node_major(places: Floats, nodes: Floats, per_node: int) -> None:
    """The library's unknowns must lie where ours do, or every result would be permuted."""
    if not np.allclose(places, np.repeat(nodes, per_node, axis=0).T, atol=1e-9 * np.ptp(nodes)):
        raise AssertionError("scikit-fem numbers its unknowns differently from the mesh")


def _nodal_mean_stiffness(scene: Scene) -> sparse.csr_array:
    """K = K_dev + D^T kappa V D: the volume strain is averaged over the cells around each node.

    D (n, N) maps displacements to nodal dilatations theta_a = sum_e V_e/4 div_e / V_a. The
    deviatoric part is the full stiffness less its pointwise volumetric part.
    Source: nodal averaging after Bonet & Burton (1998), for small strain.
    """
    mesh, material = scene.mesh, scene.material
    B, volumes = divergence(mesh)
    kappa = material.bulk_modulus
    # A material without volume stiffness shares its deviatoric part with this one.
    pointwise = B.T @ sparse.diags_array(kappa * volumes) @ B
    ones = np.ones(len(mesh.cells))
    K_dev = _assembled(scene, _lambda(material) * ones, _mu(material) * ones) - pointwise
    corners = mesh.corners
    per = corners.shape[1]
    columns = np.repeat(np.arange(len(corners)), per)
    values = np.repeat(volumes / per, per)
    share = sparse.csr_array(
        (values, (corners.ravel(), columns)), shape=(len(mesh.nodes), len(corners))
    )
    V = np.asarray(share.sum(axis=1))
    D = sparse.diags_array(1 / V) @ share @ B
    return sparse.csr_array(K_dev + D.T @ sparse.diags_array(kappa * V) @ D)


def divergence(mesh: Mesh) -> tuple[sparse.csr_array, Floats]:
    """B (e, N) so that B u is the volume strain of every linear cell, and volumes (e,) m^d."""
    cells, d = mesh.corners, mesh.dimension
    columns = (cells[..., None] * d + np.arange(d)).reshape(len(cells), -1)
    rows = np.repeat(np.arange(len(cells)), columns.shape[1])
    shape = (len(cells), len(mesh.nodes) * d)
    values = shape_gradients(mesh).ravel()
    B = sparse.csr_array((values, (rows, columns.ravel())), shape=shape)
    return B, mesh.cell_volumes()


def shape_gradients(mesh: Mesh) -> Floats:
    """dN_a/dx (e, d + 1, d) 1/m of the linear shape functions of every simplex.

    Raises `SceneError` for bricks, whose gradients vary within the cell.
    """
    if mesh.bricks:
        raise SceneError(f"elements of kind {mesh.kind} have no constant strain; use simplices")
    x = mesh.nodes[mesh.corners]
    inverse = np.linalg.inv(x[:, 1:] - x[:, :1])
    rest = np.swapaxes(inverse, 1, 2)
    return np.concatenate([-rest.sum(axis=1, keepdims=True), rest], axis=1)


# --- nodal forces of loads, weights and pressures; attached masses -------------------------------


def load_columns(scene: Scene) -> Floats:
    """Forces (N, l) on all unknowns for one newton, m/s^2 or Pa of each load, node-major.

    What moves a rigid body is an input after the loads and no force: its column is zero.
    Raises `SceneError` for a weight without densities, a pressure inside the body.
    """
    columns = np.zeros((scene.mesh.nodes.size, len(scene.loads) + len(scene.movers)))
    for j, load in enumerate(scene.loads):
        if isinstance(load, Weight):
            pull = np.tile(load.direction, len(scene.mesh.nodes))
            columns[:, j] = mass(scene) @ pull + hung_masses(scene) * pull
            continue
        if isinstance(load, Pressure):
            columns[:, j] = _pushed(scene.mesh, load).ravel()
            continue
        # The share (n,) of the input that every node takes
        if load.spread == "consistent":
            shares = uniform_shares(scene.mesh, load.facets)
        else:
            shares, nodes = np.zeros(len(scene.mesh.nodes)), nodes_of(scene.mesh, load.facets)
            shares[nodes] = 1.0 if load.spread == "per_node" else 1 / len(nodes)
        columns[:, j] = np.outer(shares, load.direction).ravel()
    return columns


def hung_masses(scene: Scene) -> Floats:
    """Masses (N,) kg of what hangs at the body, on every unknown of its nodes."""
    nodal = np.zeros(len(scene.mesh.nodes))
    for part in scene.masses:
        nodal += part.mass * uniform_shares(scene.mesh, part.facets)
    return np.repeat(nodal, scene.mesh.dimension)


def _pushed(mesh: Mesh, load: Pressure) -> Floats:
    """Forces (n, 3) N of one Pa: -integral of N_a n dA over the undeformed faces, n outward."""
    # The faces (f, m) as the surface of the body has them, oriented outward: a mesh file's own
    # facet set may be oriented either way. Raises `SceneError` for 2-D, and faces within the body
    if mesh.dimension != 3:
        raise SceneError(f"pressure '{load.name}': supported for 3-D meshes, not for {mesh.kind}")
    outside = {tuple(row): i for i, row in enumerate(np.sort(mesh.surface, axis=1).tolist())}
    wanted = np.sort(facets_of(mesh, load.facets), axis=1).tolist()
    at = [outside.get(tuple(row), -1) for row in wanted]
    if -1 in at:
        raise SceneError(
            f"pressure '{load.name}': {at.count(-1)} of {len(at)} faces lie inside the body; "
            "choose faces of its surface"
        )
    facets = np.asarray(mesh.surface[at])
    rule = facet_rule(3, facets.shape[1])
    J = rule.jacobians(mesh.nodes[facets])
    normal = np.cross(J[..., 0], J[..., 1])
    found = np.zeros_like(mesh.nodes)
    np.add.at(found, facets, -np.einsum("q,fqi,qa->fai", rule.weights, normal, rule.N))
    return found


def uniform_shares(mesh: Mesh, place: Place) -> Floats:
    """Shares (n,) of 1 that is spread evenly over faces or edges, equally over points."""
    parts = nodal_integrals(mesh, place)
    return np.asarray(parts / parts.sum())


def nodal_integrals(mesh: Mesh, place: Place) -> Floats:
    """Integral (n,) of every node's shape function over faces m^(d - 1) or edges m; 1 at points."""
    found, entities = np.zeros(len(mesh.nodes)), facets_of(mesh, place)
    if kind_of(place) == "points":
        found[entities[:, 0]] = 1.0
        return found
    integrals = _edge_integrals if kind_of(place) == "edges" else facet_integrals
    np.add.at(found, entities, integrals(mesh, entities))
    return found


def _edge_integrals(mesh: Mesh, edges: Ints) -> Floats:
    """Integral of every node's shape function (k, m) over its edge, m."""
    rule = facet_rule(2, edges.shape[1])
    lengths = np.linalg.norm(rule.jacobians(mesh.nodes[edges])[..., 0], axis=-1)
    return np.asarray(rule.weights * lengths @ rule.N)


def facet_integrals(mesh: Mesh, facets: Ints) -> Floats:
    """Integral of every node's shape function (f, m) over its facet, m^(d - 1)."""
    if mesh.dimension == 2:
        return _edge_integrals(mesh, facets)
    rule = facet_rule(3, facets.shape[1])
    J = rule.jacobians(mesh.nodes[facets])
    normal = np.cross(J[..., 0], J[..., 1])
    return np.asarray(rule.weights * np.linalg.norm(normal, axis=-1) @ rule.N)
