"""Questions about dynamics of a body and the methods of its experiment."""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil
from pathlib import Path
from typing import cast

import numpy as np

from validate.arrays import Floats
from validate.commands.questions.answers import Answers, Question
from validate.commands.questions.kinds import RELEASE, by_path, parsed
from validate.commands.questions.scene import CELLS, IDENTIFIED, damping, held, sides_of, tree_of
from validate.errors import UsageError, ValidateError
from validate.estimate.filters import FILTERS
from validate.estimate.reduced.load_scale import OVERDAMPED
from validate.fem.system import build
from validate.identify.recorded_motion import FRACTION, motion_of
from validate.pipeline.bodies.body_dynamics import (
    EXPLICIT_FILTERS,
    METHODS,
    against_mode,
    fits_motion,
    model_law,
)
from validate.pipeline.bodies.drive import drive_kind, mover, weight_beside
from validate.pipeline.bodies.dynamics_registration import started, steps_of, without_rest
from validate.pipeline.bodies.first_modes import first_frequencies, model_of
from validate.pipeline.bodies.markers import leading
from validate.pipeline.bodies.measured import static_scene
from validate.pipeline.bodies.mesh import mesh_of, unknowns_of
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording
from validate.scene.geometries.specification import MeshFile
from validate.scene.material import LawName
from validate.scene.mesh import Mesh
from validate.scene.places import axis_of
from validate.scene.scene import Scene
from validate.solve.explicit.linear import ExplicitLinear

DYNAMIC, STATIC = "dynamic", "static"
_ACROSS = 2  # cells across the shortest side: a bending body with one is too stiff
_UNKNOWNS = 6000  # of quadratic cells, at most
_QUADRATIC = 15_000  # unknowns of quadratic cells up to which a first mode is found in seconds
#: Answers on which the first mode and the recorded motion depend.
_OF_A_MODE = ("body.", "material.", "held.", "moved.", "seen.markers", "indenter.")
_FILTERED = 900  # unknowns of a filter of all nodes: its modes are all taken
_MARGIN = 0.9  # of the critical step
_LOAD = 0.1  # of its largest value: how unsure a filter is of the load
_GRAVITY = 9.80665  # m/s^2
_STILL = 0.05  # of the largest motion: a marker that moves less teaches a filter little
GIVEN, CHOSEN = "filters.markers", "methods"
#: Methods in the order of a file: what is checked first, the cheapest last.
_ORDER = (
    "large", "implicit", "explicit", "static", "kf_fem", "modal_kf", "reduced_kf",
    "roukf", "ensemble_kf", "filterpy", "load_scale", "reduced_ekf", "modal",
)  # fmt: skip
_USUAL = ("large", "implicit", "explicit", "static", "kf_fem", "modal_kf", "reduced_kf", "roukf",
          "modal")  # fmt: skip
_OF_NODES = ("kf_fem", "modal_kf")  # whose cost grows with the cube of the nodes
#: Entries of the registries that no body in motion is offered, and why.
NOT_OFFERED = {
    **dict.fromkeys(("NoFluid", "ExactPressure", "PressureLoop", "ElasticPressure",
                     "PulsePressure"), "statics of a body with fluid in a cavity"),
    "Tabulated": "a table of static loads, for plates",
    "StaticNewton": "statics at large strain: `solid` of a static body",
    "CentralDifference": "its stable step under stiffness damping is not known beforehand",
    "NewtonDynamics": "starts unloaded; FromEquilibrium is the same rule from any rest",
    "ContactNewton": "statics of a body that an indenter touches: `touching`",
    "NeedleLoop": "a needle that is held by hand",
    "AsyncRegions": "regions with steps of their own under a stylus",
    "NodeEKF": "it uses markers that are nodes of the mesh; those of a recording lie between them",
    "HapticLoop": "the loop of a haptic device",
    "TouchedKrylov": "a body that a stylus touches",
}  # fmt: skip


@dataclass(frozen=True)
class Proposal:
    """The class of method that the recording asks for, and why."""

    how: str
    why: str


