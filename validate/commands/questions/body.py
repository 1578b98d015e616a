"""Questions about a measured body of any shape, by the paths of its parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from validate.commands.questions.answers import Answers, Question
from validate.commands.questions.contact import of_the_indenter
from validate.commands.questions.kinds import (
    NONE,
    NOTED,
    RECORDED,
    RELEASE,
    UNKNOWN,
    NewKind,
    a_known_modulus,
    a_layout,
    accept_line,
    by_path,
    by_topic,
    facets_of,
    known_size,
    limit_question,
    named_place,
    parsed,
    quadratic_fits,
    reason_question,
    size_question,
    there,
    three_of,
    unit_of,
)
from validate.commands.questions.law import LINEAR, law_questions
from validate.commands.questions.motion import (
    DYNAMIC,
    cells_for,
    judged_markers,
    motion_questions,
    moving_methods,
    require_dynamic,
)
from validate.commands.questions.scene import CELLS, answered_mesh, imports, rendered, tree_of
from validate.commands.recordings import beside
from validate.errors import UsageError
from validate.pipeline.bodies.markers import AS_SEEN
from validate.pipeline.bodies.mesh import PLATES, sizes_of_mesh, unknowns_of
from validate.pipeline.run.cost import FEWEST_STATES, RUNS, newton_seconds, states_within
from validate.recording.scales import another_unit
from validate.recording.types import Recording
from validate.scene.geometries.specification import MeshFile
from validate.scene.laws import law_kind
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.mesh_file import read_mesh
from validate.scene.mesh_files.third_party_meshes import SUFFIXES as FOREIGN
from validate.scene.places import axis_of

_SHAPES = ("file", "block", "cylinder")
_ACCEPTED = {"force": ("N", "force"), "marker": ("m", "displacement of a marker, as 0.5mm"),
             "contour": ("m", "distance between outlines, as 0.5mm")}  # fmt: skip
_MOVED = {"validate.pipeline.bodies.measured": ("solid",)}
_PRESSED = {"validate.pipeline.bodies.measured": ("touching",)}
_MOVING = {"validate.pipeline.bodies.body_dynamics": ("moving",)}


def _fits(recording: Recording) -> bool:
    units = {s.unit for s in recording.signals.values()}
    return bool(recording.markers or recording.contours or {"m", "N"} <= units)


def _dynamic(found: Answers) -> bool:
    return found.get("motion.how") == DYNAMIC


# --- the questions --------------------------------------------------------------------------------


def _asks(recording: Recording, folder: Path, found: Answers) -> Sequence[Question]:
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
    mesh = answered_mesh(found)
    asked += known_size("body.size", mesh, found.get("body.unit", "m"))
    asked += [
        named_place("held.all", "places held in every direction", mesh),
        *(named_place(f"held.{c}", f"places held along {c} only", mesh) for c in "xyz"),
        named_place(
            "held.slides",
            "flat place that slides on its plate without lifting off "
            "(a body held along one axis only can drift)",
            mesh,
        ),
    ] + _of_the_load(recording, mesh, found)
    asked += _of_the_markers(recording, found) + _of_the_outlines(recording, mesh, found)
    forces = [t for t, s in recording.signals.items() if s.unit == "N"]
    if forces and unit_of(recording, found.get("moved.by", "")) == "m":
        asked.append(by_topic("seen.force", "force on the moved place to compare", forces))
    # The modulus is open only under a displacement with a force that is judged
    sought = found.get("seen.force", NONE) != NONE
    way = f"; {UNKNOWN}: identify it on the lower part of the load" if sought else ""
    asked += [
        Question("material.E", f"Young's modulus, Pa or as 15kPa{way}", open=True,
                 check=parsed("material.E", UNKNOWN) if sought else a_known_modulus),
        by_path("material.nu", "Poisson ratio"),
    ]  # fmt: skip
    if unit_of(recording, found.get("moved.by", "")) == "Pa":
        asked.append(Question("law", "law of the material", LINEAR, "the pressure acts on the "
                              "undeformed surface", choices=(LINEAR,)))  # fmt: skip
    else:
        why = "large strain; the linear law is run in addition"
        asked += law_questions(found, "neo_hooke", why)
    asked += motion_questions(recording, found, mesh)
    words = {"E": "modulus (relative)", "nu": "Poisson ratio",
             "load": "load (relative)"}  # fmt: skip
    if found.get("material.E") == UNKNOWN:
        del words["E"]
    return [
        *asked,
        *(
            question
            for name, (unit, what) in _ACCEPTED.items()
            if name in _judged(found)
            for question in (limit_question(name, what, unit), reason_question(name))
        ),
        *(
            by_path(f"ranges.{k}", f"standard uncertainty of the {text}")
            for k, text in words.items()
        ),
    ]


def _of_the_load(recording: Recording, mesh: Mesh | None, found: Answers) -> list[Question]:
    by = found.get("moved.by")
    signals = [t for t, s in recording.signals.items() if s.unit in ("m", "N", "Pa")]
    moving = ("markers",) if recording.markers else ()
    released = (RELEASE,) if recording.markers else ()
    asked = [
        Question(
            "moved.by",
            f"what loads the body; {NOTED}: a place was moved, and only notes record its motion; "
            f"{RELEASE}: a place was held and let go",
            open=True,
            choices=(*signals, *moving, "gravity", NOTED, *released),
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


def _judged(found: Answers) -> set[str]:
    keys = {"force": "seen.force", "marker": "seen.markers", "contour": "seen.outline"}
    return {name for name, key in keys.items() if found.get(key, NONE) != NONE}


# --- what is written ------------------------------------------------------------------------------


def _fields(recording: Recording, source: str, folder: Path, found: Answers) -> Mapping[str, str]:
    mesh = answered_mesh(found)
    if not any(found.get(f"held.{c}") for c in ("all", "x", "y", "z", "slides")):
        raise UsageError(
            "held.all, .x, .y, .z and .slides are all empty: name at least one held place"
        )
    if not _judged(found):
        raise UsageError(
            "seen.force, seen.markers and seen.outline are all none: choose at least one to compare"
        )
    require_dynamic(found)
    pressed = found.get("indenter.shape", "none") != "none"
    cells = cells_for(found) if _dynamic(found) else CELLS
    order = 2 if found["body.shape"] != "file" or _few(recording, found, mesh) else 1
    order = 1 if pressed and not _dynamic(found) else order
    here = tree_of(recording, found, cells, order)
    names: tuple[str, ...] = ()
    if _dynamic(found):
        methods = moving_methods(recording, here, found, order)
        names = judged_markers(recording, here)
        accepted = "large" if found["law"] != "linear" else "implicit"
    else:
        if found["law"] != "linear" and not pressed:
            seen = here.settings.seen
            states = states_within(RUNS, unknowns_of(here, order, Path()), seen.states)
            here = here.with_settings(seen=replace(seen, states=states))
        maker = "touching" if pressed else "solid"
        law, of_cells = found["law"], _cells(found, mesh, order)
        methods = [f'"linear": {maker}("linear law, {of_cells}", "linear"),']
        if law != "linear":
            words = f"{law_kind(law).title}, {of_cells}"
            methods.insert(0, f'"solid": {maker}("{words}", "{law}"),')
        accepted = "solid" if law != "linear" else "linear"
    # Files as they are found from the experiment's folder
    declared, streams = here, here.settings.seen
    if isinstance(body := here.scene.body, MeshFile):
        file = beside(Path(body.file), folder / "x.py")
        declared = declared.with_scene(body=replace(body, file=file))
    if streams.layout not in (AS_SEEN, RECORDED):
        layout = beside(Path(streams.layout), folder / "x.py")
        declared = declared.with_settings(seen=replace(streams, layout=layout))
    return {
        "imports": imports((declared.scene, declared.settings), {
            "validate.compare.verdict": ("Accept",),
            "validate.pipeline.experiment.experiment": ("Experiment",),
            **(_MOVING if _dynamic(found) else _PRESSED if pressed else _MOVED),
        }),
        "scene": rendered(declared.scene, 2),
        "settings": rendered(declared.settings, 2),
        "methods": "\n        ".join(methods),
        "accepted": accepted,
        "accept": "\n        ".join(
            accept_line(name, _ACCEPTED[name][0], found, names)
            for name in _ACCEPTED if name in _judged(found)
        ),
    }  # fmt: skip


def _few(recording: Recording, found: Answers, mesh: Mesh | None) -> bool:
    """Whether quadratic cells of a mesh file fit into a first answer, at large strain, too."""
    unknowns = unknowns_of(tree_of(recording, found), 2, Path())
    return FEWEST_STATES * newton_seconds(unknowns) <= RUNS and quadratic_fits(mesh)


def _cells(found: Answers, mesh: Mesh | None, order: int) -> str:
    outlined = found.get("seen.outline", NONE) != NONE
    if outlined or (found["body.shape"] == "file" and not (mesh is not None and mesh.bricks)):
        return "quadratic tetrahedra" if order == 2 else "linear tetrahedra"
    return "quadratic hexahedra" if order == 2 else "mixed hexahedra"


def _used(recording: Recording, found: Answers) -> set[str]:
    keys = ("moved.by", "seen.force", "seen.markers", "seen.outline")
    used = {found.get(key, "") for key in keys}
    if found.get("moved.by") == "markers":
        used |= set(recording.markers)
    return used | {recording.contours[t].images for t in used if t in recording.contours}


def _assumed(recording: Recording, found: Answers) -> Sequence[str]:
    """Streams whose metres are another unit, beside the body's size."""
    mesh = answered_mesh(found)
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
)


