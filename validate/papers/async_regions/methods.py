"""The methods of `async_line`, rows of Table 1 and other borders for its worst one, and those of
`async_block`; beside both a reduced model of the same body."""

from dataclasses import replace

from validate.replay.method import Method
from validate.solve.regions import AsyncRegions
from validate.solve.touched_krylov import TouchedKrylov

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
