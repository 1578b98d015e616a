"""Recordings of a testing machine, and experiments on the bodies that it presses."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from validate.arrays import Floats
from validate.compare.verdict import Accept
from validate.pipeline.bodies.measured import measured_body
from validate.pipeline.experiment.experiment import Experiment
from validate.pipeline.experiment.method import Method
from validate.pipeline.experiment.tree import Tree
from validate.pipeline.plates.scene import Compression
from validate.recording.mcap.write import write_recording
from validate.recording.types import Recording, Signal, Source
from validate.scene.geometries.specification import Cylinder
from validate.scene.material import Material
from validate.scene.mesh import Kind
from validate.scene.scene import Drive, Scene, Support


def machine_log(t: Floats, u: Floats, force: Floats, noise: float = 0.0) -> Recording:
    """Displacement (nt,) m, exact, and force (nt,) N of a machine at t (nt,) s."""
    signals = {
        "displacement": Signal(t, u[:, None], "m", 0.0, "machine"),
        "force": Signal(t, force[:, None], "N", noise, "machine"),
    }
    return Recording("log", Source("x", "", 0, "x"), 0, signals=signals)


def pressed_cylinder(
    diameter: float | None, height: float | None, E: float | None = None, nu: float = 0.499, *,
    cells: tuple[int, int] = (4, 4), element: Kind = "tet10", whole: bool = False,
    settings: Compression | None = None,
) -> Tree:  # fmt: skip
    """A cylinder between slipping plates, beside its log "log.mcap"."""
    scene = Scene(
        Cylinder(diameter, height, cells, element, "whole" if whole else "quarter"),
        Material(E, nu),
        (Support("lower_plate", (2,), rests=whole),),
        drives=(Drive("stage", "upper_plate", "-z"),),  # type: ignore[arg-type]
        dilatation="nodal_mean" if element == "tet4" else "pointwise",
    )
    return Tree("log.mcap", scene, settings or Compression())


def on_a_body(
    folder: Path, p: Tree, seen: Recording, methods: Mapping[str, Method],
    limits: Mapping[str, float],
) -> Experiment:  # fmt: skip
    """An experiment of which all methods are judged; its recording is written to `folder`."""
    write_recording(seen, folder / p.recording)
    accept = tuple(Accept(name, limit, "of a test") for name, limit in limits.items())
    made = measured_body("body", "body", "x", p, methods, tuple(methods), accept, folder)
    return replace(made, path=folder / "body.py")
