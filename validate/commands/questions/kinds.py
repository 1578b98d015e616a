"""Questions that several kinds of experiments share, with checks of the answers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from validate.commands.questions.answers import Answers, Question
from validate.errors import UsageError
from validate.parameters import with_values
from validate.pipeline.bodies.choices import MeasuredBody
from validate.pipeline.bodies.drive import FEWEST
from validate.pipeline.bodies.markers import AS_SEEN
from validate.pipeline.plates.scene import recorded_sides
from validate.pipeline.run.cost import MESHES, linear_seconds
from validate.recording.types import Recording
from validate.scene.body_facts import SAME, largest_side, odd_size
from validate.scene.contact import Indenter, RigidContact
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.places import GRAMMAR, place_of
from validate.units import in_si, split

_SIDES = {
    "block": (
        ("width", "thickness", "height"),
        "sizes along x, y, z from the origin, as 60mm,45mm,70mm",
    ),
    "cylinder": (("diameter", "height"), "diameter and height, axis z, as 25mm,30mm"),
}
NOTED, RELEASE = "noted", "release"  # answers to what loads the body
UNKNOWN, NONE, RECORDED = "unknown", "none", "recorded"


_OWNERS: Mapping[str, Any] = {
    "material": Material(1.0, 0.3, rho=1.0),
    "indenter": Indenter("plate"),
}
_INDENTER: Any = Indenter("plate")
_PARTS: Mapping[str, tuple[Any, str]] = {
    "moved.noted": (MeasuredBody(), "noted"),
    "indenter.friction": (RigidContact("moved", "zmax", _INDENTER), "friction"),
}


_SIDES_OF = {"body.block": 3, "body.cylinder": 2}


def by_path(path: str, text: str, default: str = "", why: str = "") -> Question:
    """Return a parameter's value as --set takes it."""
    return Question(path, text, default, why, open=not default, check=parsed(path))


def size_question(recording: Recording, shape: str) -> Question:
    """Return the question about the sides of a block or cylinder; the header's are proposed.

    A header with some of the sides names these in the question.
    """
    known = recorded_sides(recording)
    names, text = _SIDES[shape]
    if all(name in known for name in names):
        proposed = ",".join(f"{1e3 * known[name]:.9g}mm" for name in names)
        why = f"{', '.join(names)} in the header of the recording"
        return by_path(f"body.{shape}", text, proposed, why)
    held = [f"{name} {1e3 * known[name]:.6g} mm" for name in names if name in known]
    return by_path(
        f"body.{shape}", text + (f"; the header gives {', '.join(held)}" if held else "")
    )


def sides(text: str, count: int) -> tuple[float, ...]:
    """So many lengths m; raises `UsageError` for another number of them."""
    found = tuple(map(quantity_in("m"), text.split(",")))
    if len(found) != count:
        raise UsageError(f"'{text}': {len(found)} lengths; expected {count}")
    return found


def a_known_modulus(text: str) -> None:
    if text == UNKNOWN:
        raise UsageError("identifying it needs a compared force (seen.force) and a displacement "
                         "(moved.by a signal in m); give a value")  # fmt: skip
    parsed("material.E")(text)


def parsed(key: str, skip: str = "") -> Callable[[str], Any]:
    """Return a check of the parameter that an answer is of."""
    if key in _SIDES_OF:
        return lambda text: sides(text, _SIDES_OF[key])
    first, _, last = key.partition(".")
    part, path = _PARTS.get(key) or ((_OWNERS[first], last) if first in _OWNERS else (
        MeasuredBody(), key))  # fmt: skip
    return lambda text: None if text == skip else with_values(part, {path: text})


def named_place(key: str, text: str, mesh: Mesh | None, *, is_open: bool = False) -> Question:
    """Return the first of them says what words there are; it is asked in every interview."""
    named = f" ({', '.join(mesh.facets)})" if mesh is not None and len(mesh.facets) < 20 else ""
    words = f": {GRAMMAR}{named}; join several with +" if key == "held.all" else ""
    return Question(
        key, f"{text}{words}{'' if is_open else '; empty: none'}",
        open=is_open, check=lambda words: mesh is None or place_of(words, mesh),
    )  # fmt: skip


def by_topic(key: str, text: str, topics: list[str]) -> Question:
    return Question(key, text, topics[0], "the first in the recording", choices=(*topics, NONE))


def three_of(names: Sequence[str]) -> Callable[[str], Any]:
    def check(text: str) -> None:
        chosen = [part.strip() for part in text.split(",")]
        if absent := [n for n in chosen if n not in names]:
            raise UsageError(f"no marker {', '.join(absent)}; there are {', '.join(names)}")
        if len(set(chosen)) < FEWEST:
            raise UsageError(f"{len(set(chosen))} markers; at least {FEWEST} are needed")

    return check


