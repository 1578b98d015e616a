"""Methods of `async_block`: regions around the touched place, beside a reduced model."""

from dataclasses import replace

from validate.pipeline.experiment.method import Method
from validate.solve.regions.krylov import TouchedKrylov
from validate.solve.regions.scheme import AsyncRegions

_NEAR = AsyncRegions(layers=(3,), rates=(50.0,))
BLOCK = {
    "whole": Method("whole solve", AsyncRegions(layers=(), rates=())),
    "near": Method("3 layers, the rest at 50 Hz", _NEAR),
    "near_500": Method("3 layers, the rest at 500 Hz", replace(_NEAR, rates=(500.0,))),
    "overlap": Method("3 layers, 50 Hz, 2 of overlap", replace(_NEAR, overlap=2)),
    "three": Method(
        "2 layers, 2 at 500 Hz, the rest at 50 Hz",
        replace(_NEAR, layers=(2, 2), rates=(500.0, 50.0)),
    ),
    "adaptable": Method(
        "1 to 4 layers by the displaced nodes, 50 Hz",
        replace(_NEAR, layers=(1,), adapt="threshold", most=4, moved=1e-3),
    ),
    "krylov": Method("4 Krylov vectors a direction", TouchedKrylov()),
}
