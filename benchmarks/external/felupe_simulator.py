"""FElupe (pip install felupe; GPL-3, a program of its own) as an external simulator.

It solves statics of linear elasticity and neo-Hooke on tetrahedra and hexahedra.

Hexahedra that would lock, of neo-Hooke from nu = .45 on, take its mixed form of three fields.

validate external check "python benchmarks/external/felupe_simulator.py"
"""

import json
import sys
import time
import warnings
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

CELLS = {
    10: ("tetra", "RegionTetra"),
    12: ("hexahedron", "RegionHexahedron"),
    24: ("tetra10", "RegionQuadraticTetra"),
}
LOCKS = 0.45  # Poisson's ratio from where on hexahedra are mixed


def arrays(path):
    """Points (n, 3), cells (e, k) and VTK's number of their kind, from text."""
    found = {
        a.get("Name"): np.array(a.text.split(), float) for a in ET.parse(path).iter("DataArray")
    }
    kind, cells = int(found["types"][0]), found["connectivity"].astype(int)
    return found["Points"].reshape(-1, 3), cells.reshape(len(found["types"]), -1), kind


def law_of(fem, asked):
    """A material of FElupe's, or why there is none."""
    mu, bulk = asked["E"] / 2 / (1 + asked["nu"]), asked["E"] / 3 / (1 - 2 * asked["nu"])
    if asked["law"] == "linear":
        return fem.LinearElastic(asked["E"], asked["nu"])
    if asked["law"] != "neo_hooke":
        raise LookupError(f"the law {asked['law']} is not written")
    if asked["volumetric"] == "coupled":
        return fem.NeoHookeCompressible(mu=mu, lmbda=2 * mu * asked["nu"] / (1 - 2 * asked["nu"]))
    if asked["volumetric"] != "split":
        raise LookupError(f"its volume term {asked['volumetric']} is not written")
    shear = fem.NeoHooke(mu)

    def inverse(F):
        J = fem.math.det(F)
        return J, fem.math.transpose(fem.math.inv(F, determinant=J))

    def stress(x):
        """bulk/4 (J^2 - 1 - 2 ln J) beside the shear part: FElupe's own is bulk/2 (J - 1)^2."""
        J, G = inverse(x[0])
        return [shear.gradient(x)[0] + bulk / 2 * (J**2 - 1) * G, x[-1]]

    def elasticity(x):
        J, G = inverse(x[0])
        pairs = fem.math.cdya_il(G, G)
        return [
            shear.hessian(x)[0] + bulk * J**2 * fem.math.dya(G, G) - bulk / 2 * (J**2 - 1) * pairs
        ]

    return fem.Material(stress, elasticity)


def bodies(fem, asked, mesh, kind):
    """The field of unknowns, and what has stiffness in it."""
    locks = kind == 12 and asked["nu"] >= LOCKS and asked["law"] != "linear"
    region = getattr(fem, CELLS[kind][1])(mesh)
    law = law_of(fem, asked)
    if locks:
        field = fem.FieldsMixed(region, n=3)
        return field, [fem.SolidBody(fem.ThreeFieldVariation(law), field)]
    field = fem.FieldContainer([fem.Field(region, dim=3)])
    return field, [fem.SolidBody(law, field)]


def solve(folder, job, answer):
    import felupe as fem

    answer["version"] = fem.__version__
    start = time.perf_counter()
    points, cells, kind = arrays(folder / "mesh.vtu")
    if kind not in CELLS:
        raise LookupError(f"cells of VTK's kind {kind}")
    if job["inertia"]:
        raise LookupError("no dynamics: this simulator solves statics")
    mesh = fem.Mesh(points, cells, CELLS[kind][0])
    field, solids = bodies(fem, job["material"], mesh, kind)
    answer["used"] = job["material"]
    f = np.zeros_like(points)
    dead = fem.PointLoad(field, np.arange(len(points)), f)
    pull = fem.SolidBodyForce(field, np.zeros(3))
    held, value = np.zeros(points.shape, bool), np.zeros_like(points)
    held[job["held"]["nodes"], job["held"]["components"]] = True
    for drive in job["drives"]:
        held[drive["nodes"], drive["components"]] = True
    dof0 = np.flatnonzero(held)
    dof1 = np.setdiff1d(np.arange(sum(part.values.size for part in field.fields)), dof0)
    answer["setup_s"] = time.perf_counter() - start
    fields = {"t": [], "u": [], "reactions": []}
    skip = len(job["instants"]) - len(job["times"])
    for i, t in enumerate(job["times"], skip):
        start = time.perf_counter()
        value[:], f[:] = 0.0, 0.0
        for drive in job["drives"]:
            each = np.array(drive["per_unit"]) * drive["history"][i]
            np.add.at(value, (drive["nodes"], drive["components"]), each)
        for load in job["loads"]:
            f[load["nodes"]] += np.array(load["forces"]) * load["history"][i]
        g = sum((np.array(w["direction"]) * w["history"][i] for w in job["weights"]), np.zeros(3))
        f[job["masses"]["nodes"]] += np.outer(job["masses"]["kg"], g)
        dead.update(f)
        pull.update(g * job["material"].get("rho", 0.0))
        found = fem.newtonraphson(
            items=[*solids, dead, pull], dof0=dof0, dof1=dof1, ext0=value.ravel()[dof0],
            tol=job["tolerance"], verbose=False,
        )  # fmt: skip
        fields["t"].append(t)
        fields["u"].append(field[0].values.copy())
        fields["reactions"].append(
            np.where(held, found.fun[: points.size].reshape(points.shape), 0.0)
        )
        answer["step_s"].append(time.perf_counter() - start)
        np.savez(folder / "fields.npz", **fields)
    answer["state"] = "finished"


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    folder = Path(sys.argv[-1])
    job = json.loads((folder / "job.json").read_text())
    answer = {
        "schema": "validate-external-answer/1", "name": "FElupe", "version": "", "step_s": [],
        "mesh_sha256": job["mesh"]["sha256"],
    }  # fmt: skip
    try:
        solve(folder, job, answer)
    except ImportError as why:
        answer |= {"state": "cannot_run", "reason": f"not installed: {why}"}
    except LookupError as why:
        answer |= {"state": "cannot_run", "reason": str(why)}
    except Exception as why:
        if not answer["step_s"]:
            raise
        answer |= {"state": "not_converged", "reason": str(why)}
    (folder / "answer.json").write_text(json.dumps(answer))