def proposal(recording: Recording, p: Tree, folder: Path) -> Proposal:
    """Dynamic where the recorded motion has what statics would miss, against the body's first mode
    (or rings down, where its modulus is unknown)."""
    try:
        topic = p.settings.seen.markers
        shown = motion_of(recording, topic if topic in recording.markers else None)
    except ValidateError as none:
        return Proposal(STATIC, str(none))
    first = _first(recording, p, folder) if p.scene.material.E else None
    facts = against_mode(shown, first, p)
    if shown.inertia_matters(first):
        return Proposal(DYNAMIC, f"{facts}: inertia matters above {FRACTION:.2g} of it")
    return Proposal(STATIC, f"{facts}: slow enough for statics")


@dataclass(frozen=True, eq=False)
class _Same:
    """A recording as an argument that is remembered: equal to itself alone."""

    recording: Recording

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other.recording is self.recording

    def __hash__(self) -> int:
        return id(self.recording)


def _first(recording: Recording, p: Tree, folder: Path) -> float | None:
    """The first frequency of a body, Hz: computed once, as questions are listed again and again."""
    p = replace(p, settings=replace(p.settings, ranges=type(p.settings.ranges)()))  # change none
    return _computed_first(_Same(recording), p, folder)


@lru_cache(maxsize=8)
def _computed_first(one: _Same, p: Tree, folder: Path) -> float | None:
    try:
        body = p.scene.body
        if isinstance(body, MeshFile) and unknowns_of(p, 1, folder) > _QUADRATIC:
            p = p.with_scene(body=replace(body, halvings=-1))
        order = 2 if unknowns_of(p, 2, folder) <= _QUADRATIC else 1
        return first_frequencies(_scene(one.recording, p, folder, order), 1)[0]
    except (ValidateError, np.linalg.LinAlgError):
        return None


def _scene(recording: Recording, p: Tree, folder: Path, order: int) -> Scene:
    return static_scene(recording, p, model_of("linear", element(p, order)), folder)


def element(p: Tree, order: int) -> str:
    """That of the body's kind of cells in this order."""
    body = p.scene.body
    if isinstance(body, MeshFile):
        return "quadratic" if order == 2 else "linear"
    if body.element.startswith("hex"):
        return "hex27" if order == 2 else "hex8"
    return "tet10" if order == 2 else "tet4"


# --- questions ------------------------------------------------------------------------------------


def motion_questions(
    recording: Recording, found: Answers, mesh: Mesh | None
) -> list[Question]:  # fmt: skip
    """Return whether the motion in time is solved, and what follows; none until the body, its
    supports, material and load are known, or where nothing moves in time."""
    if mesh is None or not all(found.get(k) for k in ("material.E", "material.nu", "moved.by")):
        return []
    if "held.slides" not in found:
        return []
    if found["moved.by"] == RELEASE:
        proposed = Proposal(DYNAMIC, "a release is a motion in time")
    else:
        needed = ((k, v) for k, v in found.items() if k.startswith(_OF_A_MODE) and v)
        proposed = _proposed(_Same(recording), tuple(sorted(needed)))
    asked = [Question("motion.how", "dynamic: solve the motion in time; static: solve states of "
                      "rest, without inertia", proposed.how, proposed.why,
                      choices=(STATIC, DYNAMIC))]  # fmt: skip
    if found.get("motion.how") != DYNAMIC:
        return asked
    if found["moved.by"] != "gravity":
        asked.append(by_path("material.rho", "density, kg/m3"))
    asked += [
        Question("motion.start", "start of the motion, s on the recording's clock; empty: detected "
                 "in the recording", check=parsed("motion.start")),
        Question("motion.length", "seconds to solve from the start; empty: to the end",
                 check=parsed("motion.length")),
    ]  # fmt: skip
    if found["moved.by"] == RELEASE:
        asked.append(Question("moved.held", "load that held the place before the release, along "
                              "moved.along: a force, as 0.2N, or a displacement, as 5mm", open=True,
                              check=held))  # fmt: skip
    if found["moved.by"] != "gravity":
        asked.append(Question("motion.gravity", "direction of gravity, as -z (it changes the "
                              "motion at large strain only); empty: none",
                              check=axis_of))  # fmt: skip
    asked.append(Question("motion.damping", "damping: stiffness-proportional (beta, 3ms), a ratio "
                          "to the critical damping of the first mode (0.03), or "
                          f"{IDENTIFIED} on the first part of a ring-down", open=True,
                          check=damping))  # fmt: skip
    if found.get("motion.damping") == IDENTIFIED:
        asked.append(by_path("motion.fit_window", "seconds from the start used for "
                             "identification; only later samples are evidence"))  # fmt: skip
    asked += _of_the_filters(recording, tree_of(recording, found))
    if not [q for q in asked if q.key not in found]:
        p = tree_of(recording, found, cells_for(found))
        asked += _of_the_methods(recording, p, found)
    return [
        *asked,
        by_path("ranges.rho", "standard uncertainty of the density (relative)"),
        *([] if found.get("motion.damping") == IDENTIFIED else
          [by_path("ranges.damping", "standard uncertainty of the damping (relative)")]),
    ]  # fmt: skip


