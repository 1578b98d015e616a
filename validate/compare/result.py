"""Result of a comparison, and the validation domain of its runs.

Validation domain of a run: strain, strain rate and size of its body.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

import numpy as np

from validate.arrays import Floats
from validate.compare.exhibit import Exhibit
from validate.compare.overall_verdict import Expected, MovedVerdict, Overall, judge_all, moved
from validate.compare.published import Published
from validate.compare.residual import Residual
from validate.compare.row import RowBlock
from validate.compare.score import Score
from validate.compare.verdict import Check
from validate.compare.view import View
from validate.display import brief
from validate.parameters import Changed, Parameter
from validate.recording.types import Contours, Frames, Markers, Recording, Signal, Stream

if TYPE_CHECKING:
    from validate.compare.effects import Declared, Effect, Joint
    from validate.identify.budget import IdentifiedValue
    from validate.recording.types import Recording
    from validate.register.registration import Registered
    from validate.scene.mesh import Mesh
    from validate.scene.meshless import AnyScene
    from validate.solve.types import Run


# --- Which streams of the recordings an experiment uses, and why the others are not.

_KINDS: tuple[tuple[type[Stream], str], ...] = (
    (Markers, "markers"),
    (Signal, "signal"),
    (Contours, "outlines"),
    (Frames, "images"),
)
_ROLES = {
    "drives": "drives the simulation",
    "calibrates": "used to identify",
    "validates": "compared with what is simulated",
}


@dataclass(frozen=True)
class StreamUse:
    """Use of a recording's stream by the experiment: its purpose, or the reason for none."""

    recording: str
    topic: str
    kind: str
    used: bool
    why: str


def stream_uses(
    recordings: Sequence[Recording], methods: Sequence[Sequence[Registered]]
) -> tuple[StreamUse, ...]:
    """Every stream of every recording, read or not; `methods` hold the registrations of each."""
    return tuple(
        use
        for i, recording in enumerate(recordings)
        for use in _uses(recording, [seen[i] for seen in methods if i < len(seen)])
    )


def _uses(recording: Recording, registered: Sequence[Registered]) -> Iterator[StreamUse]:
    roles = {o.name: _ROLES[o.role] for seen in registered for o in seen.observations}
    found_in = {c.images: k for k, c in recording.contours.items() if c.images and k in roles}
    for topic, stream in recording.streams.items():
        # What a stream is used for; empty where it is not
        if topic in found_in:
            use = f"source of the outlines '{found_in[topic]}'"
        else:
            made = isinstance(stream, Contours) and stream.images
            end = f"; extracted from the images '{made}', not as recorded" if made else ""
            use = f"{roles[topic]}{end}" if topic in roles else ""
        why = use or _why_not(stream, recording, roles)
        kind = next(name for kind, name in _KINDS if isinstance(stream, kind))
        yield StreamUse(recording.name, topic, kind, bool(use), why)
    for topic, why in recording.unread.items():
        yield StreamUse(recording.name, topic, "not read", False, why)


def _why_not(stream: Stream, recording: Recording, roles: Mapping[str, str]) -> str:
    if not isinstance(stream, Frames):
        return "no observation of the experiment uses it"
    others = [f"'{topic}'" for topic in recording.contours if topic in roles]
    if others:
        return f"no outline is extracted from them: {', '.join(others)} are compared as recorded"
    return "no outline is extracted from them"


# -------------------------------------------------------------------------------------------------

Kind = Literal["measured", "twin", "same law, finer mesh", "same model", "reference"]
KINDS: Mapping[Kind, str] = MappingProxyType(
    {
        "measured": "measured",
        "twin": "twin, made by another model than the checked one",
        "same law, finer mesh": (
            "same law, finer mesh: evidence of code and registration, not of physics"
        ),
        "same model": "same model, made by the checked model itself: no evidence",
        "reference": "reference, computed by third-party code",
    }
)


@dataclass(frozen=True)
class MethodResult:
    """One method: its scene; per recording the registration and the run; scores and checks.

    `band`: relative standard uncertainty of the force from the modulus; 0: not declared. `chosen`:
    what was chosen on the twin that judges it.
    """

    name: str
    label: str
    accepted: bool
    scene: AnyScene
    registered: tuple[Registered, ...]
    runs: tuple[Run, ...]
    residuals: Mapping[str, Residual]
    scores: tuple[Score, ...]
    checks: tuple[Check, ...]
    band: float = 0.0
    chosen: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "residuals", MappingProxyType(dict(self.residuals)))

    __repr__ = brief

    @property
    def called(self) -> str:
        """The label, with what was chosen on the judging twin."""
        return f"{self.label} ({self.chosen})" if self.chosen else self.label

    def why(self, check: Check) -> str:
        """What stands beside a verdict on the method."""
        return f"{check.why}; {self.chosen}" if self.chosen else check.why

    @property
    def run(self) -> Run:
        """The run of the first recording."""
        return self.runs[0]


