"""Former names of public modules, classes and functions: old imports work for one version.

An import by a former name gives a `DeprecationWarning` with the new name.
"""

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import ModuleType

FORMER = {
    "compare.expected": "compare.overall_verdict",
    "compare.overall": "compare.overall_verdict",
    "compare.shape_error": "compare.shapes.shape_error",
    "compare.two_fields": "compare.shapes.two_fields",
    "estimate.batch": "estimate.kalman.coordinates",
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
    "library.view_result": "library.plots",
    "pipeline.plates.inclusion_body": "pipeline.plates.inclusion",
    "pipeline.swinging_block": "pipeline.ladder.references",
    "recording.alignment": "recording.clocks.alignment",
    "recording.events": "recording.clocks.events",
    "recording.formats.recorded": "recording.formats.streams",
    "register.as_declared": "register.registration",
    "register.fitting": "register.markers.quality",
    "register.follow": "register.registration",
    "register.markers.fitting": "register.markers.quality",
    "register.quality": "register.markers.quality",
    "register.registered": "register.registration",
    "register.scene_registration": "register.registration",
    "register.transform": "register.markers.transform",
    "replay": "pipeline",
    "replay.calibration": "pipeline.calibration.calibration",
    "replay.cards": "pipeline.experiment.tree",
    "replay.compression": "pipeline.plates.compression",
    "replay.experiment": "pipeline.experiment.experiment",
    "replay.followed": "pipeline.run.method_run",
    "replay.inclusion": "pipeline.plates.inclusion",
    "replay.ladder": "pipeline.ladder.ladder",
    "replay.ladder_solvers": "pipeline.ladder.references",
    "replay.live": "pipeline.live",
    "replay.method": "pipeline.experiment.method",
    "replay.remade": "pipeline.run.twin_record",
    "replay.swinging_block": "pipeline.ladder.references",
    "replay.tree": "pipeline.experiment.tree",
    "replay.variation": "pipeline.experiment.variation",
    "report.fields": "report.export.fields",
    "report.stored_tables": "report.stored.tables",
    "scene.box": "scene.geometries.box",
    "scene.cylinder": "scene.geometries.specification",
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
    "scene.tool": "scene.contact",
    "solve.central": "solve.explicit.central",
    "solve.contact": "solve.static.contact",
    "solve.explicit_linear": "solve.explicit.linear",
    "solve.guests": "solve.external",
    "solve.guests.guest": "solve.external.scheme",
    "solve.guests.simulators": "solve.external.program",
    "solve.haptic_loop": "solve.haptic.loop",
    "solve.harmonic": "solve.static.without_mechanics",
    "solve.implicit": "solve.dynamic.implicit",
    "solve.let_go": "solve.dynamic.release",
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
    "solve.tabulated": "solve.static.load_table",
    "solve.touched_krylov": "solve.regions.krylov",
    "solve.viscous_modes": "solve.dynamic.viscous_modes",
    "twin.stepped": "twin.tracker",
    "twin.time_stepping": "twin.tracker",
    "twin.tracked": "twin.tracker",
}


#: Names in a module: the former name and the new one.
FORMER_MEMBERS: Mapping[str, Mapping[str, str]] = {
    "estimate": {"FilterpyGuest": "FilterpyFilter"},
    "estimate.filterpy.filters": {"FilterpyGuest": "FilterpyFilter"},
    "pipeline.experiment.experiment": {"Told": "ReportAdditions"},
    "pipeline.run.method_run": {"Followed": "MethodRun"},
    "solve.external.exchange": {"GuestAnswer": "ExternalAnswer", "GuestJob": "ExternalJob"},
    "solve.external.scheme": {"Guest": "ExternalSimulator", "GuestLetGo": "ExternalLetGo"},
    "solve.external.suite": {"check_guest": "check_simulator"},
}


def new_name(member: str) -> str:
    """Return the name that a class or function has now; a name that is no former one is kept."""
    for names in FORMER_MEMBERS.values():
        if member in names:
            return names[member]
    return member


class FormerNames:
    """Import hook: finds a module by its former name, and former names in a module."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec for a former name and for a module with former members, else None."""
        short = name.removeprefix("validate.")
        if short in FORMER:
            return ModuleSpec(name, self)  # type: ignore[arg-type]
        if not name.startswith("validate.") or short not in FORMER_MEMBERS:
            return None
        spec = PathFinder.find_spec(name, path)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _WithFormerMembers(spec.loader.name, str(spec.loader.path))
        return spec

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return the module by its new name; warns with both names."""
        now = f"validate.{FORMER[spec.name.removeprefix('validate.')]}"
        warnings.warn(f"{spec.name} is called {now} now", DeprecationWarning, stacklevel=2)
        module = import_module(now)
        if hasattr(module, "__path__"):
            # A module of its own: what is imported below it would become an attribute of today's
            # package, and hide a folder of that name.
            folder = ModuleType(spec.name, module.__doc__)
            folder.__path__ = []
            vars(folder)["__getattr__"] = partial(getattr, module)
            return folder
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Give the module its own spec back, which the import of a former name replaced."""
        if module.__spec__ is not None and not hasattr(module, "__path__"):
            module.__spec__ = module.__spec__.loader_state


class _WithFormerMembers(SourceFileLoader):
    """Loader of a module whose former names are attributes, too (PEP 562)."""

    def exec_module(self, module: ModuleType) -> None:
        super().exec_module(module)
        others = vars(module).get("__getattr__")
        vars(module)["__getattr__"] = _former_members(module, others)


def _former_members(
    module: ModuleType, others: Callable[[str], object] | None
) -> Callable[[str], object]:
    """Return a module's `__getattr__`; `others` is the one that the module itself has."""
    former = FORMER_MEMBERS[module.__name__.removeprefix("validate.")]

    def load(name: str) -> object:
        if name in former:
            now = former[name]
            text = f"{module.__name__}.{name} is called {now} now"
            warnings.warn(text, DeprecationWarning, stacklevel=2)
            return getattr(module, now)
        if others is not None:
            return others(name)
        raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}")

    return load


def install() -> None:
    """Install the import hook, once."""
    if not any(isinstance(finder, FormerNames) for finder in sys.meta_path):
        sys.meta_path.insert(0, FormerNames())  # folders of today may have a former name
