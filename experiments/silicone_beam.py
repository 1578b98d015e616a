"""A silicone beam let go under its own weight: where it comes to rest, measured by others.

Motion capture of a clamped 30 x 30 x 100 mm beam (srl-ethz/diffPD_sim2real, MIT). Modulus, Poisson
ratio and density are the data set's own, identified on another load by its authors; nothing is
fitted here. Another case: `--set recording=NEW.c3d --set load.mass=52g`.
"""

from collections.abc import Callable

from validate.compare.verdict import Accept
from validate.papers.released_beam.beam import BeamModel as Model
from validate.papers.released_beam.beam import (
    ReleasedBeam,
    build,
    load,
    place,
)
from validate.replay.cards import changed, moved
from validate.replay.experiment import Change, Experiment, Input, MeshLadder, Uncertainty
from validate.replay.method import Method
from validate.solve.newton import StaticNewton

STATIC = StaticNewton("none")
METHODS = {
    "mixed": Method("quadratic hexahedra with a pressure of their own, neo-Hooke", STATIC, Model()),
    "mixed_svk": Method("the same, St. Venant-Kirchhoff", STATIC, Model("svk")),
    "mixed_coarse": Method("linear hexahedra with a pressure, neo-Hooke", STATIC, Model(order=1)),
    "locking": Method("linear hexahedra (lock), neo-Hooke", STATIC, Model(order=1, mixed=False)),
}


def _cells(along: int, across: int) -> Change:
    return changed("mesh", along=along, across=across)


def _by(part: str, name: str, share: str) -> Callable[[ReleasedBeam, float], ReleasedBeam]:
    """A value off by z of its relative standard uncertainty."""
    return moved(part, **{
        name: lambda p, z: getattr(getattr(p, part), name) * (1 + z * getattr(p.ranges, share))
    })  # fmt: skip


def _hung(p: ReleasedBeam, z: float) -> float:
    """No mass is none, whatever its uncertainty."""
    return p.load.mass and p.load.mass + z * p.ranges.mass


NONE = "assumed; the data set gives none"
UNCERTAINTY = Uncertainty(
    MeshLadder((_cells(4, 1), _cells(8, 2)), lambda p: p.size.length / p.mesh.along),
    (
        Input("modulus", _by("material", "E", "modulus"), "E", NONE),
        Input("density", _by("material", "rho", "rho"), "rho", NONE),
        Input("Poisson ratio",
              moved("material", nu=lambda p, z: p.material.nu - abs(z) * p.ranges.nu), "nu", NONE),
        Input("height", moved("size", height=lambda p, z: p.size.height + z * p.ranges.size),
              "height of the section", NONE),
        Input("mass", moved("load", mass=_hung), "what hangs at the end", NONE),
    ),
    surrogate="mixed_coarse",
)  # fmt: skip

EXPERIMENT = Experiment(
    name="silicone_beam",
    title="Silicone beam let go under its weight",
    source="srl-ethz/diffPD_sim2real 825e7b7 (MIT)",
    parameters=ReleasedBeam(),
    methods=METHODS,
    accepted=("mixed",),
    accept=(
        Accept("tip.vertical", 1e-3, "1 mm (ours)"),
        Accept("tip.axial", 1e-3, "1 mm (ours)"),
    ),
    load=load,
    build=build,
    place=place,
    uncertainty=UNCERTAINTY,
    locates=("recording",),
)
