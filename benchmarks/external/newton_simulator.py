"""NVIDIA Newton on the processor (pip install newton; Apache-2.0) as an external simulator.

It is installed manually. It solves statics and dynamics of its stable neo-Hooke law on linear
tetrahedra, by its semi-implicit solver.

Its steps are explicit, in single precision. At rest they are damped: what moves is stopped wherever
its kinetic energy has passed a peak, until forces balance. Hexahedra are cut into six tetrahedra.

validate external check "python benchmarks/external/newton_simulator.py"
"""

import json
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

SIX = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
COURANT = 0.2  # of the time that a wave takes across the thinnest tetrahedron
BALANCED, MOST = 1e-3, 20_000  # of the forces, in single precision; steps to rest
ROUNDED = 5e-6  # forces of no account, of E and the body's length squared: its rounding
OWN = "stable neo-Hooke of Smith et al. 2018"


def arrays(path):
    """Points (n, 3) and tetrahedra (e, 4) from text, and whether they were hexahedra."""
    found = {
        a.get("Name"): np.array(a.text.split(), float) for a in ET.parse(path).iter("DataArray")
    }
    kind, cells = int(found["types"][0]), found["connectivity"].astype(int)
    if kind not in (10, 12):
        raise LookupError(f"cells of VTK's kind {kind}: it has linear tetrahedra")
    cells = cells.reshape(len(found["types"]), -1)
    cut = kind == 12
    return found["Points"].reshape(-1, 3), cells[:, SIX].reshape(-1, 4) if cut else cells, cut


class Body:
    """Particles in Newton; what is held or driven is put back after every step."""

    def __init__(self, job, points, cells):
        import newton
        import warp as wp

        asked, self.job, self.x = job["material"], job, points
        mu = asked["E"] / 2 / (1 + asked["nu"])
        lam = 2 * mu * asked["nu"] / (1 - 2 * asked["nu"])
        density = asked.get("rho", 1000.0)  # any, where nothing weighs
        build = newton.ModelBuilder()
        # Its moduli are not Lame's: 4/3 mu and lambda + 5/6 mu are the same at small strain.
        build.add_soft_mesh(
            pos=wp.vec3(), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(),
            vertices=[wp.vec3(*p) for p in points.tolist()], indices=cells.ravel().tolist(),
            density=density, k_mu=4 / 3 * mu, k_lambda=lam + 5 / 6 * mu, k_damp=0.0,
            add_surface_mesh_edges=False, particle_radius=1e-6,
        )  # fmt: skip
        for node, kg in zip(job["masses"]["nodes"], job["masses"]["kg"], strict=True):
            build.particle_mass[node] += kg
        mass = np.array(build.particle_mass)
        hung = np.bincount(job["masses"]["nodes"], job["masses"]["kg"], len(points))
        self.weighs = mass if "rho" in asked else hung
        self.drag = asked.get("mass_damping", 0.0) * mass[:, None]
        self.model = build.finalize(device="cpu")
        self.model.set_gravity((0.0, 0.0, 0.0))  # it comes with the other forces
        self.solver = newton.solvers.SolverSemiImplicit(self.model, enable_tri_contact=False)
        self.now, self.next = self.model.state(), self.model.state()
        self.held = np.zeros(points.shape, bool)
        for part in (job["held"], *job["drives"]):
            self.held[part["nodes"], part["components"]] = True
        edges = points[cells[:, 1:]] - points[cells[:, :1]]
        thinnest = 1 / np.linalg.norm(np.linalg.inv(edges), axis=1).max()
        self.dt = COURANT * thinnest / np.sqrt((lam + 2 * mu) / density)
        self.floor = ROUNDED * asked["E"] * np.ptp(points, axis=0).max() ** 2

    def load(self, i, share=1.0):
        """Drives u (n, 3) m and forces f (n, 3) N at a share of the way from instant i - 1 to i."""
        job, self.u, self.f = self.job, np.zeros(self.x.shape), np.zeros(self.x.shape)
        for part in (*job["drives"], *job["loads"], *job["weights"]):
            y = part["history"]
            each = y[i] if share == 1 else (1 - share) * y[i - 1] + share * y[i]
            if "per_unit" in part:
                per = np.array(part["per_unit"])
                np.add.at(self.u, (part["nodes"], part["components"]), per * each)
            elif "forces" in part:
                self.f[part["nodes"]] += np.array(part["forces"]) * each
            else:
                self.f += np.outer(self.weighs, np.array(part["direction"]) * each)

    def step(self, dt):
        """One step; all forces (n, 3) N at its start, and velocities (n, 3) m/s at its end."""
        before = self.now
        before.particle_f.numpy()[:] = self.f - self.drag * before.particle_qd.numpy()
        self.solver.step(before, self.next, None, None, dt)
        self.now, self.next = self.next, before
        q, v = self.now.particle_q.numpy(), self.now.particle_qd.numpy()
        q[self.held], v[self.held] = (self.x + self.u)[self.held], 0.0
        return before.particle_f.numpy(), v

    def settle(self):
        """All forces at rest, or None where it does not come to it."""
        energy, q = 0.0, self.now.particle_q.numpy()
        q[self.held] = (self.x + self.u)[self.held]
        for _ in range(MOST):
            left, v = self.step(self.dt)
            rest = np.abs(left)
            whole = rest[self.held].sum() + np.abs(self.f).sum()
            if rest[~self.held].sum() <= max(BALANCED * whole, self.floor):
                return left
            if not np.isfinite(before := (v**2).sum()):
                return None
            v[:], energy = (0.0, 0.0) if before < energy else (v, before)
        return None

    def march(self, i):
        """From instant i - 1 to i; all forces at the start of the last step."""
        span = self.job["instants"][i] - self.job["instants"][i - 1]
        parts = int(np.ceil(span / self.dt))
        for k in range(parts):
            self.load(i, (k + 1) / parts)
            left, _ = self.step(span / parts)
        return left

    def field(self):
        return self.now.particle_q.numpy().astype(float) - self.x


