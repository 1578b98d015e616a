"""Penalty on changes of volume along the face normals of every cell.

Picinbono, Delingette & Ayache (2001), as paper 002 tells it (section VI.B): a low Poisson ratio,
and at each node of an element a force along the normal of the opposite face that resists a change
of the element's volume. With the volume strain theta of a cell, its slopes g_a = -A_a n_a / (d V)
(area and outward normal of the face opposite to node a) and a weight k Pa there are two readings:

- area-weighted normals, f_a = -k V theta g_a: the gradient of the energy k V theta^2 / 2, and so
  exactly a Lame constant lambda that is raised by k;
- unit normals, f_a = -k V theta s g_a/|g_a|, s the mean of the |g_a|: all nodes of a cell are
  pushed alike. The forces of a cell that is not regular then neither add up to zero nor come from
  an energy: the matrix is not symmetric, and the body gains momentum and energy from nothing.

Departures: paper 002 prints no law; the force is linear in theta, as the rest of its model is.
"""

from typing import Literal

import numpy as np
from scipy import sparse

from validate.arrays import Floats
from validate.errors import SceneError
from validate.fem.assembly.assemble import stiffness_points
from validate.scene.scene import Scene

Normals = Literal["area", "unit"]


def volume_penalty(scene: Scene, weight: float, normals: Normals = "area") -> sparse.csr_array:
    """P (N, N) N/m: the penalty's forces on the nodes are -P u. `weight` is k in Pa.

    Raises `SceneError` for a negative weight, plane stress, whose cells may thin out, and cells
    other than linear simplices.
    """
    if not (np.isfinite(weight) and weight >= 0):
        raise SceneError(f"penalty of {weight:g} Pa on a change of volume: expected at least 0")
    if scene.plane == "stress":
        raise SceneError(
            "in plane stress the thickness is free: use the penalty in plane strain or 3-D"
        )
    if scene.mesh.kind not in ("tri3", "tet4"):
        raise SceneError(
            f"a penalty along face normals supports linear simplices, not {scene.mesh.kind}"
        )
    at = stiffness_points(scene.mesh)
    slopes, volumes = at.slopes[:, 0], at.weights.sum(axis=1)
    B = _rows(scene, slopes)
    if normals == "area":
        along = B
    else:
        # Inward normals, all as long as the mean slope of their cell, 1/m
        lengths: Floats = np.linalg.norm(slopes, axis=2, keepdims=True)
        along = _rows(scene, slopes / lengths * lengths.mean(axis=1, keepdims=True))
    scale = sparse.diags_array(scene.thickness * weight * volumes)
    return sparse.csr_array(along.T @ scale @ B)


def _rows(scene: Scene, slopes: Floats) -> sparse.csr_array:
    """A row for every cell of values (e, a, d) at its nodes (e, N)."""
    e, a, d = slopes.shape
    columns = d * scene.mesh.cells[:, :, None] + np.arange(d)
    pointers = np.arange(e + 1) * a * d
    shape = (e, scene.mesh.nodes.size)
    return sparse.csr_array((slopes.ravel(), columns.ravel(), pointers), shape=shape)
