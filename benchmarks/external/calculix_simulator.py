"""CalculiX (Debian: apt-get install calculix-ccx; GPL-2, a program of its own) as an external
simulator, by its input deck: statics and dynamics of linear elasticity and neo-Hooke.

validate external check "python benchmarks/external/calculix_simulator.py"
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

CELLS = {10: "C3D4", 12: "C3D8", 24: "C3D10"}
BEND = "C3D8I"  # hexahedra of neo-Hooke: incompatible modes, which do not lock in bending
ALPHA = -0.05  # its own default, for neo-Hooke
PARTS = 4  # increments in one of the job's steps, where time counts, of the linear law


def num(x):
    """A number in the 20 characters that a field of a deck has."""
    return f"{x:.12e}"


def arrays(path):
    """Points (n, 3), cells (e, k) and CalculiX's name of their kind, from text."""
    found = {
        a.get("Name"): np.array(a.text.split(), float) for a in ET.parse(path).iter("DataArray")
    }
    kind, cells = int(found["types"][0]), found["connectivity"].astype(int)
    if kind not in CELLS:
        raise LookupError(f"cells of VTK's kind {kind}")
    return found["Points"].reshape(-1, 3), cells.reshape(len(found["types"]), -1), CELLS[kind]


def material(asked, used, could_not):
    lines = ["*MATERIAL, NAME=BODY"]
    if asked["law"] == "linear":
        lines += ["*ELASTIC", f"{num(asked['E'])}, {num(asked['nu'])}"]
    elif asked["law"] == "neo_hooke":
        mu, bulk = asked["E"] / 2 / (1 + asked["nu"]), asked["E"] / 3 / (1 - 2 * asked["nu"])
        lines += ["*HYPERELASTIC, NEO HOOKE", f"{num(mu / 2)}, {num(2 / bulk)}"]
        used["volumetric"] = "K/2 (J - 1)^2"
        could_not.append("the volumetric part: CalculiX has K/2 (J - 1)^2")
    else:
        raise LookupError(f"the law {asked['law']} ({asked.get('volumetric')}) is not written")
    if "rho" in asked:
        lines += ["*DENSITY", num(asked["rho"])]
    damping = asked.get("mass_damping", 0.0), asked.get("stiffness_damping", 0.0)
    if any(damping):
        lines += [f"*DAMPING, ALPHA={num(damping[0])}, BETA={num(damping[1])}"]
    return lines


def body(points, cells, kind):
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i}, " + ", ".join(map(num, x)) for i, x in enumerate(points.tolist(), 1)]
    lines += [f"*ELEMENT, TYPE={kind}, ELSET=ALL"]
    return lines + [
        f"{i}, " + ", ".join(map(str, c)) for i, c in enumerate((cells + 1).tolist(), 1)
    ]


def hung(masses, first):
    """Elements of mass, numbered from `first` on; their weight is given as forces."""
    lines = []
    for i, (node, kg) in enumerate(zip(masses["nodes"], masses["kg"], strict=True)):
        lines += [f"*ELEMENT, TYPE=MASS, ELSET=HUNG{i}", f"{first + i}, {node + 1}"]
        lines += [f"*MASS, ELSET=HUNG{i}", num(kg)]
    return lines


def at_instant(job, i, shape):
    """Prescribed displacements m, nodal forces N and gravity m/s^2, all parts summed."""
    u, f = np.full(shape, np.nan), np.zeros(shape)
    u[job["held"]["nodes"], job["held"]["components"]] = 0.0
    for drive in job["drives"]:
        u[drive["nodes"], drive["components"]] = 0.0
    for drive in job["drives"]:
        u[drive["nodes"], drive["components"]] += np.array(drive["per_unit"]) * drive["history"][i]
    for load in job["loads"]:
        f[load["nodes"]] += np.array(load["forces"]) * load["history"][i]
    g = sum((np.array(w["direction"]) * w["history"][i] for w in job["weights"]), np.zeros(3))
    f[job["masses"]["nodes"]] += np.outer(job["masses"]["kg"], g)
    return u, f, g