# --- questions about the mesh file of a specimen between plates ----------------------------------


def mesh_questions(found: Answers, *, needed: bool) -> list[Question]:
    """Return the questions about the mesh file, its unit and its unusual size."""
    plates = " and ".join(f'"{plate}"' for plate in PLATES)
    asked = [
        Question(
            "body.file",
            f"mesh file of the specimen, axis z, with the facet sets {plates}"
            + ("; it needs the wall of the inclusion, too" if needed else "; empty: a cylinder"),
            open=needed, check=_readable, words=(),
        )
    ]  # fmt: skip
    file = found.get("body.file", "")
    if not _foreign(file):
        return asked
    asked.append(
        Question("body.unit", "unit of the file's lengths, as mm", open=True,
                 check=lambda unit: sizes_of_mesh(read_mesh(Path(file), unit), Path(file).name))
    )  # fmt: skip
    if unit := found.get("body.unit"):
        asked += known_size("body.size", specimen_mesh(found), unit)
    return asked


def specimen_mesh(found: Answers) -> Mesh | None:
    """Return the mesh that the answers name; None without one, or before its unit is known."""
    file, unit = found.get("body.file", ""), found.get("body.unit")
    if not file or (_foreign(file) and not unit):
        return None
    return _read(file, unit, Path(file).stat().st_mtime_ns)