def _of_the_filters(recording: Recording, p: Tree) -> list[Question]:
    """Which markers filters are given; none where there is no choice."""
    names = judged_markers(recording, p)
    if len(names) < 2:
        return []

    def check(text: str) -> None:
        chosen = _listed(text)
        if absent := [n for n in chosen if n not in names]:
            raise UsageError(f"no marker {', '.join(absent)}; there are {', '.join(names)}")
        if not chosen or len(set(chosen)) < len(chosen):
            raise UsageError(f"expected at least one of {', '.join(names)}, each once")

    return [Question(GIVEN, f"markers that filters use, of {', '.join(names)}; the others "
                     "test their prediction", ",".join(_given(recording, p, names)),
                     "every second marker by size of motion, at least two if three move; the "
                     "marker that moves most is predicted", check=check)]  # fmt: skip


def _listed(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())


@lru_cache(maxsize=1)
def _proposed(one: _Same, values: tuple[tuple[str, str], ...]) -> Proposal:
    return proposal(one.recording, tree_of(one.recording, dict(values)), Path())


# --- what is written ------------------------------------------------------------------------------


def cells_for(found: Answers) -> int:
    """Cells along the longest edge of a block or cylinder: two across the shortest, as long as the
    quadratic mesh stays small."""
    if found["body.shape"] == "file":
        return CELLS
    sides = sides_of(found)
    wanted = ceil(_ACROSS * max(sides) / min(sides) - 1e-9)
    share = np.prod([s / max(sides) for s in sides]) ** (1 / 3)  # of a cube as large
    most = int(((_UNKNOWNS / 3) ** (1 / 3) - 1) / 2 / share)
    return max(CELLS, min(wanted, most))


def moving_methods(recording: Recording, p: Tree, found: Answers, order: int) -> list[str]:
    """Lines of the chosen methods, in the order of `offered`."""
    # What filters are given: markers, or the outline where only one marker is compared
    markers, outline = judged_markers(recording, p), p.settings.seen.outline
    given: tuple[str, ...] = ()
    if len(markers) > 1:
        given = _given(recording, p, markers)
    elif outline or markers:
        given = (outline or markers[0],)
    answer = found.get(GIVEN, "")
    if given and answer not in ("", ",".join(given)):
        given = _listed(answer)
    law = cast(LawName, found["law"])
    chosen = _listed(found.get(CHOSEN, "")) or proposed_methods(recording, p, found)
    names = [name for name in offered(recording, p, found) if name in chosen]
    return [_line(name, (recording, p), law, order, given) for name in names]


def offered(recording: Recording, p: Tree, found: Answers) -> tuple[str, ...]:
    """Return the names of the methods that fit the body and the recording; the cheapest is the
    last."""
    kind = drive_kind(recording, p)
    preloaded = kind == "releases" or weight_beside(p.scene) is not None
    measured = bool(judged_markers(recording, p) or p.settings.seen.outline)
    law = cast(LawName, found.get("law", "linear"))
    motion, beta = p.settings.motion, p.scene.material.stiffness_damping
    undamped = not (beta or motion.damping_ratio or motion.fit_window)
    explicit = undamped and not mesh_of(p, Path()).bricks
    small = unknowns_of(p, 1, Path()) <= _FILTERED
    creeps = False  # returns without swinging, as a filter without inertia takes it
    if measured and not preloaded:
        ratio = motion.damping_ratio
        if ratio is None:
            first = _first(recording, p, Path()) if beta else None
            ratio = np.pi * first * beta if first else 0.0
        creeps = bool(ratio >= OVERDAMPED)
    return tuple(
        name for name in _ORDER
        if (small or name not in _OF_NODES) and (explicit or name not in EXPLICIT_FILTERS)
        and (creeps or name != "load_scale")
        and fits_motion(name, law, kind, preloaded=preloaded, measured=measured)
    )  # fmt: skip


