"""FEBio (febio.org; MIT, a program of its own) as an external simulator.

The script writes `body.feb` of format 4.0 into the folder of the job, and runs `febio4` if it is
installed. It follows the published format; no test ran FEBio itself.

validate run NAME --external "python benchmarks/external/febio_simulator.py"
validate external job NAME -o FOLDER; python benchmarks/external/febio_simulator.py FOLDER
febio4 FOLDER/body.feb
"""

import json
import re
import shutil
import subprocess
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

CELLS = {10: "tet4", 12: "hex8", 24: "tet10"}
DOFS = "xyz"
HEX8 = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def arrays(path):
    """Points (n, 3), cells (e, k) and FEBio's name of their kind."""
    found = {
        a.get("Name"): np.array(a.text.split(), float) for a in ET.parse(path).iter("DataArray")
    }
    kind, cells = int(found["types"][0]), found["connectivity"].astype(int)
    return found["Points"].reshape(-1, 3), cells.reshape(len(found["types"]), -1), CELLS[kind]


def child(parent, tag, text=None, **attributes):
    node = ET.SubElement(parent, tag, {k: str(v) for k, v in attributes.items()})
    node.text = None if text is None else str(text)
    return node


def numbers(values):
    return ",".join(f"{v:.12e}" for v in np.atleast_1d(values).tolist())


def material(spec, asked, used, could_not):
    """Its `isotropic elastic` is St. Venant-Kirchhoff, its `neo-Hookean` the coupled form."""
    names = {"linear": "isotropic elastic", "svk": "isotropic elastic", "neo_hooke": "neo-Hookean"}
    if asked["law"] not in names:
        raise LookupError(f"the law {asked['law']} is not written")
    if asked["law"] == "linear":
        used["law"] = "svk"
        could_not.append("the linear law: isotropic elastic is St. Venant-Kirchhoff")
    if asked.get("volumetric", "coupled") != "coupled":
        used["volumetric"] = "coupled"
        could_not.append("the split volumetric form: neo-Hookean is the coupled one")
    if any(asked.get(f"{k}_damping") for k in ("mass", "stiffness")):
        used |= {"mass_damping": 0.0, "stiffness_damping": 0.0}
        could_not.append("Rayleigh damping")
    body = child(child(spec, "Material"), "material", id=1, name="body", type=names[asked["law"]])
    child(body, "density", asked.get("rho", 0.0))
    child(body, "E", asked["E"])
    child(body, "v", asked["nu"])


def mesh(spec, points, cells, kind, sets):
    part = child(spec, "Mesh")
    nodes = child(part, "Nodes", name="body")
    for i, x in enumerate(points, 1):
        child(nodes, "node", numbers(x), id=i)
    elements = child(part, "Elements", type=kind, name="body")
    for i, c in enumerate((cells + 1).tolist(), 1):
        child(elements, "elem", ",".join(map(str, c)), id=i)
    for name, at in sets.items():
        child(part, "NodeSet", ",".join(str(n + 1) for n in at), name=name)
    child(child(spec, "MeshDomains"), "SolidDomain", name="body", mat="body")


def grouped(name, nodes, values, sets):
    """(set, value) of the nodes that have one value, whose sets are added to `sets`."""
    values = np.asarray(values, float).reshape(len(nodes), -1)
    known, which = np.unique(values, axis=0, return_inverse=True)
    for i, value in enumerate(known):
        own = f"{name}.{i + 1}"
        sets[own] = np.asarray(nodes)[which.ravel() == i].tolist()
        yield own, value


