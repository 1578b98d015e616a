"""Nodal forces of loads (per N), weights (per m/s^2) and pressures (per Pa); attached masses."""

import numpy as np

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.fem.assembly.assemble import mass
from validate.scene.mesh import Mesh
from validate.scene.places import Place, facets_of, kind_of, nodes_of
from validate.scene.scene import Pressure, Scene, Weight
from validate.scene.shape_functions import facet_rule


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