def conditions(u, f, g, amplitude=""):
    lines = [f"*BOUNDARY{amplitude}"]
    lines += [
        f"{n + 1}, {c + 1}, {c + 1}, {num(u[n, c])}" for n, c in np.argwhere(~np.isnan(u)).tolist()
    ]
    if f.any():
        lines += [f"*CLOAD{amplitude}"]
        lines += [f"{n + 1}, {c + 1}, {num(f[n, c])}" for n, c in np.argwhere(f != 0).tolist()]
    if g.any():
        size = float(np.linalg.norm(g))
        lines += [
            f"*DLOAD{amplitude}",
            f"ALL, GRAV, {num(size)}, " + ", ".join(map(num, g / size)),
        ]
    return lines


def statics(job, shape):
    """A step of the deck for every time."""
    large, lines, before = ", NLGEOM" if job["material"]["law"] != "linear" else "", [], 0.0
    skip = len(job["instants"]) - len(job["times"])
    for i, t in enumerate(job["times"], skip):
        each = max(t - before, 1e-9)
        lines += [f"*STEP, INC=1000{large}", "*STATIC", f"{num(each)}, {num(each)}"]
        lines += conditions(*at_instant(job, i, shape))
        lines += ["*NODE PRINT, NSET=ALL, FREQUENCY=1000", "U, RF", "*END STEP"]
        before = t
    return lines


def dynamics(job, shape, could_not):
    """One step of the deck by its alpha method: of the linear law without numerical damping in even
    increments, else in those that it chooses, with a little, or it does not converge."""
    t = np.array(job["instants"])
    parts = [*job["drives"], *job["loads"], *job["weights"]]
    histories = {tuple(part["history"]) for part in parts}
    if t[0] or np.ptp(np.diff(t)) > 1e-6 * t[1]:
        raise LookupError("dynamics of uneven times")
    if len(histories) > 1:
        raise LookupError("dynamics of several histories in one job")
    (y,) = histories
    k = int(np.argmax(np.abs(y)))
    scale = [a / y[k] if y[k] else 0.0 for a in y]
    table = [f"{num(a)}, {num(b)}" for a, b in zip(t.tolist(), scale, strict=True)]
    dt, end = t[1], num(t[-1])
    often, large = f"FREQUENCY={PARTS}", ""
    march = ["*DYNAMIC, DIRECT, ALPHA=0.", f"{num(dt / PARTS)}, {end}"]
    if job["material"]["law"] != "linear":
        often, large = "TIME POINTS=ASKED", ", NLGEOM"
        table += ["*TIME POINTS, NAME=ASKED, GENERATE", f"{num(dt)}, {end}, {num(dt)}"]
        march = [
            f"*DYNAMIC, ALPHA={ALPHA}",
            f"{num(dt / PARTS)}, {end}, {num(1e-6 * dt)}, {num(dt)}",
        ]
        could_not.append(f"do without numerical damping: alpha = {ALPHA}")
    return (
        ["*AMPLITUDE, NAME=GIVEN", *table],
        [f"*STEP, INC={100 * PARTS * len(t)}{large}", *march,
         *conditions(*at_instant(job, k, shape), ", AMPLITUDE=GIVEN"),
         f"*NODE PRINT, NSET=ALL, {often}", "U, RF", "*END STEP"],
    )  # fmt: skip


def carried(points, cells, density, g):
    """The weight (n, 3) N on every node, a cell's in equal shares (of C3D10 in its own)."""
    x = points[cells[:, :8]] if cells.shape[1] == 8 else points[cells[:, :4]]
    corners = x[:, [0, 1, 3, 4]] if cells.shape[1] == 8 else x
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    volume = volume if cells.shape[1] == 8 else volume / 6
    share = np.array([-1 / 20] * 4 + [1 / 5] * 6) if cells.shape[1] == 10 else 1 / cells.shape[1]
    found = np.zeros(len(points))
    np.add.at(found, cells, volume[:, None] * share * np.ones(cells.shape[1]))
    return density * found[:, None] * g