def boundary(spec, job, sets):
    part = child(spec, "Boundary")
    held = job["held"]
    at = {c: [n for n, k in zip(held["nodes"], held["components"], strict=True) if k == c]
          for c in range(3)}  # fmt: skip
    for c in (c for c in range(3) if at[c]):
        sets[f"held.{DOFS[c]}"] = at[c]
        bc = child(part, "bc", name=f"held {DOFS[c]}", type="zero displacement",
                   node_set=f"held.{DOFS[c]}")  # fmt: skip
        for k in range(3):
            child(bc, f"{DOFS[k]}_dof", int(k == c))
    for j, drive in enumerate(job["drives"], 1):
        nodes, comps = np.array(drive["nodes"]), np.array(drive["components"])
        per_unit = np.array(drive["per_unit"])
        for c in np.unique(comps).tolist():
            own = comps == c
            for name, value in grouped(f"drive.{j}.{DOFS[c]}", nodes[own], per_unit[own], sets):
                bc = child(part, "bc", name=name, type="prescribed displacement", node_set=name)
                child(bc, "dof", DOFS[c])
                child(bc, "value", numbers(value), lc=j)
                child(bc, "relative", 0)


def loads(spec, job, weight, sets):
    """Loads, and weights as forces of the nodes; each by the curve of its history."""
    part, first = child(spec, "Loads"), len(job["drives"]) + 1
    parts = [(load["nodes"], load["forces"]) for load in job["loads"]]
    for w in job["weights"]:
        parts.append((list(range(len(weight))), weight[:, None] * np.array(w["direction"])))
    for j, (nodes, forces) in enumerate(parts, first):
        for name, value in grouped(f"load.{j}", nodes, forces, sets):
            load = child(part, "nodal_load", name=name, type="nodal_force", node_set=name)
            child(load, "value", numbers(value), lc=j)


def curves(spec, job, clock):
    part = child(spec, "LoadData")
    for j, one in enumerate([*job["drives"], *job["loads"], *job["weights"]], 1):
        curve = child(part, "load_controller", id=j, name=one["name"], type="loadcurve")
        child(curve, "interpolate", "LINEAR")
        child(curve, "extend", "CONSTANT")
        points = child(curve, "points")
        for t, y in zip(clock, one["history"], strict=True):
            child(points, "pt", f"{t:.12e},{y:.12e}")


def control(spec, job, steps, step):
    part = child(spec, "Control")
    child(part, "analysis", "DYNAMIC" if job["inertia"] else "STATIC")
    child(part, "time_steps", steps)
    child(part, "step_size", f"{step:.12e}")
    solver = child(part, "solver", type="solid")
    child(solver, "symmetric_stiffness", "symmetric")
    for name in ("dtol", "etol", "rtol"):
        child(solver, name, job["tolerance"])
    stepper = child(part, "time_stepper", type="default")
    child(stepper, "dtmax", f"{step:.12e}")


def shares(points, cells):
    """Volume (e, k) m3 of each cell that its nodes have: the integrals of their shape functions."""
    x, k = points[cells], cells.shape[1]
    if k != 8:
        volume = np.abs(np.linalg.det(x[:, 1:4] - x[:, :1])) / 6
        return np.outer(volume, [-1 / 20] * 4 + [1 / 5] * 6 if k == 10 else [1 / 4] * 4)
    found = np.zeros(cells.shape)
    for at in HEX8 / np.sqrt(3):
        factors = (1 + HEX8 * at) / 2
        slopes = [HEX8[:, i] / 2 * np.delete(factors, i, 1).prod(1) for i in range(3)]
        found += np.linalg.det(np.einsum("ia,eaj->eij", slopes, x))[:, None] * factors.prod(1)
    return found


def weights(points, cells, job):
    """Mass (n,) kg of every node, of the body and of what hangs."""
    found = np.zeros(len(points))
    np.add.at(found, cells, job["material"].get("rho", 0.0) * shares(points, cells))
    np.add.at(found, job["masses"]["nodes"], job["masses"]["kg"])
    return found


def apart(drives):
    """The same motion, no unknown in two drives: a later `bc` would replace the earlier."""
    moved = {}
    for j, d in enumerate(drives):
        for n, c, p in zip(d["nodes"], d["components"], d["per_unit"], strict=True):
            moved.setdefault((n, c), []).append((j, p))
    if all(len(by) == 1 for by in moved.values()):
        return drives
    groups = {}
    for unknown, by in moved.items():
        groups.setdefault(tuple(by), []).append(unknown)
    return [
        {"name": f"drives {i}", "nodes": [n for n, _ in at], "components": [c for _, c in at],
         "per_unit": [1.0] * len(at),
         "history": sum(p * np.array(drives[j]["history"]) for j, p in by).tolist()}
        for i, (by, at) in enumerate(groups.items(), 1)
    ]  # fmt: skip


