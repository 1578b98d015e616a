"""One method on one case: scene, registration, runs, residuals and, of a twin, the truth."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Self

import numpy as np

from validate.arrays import Floats, Ints
from validate.compare.residual import Residual, reached_end
from validate.errors import ComparisonError, SceneError
from validate.register.observation import History, Observation, OverTime
from validate.register.registration import Registered
from validate.scene.mesh import Mesh
from validate.scene.meshless import AnyScene, Meshless
from validate.scene.scene import Scene
from validate.solve.types import Run

MAIN = ""  # the case that was recorded


@dataclass(frozen=True)
class Truth:
    """True motion of the twin: displacement (nt, d) m of every probe at the steps' times.

    `u` (no, n, d) m are its fields at the output frames, where its `mesh` is the models' mesh.
    """

    probes: Mapping[str, Floats]
    u: Floats | None = None
    mesh: Mesh | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "probes", MappingProxyType(dict(self.probes)))

    @classmethod
    def of(cls, run: Run, scene: Scene) -> Self:
        """Return the truth from a twin's run, at its own probes and nodes."""
        axes = "xyz"[: scene.mesh.dimension]
        probes = {
            p.name: np.stack([run.traces[f"{p.name}.{c}"].y for c in axes], axis=1)
            for p in scene.probes
        }
        return cls(probes, run.u, scene.mesh)


NO_TRUTH = Truth({})


@dataclass(frozen=True)
class MethodRun:
    """A method on a case: one registration and run for every recording, residuals over all."""

    method: str
    label: str
    case: str
    scene: AnyScene
    registered: tuple[Registered, ...]
    runs: tuple[Run, ...]
    residuals: Mapping[str, Residual]
    truth: Truth = NO_TRUTH

    def __post_init__(self) -> None:
        object.__setattr__(self, "residuals", MappingProxyType(dict(self.residuals)))

    @property
    def body(self) -> Scene:
        """The scene of a run on a mesh; raises `SceneError` without one."""
        if isinstance(self.scene, Meshless):
            raise SceneError(f"'{self.label}' was run on a scene without a mesh")
        return self.scene

    @property
    def seen(self) -> Registered:
        """The registration of the first recording."""
        return self.registered[0]

    @property
    def run(self) -> Run:
        """The run of the first recording."""
        return self.runs[0]

    @property
    def whole(self) -> bool:
        """Whether the run reached the last recorded time."""
        return reached_end(self.seen, self.run)

    @property
    def histories(self) -> tuple[History, ...]:
        """What the first recording's run is compared with over time, at the compared samples; none
        of a run that stopped before the end."""
        if not self.whole or isinstance(self.scene, Meshless):
            return ()
        seen = [o for o in self.seen.observations if o.role == "validates"]
        found = [(o, o.history(self.run)) for o in seen if isinstance(o, OverTime)]
        compared = [h.at(self._compared(o)) for o, h in found if h is not None]
        return tuple(h for h in compared if len(h.t))

    def _compared(self, of: Observation) -> Ints:
        """Indices of an observation's samples at the selected instants, or in the run's time."""
        at = [np.zeros(0, dtype=np.int64)]
        for selection in self.seen.selections:
            if selection.of and of.name not in selection.of:
                continue
            with suppress(ComparisonError):  # instants of another observation: a sag and a swing
                at.append(selection.samples(of.t, self.run.t, of.name))
        return np.unique(np.concatenate(at))

    @property
    def over_time(self) -> bool:
        """Whether every sample is compared, not load steps or windows of a load."""
        return self.seen.moves or any(s.t is None for s in self.seen.selections)

    @property
    def own_time(self) -> Floats:
        """Recorded times (nt,) s of the run's steps: explicit runs may walk a slow recording
        faster."""
        return self.run.t * self.seen.time_scale

    def reference(self, probe: str) -> Floats:
        """Return the truth (nt, d) m at the times of the run's own steps."""
        at = np.searchsorted(self.seen.t, self.run.t - 1e-9)
        return self.truth.probes[probe][at]

    @property
    def shown(self) -> tuple[str, ...]:
        """Probes that the run traced to the end."""
        return tuple(p.name for p in self.scene.probes) if self.whole else ()

    @property
    def scored(self) -> tuple[str, ...]:
        """Those of the truth's probes that the run traced to the end."""
        mine = set(self.shown)
        return tuple(name for name in self.truth.probes if name in mine)


Cases = Mapping[str, Mapping[str, MethodRun]]
