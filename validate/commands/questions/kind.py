"""Base type of the kinds of experiments that `validate new` writes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from validate.commands.questions.answers import Answers, Question
from validate.errors import UsageError
from validate.pipeline.run.cost import MESHES, linear_seconds
from validate.recording.types import Recording
from validate.scene.mesh import Mesh, quadratic
from validate.units import in_si, split


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
    return linear_seconds(8 * quadratic(mesh).nodes.size) <= MESHES