def there(text: str) -> None:
    if not Path(text).is_file():
        raise UsageError("no such file; paths start from the current folder")


def a_layout(text: str) -> None:
    if text not in (RECORDED, AS_SEEN):
        there(text)


def known_size(key: str, mesh: Mesh | None, unit: str) -> list[Question]:
    """Return the question about the largest side of a body, where it is unusual."""
    if mesh is None or not (odd := odd_size(mesh, unit)):
        return []
    side = largest_side(mesh)

    def check(text: str) -> None:
        if abs(quantity_in("m")(text) / side - 1) > SAME:
            raise UsageError(
                f"the file's largest side is {1e3 * side:.4g} mm; if that is wrong, change the unit"
            )

    return [Question(key, f"largest side of the body, as 3mm, to confirm its unit: the body is "
                          f"{odd}",
                     open=True, check=check)]  # fmt: skip


def facets_of(mesh: Mesh | None) -> Callable[[str], Any]:
    return lambda name: mesh is None or mesh.facet_nodes(name)


def unit_of(recording: Recording, topic: str) -> str:
    if topic == NOTED:
        return "m"
    found = recording.signals.get(topic)
    return found.unit if found is not None else ""


# --- base type of the kinds of experiments that `validate new` writes ----------------------------


@dataclass(frozen=True)
class NewKind:
    """`fits` says whether a recording holds what it `needs`; `asks` gives the questions that follow
    from the answers so far, for a file in a folder; `fields` fills the `template`, given the
    recording's path from that folder; `used` are the topics it looks at, `assumed` lines on what
    nobody said."""

    name: str
    doc: str
    needs: str
    against: str
    template: str
    fits: Callable[[Recording], bool]
    asks: Callable[[Recording, Path, Answers], Sequence[Question]]
    fields: Callable[[Recording, str, Path, Answers], Mapping[str, str]]
    used: Callable[[Recording, Answers], set[str]]
    assumed: Callable[[Recording, Answers], Sequence[str]]


_NOISY = ("contour",)  # many points of one image, each as uncertain as speckle: judged by their rms
NOTHING = "none"  # the answer of a user who requires nothing


def limit_question(name: str, what: str, unit: str) -> Question:
    """Which error is good enough, or that none is required."""
    given = quantity_in(unit)
    return Question(
        f"accept.{name}", f"largest acceptable error, {unit}: {what}; {NOTHING}: test only the "
        "difference from zero", open=True,
        check=lambda text: None if text == NOTHING else given(text),
    )  # fmt: skip


def reason_question(name: str, default: str = "") -> Question:
    """Why the limit is what it is: without a reason it is no requirement."""
    return Question(
        f"why.{name}", "reason why this error is good enough: your purpose or a source; "
        "empty: the limit is not a requirement", default,
    )  # fmt: skip


def accept_line(name: str, unit: str, found: Answers, each: tuple[str, ...] = ()) -> str:
    """Return the requirement as an experiment's file declares it; of a motion in time one for
    `each` marker, as the rms over its samples."""
    answer, many = found[f"accept.{name}"], name == "marker" and bool(each)
    what = "name" if many else f'"{name}"'
    whole = ', statistic="rms"' if many or name in _NOISY else ""
    if answer == NOTHING:
        call, note = f"Accept({what}{whole})", "nothing is required"
    else:
        reason = found.get(f"why.{name}", "")
        call = f"Accept({what}, {quantity_in(unit)(answer):.6g}, {reason!r}{whole})"
        note = unit + ("" if reason else "; add a reason, or it is not a requirement")
    return f"{f'*({call} for name in {each!r})' if many else call},  # {note}"


def quantity_in(unit: str) -> Callable[[str], float]:
    """Return a check: a positive number in `unit`, or with its own."""

    def check(text: str) -> float:
        found = split(text)
        value = in_si(found[0], found[1] or unit, unit) if found else None
        if value is None or not 0 < value < float("inf"):
            raise UsageError(f"expected a number above 0 in {unit}, or with another unit")
        return value

    return check


def quadratic_fits(mesh: Mesh | None) -> bool:
    """Return whether quadratic cells of a mesh file, halved once for u_num, fit into the time of a
    first answer; hexahedra are taken as they are."""
    if mesh is None or mesh.bricks:
        return False
    return linear_seconds(8 * mesh.quadratic().nodes.size) <= MESHES
