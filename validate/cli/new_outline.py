"""What `validate new` asks of images beside a log: which surface they show, and where they lie."""

from collections.abc import Callable, Sequence
from dataclasses import fields as attributes
from pathlib import Path
from typing import Any

import numpy as np

from validate.cli.asking import Answers, Question
from validate.cli.new_body_questions import known_size, there
from validate.cli.new_kind import (
    accept_line,
    limit_question,
    quadratic_fits,
    quantity_in,
    reason_question,
)
from validate.parameters import with_values
from validate.recording.types import Recording
from validate.replay.compression_cards import Compression
from validate.scene.foreign_mesh import SUFFIXES as FOREIGN
from validate.scene.mesh import Mesh
from validate.scene.mesh_file import read_mesh
from validate.scene.named_place import axis_of

_EDGE, _WALL, _OTHER, _RECORDED = "edge", "inclusion", "other", "recorded"
_WIDTH = 88  # characters of a line inside a card
_FRAME = "in the body's frame (z: the axis, 0 at the resting plate; x, y: across, 0 on the axis)"


def asks(recording: Recording, found: Answers) -> Sequence[Question]:
    """None of a recording without outlines, nor of what the model does not have."""
    if not recording.contours:
        return []
    topics = tuple(recording.contours)
    asked = [
        Question("outline.topic", "outlines to compare", topics[0], "the first in the recording",
                 choices=topics),
        Question("outline.shows", f"what the outlines show: {_EDGE} (the specimen's edge), "
                 f"{_WALL} (an inclusion in a mesh file), {_OTHER} (not in the model: not "
                 f"compared)",
                 open=True, choices=(_EDGE, _WALL, _OTHER)),
    ]  # fmt: skip
    shows = found.get("outline.shows", _OTHER)
    if shows == _OTHER:
        return asked
    if shows == _WALL:
        asked += _of_the_inclusion(found)
    return [*asked, *_of_the_place(recording, found)]


def _of_the_inclusion(found: Answers) -> list[Question]:
    asked = [
        Question("specimen.mesh", 'mesh file of the specimen, axis z, with the facet sets '
                 '"lower_plate", "upper_plate" and the inclusion\'s wall', open=True, check=there,
                 words=()),
        Question("outline.surface", "facet set of the inclusion's wall", open=True),
        Question("outline.fluid", "whether a fluid of constant volume fills the "
                                  "inclusion", open=True,
                 choices=("true", "false")),
        Question("material.E", "Young's modulus, as 15kPa (the log's slope holds for a specimen "
                 "without inclusion)", open=True, check=quantity_in("Pa")),
    ]  # fmt: skip
    if Path(found.get("specimen.mesh", "")).suffix.lower() in FOREIGN:
        asked.insert(
            1, Question("specimen.mesh_unit", "unit of the file's lengths, as mm", open=True)
        )
        if unit := found.get("specimen.mesh_unit"):
            mesh = read_mesh(Path(found["specimen.mesh"]), unit)
            asked[2:2] = known_size("specimen.mesh_size", mesh, unit)
    return asked


def _of_the_place(recording: Recording, found: Answers) -> list[Question]:
    pose = recording.contour(found.get("outline.topic", next(iter(recording.contours)))).pose
    posed = not np.array_equal(pose, np.eye(4))
    asked = [
        Question("outline.origin", f"position of the images' first pixel {_FRAME}, as "
                 f"-12mm,0mm,30mm; {_RECORDED}: take the recorded pose", _RECORDED if posed else "",
                 "the recording has a pose", open=not posed, check=_path("outline.origin")),
    ]  # fmt: skip
    if found.get("outline.origin", _RECORDED) not in ("", _RECORDED):
        asked += [
            Question(f"outline.image_{c}", f"direction of the images' {c} ({what}) there, as +x",
                     open=True, check=axis_of)
            for c, what in (("x", "columns"), ("y", "rows"))
        ]  # fmt: skip
    return [
        *asked,
        Question("outline.sd", "standard uncertainty of that position along x and y of the "
                 "images, as 0.3mm", open=True, check=quantity_in("m")),
        limit_question("contour", "distance between outlines", "m"),
        reason_question("contour"),
    ]  # fmt: skip


def _path(path: str) -> Callable[[str], Any]:
    return lambda text: None if text == _RECORDED else with_values(Compression(), {path: text})


def used(recording: Recording, found: Answers) -> set[str]:
    """The outlines that are judged, and the images that they were found in."""
    if found.get("outline.shows", _OTHER) == _OTHER:
        return set()
    topic = found["outline.topic"]
    return {topic, recording.contour(topic).images} - {""}


def assumed(recording: Recording, found: Answers) -> tuple[str, ...]:
    if recording.frames and not recording.contours:
        return ("the images are not compared, as the recording has no outlines: find them "
                "with `validate outline`",)  # fmt: skip
    mesh = _mesh_of(found)
    if mesh is not None and not quadratic_fits(mesh):
        return (f"{found['specimen.mesh']} has {len(mesh.cells)} cells: linear ones are proposed "
                "(order=1), as quadratic ones do not fit into a first answer of 30 s",)  # fmt: skip
    return ()


def fields(found: Answers) -> dict[str, str]:
    """What stands in the file: empty where no outlines are judged."""
    if found.get("outline.shows", _OTHER) == _OTHER:
        return {"outline": "", "accept_outline": "", "body": "", "fluid": "",
                "E": "None"}  # fmt: skip
    inside = found["outline.shows"] == _WALL
    return {
        "outline": f"    # The images and their position, m.\n    outline={_card(found)},\n",
        "accept_outline": f"\n        {accept_line('contour', 'm', found)}",
        "body": _mesh(found) if inside else "",
        "E": f"{quantity_in('Pa')(found['material.E']):.6g}" if inside else "None",
        "fluid": _of_the_model(found) if inside else "",
    }


def _of_the_model(found: Answers) -> str:
    """What the models of a mesh file are given: linear cells where it has many, and the fluid."""
    order = "" if quadratic_fits(_mesh_of(found)) else ", order=1"
    return order + (", fluid=True" if found["outline.fluid"] == "true" else "")


def _mesh_of(found: Answers) -> Mesh | None:
    """The specimen's mesh file, if it has one."""
    if not found.get("specimen.mesh"):
        return None
    return read_mesh(Path(found["specimen.mesh"]), found.get("specimen.mesh_unit"))


def _card(found: Answers) -> str:
    keys = ("topic", "surface", "origin", "image_x", "image_y", "sd")
    said = {k: found[f"outline.{k}"] for k in keys if f"outline.{k}" in found}
    values = {f"outline.{k}": v for k, v in said.items() if v != _RECORDED}
    card = with_values(Compression(), values).outline
    told = [
        f"{f.name}={v!r}" for f in attributes(card) if (v := getattr(card, f.name)) != f.default
    ]
    lines: list[str] = []
    last = told[0]
    for piece in told[1:]:  # a text may hold spaces: no piece is broken
        short = len(last) + len(piece) < _WIDTH
        lines, last = (lines, f"{last}, {piece}") if short else ([*lines, last], piece)
    inside = "".join(f"        {line},\n" for line in (*lines, last))
    return f"cards.PressedOutline(\n{inside}    )"


def _mesh(found: Answers) -> str:
    said = {"mesh": found["specimen.mesh"], "mesh_unit": found.get("specimen.mesh_unit")}
    if found["outline.fluid"] == "true":
        said["fluid"] = found["outline.surface"]
    told = ", ".join(f"{k}={v!r}" for k, v in said.items() if v)
    return f"        {told},  # from where `validate run` is called\n"
