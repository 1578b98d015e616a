"""What `ekf_liver` shows besides: its node sets drawn, and what the printed numbers leave open."""

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Entry, Exhibit, NumberTable
from validate.fem.critical import CriticalStep
from validate.fem.system import build as build_system
from validate.pipeline.experiment.experiment import Progress, ReportAdditions
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.run.method_run import Cases, MethodRun
from validate.scene.mesh import Mesh
from validate.scene.scene import Scene

from ..ekf_cube.published import PRINTED_LIVER_STEP
from ..ekf_cube.tables import (
    fields_apart,
    locking_table,
    readings_table,
    steps_table,
)
from .body import watched
from .node_sets import node_sets_picture
from .twin import FOLDER

NU = (0.45, 0.49, 0.499)  # what locking is shown at
_MM = 1e3
_SLIVER = 0.25  # of the median altitude: what counts as a flat cell
_NAMED = {
    "data": "the data folder's liver",
    "generated": "made by formulas, about a liver's size",
}


def tell_liver(tree: Tree, cases: Cases, progress: Progress) -> ReportAdditions:
    """Node sets, both readings of the force, critical steps, locking, and how near two fields are.

    The filter's field is held against the plain one's, as the paper's Figs. 3 (b) and (c) are.
    """
    main = cases[""]
    scene = main["nfem"].body
    progress("readings of the force")
    readings = readings_table(scene, tree.settings.loading.force, "z")
    limits = steps_table(scene, PRINTED_LIVER_STEP)
    progress("locking")
    locked = locking_table(scene, NU)
    body = _NAMED[tree.scene.body.which(FOLDER)]
    model = Exhibit(
        "model",
        "Choices that the printed numbers do not determine",
        (_ramp_words(main["nfem"], readings), _sliver_words(scene)),
        (readings, limits, locked),
    )
    numbers = {
        "critical_step": CriticalStep.of(build_system(scene)).lanczos,
        "nodes": float(len(scene.mesh.nodes)),
        "tetrahedra": float(len(scene.mesh.cells)),
        "duration": float(main["nfem"].seen.t[-1]),
        "fields_apart": fields_apart(main, ("ekf_held", "nfem")),
    }
    return ReportAdditions((sets_exhibit(scene, body), model), numbers)


def sets_exhibit(scene: Scene, body: str) -> Exhibit:
    """Held nodes, loaded nodes, A and B: drawn and counted."""
    mesh = scene.mesh
    sets = {name: mesh.facet_nodes(name) for name in ("held", "loaded")}
    named = {name[-1]: node for name, node in watched(mesh).items()}
    words = (
        f"The body: {body}, {len(mesh.nodes)} nodes and {len(mesh.cells)} tetrahedra, "
        f"{1e3 * mesh.cell_volumes().sum():.3g} litres. Paper 003 draws its liver and prints no "
        "mesh, so its counts of nodes are not targets.",
        "Held: faces with an upward normal in the left three tenths of the length. Loaded: "
        "faces with an upward or downward normal in the right lobe. A is the loaded node "
        "nearest to their middle, B the free one nearest to the middle of the top.",
    )
    caption = "Held and loaded nodes, the measured node A and the free node B."
    picture = node_sets_picture("node_sets", caption, mesh, sets, named)
    return Exhibit("sets", "Held, loaded and observed nodes", words, (_sets_table(scene),),
                   pictures=(picture,))  # fmt: skip


def _sets_table(scene: Scene) -> NumberTable:
    mesh, x = scene.mesh, _MM * scene.mesh.nodes
    rows: list[tuple[Entry, ...]] = []
    for name in ("held", "loaded"):
        nodes = mesh.facet_nodes(name)
        middle = x[nodes].mean(axis=0).tolist()
        rows.append((name, len(nodes), len(mesh.facets[name]), *middle))
    rows += [(p.name, 1, None, *(_MM * c for c in p.point)) for p in scene.probes]
    heads = ("set", "nodes", "faces", "middle x / mm", "middle y / mm", "middle z / mm")
    return NumberTable("node_sets", "Sets of nodes, x to the body's left, z up.", heads,
                       tuple(rows))  # fmt: skip


def _ramp_words(plain: MethodRun, readings: NumberTable) -> str:
    """How much of the static answer the ramp reaches at A."""
    static, end = readings.rows[0][2], float(plain.reference("node_A")[-1, 2])
    share = ""
    if isinstance(static, float):
        share = f", {_MM * end / static:.2f} of its static displacement under that force"
    return (
        f"The ramp lasts {plain.seen.t[-1]:.3g} s and takes node A to {_MM * end:.3g} "
        f"mm{share}: near 1, stiffness matters more than inertia."
    )


def altitudes(mesh: Mesh) -> Floats:
    """Least altitude m of every tetrahedron (e,)."""
    x = mesh.nodes[mesh.corners]
    slopes = np.linalg.inv(x[:, 1:] - x[:, :1])  # of the shape functions of all corners but one
    slopes = np.concatenate([-slopes.sum(axis=2, keepdims=True), slopes], axis=2)
    return np.asarray(1 / np.linalg.norm(slopes, axis=1).max(axis=1))


def _sliver_words(scene: Scene) -> str:
    flat = altitudes(scene.mesh)
    count = int((flat < _SLIVER * np.median(flat)).sum())
    return (
        f"{count} of {len(flat)} cells are slivers (altitude below {_SLIVER:g} of the median "
        f"{_MM * np.median(flat):.2g} mm); the flattest is {_MM * flat.min():.2g} mm high. "
        "The critical step is that of the whole body by its largest frequency, not of one altitude."
    )