def document(job, path, used, could_not):
    """The .feb of a job; statics count the job's instants in place of seconds."""
    points, cells, kind = arrays(path)
    job = job | {"drives": apart(job["drives"])}
    t = np.array(job["instants"])
    if job["inertia"] and np.ptp(np.diff(t)) > 1e-6 * t[-1] / len(t):
        raise LookupError("dynamics of uneven times")
    if job["inertia"] and job["masses"]["nodes"]:
        raise LookupError("masses that hang, in dynamics")
    first = len(t) - len(job["times"])
    clock = t if job["inertia"] else np.arange(len(t)) + 1.0 - first
    spec, sets = ET.Element("febio_spec", version="4.0"), {}
    child(spec, "Module", type="solid")
    control(spec, job, len(job["times"]), float(t[1] - t[0]) if job["inertia"] else 1.0)
    material(spec, job["material"], used, could_not)
    place = len(spec)
    boundary(spec, job, sets)
    loads(spec, job, weights(points, cells, job), sets)
    curves(spec, job, clock)
    log = child(child(spec, "Output"), "logfile")
    child(log, "node_data", data="ux;uy;uz", file="displacement.txt", delim=" ")
    later = list(spec)[place:]
    for part in later:
        spec.remove(part)
    mesh(spec, points, cells, kind, sets)
    spec.extend(later)
    ET.indent(spec)
    return ET.ElementTree(spec), clock[first:], points.shape


def fields(path, clock, shape):
    """Displacements (k, n, 3) at the asked times, in order, of FEBio's table of nodes."""
    blocks = re.split(r"(?m)^\*Step\s*=.*$", path.read_text())[1:]
    found = {}
    for block in blocks:
        at = float(re.search(r"(?m)^\*Time\s*=\s*(\S+)", block)[1])
        rows = [line.split() for line in block.splitlines() if line[:1].isdigit()]
        u = np.zeros(shape)
        u[[int(r[0]) - 1 for r in rows]] = [[float(v) for v in r[1:4]] for r in rows]
        found[at] = u
    times = np.array(sorted(found))
    kept = [times[np.abs(times - t).argmin()] for t in clock if len(times)
            and np.abs(times - t).min() < 1e-6 * clock[-1]]  # fmt: skip
    return np.array([found[t] for t in kept]).reshape(-1, *shape)


def main(folder):
    job = json.loads((folder / "job.json").read_text())
    answer = {"schema": "validate-external-answer/1", "name": "FEBio", "version": "", "state": "",
              "mesh_sha256": job["mesh"]["sha256"], "used": dict(job["material"]),
              "could_not": ["reactions: the sign of what it prints was never tried"]}  # fmt: skip
    try:
        start = time.perf_counter()
        tree, clock, shape = document(job, folder / "mesh.vtu", answer["used"],
                                      answer["could_not"])  # fmt: skip
        tree.write(folder / "body.feb", encoding="UTF-8", xml_declaration=True)
        program = shutil.which("febio4")
        if program is None:
            raise LookupError("no program 'febio4' here; body.feb is written, for: febio4 body.feb")
        subprocess.run([program, "-i", "body.feb"], cwd=folder, stdout=sys.stderr, check=False)
        u = fields(folder / "displacement.txt", clock, shape)
        answer["state"] = "finished" if len(u) == len(clock) else "not_converged"
        each = (time.perf_counter() - start) / max(len(u), 1)
        answer |= {"setup_s": 1e-6, "step_s": [each] * len(u)}
        np.savez(folder / "fields.npz", t=np.array(job["times"][: len(u)]), u=u)
    except LookupError as why:
        answer |= {"state": "cannot_run", "reason": str(why).strip("'")}
    (folder / "answer.json").write_text(json.dumps(answer))


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
