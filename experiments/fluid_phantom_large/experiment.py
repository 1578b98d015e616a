"""The fluid phantom with a twin at large strain: what linear models cost.

The same experiment as `fluid_phantom`, recorded by a twin of compressible neo-Hookean quadratic
elements; linear and large-strain models are judged against it side by side.
"""

from dataclasses import replace

from validate.compare.overall_verdict import Expected
from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import EffectSpec, Variant
from validate.pipeline.experiment.method import Method
from validate.scene.material import LawName
from validate.solve.static.load_table import Tabulated
from validate.solve.static.newton import StaticNewton

from ..fluid_phantom.experiment import EXPERIMENT as LINEAR

_own, _twin = LINEAR.parameters.settings, LINEAR.twin
assert _twin is not None
assert LINEAR.uncertainty is not None
SETTINGS = replace(
    _own, outlines="images", twin=replace(_own.twin, law="neo_hooke", seed=20040328, frames=True)
)
_mean, _quadratic = LINEAR.methods["md_fluid"], LINEAR.methods["p2_fluid"]


def _large(label: str, linear: Method, law: LawName, step: float) -> Method:
    """A method at large strain, solved on a grid of loads of `step` m."""
    scheme = Tabulated(StaticNewton(), step)
    return Method(label, scheme, {**linear.scene, "material.law": law})


METHODS = {
    "md_fluid": _mean,
    "p2_fluid": replace(_quadratic, label="P2 linear with fluid"),
    "md_svk": _large("P1 mean dilatation, SVK", _mean, "svk", 0.0015),
    "md_neo_hooke": _large("P1 mean dilatation, neo-Hooke", _mean, "neo_hooke", 0.0015),
    "p2_neo_hooke": _large("P2 neo-Hooke with fluid", _quadratic, "neo_hooke", 0.003),
}

EXPERIMENT = replace(
    LINEAR,
    name="fluid_phantom_large",
    title="Fluid inclusion in a phantom, twin at large strain",
    source="Gosline, Salcudean, Yan (2004), section 4",
    scene=LINEAR.parameters.scene,
    settings=SETTINGS,
    recording="../../recordings/fluid_phantom_large.mcap",
    methods=METHODS,
    accepted=("p2_neo_hooke",),
    accept=(
        *LINEAR.accept,
        Accept("force.plate", 0.8, "a tenth of the largest plate force"),
    ),
    expected=(
        Expected("undecided", "the modulus is declared to 5 %", check="pressure@9mm"),
        Expected("undecided", "the modulus is declared to 5 %", check="force.plate@9mm"),
    ),
    uncertainty=replace(LINEAR.uncertainty, stand_in={"p2_neo_hooke": "p2_fluid"}),
    effects=(
        EffectSpec("large strain", "linear instead of neo-Hookean (P2)",
                   Variant("p2_neo_hooke"), Variant("p2_fluid")),
        EffectSpec("large strain, P1", "linear instead of neo-Hookean (mean dilatation)",
                   Variant("md_neo_hooke"), Variant("md_fluid")),
        EffectSpec("element", "P1 mean dilatation instead of P2, both neo-Hookean",
                   Variant("p2_neo_hooke"), Variant("md_neo_hooke")),
    ),
    identify=None,
    published=(),
    twin=replace(_twin, seed=SETTINGS.twin.seed, notice=(
        "The outlines are extracted from synthetic B-mode images. The recording is a twin: it and "
        "the accepted model share the law (neo-Hookean), not the mesh. u_num of the accepted model "
        "is that of the linear quadratic elements."
    )),
)  # fmt: skip
