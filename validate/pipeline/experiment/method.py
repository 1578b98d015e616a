"""Method of an experiment: a scheme or a filter, with its changes of the scene."""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields, replace
from inspect import signature
from typing import Any, ClassVar, Protocol, cast, runtime_checkable

from validate.errors import UsageError
from validate.estimate.measurements import Measurements
from validate.fem.system import System
from validate.parameters import part, quantity
from validate.pipeline.experiment.variation import ByPath
from validate.register.registration import Registered
from validate.scene.scene import Scene
from validate.solve.types import Stepper


@runtime_checkable
class Limited(Protocol):
    """Settings of an explicit scheme: a limit to its step stands where others have a factor."""

    @property
    def beyond_limit(self) -> str: ...


@dataclass(frozen=True)
class Method:
    """`settings` of a scheme or filter; `scene`: what it changes of the scene, by path.

    The fields of both are the method's own to `--set`: `methods.NAME.tolerance=1e-3`. `markers`
    are those that a filter is given. `steps`: run only so many, as a baseline that is timed and
    not scored. `stride` above 1: a longer step than the recording's, so
    that many times the `dt` that the experiment gives; `split` above 1: a shorter one. `chosen`:
    which settings were chosen on the very twin that judges the method, so that its verdict is shown
    with that beside.
    """

    #: `chosen` of a filter of whose load's walk nobody wrote down how it was chosen.
    walk_unrecorded: ClassVar[str] = (
        "the run does not record whether the load's walk was chosen on this twin"
    )

    label: str = quantity("", "1", "name in reports")
    settings: Any = part(None, "of the scheme or filter")
    scene: Any = part(None, "settings of the scene")
    markers: tuple[str, ...] = quantity((), "1", "markers and outlines that a filter is given")
    steps: int | None = quantity(None, "1", "steps to run; none: all")
    stride: int = quantity(1, "1", "steps of the recording that one step of this method takes")
    chosen: str = quantity("", "1", "settings chosen on the twin that checks it; empty: none")
    split: int = quantity(1, "1", "steps of this method in one of these, inputs interpolated")

    def __post_init__(self) -> None:
        if isinstance(self.scene, Mapping):
            object.__setattr__(self, "scene", ByPath(self.scene))
        kind = self.settings if isinstance(self.settings, type) else type(self.settings)
        steps = hasattr(kind, "prepare") or hasattr(kind, "solve")
        if self.settings is not None and (kind is self.settings or not steps):
            made = f"; give {kind.__name__}()" if steps else ""
            found = f"the class {kind.__name__}" if steps else f"{self.settings!r:.40}"
            raise UsageError(
                f"method '{self.label}': expected the settings of a scheme or a filter, as "
                f"Newmark(), found {found}{made}"
            )

    @property
    def filters(self) -> bool:
        """Whether its settings are a filter: they are prepared with measurements."""
        prepare = getattr(self.settings, "prepare", None)
        given = signature(prepare).parameters.values() if prepare else ()
        return sum(p.default is p.empty and p.kind is p.POSITIONAL_OR_KEYWORD for p in given) > 1

    def require_measured(self, scene: Scene, seen: Registered) -> None:
        """Raise `ComparisonError` where the recording has none of its markers and outlines."""
        Measurements.taken(seen, scene.mesh).of(*self.markers)

    def prepare(
        self,
        system: System,
        seen: Registered,
        given: Mapping[str, Any],
        declared: "Method | None" = None,
    ) -> Stepper:
        """Return the prepared scheme or filter, with the experiment's settings where it has them.

        Filters get what moves freely of their markers. Raises as `given` does.
        """
        settings = self.given(given, declared)
        if not self.markers:
            return cast(Stepper, settings.prepare(system))
        return cast(Stepper, settings.prepare(system, self.offered(system, seen)))

    def offered(self, system: System, seen: Registered) -> Measurements:
        """Return the measurements of its markers that a filter is given: of what moves freely."""
        return Measurements.taken(seen, system.scene.mesh).of(*self.markers).moving(system.free)

    def given(self, given: Mapping[str, Any], declared: "Method | None" = None) -> Any:
        """Return the settings with those that the experiment itself gives.

        Raises `UsageError` where a user set one of these to something else: a value that is neither
        the experiment's, nor the default, nor that of the method as `declared`.
        """
        declared = declared or Method()
        defaults = {f.name: f.default for f in fields(self.settings)}
        mine = {k: v for k, v in given.items() if k in defaults}
        if "dt" in mine:
            mine["dt"] = self.stride / self.split * mine["dt"]
        for name, value in mine.items():
            own = getattr(self.settings, name)
            known = (defaults[name], value, getattr(declared.settings, name, value))
            if own not in known and defaults[name] is not MISSING:
                raise UsageError(
                    f"{name} = {own} of '{self.label}': the experiment sets {value}; change the "
                    f"experiment's parameter"
                )
        return replace(self.settings, **mine)