def blocks(text, shape):
    """(time, displacements, forces) of every print in the .dat file."""
    found = {}
    head = re.compile(r"^ (displacements|forces) .* time +(\S+)$", re.MULTILINE)
    heads = list(head.finditer(text))
    ends = [*(h.start() for h in heads[1:]), len(text)]
    for this, end in zip(heads, ends, strict=False):
        rows = text[this.end() : end].split()
        values = np.zeros(shape)
        table = np.array(rows, float).reshape(-1, 4)
        values[table[:, 0].astype(int) - 1] = table[:, 1:]
        found.setdefault(float(this[2]), {})[this[1]] = values
    return sorted(found.items())


def solve(folder, job, answer):
    ccx = shutil.which("ccx")
    if ccx is None:
        raise LookupError("not installed: no program 'ccx'; apt-get install calculix-ccx")
    said = subprocess.run([ccx, "-v"], capture_output=True, text=True, check=False).stdout
    answer["version"] = said.split()[-1] if said.split() else ""
    start = time.perf_counter()
    points, cells, kind = arrays(folder / "mesh.vtu")
    answer["used"] = dict(job["material"])
    law = material(job["material"], answer["used"], answer["could_not"])
    shape, large = points.shape, job["material"]["law"] != "linear"
    kind = BEND if kind == "C3D8" and large else kind
    before, steps = (
        dynamics(job, shape, answer["could_not"]) if job["inertia"] else ([], statics(job, shape))
    )
    deck = [
        *body(points, cells, kind),
        *hung(job["masses"], len(cells) + 1),
        *law,
        "*SOLID SECTION, ELSET=ALL, MATERIAL=BODY",
        *before,
        *steps,
    ]
    (folder / "deck.inp").write_text("\n".join(deck) + "\n")
    answer["setup_s"] = time.perf_counter() - start
    start = time.perf_counter()
    done = subprocess.run(
        [ccx, "-i", "deck"], cwd=folder, capture_output=True, text=True, check=False
    )
    mean = (time.perf_counter() - start) / len(job["times"])
    answer["step_s"] = [mean] * len(job["times"])
    dat = folder / "deck.dat"
    found = blocks(dat.read_text(), points.shape) if dat.is_file() else []
    skip = len(job["instants"]) - len(job["times"])
    fields = {"t": [], "u": [], "reactions": []}
    for i, t in enumerate(job["times"], skip):
        near = [b for at, b in found if abs(at - t) <= 1e-5 * t]
        if not near:
            break
        held, f, g = at_instant(job, i, points.shape)
        f = f + carried(points, cells, job["material"].get("rho", 0.0), g)
        fields["t"].append(t)
        fields["u"].append(near[0]["displacements"])
        fields["reactions"].append(np.where(np.isnan(held), 0.0, near[0]["forces"] - f))
    if not fields["t"]:
        raise RuntimeError(f"ccx ended with {done.returncode}: {done.stdout[-300:]}")
    np.savez(folder / "fields.npz", **fields)
    complete = len(fields["t"]) == len(job["times"])
    answer |= {"state": "finished"} if complete else {
        "state": "not_converged", "reason": f"ccx ended with {done.returncode}"
    }  # fmt: skip


if __name__ == "__main__":
    folder = Path(sys.argv[-1])
    job = json.loads((folder / "job.json").read_text())
    answer = {
        "schema": "validate-external-answer/1", "name": "CalculiX", "version": "",
        "mesh_sha256": job["mesh"]["sha256"],
        "could_not": ["say how long each step took: all are their mean, its files included"],
    }  # fmt: skip
    try:
        solve(folder, job, answer)
    except LookupError as why:
        answer |= {"state": "cannot_run", "reason": str(why)}
    (folder / "answer.json").write_text(json.dumps(answer))