def mesh_sizes(found: Answers) -> dict[str, float]:
    """Return height and diameter of equal area m of the mesh, by parameter; none without one."""
    mesh = specimen_mesh(found)
    return {} if mesh is None else sizes_of_mesh(mesh, Path(found["body.file"]).name)


def declared_mesh(found: Answers, folder: Path) -> str:
    """Return the mesh file as an experiment file in `folder` declares it; empty without one."""
    if not found.get("body.file"):
        return ""
    file = beside(Path(found["body.file"]), folder / "x.py")
    unit = f", unit={found['body.unit']!r}" if found.get("body.unit") else ""
    halvings = f", halvings={found['body.halvings']}" if found.get("body.halvings") else ""
    element = "linear" if linear_cells(found) else "quadratic"
    return f'MeshFile({file!r}{unit}{halvings}, element="{element}"),'


def linear_cells(found: Answers) -> str:
    """Return why linear cells are proposed; empty where quadratic ones fit, or without a mesh."""
    mesh = specimen_mesh(found)
    if mesh is None or quadratic_fits(mesh):
        return ""
    return (
        f"{found['body.file']} has {len(mesh.cells)} cells: linear ones are proposed "
        "(element=linear), as quadratic ones do not fit into a first answer of 30 s"
    )


def _foreign(file: str) -> bool:
    return Path(file).suffix.lower() in FOREIGN


def _readable(file: str) -> None:
    there(file)
    if not _foreign(file):
        sizes_of_mesh(read_mesh(Path(file)), Path(file).name)


@lru_cache(maxsize=4)
def _read(file: str, unit: str | None, changed: int) -> Mesh:
    return read_mesh(Path(file), unit)
