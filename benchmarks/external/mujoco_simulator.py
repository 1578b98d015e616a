"""MuJoCo (pip install mujoco; Apache-2.0) as an external simulator, by a flex of linear
tetrahedra that obey St. Venant-Kirchhoff's law, at rest and in time.

MuJoCo's hexahedral cells (flexcomp's dof and cellcount) and its stable neo-Hooke law
(MjsFlex.elastic3d = 1) are not used.

Every node is a body with a slide for each component that is free; what is held has none, and what
is driven is moved by the place of its body. At rest it is stepped, long steps and no velocity kept,
until forces balance. Hexahedra are cut into six tetrahedra each.

validate external check "python benchmarks/external/mujoco_simulator.py"
"""

import json
import sys
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

SIX = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
STEP = 1e-3  # s: the longest in time; its documentation calls 1 to 4 ms typical
PARTS = 4  # steps in one of the job's, at least
LONG = 30.0  # a step to rest, of the time that a wave takes along the body
BALANCED, MOST = 1e-6, 400  # of the forces; steps to rest, else it did not converge
NOUGHT = 1e-8  # forces of no account, of E and the body's length squared
LAWS = ("linear", "svk", "neo_hooke")  # asked laws whose E and nu it takes


def arrays(path):
    """Points (n, 3) and tetrahedra (e, 4) from text, and whether they were hexahedra."""
    found = {
        a.get("Name"): np.array(a.text.split(), float) for a in ET.parse(path).iter("DataArray")
    }
    kind, cells = int(found["types"][0]), found["connectivity"].astype(int)
    if kind not in (10, 12):
        raise LookupError(f"cells of VTK's kind {kind}: this simulator has linear tetrahedra only")
    cells = cells.reshape(len(found["types"]), -1)
    points, cut = found["Points"].reshape(-1, 3), kind == 12
    return points, cells[:, SIX].reshape(-1, 4) if cut else cells, cut


def lumped(points, cells, density):
    """Masses (n,) kg: a quarter of every tetrahedron on each of its nodes."""
    x = points[cells]
    volume = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6
    return np.bincount(cells.ravel(), np.repeat(density * volume / 4, 4), len(points))


def words(values):
    return " ".join(map(repr, np.asarray(values, float).ravel().tolist()))


def mjcf(points, cells, mass, held, asked):
    """The model: slides of what is free (n, 3), and one flex through all bodies."""
    bodies = []
    for i, (x, m, still) in enumerate(zip(points, mass.tolist(), held, strict=True)):
        slides = "".join(
            f'<joint type="slide" axis="{words(np.eye(3)[c])}"/>' for c in np.flatnonzero(~still)
        )
        inertia = f'<inertial pos="0 0 0" mass="{m!r}" diaginertia="1 1 1"/>'
        bodies.append(f'<body name="n{i}" pos="{words(x)}">{slides}{inertia}</body>')
    names = " ".join(f"n{i}" for i in range(len(points)))
    return f"""<mujoco><compiler boundmass="0" boundinertia="0" balanceinertia="false"/>
<option gravity="0 0 0" integrator="discrete" solver="Newton" jacobian="sparse" tolerance="1e-10"
iterations="3000"/><worldbody>{"".join(bodies)}</worldbody><deformable><flex name="body" dim="3"
radius="1e-6" body="{names}" element="{" ".join(map(str, cells.ravel().tolist()))}">
<elasticity young="{asked["E"]!r}" poisson="{asked["nu"]!r}"
damping="{asked.get("stiffness_damping", 0.0)!r}"/>
<contact selfcollide="none" contype="0" conaffinity="0"/></flex></deformable></mujoco>"""


