"""`validate external check` and `validate external job`.

`check` tests capabilities and accuracy of an external simulator. `job` writes its input files.
"""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from validate.commands.arguments import FAILED, OK, require_empty
from validate.commands.display import say, table
from validate.errors import UsageError
from validate.parameters import nearest_names
from validate.pipeline.bodies.own_body import meshed, own_body
from validate.pipeline.experiment.find import find
from validate.solve.external.exchange import write_job
from validate.solve.external.scheme import ExternalSimulator
from validate.solve.external.suite import check_simulator

_STATES = {"finished": "yes", "refused": "no"}
_TOLERANCE = 1e-6  # relative, of the equations


def check(command: str, seconds: float, memory: float, as_json: bool) -> int:
    """Run the small scenes and return the exit code.

    It is 1 if a run failed or no run finished. The size of an error does not count.
    """
    simulator = ExternalSimulator(command, seconds=seconds, memory=memory)
    found = [row for rows in check_simulator(simulator) for row in rows]
    if as_json:
        print(
            json.dumps(
                [asdict(row) for row in found], ensure_ascii=False, indent=2, allow_nan=False
            )
        )
    else:
        head = ["scene", "solved", "quantity", "error", "exact", "unit"]
        cells = []
        for row in found:
            milli, unit = (1e3, "mm") if row.unit == "m" else (1.0, row.unit)
            error = "-" if row.error is None else f"{milli * row.error:.3g}"
            can = _STATES.get(row.state, row.state)
            cells.append([row.scene, can, row.quantity, error, f"{milli * row.exact:.4g}", unit])
        table("", head, cells)
        for row in found:
            if row.why:
                say(f"{row.scene}: {row.why}", indent="  ")
    states = {row.state for row in found}
    return OK if "finished" in states and states <= set(_STATES) else FAILED


def job(
    name: str,
    folder: Path,
    method: str | None,
    times: int,
    experiments: tuple[Path, ...],
    *,
    inertia: bool,
    force: bool,
) -> None:
    """Write the job of a method's scene to an empty `folder`; with `force` to any folder."""
    require_empty(folder, "-o", force=force)
    own = own_body(find(name, Path.cwd(), experiments))
    experiment, key = own.experiment, method or own.experiment.accepted[0]
    if key not in experiment.methods:
        raise UsageError(f"no method '{key}'; {nearest_names(key, set(experiment.methods))}")
    options = experiment.methods[key].scene
    scene = meshed(experiment.build(own.recording, own.parameters, options))
    seen = experiment.place(own.recording, own.parameters, scene)
    kept = np.arange(len(seen.t))
    if not inertia:
        kept = np.unique(np.linspace(0, len(kept) - 1, times).round().astype(int))
    folder.mkdir(parents=True, exist_ok=True)
    made = write_job(folder, scene, seen.t[kept], seen.inputs[kept], inertia, _TOLERANCE)
    mesh = made.document["mesh"]
    what = f"{mesh['cells']} {mesh['kind']}, {len(kept)} times"
    say(f"{folder}: job.json and mesh.vtu of {key}: {what}", indent="  ")
