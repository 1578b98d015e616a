"""Questions about images that accompany a log: visible surface and image plane."""

from collections.abc import Sequence
from dataclasses import fields as attributes

import numpy as np

from validate.commands.questions.answers import Answers, Question
from validate.commands.questions.body import linear_cells, specimen_mesh
from validate.commands.questions.kinds import (
    accept_line,
    facets_of,
    limit_question,
    quantity_in,
    reason_question,
)
from validate.parameters import with_values
from validate.pipeline.plates.scene import Compression
from validate.recording.types import Recording
from validate.scene.places import axis_of

_EDGE, _WALL, _OTHER, _RECORDED = "edge", "inclusion", "other", "recorded"
_WIDTH = 84  # characters of a line inside a card
_FRAME = "in the body's frame (z: the axis, 0 at the resting plate; x, y: across, 0 on the axis)"


def shown_questions(recording: Recording) -> list[Question]:
    """Return which outlines are compared and what they show; none without outlines."""
    if not recording.contours:
        return []
    topics = tuple(recording.contours)
    return [
        Question("outline.topic", "outlines to compare", topics[0], "the first in the recording",
                 choices=topics),
        Question("outline.shows", f"what the outlines show: {_EDGE} (the specimen's edge), "
                 f"{_WALL} (an inclusion in a mesh file), {_OTHER} (not in the model: not "
                 f"compared)",
                 open=True, choices=(_EDGE, _WALL, _OTHER)),
    ]  # fmt: skip


def inside(found: Answers) -> bool:
    """Return whether the outlines show an inclusion, which a mesh file has to hold."""
    return found.get("outline.shows") == _WALL


def filled(found: Answers) -> bool:
    """Return whether a fluid fills the inclusion."""
    return inside(found) and found.get("outline.fluid") == "true"


def place_questions(recording: Recording, found: Answers) -> Sequence[Question]:
    """Return the questions about the inclusion and the images' place; none if not compared."""
    if not recording.contours or not whole(found):
        return []
    asked = [
        Question("outline.surface", "facet set of the inclusion's wall", open=True,
                 check=facets_of(specimen_mesh(found))),
        Question("outline.fluid", "whether a fluid of constant volume fills the inclusion",
                 open=True, choices=("true", "false")),
        Question("material.E", "Young's modulus, as 15kPa (the log's slope holds for a specimen "
                 "without inclusion)", open=True, check=quantity_in("Pa")),
    ] if inside(found) else []  # fmt: skip
    # The images' place
    pose = recording.contour(found.get("outline.topic", next(iter(recording.contours)))).pose
    posed = not np.array_equal(pose, np.eye(4))

    def check(text: str) -> None:
        if text != _RECORDED:
            with_values(Compression(), {"outline.origin": text})

    asked += [
        Question("outline.origin", f"position of the images' first pixel {_FRAME}, as "
                 f"-12mm,0mm,30mm; {_RECORDED}: take the recorded pose", _RECORDED if posed else "",
                 "the recording has a pose", open=not posed, check=check),
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


def used(recording: Recording, found: Answers) -> set[str]:
    """Return the compared outlines, and the images that they were extracted from."""
    if not whole(found):
        return set()
    topic = found["outline.topic"]
    return {topic, recording.contour(topic).images} - {""}


def assumed(recording: Recording, found: Answers) -> tuple[str, ...]:
    if recording.frames and not recording.contours:
        return ("the images are not compared, as the recording has no outlines: find them "
                "with `validate outline`",)  # fmt: skip
    return tuple(line for line in (linear_cells(found),) if line)


def whole(found: Answers) -> bool:
    """Return whether images show the body, which is then meshed as a whole."""
    return found.get("outline.shows", _OTHER) != _OTHER


def modulus(found: Answers) -> str:
    """Return Young's modulus Pa, which an inclusion needs; else it is identified."""
    return f"{quantity_in('Pa')(found['material.E']):.6g}" if inside(found) else "None"


def fields(found: Answers) -> dict[str, str]:
    """What stands in the file: empty where no outlines are judged."""
    if not whole(found):
        return {"outline": "", "accept_outline": ""}
    keys = ("topic", "surface", "origin", "image_x", "image_y", "sd")
    said = {k: found[f"outline.{k}"] for k in keys if f"outline.{k}" in found}
    values = {f"outline.{k}": v for k, v in said.items() if v != _RECORDED}
    card = with_values(Compression(), values).outline
    told = [
        f"{f.name}={v!r}" for f in attributes(card) if (v := getattr(card, f.name)) != f.default
    ]
    call = f"PressedOutline({', '.join(told)})"
    if len(call) >= _WIDTH:
        lines: list[str] = []
        last = told[0]
        for piece in told[1:]:  # a text may hold spaces: no piece is broken
            short = len(last) + len(piece) < _WIDTH
            lines, last = (lines, f"{last}, {piece}") if short else ([*lines, last], piece)
        body = "".join(f"            {line},\n" for line in (*lines, last))
        call = f"PressedOutline(\n{body}        )"
    return {
        "outline": f"        # The images and their position, m.\n        outline={call},\n",
        "accept_outline": f"\n        {accept_line('contour', 'm', found)}",
    }
