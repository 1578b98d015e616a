"""Write the log of a sphere pressed into a thin layer on a compliant machine, solved by FElupe.

python benchmarks/indentation_log.py -o DIR

The truth is another code's (pip install felupe): an axisymmetric neo-Hooke disc in mixed cells,
bonded to its floor, under a frictionless rigid sphere by penalty. What is recorded is the motion of
the stage: the depth, and what the machine yields under the force. DIR gets the log (layer.csv), one
of the same machine on a rigid block (rigid.csv), and the answers of `validate new` without
(unknown.toml), with a declared (declared.toml) compliance.
docs/how-to/indentation.md goes on from there.
"""

import argparse
from math import sinh
from pathlib import Path

import numpy as np

from validate.arrays import Floats

E, NU = 10e6, 0.45  # Pa, 1
DIAMETER, HEIGHT, RADIUS = 20e-3, 3e-3, 4e-3  # m
DEPTH, GAP = 0.4e-3, 0.1e-3  # m
COMPLIANCE = 4e-6  # m/N, of a small machine with a soft load cell
STATES, SAMPLES, APPROACH = 24, 240, 48
NOISE = {"displacement": 0.2e-6, "force": 0.02}  # m, N
CELLS, CLUSTER = (60, 36), 3.0  # along radius and height
PENALTY = 1000.0  # of a node, over E times the length of a ring of the smallest cells

ANSWERS = """\
experiment = "body"
body = {{shape = "cylinder", cylinder = "20mm,3mm"}}
held = {{all = "zmin"}}
moved = {{by = "displacement", along = "-z", place = "zmax"}}
indenter = {{shape = "sphere", radius = "4mm", friction = "frictionless"}}
machine = {machine}
material = {{E = "10MPa", nu = 0.45}}
law = "neo_hooke"
accept = {{force = "1.5N"}}
why = {{force = "a tenth of the largest force, our own choice"}}
ranges = {{E = "1%", nu = 0.002, load = 0.002}}
"""


def forces(depths: Floats, cells: tuple[int, int] = CELLS, penalty: float = PENALTY) -> Floats:
    """Forces N of the sphere at these depths (n,) m, rising."""
    import felupe as fem

    def lines(count: int, to: float) -> Floats:
        """From the contact outwards, ever longer."""
        s = np.linspace(0, 1, count + 1)
        return np.asarray(to * np.sinh(CLUSTER * s) / sinh(CLUSTER))

    r, z = lines(cells[0], DIAMETER / 2), HEIGHT - lines(cells[1], HEIGHT)[::-1]
    grid = fem.Rectangle(n=(len(z), len(r)))
    at = np.rint(grid.points * [len(z) - 1, len(r) - 1]).astype(int)
    mesh = fem.Mesh(np.stack([z[at[:, 0]], r[at[:, 1]]], axis=1), grid.cells, grid.cell_type)
    mesh.add_points([HEIGHT + RADIUS, 0.0])
    centre = mesh.npoints - 1
    field = fem.FieldsMixed(fem.RegionQuad(mesh), n=3, axisymmetric=True)
    law = fem.NeoHooke(E / 2 / (1 + NU), E / 3 / (1 - 2 * NU))
    ball = fem.ContactRigidCylinder(  # a circle about the axis of symmetry
        field=field,
        points=np.flatnonzero(np.isclose(mesh.points[:centre, 0], HEIGHT)),
        centerpoint=centre,
        radius=RADIUS,
        multiplier=penalty * E * 2 * np.pi * r[1],
    )
    u = field[0]
    bounds = {
        "floor": fem.Boundary(u, fx=lambda x: np.isclose(x, 0)),
        "axis": fem.Boundary(u, fy=lambda y: np.isclose(y, 0), skip=(1, 0)),
        "down": fem.Boundary(u, fx=lambda x: np.isclose(x, HEIGHT + RADIUS), skip=(0, 1)),
    }
    body = fem.SolidBody(fem.ThreeFieldVariation(law), field)
    step = fem.Step([body, ball], ramp={bounds["down"]: -depths}, boundaries=bounds)
    felt = []
    for _ in step.generate(verbose=0, x0=field):
        felt.append(-float(ball.results.force.toarray()[2 * centre, 0]))
    return np.array(felt)


def table(path: Path, t: Floats, u: Floats, F: Floats, rng: np.random.Generator) -> None:
    rows = np.column_stack([
        t,
        1e3 * (u + rng.normal(0, NOISE["displacement"], len(t))),
        F + rng.normal(0, NOISE["force"], len(t)),
    ])  # fmt: skip
    head = "Time (s),Displacement (mm),Force (N)"
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header=head, comments="")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("-o", type=Path, required=True, metavar="DIR")
    folder: Path = parser.parse_args().o
    folder.mkdir(parents=True, exist_ok=True)
    known = np.linspace(0, DEPTH, STATES + 1)
    force = np.append(0.0, forces(known[1:]))
    depth = np.append(np.linspace(-GAP, 0, APPROACH, endpoint=False),
                      np.linspace(0, DEPTH, SAMPLES))  # fmt: skip
    F = np.interp(depth, known, force)
    t, rng = 0.1 * np.arange(len(depth)), np.random.default_rng(1)
    table(folder / "layer.csv", t, GAP + depth + COMPLIANCE * F, F, rng)
    table(folder / "rigid.csv", t, COMPLIANCE * F, F, rng)
    machines = {
        "unknown": '{compliance = "unknown"}',
        "declared": f'{{compliance = "{COMPLIANCE:g}", sd = "1e-7"}}',
    }
    for name, machine in machines.items():
        (folder / f"{name}.toml").write_text(ANSWERS.format(machine=machine), "utf-8")
    print(f"{folder}: layer.csv, rigid.csv, unknown.toml, declared.toml; largest force "
          f"{F.max():.4g} N at {1e3 * DEPTH:g} mm")  # fmt: skip


if __name__ == "__main__":
    main()