def solve(folder, job, answer):
    import newton

    answer["version"] = newton.__version__
    start, asked = time.perf_counter(), job["material"]
    points, cells, cut = arrays(folder / "mesh.vtu")
    if asked["law"] not in ("linear", "svk", "neo_hooke"):
        raise LookupError(f"the law {asked['law']} is not written")
    answer["used"] = asked | {"law": "neo_hooke", "volumetric": OWN}
    if asked.get("stiffness_damping"):
        answer["used"]["stiffness_damping"] = 0.0
    if asked["law"] == "neo_hooke":
        answer["could_not"].append(f"the asked volumetric part: it has the {OWN}")
    if cut:
        answer["could_not"].append("use hexahedra: each was cut into six linear tetrahedra")
    body = Body(job, points, cells)
    answer["setup_s"] = time.perf_counter() - start
    skip, t, u, reactions = len(job["instants"]) - len(job["times"]), [], [], []
    for i, at in enumerate(job["times"], skip):
        start, left = time.perf_counter(), np.zeros(points.shape)
        if not job["inertia"]:
            body.load(i)
            left = body.settle()
        elif i:
            left = body.march(i)
        if left is None:
            answer |= {"state": "not_converged", "reason": f"no rest in {MOST} steps"}
            break
        t.append(at)
        u.append(body.field())
        reactions.append(np.where(body.held, -left, 0.0))
        answer["step_s"].append(time.perf_counter() - start)
    shape = (-1, *points.shape)
    np.savez(folder / "fields.npz", t=t, u=np.reshape(u, shape),
             reactions=np.reshape(reactions, shape))  # fmt: skip


if __name__ == "__main__":
    folder = Path(sys.argv[-1])
    job = json.loads((folder / "job.json").read_text())
    answer = {
        "schema": "validate-external-answer/1", "name": "NVIDIA Newton", "version": "",
        "mesh_sha256": job["mesh"]["sha256"], "state": "finished",
        "step_s": [], "could_not": ["compute in double precision"],
    }  # fmt: skip
    try:
        solve(folder, job, answer)
    except ImportError as why:
        answer |= {"state": "cannot_run", "reason": f"not installed: {why}"}
    except LookupError as why:
        answer |= {"state": "cannot_run", "reason": str(why)}
    (folder / "answer.json").write_text(json.dumps(answer))