def proposed_methods(recording: Recording, p: Tree, found: Answers) -> tuple[str, ...]:
    """Return the usual ones of those that are offered."""
    return tuple(n for n in offered(recording, p, found) if n in _USUAL)


def _of_the_methods(recording: Recording, p: Tree, found: Answers) -> list[Question]:
    names = offered(recording, p, found)
    needed = "large" if found.get("law", "linear") != "linear" else "implicit"

    def check(text: str) -> None:
        chosen = _listed(text)
        if absent := [n for n in chosen if n not in names]:
            raise UsageError(f"no method {', '.join(absent)} fits; choose of {', '.join(names)}")
        if needed not in chosen:
            raise UsageError(f"'{needed}' is missing: its errors are checked; add it")

    words = "; ".join(f"{n}: {METHODS[n][1].partition(', {law}')[0]}" for n in names)
    words = words.replace("{modes}", "20")
    return [Question(CHOSEN, f"methods of the motion ({words})",
                     ",".join(proposed_methods(recording, p, found)),
                     "the usual ones that fit", check=check)]  # fmt: skip


def _line(
    name: str,
    of: tuple[Recording, Tree],
    law: LawName,
    order: int,
    given: tuple[str, ...],
) -> str:
    recording, p = of
    settings, kind = METHODS[name][0], drive_kind(*of)
    used = model_law(name, law)
    parts = [f'"{name}"', *([f'"{used}"'] if used != "linear" else [])]
    explicit = name == "explicit" or name in EXPLICIT_FILTERS
    parts.append(f'element="{element(p, 1 if explicit or name in _OF_NODES else order)}"')
    parts += [f"markers={given!r}"] if isinstance(settings, tuple(FILTERS)) else []
    if explicit:  # steps in one of the recording's
        system = build(_scene(recording, p, Path(), 1))
        limit = _MARGIN * ExplicitLinear(damping_terms="full").stable_step(system)
        cut = started(recording, p).recording
        dt = float(steps_of(without_rest(p), cut)[0])
        parts.append(f"split={max(1, ceil(dt / limit))}")
    if kind not in ("moves", "follows"):
        # The largest load, in its unit
        if kind == "weighs":
            largest = _GRAVITY
        elif kind == "releases":
            largest = p.settings.motion.held_force or 0.1
        else:
            largest = float(np.ptp(recording.signals[mover(p.scene).name].y))
        unsure = f"{_LOAD * largest:.3g}"
        walks = ("load_start", "load_walk", "load_sd")
        parts += [f"{w}={unsure}" for w in walks if hasattr(settings, w)]
    return f'"{name}": moving({", ".join(parts)}),'


def _given(recording: Recording, p: Tree, names: tuple[str, ...]) -> tuple[str, ...]:
    """Every second marker by size of motion, without the largest; of three that move two."""
    seen = recording.marker(str(p.settings.seen.markers))
    x = {n: seen.x[:, seen.names.index(n)] for n in names}
    size = {n: float(np.nanmax(np.ptp(_seen(x[n]), axis=0), initial=0.0)) for n in names}
    order = sorted(names, key=lambda n: -size[n])
    moving = [n for n in order if size[n] > _STILL * size[order[0]]]
    return tuple(moving[1:3] if len(moving) == 3 else moving[1::2]) or (order[1],)


def _seen(x: Floats) -> Floats:
    kept = x[np.isfinite(x).all(axis=1)]
    return kept if len(kept) else np.zeros((1, x.shape[1]))


def judged_markers(recording: Recording, p: Tree) -> tuple[str, ...]:
    """Markers that are compared: all of the topic but those that move the body."""
    if not p.settings.seen.markers:
        return ()
    names = recording.marker(p.settings.seen.markers).names
    return tuple(n for n in names if n not in leading(p.scene))


def require_dynamic(found: Answers) -> None:
    """Raise `UsageError` for a release that is to be solved as statics."""
    if found.get("moved.by") == RELEASE and found.get("motion.how") != DYNAMIC:
        raise UsageError("motion.how = static: a release is a motion in time; answer dynamic")
