"""The fluid phantom with a twin at large strain: what linear models cost.

The same experiment as `fluid_phantom`, recorded by a twin of compressible neo-Hookean quadratic
elements; linear and large-strain models are judged against it side by side.
"""

from dataclasses import replace
from pathlib import Path
from typing import cast

from validate.compare.verdict import Accept
from validate.replay.experiment import EffectSpec, Experiment, Variant
from validate.replay.find import load_file

LINEAR = cast(Experiment, load_file(Path(__file__).with_name("fluid_phantom.py")))
_p = LINEAR.parameters
PARAMETERS = replace(
    _p,
    recording=str(Path(__file__).parents[1] / "recordings" / "fluid_phantom_large.mcap"),
    outlines="images",
    twin=replace(_p.twin, law="neo_hooke", seed=20040328, frames=True),
)
_linear = LINEAR.methods
METHODS = {
    "md_fluid": _linear["md_fluid"],
    "p2_fluid": replace(_linear["p2_fluid"], label="P2 linear with fluid"),
    "md_svk": replace(_linear["md_fluid"], label="P1 mean dilatation, SVK", law="svk"),
    "md_neo_hooke": replace(
        _linear["md_fluid"], label="P1 mean dilatation, neo-Hooke", law="neo_hooke"
    ),
    "p2_neo_hooke": replace(
        _linear["p2_fluid"], label="P2 neo-Hooke with fluid", law="neo_hooke", load_step=0.003
    ),
}

EXPERIMENT = replace(
    LINEAR,
    name="fluid_phantom_large",
    title="Fluid inclusion in a phantom, twin at large strain",
    parameters=PARAMETERS,
    methods=METHODS,
    accepted=("p2_neo_hooke",),
    accept=(
        *LINEAR.accept,
        Accept("force.plate", 0.8, "a tenth of the largest plate force (ours)"),
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
    published=None,
    seed=PARAMETERS.twin.seed,
    twin_notice=(
        "The outlines are extracted from synthetic B-mode images. The recording is a twin: it and "
        "the accepted model share the law (neo-Hookean), not the mesh. u_num of the accepted model "
        "is that of the linear quadratic elements."
    ),
)  # fmt: skip