@dataclass(frozen=True)
class Result:
    """An experiment compared: all that a report needs.

    `kind` is what the recording is: measured, a twin, the judged model's own, or computed.
    `warnings` doubt what was given. `changed` parameters are not as the experiment declares them.
    `specimens` are those of the recordings, one name each. `expected` are the verdicts that the
    experiment is known to have. `locking` warns of elements that are too stiff, a line a cause.
    `rows` are an experiment's own numbers for the long table, `views` what it shows of that table.
    `identified_values` carry their budgets; `identified` are numbers that identification found
    besides.
    """

    name: str
    title: str
    source: str
    sentence: str
    parameters: tuple[Parameter, ...]
    methods: tuple[MethodResult, ...]
    recordings: tuple[Recording, ...]
    rest: tuple[Residual, ...]
    effects: tuple[Effect, ...]
    published: tuple[Published, ...]
    identified: tuple[Score, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    quick: bool = False
    kind: Kind = "measured"
    seed: int | None = None
    twin_notice: str = ""
    inputs: tuple[Declared, ...] = ()
    joint: tuple[Joint, ...] = ()
    exhibits: tuple[Exhibit, ...] = ()
    rows: tuple[RowBlock, ...] = ()
    views: tuple[View, ...] = ()
    changed: tuple[Changed, ...] = ()
    specimens: tuple[str, ...] = ()
    expected: tuple[Expected, ...] = ()
    locking: tuple[str, ...] = ()
    identified_values: tuple[IdentifiedValue, ...] = ()

    __repr__ = brief

    @property
    def registered(self) -> tuple[Registered, ...]:
        """The registrations of the first method, one per recording."""
        return self.methods[0].registered if self.methods else ()

    @property
    def streams(self) -> tuple[StreamUse, ...]:
        """Every stream of the recordings, and whether the experiment uses it."""
        return stream_uses(self.recordings, [m.registered for m in self.methods])

    @property
    def checks(self) -> tuple[Check, ...]:
        return tuple(c for m in self.methods for c in m.checks)

    @property
    def overall(self) -> Overall:
        """The experiment's verdict over all its checks."""
        return judge_all(self.checks)

    @property
    def fallen(self) -> tuple[Published, ...]:
        """The printed figures whose claim does not stand today."""
        return tuple(p for p in self.published if p.fault)

    @property
    def passed(self) -> bool:
        """What the exit code follows: a run that compares nothing has failed."""
        return self.overall.passed

    @property
    def moved(self) -> tuple[MovedVerdict, ...]:
        """The checks whose verdict is not the one that the experiment declares."""
        return moved(((m.name, c) for m in self.methods for c in m.checks), self.expected)

    @property
    def as_expected(self) -> bool:
        """Whether every verdict is the declared one; without declarations, whether it passed."""
        return bool(self.checks) and not self.moved if self.expected else self.passed


_SHARE = 0.99  # of the cells stays below the strain that is told: corners are singular
_FRAMES = 50  # frames that are looked at


@dataclass(frozen=True)
class Domain:
    """One run: principal logarithmic strain (its largest size) that 99 % of the cells stay below,
    the fastest that it grew (1/s), the smallest and largest side (m) of the box about the body.

    None where the run does not say: a material point has no size, one instant or rows without
    times no rate.
    """

    recording: str
    specimen: str
    strain: float | None
    rate: float | None
    sides: tuple[float, float] | None


def domains(
    method: MethodResult, recordings: tuple[str, ...], specimens: tuple[str, ...]
) -> tuple[Domain, ...]:
    """Of every recording that a method was run on."""
    mesh = method.scene.mesh
    sides = np.ptp(mesh.nodes, axis=0) if len(mesh.nodes) else None
    found = []
    each = zip(method.runs, method.registered, recordings, specimens, strict=False)
    for run, seen, recording, specimen in each:
        # Times (k,) s and the strains (k,) then; none where a run keeps neither field nor stretch
        t, strain = np.zeros(0), np.zeros(0)
        if "stretch" in run.traces:
            stretch = np.maximum(run.traces["stretch"].y, np.finfo(float).tiny)
            t, strain = run.t, np.abs(np.log(stretch))
        elif len(mesh.cells) and len(run.u):
            kept = np.unique(np.linspace(0, len(run.u) - 1, _FRAMES).astype(int))
            t = run.t[run.at[kept]]
            strain = np.array([float(np.quantile(hencky(mesh, run.u[i]), _SHARE)) for i in kept])
        rate = _largest(np.abs(np.diff(strain)) / np.diff(t)) if seen.timed else None
        box = None if sides is None else (float(sides.min()), float(sides.max()))
        found.append(Domain(recording, specimen, _largest(strain), rate, box))
    return tuple(found)


def _largest(values: Floats) -> float | None:
    return float(values.max()) if len(values) and np.isfinite(values).all() else None


def hencky(mesh: Mesh, u: Floats) -> Floats:
    """Largest principal logarithmic strain (e,) of every cell, by size, under u (n, d) m.

    Of the affine map that fits the cell's vertices best. Infinite for a cell turned inside out.
    """
    X, x = mesh.nodes[mesh.corners], (mesh.nodes + u)[mesh.corners]
    X, x = X - X.mean(axis=1, keepdims=True), x - x.mean(axis=1, keepdims=True)
    onto = np.einsum("eki,ekj->eij", x, X)
    F = onto @ np.linalg.inv(np.einsum("eki,ekj->eij", X, X))
    stretches = np.linalg.svd(F, compute_uv=False)
    strain = np.abs(np.log(np.maximum(stretches, np.finfo(float).tiny))).max(axis=1)
    return np.where(np.linalg.det(F) > 0, strain, np.inf)
