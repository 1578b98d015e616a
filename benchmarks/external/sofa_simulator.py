"""SOFA (sofa-framework.org; LGPL, a program of its own) as an external simulator.

The script writes `scene.py` for SofaPython3 into the folder of the job, and runs `runSofa` if it is
installed; the scene writes the answer. It follows the published components; no test ran SOFA
itself.

validate run NAME --external "python benchmarks/external/sofa_simulator.py"
validate external job NAME -o FOLDER; python benchmarks/external/sofa_simulator.py FOLDER
runSofa FOLDER/scene.py
"""

import json
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

PLUGINS = (
    "Sofa.Component.Constraint.Projective", "Sofa.Component.LinearSolver.Direct",
    "Sofa.Component.Mass", "Sofa.Component.MechanicalLoad", "Sofa.Component.ODESolver.Backward",
    "Sofa.Component.SolidMechanics.FEM.Elastic", "Sofa.Component.SolidMechanics.FEM.HyperElastic",
    "Sofa.Component.StateContainer", "Sofa.Component.Topology.Container.Dynamic",
)  # fmt: skip
CELLS = {10: "tetrahedra", 12: "hexahedra"}
HEX8 = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
SCENE = '''"""A job of `validate` as a scene: runSofa -l SofaPython3 -g batch -n {steps} scene.py"""

import json
from pathlib import Path

import numpy as np
import Sofa

HERE = Path(__file__).parent
GIVEN = json.loads((HERE / "sofa.json").read_text())


class Walks(Sofa.Core.Controller):
    """Scales loads by their histories before a step, keeps displacements after it."""

    def __init__(self, dofs, loads, **given):
        super().__init__(**given)
        self.dofs, self.loads, self.u, self.k = dofs, loads, [], 0
        self.rest = np.array(GIVEN["points"])

    def onAnimateBeginEvent(self, event):
        for field, forces, history in self.loads:
            k = min(self.k, len(history) - 1)
            field.forces.value = history[k] * np.array(forces)

    def onAnimateEndEvent(self, event):
        self.u.append(np.array(self.dofs.position.value) - self.rest)
        self.k += 1
        if self.k == len(GIVEN["times"]):
            np.savez(HERE / "fields.npz", t=np.array(GIVEN["times"]), u=np.array(self.u))
            answer = GIVEN["answer"] | {{"state": "finished"}}
            (HERE / "answer.json").write_text(json.dumps(answer))


def createScene(root):
    root.dt, root.gravity = GIVEN["dt"], [0.0, 0.0, 0.0]
    for plugin in GIVEN["plugins"]:
        root.addObject("RequiredPlugin", name=plugin)
    root.addObject("DefaultAnimationLoop")
    body = root.addChild("body")
    for kind, given in GIVEN["solver"]:
        body.addObject(kind, **given)
    kind = GIVEN["cells"]["kind"]
    container = "Tetrahedron" if kind == "tetrahedra" else "Hexahedron"
    body.addObject(f"{{container}}SetTopologyContainer", name="topology", position=GIVEN["points"],
                   **{{kind: GIVEN["cells"]["nodes"]}})
    body.addObject(f"{{container}}SetGeometryAlgorithms", template="Vec3d")
    dofs = body.addObject("MechanicalObject", name="dofs", template="Vec3d",
                          position=GIVEN["points"])
    for kind, given in (*GIVEN["material"], *GIVEN["constraints"]):
        body.addObject(kind, **given)
    loads = []
    for one in GIVEN["loads"]:
        field = body.addObject("ConstantForceField", indices=one["nodes"], forces=one["forces"])
        loads.append((field, one["forces"], one["history"]))
    root.addObject(Walks(dofs, loads, name="walks"))
'''


def arrays(path):
    found = {
        a.get("Name"): np.array(a.text.split(), float) for a in ET.parse(path).iter("DataArray")
    }
    kind, cells = int(found["types"][0]), found["connectivity"].astype(int)
    if kind not in CELLS:
        raise LookupError(f"cells of VTK's kind {kind}: tetrahedra and hexahedra of corners alone")
    return found["Points"].reshape(-1, 3), cells.reshape(len(found["types"]), -1), CELLS[kind]


def material(asked, kind, used, could_not):
    """Mass and law as components: NeoHookean by mu, kappa, StVenantKirchhoff by mu, lambda."""
    E, nu = asked["E"], asked["nu"]
    mu, lame, bulk = E / 2 / (1 + nu), E * nu / (1 + nu) / (1 - 2 * nu), E / 3 / (1 - 2 * nu)
    damped = {"rayleighStiffness": asked.get("stiffness_damping", 0.0)}
    mass = [["MeshMatrixMass", {"massDensity": asked["rho"]}]] if "rho" in asked else []
    law, name = asked["law"], "Tetrahedron" if kind == "tetrahedra" else "Hexahedron"
    if law == "linear":
        given = {"method": "small", "youngModulus": E, "poissonRatio": nu}
        return [*mass, [f"{name}FEMForceField", given | damped]]
    laws = {"svk": ("StVenantKirchhoff", [mu, lame]), "neo_hooke": ("NeoHookean", [mu, bulk])}
    if law not in laws or kind != "tetrahedra":
        raise LookupError(f"the law {law} on {kind} is not written")
    if law == "neo_hooke":
        used["volumetric"] = "as its NeoHookean has it"
        could_not.append("the volumetric form that was asked: its NeoHookean has its own")
    given = {"materialName": laws[law][0], "ParameterSet": laws[law][1]}
    return [*mass, ["TetrahedronHyperelasticityFEMForceField", given | damped]]