class Flex:
    """The body in MuJoCo, and the same without supports, that tells the forces on all nodes."""

    def __init__(self, mj, job, points, cells):
        asked, masses = job["material"], job["masses"]
        density = asked.get("rho", 1000.0)  # any, where nothing weighs
        hung = np.bincount(masses["nodes"], masses["kg"], len(points))
        mass = lumped(points, cells, density) + hung
        self.mj, self.job, self.x = mj, job, points
        self.weighs = mass if "rho" in asked else hung
        self.held = np.zeros(points.shape, bool)
        for part in (job["held"], *job["drives"]):
            self.held[part["nodes"], part["components"]] = True
        self.model, self.all = (
            mj.MjModel.from_xml_string(mjcf(points, cells, mass, held, asked))
            for held in (self.held, np.zeros_like(self.held))
        )
        self.data, self.apart = mj.MjData(self.model), mj.MjData(self.all)
        # Its slides take no damping where a flex is: the masses' is given as a force.
        self.drag = (asked.get("mass_damping", 0.0) * np.repeat(mass, 3).reshape(-1, 3))[~self.held]
        size = np.ptp(points, axis=0).max()
        self.long = LONG * size * np.sqrt(density / asked["E"])
        self.nought = NOUGHT * asked["E"] * size**2

    def given(self, part, i, share):
        """A history at a share of the way from instant i - 1 to i."""
        y = part["history"]
        return y[i] if share == 1 else (1 - share) * y[i - 1] + share * y[i]

    def load(self, i, share=1.0):
        """Moves what is driven, sets forces (n, 3) N: MuJoCo's own gravity is not used."""
        job, self.now, self.f = self.job, np.zeros(self.x.shape), np.zeros(self.x.shape)
        for part in job["drives"]:
            each = np.array(part["per_unit"]) * self.given(part, i, share)
            np.add.at(self.now, (part["nodes"], part["components"]), each)
        for part in job["loads"]:
            self.f[part["nodes"]] += np.array(part["forces"]) * self.given(part, i, share)
        for part in job["weights"]:
            g = np.array(part["direction"]) * self.given(part, i, share)
            self.f += np.outer(self.weighs, g)
        self.model.body_pos[1:] = self.x + self.now
        self.data.qfrc_applied[:] = self.f[~self.held]

    def forces(self):
        """Displacements m and what is left of all forces N, both (n, 3)."""
        u, v = self.now.copy(), np.zeros(self.x.shape)
        u[~self.held], v[~self.held] = self.data.qpos, self.data.qvel
        self.apart.qpos[:], self.apart.qvel[:] = u.ravel(), v.ravel()
        self.mj.mj_fwdPosition(self.all, self.apart)
        self.mj.mj_fwdVelocity(self.all, self.apart)
        return u, self.apart.qfrc_passive.reshape(self.x.shape) + self.f

    def settle(self):
        """Steps to rest; those that it took, or none where it did not come to it."""
        self.model.opt.timestep = self.long
        for k in range(MOST):
            self.mj.mj_step(self.model, self.data)
            self.data.qvel[:] = 0.0
            rest = np.abs(self.forces()[1])
            all_ = rest[self.held].sum() + np.abs(self.f).sum()
            if rest[~self.held].sum() <= max(BALANCED * all_, self.nought):
                return k + 1
        return 0

    def step(self, i):
        """From instant i - 1 to i, in even steps of time."""
        span = self.job["instants"][i] - self.job["instants"][i - 1]
        parts = max(PARTS, int(np.ceil(span / STEP - 1e-9)))
        self.model.opt.timestep = span / parts
        for k in range(parts):
            self.load(i, (k + 1) / parts)
            self.data.qfrc_applied -= self.drag * self.data.qvel
            self.mj.mj_step(self.model, self.data)


def solve(folder, job, answer):
    import mujoco as mj

    answer["version"] = mj.__version__
    start, asked, could_not = time.perf_counter(), job["material"], answer["could_not"]
    points, cells, cut = arrays(folder / "mesh.vtu")
    if asked["law"] not in LAWS:
        raise LookupError(f"the law {asked['law']}: this simulator has St. Venant-Kirchhoff's only")
    answer["used"] = {k: v for k, v in asked.items() if k != "volumetric"} | {"law": "svk"}
    if cut:
        could_not.append("use hexahedra: each was cut into six linear tetrahedra")
    if job["inertia"]:
        could_not += ["use consistent masses", "step otherwise than by an implicit Euler"]
    body = Flex(mj, job, points, cells)
    answer["setup_s"] = time.perf_counter() - start
    fields = {"t": [], "u": [], "reactions": []}
    skip = len(job["instants"]) - len(job["times"])
    for i, t in enumerate(job["times"], skip):
        start = time.perf_counter()
        if job["inertia"] and i:
            body.step(i)
        else:
            body.load(i)
        if not job["inertia"] and not body.settle():
            answer |= {"state": "not_converged", "reason": f"no rest in {MOST} steps"}
            break
        u, left = body.forces()
        fields["t"].append(t)
        fields["u"].append(u)
        fields["reactions"].append(np.where(body.held, -left, 0.0))
        answer["step_s"].append(time.perf_counter() - start)
    np.savez(
        folder / "fields.npz",
        t=fields["t"], **{k: np.reshape(fields[k], (-1, *points.shape)) for k in ("u", "reactions")}
    )  # fmt: skip


if __name__ == "__main__":
    folder = Path(sys.argv[-1])
    job = json.loads((folder / "job.json").read_text())
    answer = {
        "schema": "validate-external-answer/1", "name": "MuJoCo", "version": "", "step_s": [],
        "mesh_sha256": job["mesh"]["sha256"], "could_not": [], "state": "finished",
    }  # fmt: skip
    try:
        solve(folder, job, answer)
    except ImportError as why:
        answer |= {"state": "cannot_run", "reason": f"not installed: {why}"}
    except LookupError as why:
        answer |= {"state": "cannot_run", "reason": str(why)}
    (folder / "answer.json").write_text(json.dumps(answer))
