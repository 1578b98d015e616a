"""Any body under what a recording says moved it: questions by the paths of its parameters."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from validate.cli.asking import Answers, Question
from validate.cli.holdings import beside
from validate.cli.new_body_questions import (
    NONE,
    RECORDED,
    UNKNOWN,
    a_known_modulus,
    a_layout,
    by_path,
    by_topic,
    facets_of,
    known_size,
    named_place,
    parsed,
    size_question,
    there,
    three_of,
    unit_of,
)
from validate.cli.new_contact import CONTACT_WORDS, contact_values, of_the_indenter
from validate.cli.new_kind import (
    NewKind,
    accept_line,
    limit_question,
    quadratic_fits,
    reason_question,
)
from validate.cli.new_law import LINEAR, law_questions, left_open
from validate.cli.new_motion import (
    DYNAMIC,
    cells_for,
    judged_markers,
    motion_questions,
    motion_values,
    moving_methods,
    require_dynamic,
)
from validate.cli.rendered import rendered
from validate.errors import UsageError
from validate.parameters import describe, with_values
from validate.recording.scales import another_unit
from validate.recording.types import Recording
from validate.replay.body_mesh import body_of, unknowns_of
from validate.replay.cost import (
    FEWEST_STATES,
    RUNS,
    newton_seconds,
    states_within,
)
from validate.replay.measured_cards import MeasuredBody
from validate.replay.measured_drive import NOTED, RELEASE
from validate.replay.measured_markers import AS_SEEN
from validate.scene.foreign_mesh import SUFFIXES as FOREIGN
from validate.scene.laws import law_kind
from validate.scene.mesh import Mesh
from validate.scene.named_place import axis_of

_SHAPES = ("file", "block", "cylinder")
_ACCEPTED = {"force": ("N", "force"), "marker": ("m", "displacement of a marker, as 0.5mm"),
             "contour": ("m", "distance between outlines, as 0.5mm")}  # fmt: skip
_MOVED = "from validate.replay.measured_body import solid"
_PRESSED = "from validate.replay.measured_contact import touching"
_MOVING = "from validate.replay.moving_body import moving"
_MANY = 5  # classes whose lines would make the file longer than 60
_PATHS = {p.path for p in describe(MeasuredBody())}


def _fits(recording: Recording) -> bool:
    units = {s.unit for s in recording.signals.values()}
    return bool(recording.markers or recording.contours or {"m", "N"} <= units)


def _dynamic(found: Answers) -> bool:
    return found.get("motion.how") == DYNAMIC


# --- the questions --------------------------------------------------------------------------------


def _asks(recording: Recording, folder: Path, found: Answers) -> Sequence[Question]:
    asked = _of_the_body(recording, found)
    mesh = _mesh_of(found)
    asked += known_size("body.size", mesh, found.get("body.unit", "m"))
    asked += _of_the_supports(mesh) + _of_the_load(recording, mesh, found)
    asked += _of_the_markers(recording, found) + _of_the_outlines(recording, mesh, found)
    forces = [t for t, s in recording.signals.items() if s.unit == "N"]
    if forces and unit_of(recording, found.get("moved.by", "")) == "m":
        asked.append(by_topic("seen.force", "force on the moved place to compare", forces))
    asked += _of_the_material(recording, found)
    asked += motion_questions(recording, found, mesh, _values(found))
    return [*asked, *_of_the_limits(found), *_of_the_ranges(found)]


def _of_the_body(recording: Recording, found: Answers) -> list[Question]:
    shape, file = found.get("body.shape"), found.get("body.file", "")
    asked = [Question("body.shape", "the body", open=True, choices=_SHAPES)]
    if shape == "file":
        asked.append(Question("body.file", "mesh file: npz, inp, msh, vtu, vtk (`validate "
                              "body` fills a surface)", open=True, check=there,
                              words=()))  # fmt: skip
        if Path(file).suffix.lower() in FOREIGN:
            asked.append(Question("body.unit", "unit of the file's lengths, as mm", open=True))
    elif shape in ("block", "cylinder"):
        asked.append(size_question(recording, shape))
    return asked


def _of_the_material(recording: Recording, found: Answers) -> list[Question]:
    """The modulus is open only under a displacement with a force that is judged."""
    sought = found.get("seen.force", NONE) != NONE
    way = f"; {UNKNOWN}: identify it on the lower part of the load" if sought else ""
    pressed = unit_of(recording, found.get("moved.by", "")) == "Pa"
    return [
        Question("material.E", f"Young's modulus, Pa or as 15kPa{way}", open=True,
                 check=parsed("material.E", UNKNOWN) if sought else a_known_modulus),
        by_path("material.nu", "Poisson ratio"),
        *([Question("law", "law of the material", LINEAR, "the pressure acts on the "
                    "undeformed surface", choices=(LINEAR,))] if pressed else
          law_questions(MeasuredBody(), found, "neo_hooke", "large strain; the linear law is run "
                        "in addition")),
    ]  # fmt: skip


def _of_the_load(recording: Recording, mesh: Mesh | None, found: Answers) -> list[Question]:
    by = found.get("moved.by")
    asked = [
        Question(
            "moved.by",
            f"what loads the body; {NOTED}: a place was moved, and only notes record its motion; "
            f"{RELEASE}: a place was held and let go",
            open=True,
            choices=_movers(recording),
        )
    ]
    if by is None:
        return asked
    if by != "markers" and unit_of(recording, by) != "Pa":
        asked.append(Question("moved.along", "direction of the load, as -z (force and displacement "
                              "are positive along it)", open=True, check=axis_of))  # fmt: skip
    if by == "gravity":
        return [*asked, by_path("material.rho", "density, kg/m3")]
    asked.append(named_place("moved.place", "place that is moved or loaded", mesh, is_open=True))
    if by == "markers":
        names = [n for m in recording.markers.values() for n in m.names]
        text = f"three or more markers on this place, of {', '.join(names)}"
        asked.append(Question("moved.markers", text, open=True, check=three_of(names)))
    elif unit_of(recording, by) == "m":
        if by == NOTED:
            asked.append(by_path("moved.noted", "displacements you noted, evenly spaced from the "
                                                "first to "
                               "the last instant, linear between, as 0,2mm,5mm"))  # fmt: skip
        asked += of_the_indenter(recording, found)
        if found.get("indenter.shape", "none") != "none":
            return asked
        asked.append(Question("moved.sideways", "true: the moved place is held across its "
                              "direction (glued, gripped); false: it slides", open=True,
                              choices=("true", "false")))  # fmt: skip
    return asked


def _movers(recording: Recording) -> tuple[str, ...]:
    signals = [t for t, s in recording.signals.items() if s.unit in ("m", "N", "Pa")]
    moving = ("markers",) if recording.markers else ()
    return (*signals, *moving, "gravity", NOTED, *((RELEASE,) if recording.markers else ()))


def _of_the_supports(mesh: Mesh | None) -> list[Question]:
    return [
        named_place("held.all", "places held in every direction", mesh),
        *(named_place(f"held.{c}", f"places held along {c} only", mesh) for c in "xyz"),
        named_place(
            "held.slides",
            "flat place that slides on its plate without lifting off "
            "(a body held along one axis only can drift)",
            mesh,
        ),
    ]


def _of_the_markers(recording: Recording, found: Answers) -> list[Question]:
    if not recording.markers:
        return []
    asked = [by_topic("seen.markers", "markers to compare", list(recording.markers))]
    if found.get("seen.markers") == NONE and found.get("moved.by") != "markers":
        return asked
    known = "marker_layout" in recording.metadata
    return [
        *asked,
        Question("seen.layout", f"marker positions in the body's frame: {RECORDED}, a file "
                 f"of landmarks (four or more), or '{AS_SEEN}' (recorded in that frame; one marker "
                 "is enough)",
                 RECORDED if known else "", "the record marker_layout", open=not known,
                 check=a_layout, words=(RECORDED, AS_SEEN)),
        by_path("seen.still", "seconds from the start in which the body is unloaded", "0",
              "only the first sample"),
    ]  # fmt: skip


def _of_the_outlines(
    recording: Recording, mesh: Mesh | None, found: Answers
) -> list[Question]:  # fmt: skip
    if not recording.contours:
        return []
    asked = [by_topic("seen.outline", "outlines to compare", list(recording.contours))]
    topic = found.get("seen.outline")
    if topic is None or topic == NONE:
        return asked
    posed = not np.array_equal(recording.contour(topic).pose, np.eye(4))
    asked += [
        Question("seen.surface", "facet set whose section the outlines show; surface: the "
                 "whole surface", "surface", "the whole surface", check=facets_of(mesh)),
        Question("seen.pose", "pose of the images: recorded; declared (give origin and "
                 "directions); fitted (give directions; the outline at rest is fitted to the "
                 "body's middle section)", "recorded" if posed else "", "the recording has a pose",
                 open=not posed, choices=("recorded", "declared", "fitted")),
    ]  # fmt: skip
    pose = found.get("seen.pose", "recorded")
    if pose == "declared":
        asked.append(by_path("seen.origin", "the images' first pixel in the body's frame, as "
                           "0,20mm,0"))  # fmt: skip
    if pose not in ("", "recorded"):
        asked += [
            Question(f"seen.image_{c}", f"direction of the images' {c} ({what}) there, as +x",
                     open=True, check=axis_of)
            for c, what in (("x", "columns"), ("y", "rows"))
        ]  # fmt: skip
    return asked


def _of_the_limits(found: Answers) -> list[Question]:
    return [
        question
        for name, (unit, what) in _ACCEPTED.items() if name in _judged(found)
        for question in (limit_question(name, what, unit), reason_question(name))
    ]  # fmt: skip


def _of_the_ranges(found: Answers) -> list[Question]:
    words = {"E": "modulus (relative)", "nu": "Poisson ratio",
             "load": "load (relative)"}  # fmt: skip
    if found.get("material.E") == UNKNOWN:
        del words["E"]
    return [
        by_path(f"ranges.{k}", f"standard uncertainty of the {text}") for k, text in words.items()
    ]


def _judged(found: Answers) -> set[str]:
    keys = {"force": "seen.force", "marker": "seen.markers", "contour": "seen.outline"}
    return {name for name, key in keys.items() if found.get(key, NONE) != NONE}


# --- what is written ------------------------------------------------------------------------------


def _mesh_of(found: Answers) -> Mesh | None:
    """The body, once it is known; raises what reading it does."""
    shape = found.get("body.shape", "")
    file = found.get("body.file", "")
    needed = f"body.{shape}" if shape != "file" else "body.unit"
    if shape == "file" and (not file or Path(file).suffix.lower() not in FOREIGN):
        needed = "body.file"
    if not found.get(needed):
        return None
    changed = Path(file).resolve() if file else Path(), Path(file).stat().st_mtime_ns if file else 0
    return _read(tuple(sorted((k, v) for k, v in found.items() if k.startswith("body."))), changed)


@lru_cache(maxsize=4)
def _read(said: tuple[tuple[str, str], ...], changed: tuple[Path, int]) -> Mesh:
    """The body that is answered; its file is read again where it has `changed`."""
    values = {k: v for k, v in said if k in _PATHS and v}
    card = with_values(MeasuredBody(), values).body
    return body_of(card, folder=Path())


def _fields(recording: Recording, source: str, folder: Path, found: Answers) -> Mapping[str, str]:
    mesh = _mesh_of(found)
    if not any(found.get(f"held.{c}") for c in ("all", "x", "y", "z", "slides")):
        raise UsageError(
            "held.all, .x, .y, .z and .slides are all empty: name at least one held place"
        )
    if not _judged(found):
        raise UsageError(
            "seen.force, seen.markers and seen.outline are all none: choose at least one to compare"
        )
    require_dynamic(found)
    here = with_values(MeasuredBody(), _values(found))
    order = 2 if found["body.shape"] != "file" or _few(mesh, here) else 1
    parameters = _card(source, folder, found, contact_values(recording, found))
    pressed = found.get("indenter.shape", "none") != "none"
    if _dynamic(found):
        parameters, here = (
            replace(p, body=replace(p.body, cells=cells_for(p))) for p in (parameters, here)
        )
        methods = moving_methods(recording, here, found, order)
        names = judged_markers(recording, here)
        accepted = "large" if found["law"] != "linear" else "implicit"
    else:
        maker = "touching" if pressed else "solid"
        order = 1 if pressed else order
        if found["law"] != "linear" and not pressed:
            states = states_within(RUNS, unknowns_of(here, order, Path()), here.seen.states)
            parameters = replace(parameters, seen=replace(parameters.seen, states=states))
        methods = _methods(found["law"], maker, order, _cells(found, mesh, order))
        names, accepted = (), "solid" if found["law"] != "linear" else "linear"
    return {
        "imports": _MOVING if _dynamic(found) else _PRESSED if pressed else _MOVED,
        "cards": _names(sorted(_classes(parameters))),
        "parameters": rendered(parameters),
        "methods": "\n        ".join(methods),
        "accepted": accepted,
        "accept": "\n        ".join(
            accept_line(name, _ACCEPTED[name][0], found, names)
            for name in _ACCEPTED if name in _judged(found)
        ),
    }  # fmt: skip


def _card(source: str, folder: Path, found: Answers, more: Mapping[str, str]) -> MeasuredBody:
    values = _values(found)
    for key in ("body.file", "seen.layout"):
        if values.get(key, AS_SEEN) not in (AS_SEEN, RECORDED):
            values[key] = beside(Path(values[key]), folder / "x.py")
    values |= {**more, "recording": source}
    card: MeasuredBody = with_values(MeasuredBody(), values)
    return card


def _values(found: Answers) -> dict[str, str]:
    """The answers that are parameters, by path."""
    skipped = ("", UNKNOWN)
    paths = _PATHS - left_open(found)
    values = {k: v for k, v in found.items() if k in paths and v not in skipped}
    nothing = ("seen.markers", "seen.force", "seen.outline")
    values = {k: v for k, v in values.items() if k not in nothing or v != NONE}
    if values.get("indenter.friction") in CONTACT_WORDS:  # a parameter of another path
        del values["indenter.friction"]
    return values | motion_values(found)


def _few(mesh: Mesh | None, p: MeasuredBody) -> bool:
    """Whether quadratic cells of a mesh file fit into a first answer, at large strain, too."""
    fewest = FEWEST_STATES * newton_seconds(unknowns_of(p, 2, Path())) <= RUNS
    return fewest and quadratic_fits(mesh)


def _cells(found: Answers, mesh: Mesh | None, order: int) -> str:
    outlined = found.get("seen.outline", NONE) != NONE
    if outlined or (found["body.shape"] == "file" and not (mesh is not None and mesh.bricks)):
        return "quadratic tetrahedra" if order == 2 else "linear tetrahedra"
    return "quadratic hexahedra" if order == 2 else "mixed hexahedra"


def _methods(law: str, maker: str, order: int, cells: str) -> list[str]:
    lines = [f'"linear": {maker}("linear law, {cells}", "linear", {order}),']
    if law != "linear":
        words = f"{law_kind(law).title}, {cells}"
        lines.insert(0, f'"solid": {maker}("{words}", "{law}", {order}),')
    return lines


def _classes(card: Any) -> set[str]:
    """Names of the classes that the file writes out."""
    inner = (getattr(card, f.name) for f in fields(card) if getattr(card, f.name) != f.default)
    found = {type(card).__name__}
    return found.union(*(_classes(value) for value in inner if is_dataclass(value)))


def _names(classes: Sequence[str]) -> str:
    """The imported names, one a line; several a line where they are many."""
    if len(classes) <= _MANY:
        return ",\n    ".join(classes) + ","
    return "\n    ".join(textwrap.wrap(", ".join(classes) + ",", 90))


def _used(recording: Recording, found: Answers) -> set[str]:
    keys = ("moved.by", "seen.force", "seen.markers", "seen.outline")
    used = {found.get(key, "") for key in keys}
    if found.get("moved.by") == "markers":
        used |= set(recording.markers)
    return used | {recording.contours[t].images for t in used if t in recording.contours}


def _assumed(recording: Recording, found: Answers) -> Sequence[str]:
    """Streams whose metres are another unit, beside the body's size."""
    mesh = _mesh_of(found)
    size = float(np.ptp(mesh.nodes, axis=0).max()) if mesh is not None else np.inf
    judged = {t: recording.streams[t] for t in _used(recording, found) if t in recording.streams}
    doubts = {topic: another_unit(stream, size) for topic, stream in judged.items()}
    file = Path(recording.source.path).name
    return [f"'{topic}': {why}".replace("FILE", file) for topic, why in doubts.items() if why]


BODY = NewKind(
    "body",
    "any body, held and moved at places that you name; compares force, markers or outlines",
    "markers, outlines, or signals in m and N",
    "FEM",
    "new_body.py.txt",
    _fits,
    _asks,
    _fields,
    _used,
    _assumed,
    halvings="body.halvings",
)
