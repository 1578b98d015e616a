"""Public modules by their former names, for one version: an old import works, with a warning."""

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType

FORMER = {
    "compare.expected": "compare.overall",
    "compare.shape_error": "compare.shapes.shape_error",
    "compare.two_fields": "compare.shapes.two_fields",
    "estimate.batch": "estimate.kalman.batch",
    "estimate.ensemble_kf": "estimate.ensemble.ensemble_kf",
    "estimate.filterpy_guest": "estimate.filterpy.filters",
    "estimate.kf_fem": "estimate.kalman.kf_fem",
    "estimate.load_scale": "estimate.reduced.load_scale",
    "estimate.modal_kf": "estimate.kalman.modal_kf",
    "estimate.node_ekf": "estimate.extended.node_ekf",
    "estimate.reduced_ekf": "estimate.reduced.reduced_ekf",
    "estimate.reduced_kf": "estimate.reduced.reduced_kf",
    "estimate.roukf": "estimate.ensemble.roukf",
    "fem.locate": "fem.assembly.locate",
    "recording.alignment": "recording.clocks.alignment",
    "recording.events": "recording.clocks.events",
    "register.fitting": "register.markers.fitting",
    "register.follow": "register.as_declared",
    "register.quality": "register.markers.quality",
    "register.transform": "register.markers.transform",
    "replay": "pipeline",
    "replay.calibration": "pipeline.calibration.calibration",
    "replay.cards": "pipeline.experiment.tree",
    "replay.compression": "pipeline.plates.compression",
    "replay.experiment": "pipeline.experiment.experiment",
    "replay.followed": "pipeline.run.followed",
    "replay.inclusion": "pipeline.plates.inclusion",
    "replay.ladder": "pipeline.ladder.ladder",
    "replay.ladder_solvers": "pipeline.ladder.references",
    "replay.live": "pipeline.live",
    "replay.method": "pipeline.experiment.method",
    "replay.remade": "pipeline.run.remade",
    "replay.swinging_block": "pipeline.swinging_block",
    "replay.tree": "pipeline.experiment.tree",
    "replay.variation": "pipeline.experiment.variation",
    "report.fields": "report.export.fields",
    "report.stored_tables": "report.stored.tables",
    "scene.box": "scene.geometries.box",
    "scene.cylinder": "scene.geometries.cylinder",
    "scene.geometry": "scene.geometries.specification",
    "scene.hollow_block": "scene.geometries.hollow_block",
    "scene.inclusion": "scene.geometries.inclusion",
    "scene.indenter": "scene.contact",
    "scene.material_point": "scene.meshless",
    "scene.mesh_file": "scene.mesh_files.mesh_file",
    "scene.named_place": "scene.places",
    "scene.prony": "scene.material",
    "scene.rigid_body": "scene.meshless",
    "scene.select": "scene.places",
    "scene.sheet": "scene.geometries.sheet",
    "solve.central": "solve.explicit.central",
    "solve.contact": "solve.static.contact",
    "solve.explicit_linear": "solve.explicit.linear",
    "solve.guests": "solve.external",
    "solve.guests.guest": "solve.external.scheme",
    "solve.guests.simulators": "solve.external.program",
    "solve.haptic_loop": "solve.haptic.loop",
    "solve.harmonic": "solve.static.without_mechanics",
    "solve.implicit": "solve.dynamic.implicit",
    "solve.let_go": "solve.dynamic.let_go",
    "solve.modal": "solve.dynamic.modal",
    "solve.needle": "solve.haptic.needle",
    "solve.newmark": "solve.dynamic.newmark",
    "solve.newton": "solve.static.newton",
    "solve.pressure_curve": "solve.fluid.pressure_curve",
    "solve.pressure_loop": "solve.fluid.pressure_loop",
    "solve.proportional": "solve.static.proportional",
    "solve.quasi_static": "solve.static.quasi_static",
    "solve.rigid_motion": "solve.static.without_mechanics",
    "solve.stretch_test": "solve.static.stretch_test",
    "solve.tabulated": "solve.static.tabulated",
    "solve.touched_krylov": "solve.regions.krylov",
    "solve.viscous_modes": "solve.dynamic.viscous_modes",
}


class FormerNames:
    """Finds a module of `FORMER` as the one that it became."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """A spec for a former name; None for every other."""
        if name.removeprefix("validate.") not in FORMER:
            return None
        return ModuleSpec(name, self)  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module of today; warns with both names."""
        now = f"validate.{FORMER[spec.name.removeprefix('validate.')]}"
        warnings.warn(f"{spec.name} is called {now} now", DeprecationWarning, stacklevel=2)
        module = import_module(now)
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Gives the module its own spec back, which the import of a former name replaced."""
        if module.__spec__ is not None:
            module.__spec__ = module.__spec__.loader_state


def install() -> None:
    """Let old imports work from now on."""
    if not any(isinstance(finder, FormerNames) for finder in sys.meta_path):
        sys.meta_path.insert(0, FormerNames())  # folders of today may have a former name
