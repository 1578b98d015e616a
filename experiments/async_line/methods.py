"""Methods of `async_line`: rows of Table 1, other borders for its worst one, a reduced model."""

from dataclasses import replace

from validate.pipeline.experiment.method import Method
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions

_WORST = AsyncRegions(layers=(5,), rates=(5.0,))
LINE = {
    "whole": Method("whole solve", AsyncRegions(layers=(), rates=())),
    "n30_f500": Method("N = 30, f = 500 Hz", AsyncRegions(layers=(30,), rates=(500.0,))),
    "n30_f50": Method("N = 30, f = 50 Hz", AsyncRegions(layers=(30,), rates=(50.0,))),
    "n5_f500": Method("N = 5, f = 500 Hz", AsyncRegions(layers=(5,), rates=(500.0,))),
    "n5_f5": Method("N = 5, f = 5 Hz", _WORST),
    "n5_f5_held": Method("N = 5, f = 5 Hz, borders held", replace(_WORST, border="hold")),
    "n5_f5_joint": Method("N = 5, f = 5 Hz, solved jointly", replace(_WORST, border="joint")),
    "n5_f5_overlap": Method("N = 5, f = 5 Hz, 4 layers of overlap", replace(_WORST, overlap=4)),
    "three": Method(
        "N = 5 explicit, 10 at 500 Hz, the rest static at 50 Hz",
        AsyncRegions(
            layers=(5, 10), rates=(500.0, 50.0), solvers=("explicit", "semi_implicit", "static")
        ),
    ),
    "krylov": Method("4 Krylov vectors", TouchedKrylov()),
}