def constraints(job, shape):
    """What is held, and what moves as a whole: SOFA moves nodes in all three directions at once."""
    held = np.zeros(shape, bool)
    held[job["held"]["nodes"], job["held"]["components"]] = True
    moved = np.zeros((len(job["instants"]), *shape))
    driven = np.zeros(shape, bool)
    for drive in job["drives"]:
        at = (drive["nodes"], drive["components"])
        driven[at] = True
        moved[:, *at] += np.outer(drive["history"], drive["per_unit"])
    nodes = np.flatnonzero(driven.any(axis=1))
    loose = nodes[~(held | driven)[nodes].all(axis=1)]
    if len(loose):
        raise LookupError(f"a drive that leaves other directions of {len(loose)} nodes free")
    found = []
    for pattern in np.unique(held, axis=0):
        at = np.flatnonzero((held == pattern).all(axis=1) & ~driven.any(axis=1)).tolist()
        if pattern.any() and at:
            kind = "FixedProjectiveConstraint" if pattern.all() else \
                "PartialFixedProjectiveConstraint"  # fmt: skip
            more = {} if pattern.all() else {"fixedDirections": pattern.astype(int).tolist()}
            found.append([kind, {"indices": at, **more}])
    histories = moved[:, nodes].swapaxes(0, 1).reshape(len(nodes), 3 * len(moved))
    paths, which = np.unique(histories, axis=0, return_inverse=True)
    for i, path in enumerate(paths):
        given = {"indices": nodes[which.ravel() == i].tolist(), "template": "Vec3d",
                 "keyTimes": job["clock"], "movements": path.reshape(-1, 3).tolist()}  # fmt: skip
        found.append(["LinearMovementProjectiveConstraint", given])
    return found


def shares(points, cells):
    """Volume (e, k) m3 of each cell that its nodes have: the integrals of their shape functions."""
    x = points[cells]
    if cells.shape[1] == 4:
        return np.outer(np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6, [1 / 4] * 4)
    found = np.zeros(cells.shape)
    for at in HEX8 / np.sqrt(3):
        factors = (1 + HEX8 * at) / 2
        slopes = [HEX8[:, i] / 2 * np.delete(factors, i, 1).prod(1) for i in range(3)]
        found += np.linalg.det(np.einsum("ia,eaj->eij", slopes, x))[:, None] * factors.prod(1)
    return found


def weights(points, cells, rho):
    """Mass (n,) kg of every node."""
    found = np.zeros(len(points))
    np.add.at(found, cells, rho * shares(points, cells))
    return found


def given(job, path, answer):
    """What the scene is made of; statics count the job's instants in place of seconds."""
    points, cells, kind = arrays(path)
    t, first = np.array(job["instants"]), len(job["instants"]) - len(job["times"])
    if job["inertia"] and np.ptp(np.diff(t)) > 1e-6 * t[-1] / len(t):
        raise LookupError("dynamics of uneven times")
    if job["masses"]["nodes"]:
        raise LookupError("masses that hang")
    job["clock"] = (t if job["inertia"] else np.arange(len(t)) + 1.0 - first).tolist()
    solver = [["SparseLDLSolver", {"template": "CompressedRowSparseMatrixMat3x3d"}]]
    marched = {"gamma": 0.5, "beta": 0.25, "rayleighMass": job["material"].get("mass_damping", 0.0)}
    solver.insert(
        0,
        ["NewmarkImplicitSolver", marched]
        if job["inertia"]
        else [
            "StaticSolver",
            {"newton_iterations": 50, "relative_correction_tolerance_threshold": job["tolerance"]},
        ],
    )
    loads = [{"nodes": p["nodes"], "forces": p["forces"], "history": p["history"][first:]}
             for p in job["loads"]]  # fmt: skip
    mass = weights(points, cells, job["material"].get("rho", 0.0))
    loads += [{"nodes": list(range(len(points))), "history": w["history"][first:],
               "forces": (mass[:, None] * np.array(w["direction"])).tolist()}
              for w in job["weights"]]  # fmt: skip
    law = material(job["material"], kind, answer["used"], answer["could_not"])
    return {
        "points": points.tolist(), "cells": {"kind": kind, "nodes": cells.tolist()},
        "times": job["times"], "dt": float(t[1] - t[0]) if job["inertia"] else 1.0,
        "plugins": PLUGINS, "solver": solver, "material": law, "loads": loads,
        "constraints": constraints(job, points.shape), "answer": answer,
    }  # fmt: skip


def main(folder):
    job = json.loads((folder / "job.json").read_text())
    answer = {"schema": "validate-external-answer/1", "name": "SOFA", "version": "", "state": "",
              "mesh_sha256": job["mesh"]["sha256"], "used": dict(job["material"]),
              "could_not": ["reactions"]}  # fmt: skip
    try:
        made = given(job, folder / "mesh.vtu", answer)
        (folder / "sofa.json").write_text(json.dumps(made))
        steps = len(job["times"])
        (folder / "scene.py").write_text(SCENE.format(steps=steps))
        program = shutil.which("runSofa")
        call = ["-l", "SofaPython3", "-g", "batch", "-n", str(steps), "scene.py"]
        if program is None:
            said = f"runSofa {' '.join(call)}"
            raise LookupError(f"no program 'runSofa' here; scene.py is written, for: {said}")
        subprocess.run([program, *call], cwd=folder, stdout=sys.stderr, check=False)
        return
    except LookupError as why:
        answer |= {"state": "cannot_run", "reason": str(why).strip("'")}
    (folder / "answer.json").write_text(json.dumps(answer))


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
