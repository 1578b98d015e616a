"""The beam of `benchmarks/beam.py` by FElupe or MuJoCo, in the interpreter that has them; JSON out.

python benchmarks/beam_peers.py felupe 11 4 4        static: mean end motion mm, least ms of five
python benchmarks/beam_peers.py mujoco 11 4 4        swing: its trace mm at 1 ms, steps a second
"""

import json
import sys
import time
import warnings

import numpy as np

E, NU, RHO, G, SIZE = 263_824.0, 0.499, 1070.0, 9.80709, (0.1, 0.03, 0.03)
_FLEX = """<mujoco><option gravity="0 0 -{g}" timestep="0.001" integrator="discrete"/>
<size memory="200M"/><worldbody><flexcomp name="beam" type="grid" dim="3" count="{count}"
spacing="{spacing}" mass="{mass}" radius=".0001"><elasticity young="{E}" poisson="{nu}"/>
<contact selfcollide="none" contype="0" conaffinity="0"/><pin gridrange="0 0 0 0 {j} {k}"/>
</flexcomp></worldbody></mujoco>"""


def felupe(n: tuple[int, ...]) -> dict[str, object]:
    """Mixed hexahedra (three fields, mean dilatation) of n nodes a side."""
    import felupe as fem

    mesh = fem.Cube(b=SIZE, n=n)
    best = np.inf
    for _ in range(5):
        field = fem.FieldsMixed(fem.RegionHexahedron(mesh), n=3)
        clamp = {"clamp": fem.Boundary(field[0], fx=0.0)}
        dof0, dof1 = fem.dof.partition(field, clamp)
        law = fem.NeoHooke(mu=E / 2 / (1 + NU), bulk=E / 3 / (1 - 2 * NU))
        solid = fem.SolidBody(fem.ThreeFieldVariation(law), field)
        weight = fem.SolidBodyForce(field, values=[0, 0, -G * RHO])
        start = time.process_time()
        fem.newtonraphson(
            items=[solid, weight], dof0=dof0, dof1=dof1,
            ext0=fem.dof.apply(field, clamp, dof0), verbose=False,
        )  # fmt: skip
        best = min(best, time.process_time() - start)
    end = np.isclose(mesh.points[:, 0], SIZE[0])
    return {"mm": 1e3 * float(field[0].values[end, 2].mean()), "ms": 1e3 * best}


def mujoco(n: tuple[int, ...], nu: float = 0.45, steps: int = 250) -> dict[str, object]:
    """A flex of linear tetrahedra; at nu .499 it hardly moves, .45 is the best of it."""
    import mujoco as mj

    spacing = [s / (c - 1) for s, c in zip(SIZE, n, strict=True)]
    xml = _FLEX.format(
        g=G, E=E, nu=nu, mass=RHO * float(np.prod(SIZE)), count=" ".join(map(str, n)),
        spacing=" ".join(map(str, spacing)), j=n[1] - 1, k=n[2] - 1,
    )  # fmt: skip
    model = mj.MjModel.from_xml_string(xml)
    data = mj.MjData(model)
    mj.mj_forward(model, data)
    x0 = data.flexvert_xpos.copy()
    end, z = np.isclose(x0[:, 0], x0[:, 0].max()), []
    start = time.process_time()
    for _ in range(steps):
        mj.mj_step(model, data)
        z.append(1e3 * float((data.flexvert_xpos - x0)[end, 2].mean()))
    return {"trace": z, "hz": steps / (time.process_time() - start)}


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    nodes = tuple(int(x) for x in sys.argv[2:])
    print(json.dumps({"felupe": felupe, "mujoco": mujoco}[sys.argv[1]](nodes)))
