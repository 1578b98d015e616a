"""Questions about compression and tension tests of a testing machine."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from validate.commands.questions import outline as new_outline
from validate.commands.questions.answers import Answers, Question
from validate.commands.questions.body import (
    declared_mesh,
    linear_cells,
    mesh_questions,
    mesh_sizes,
    specimen_mesh,
)
from validate.commands.questions.kinds import NewKind, quantity_in, reason_question
from validate.commands.questions.law import (
    LINEAR,
    coefficient_values,
    coefficients_of,
    law_questions,
)
from validate.identify.modulus import stated_test
from validate.parameters import with_values
from validate.pipeline.plates.scene import Compression, stated_sizes
from validate.recording.types import Recording
from validate.scene.body_facts import SAME
from validate.scene.laws import law_kind
from validate.scene.material import Material

_USUAL = Compression()  # the windows of strain, unless a test ends earlier
_TENTH = 0.1  # of a force: the proposed limit of its error
_SIZES = ("diameter", "height")
_SIDES = ("width_m", "thickness_m", "length_m")
_WORDS = {
    "compression": ("slipping plates", "bonded plates", "plates"),
    "tension": ("ends free to contract", "gripped ends", "grips"),
}


def _fits(recording: Recording) -> bool:
    units = {topic: s.unit for topic, s in recording.signals.items()}
    return units.get("displacement") == "m" and units.get("force") == "N"


def _asks(recording: Recording, folder: Path, found: Answers) -> Sequence[Question]:
    """What the recording does not hold is taken from the mesh, then asked."""
    asked = new_outline.shown_questions(recording)
    if asked and "outline.shows" not in found:
        return asked  # an inclusion needs a mesh
    asked += mesh_questions(found, needed=new_outline.inside(found))
    if not stated_test(recording):
        asked.append(Question("test", "whether the test presses or pulls", open=True,
                              choices=tuple(_WORDS)))  # fmt: skip
    file = found.get("body.file")
    if file is not None and not (file and specimen_mesh(found) is None):  # its unit is known
        known, length = _known_sizes(recording, found), quantity_in("m")
        asked += [
            Question(f"body.{name}", f"{_what(name, recording)}, in m or as 25mm; empty: left open",
                     check=length)
            for name in _SIZES if f"body.{name}" not in known
        ]  # fmt: skip
    asked += new_outline.place_questions(recording, found)
    if not new_outline.filled(found):  # a fluid inside needs the linear law
        asked += law_questions(found, LINEAR, "it holds to strains of about 0.1")
    # Without a height the force at the strain limit is not known yet, so that no number is shown
    # that would stay when the height is answered
    what, check = "largest acceptable error of the force, N", quantity_in("N")
    height, limit, judged = _judged(recording, found)[1:]
    if height is None:
        what += "; empty: a tenth of the force at the strain limit"
        return [*asked, Question("accept.force", what, check=check), reason_question("force")]
    own = found.get("accept.force", f"{limit:.3g}") != f"{limit:.3g}"
    why = f"a tenth of {judged}"
    return [
        *asked,
        Question("accept.force", what, f"{limit:.3g}", f"{why}, assumed", check=check),
        reason_question("force", "" if own else why),
    ]


def _known_sizes(recording: Recording, found: Answers) -> dict[str, float]:
    """Sizes m by path: those of the mesh, else those of the recording."""
    return {**stated_sizes(recording), **mesh_sizes(found)}


def _what(name: str, recording: Recording) -> str:
    """What is asked for, and which lengths of the header may be it: none is taken unasked."""
    said = recording.metadata.get("specimen", {})
    lengths = [f"{_called(key)} {1e3 * float(value):.6g} mm" for key, value in said.items()
               if key.split("/")[0] in _SIDES]  # fmt: skip
    what = {
        "diameter": "diameter of the specimen (if not round: of a circle of the same area)",
        "height": "height of the specimen (in tension: length between the grips)",
    }[name]
    return f"{what}{'; the header gives ' + ', '.join(lengths) if lengths else ''}"


def _called(size: str) -> str:
    """A size of the record in words: width of width_m, the header's own of length_m/OWN."""
    return size.partition("/")[2] or size.removesuffix("_m")


def _judged(recording: Recording, found: Answers) -> tuple[float, float | None, float, str]:
    """Strain limit, height m, limit of the error N, and what that is a tenth of."""
    said = found.get("body.height", "")
    answered = quantity_in("m")(said) if said else None
    height = _known_sizes(recording, found).get("body.height", answered)
    moved = recording.signal("displacement", "m").y[:, 0]
    force = recording.signal("force", "N").y[:, 0]
    limit, inside, judged = _USUAL.limit, np.full(len(force), True), "the largest force recorded"
    if height is not None:
        limit = min(limit, 0.9 * float(np.ptp(moved)) / height)
        inside = np.abs(moved - moved[0]) <= limit * height
        judged = "the force at the strain limit"
    return limit, height, _TENTH * float(np.ptp(force[inside])), judged


def _fields(recording: Recording, source: str, folder: Path, found: Answers) -> dict[str, str]:
    limit, _, accepted, judged = _judged(recording, found)
    test = stated_test(recording) or found["test"]
    free, fixed, ends = _WORDS[test]
    own = found.get("accept.force", "")
    said = quantity_in("N")(own) if own else accepted
    default = "" if own and f"{said:.3g}" != f"{accepted:.3g}" else f"a tenth of {judged}"
    reason = found.get("why.force") or default
    law, mesh = found.get("law", LINEAR), declared_mesh(found, folder)
    part = "" if new_outline.whole(found) else ', part="quarter"'
    sizes = "".join(f"            {name}={_size(name, recording, found)}\n" for name in _SIZES)
    cylinder = f'Cylinder(\n{sizes}            cells=(4, 4), element="tet10"{part},\n        ),'
    # The fluid, and whose volume change counts in linear cells
    lines = []
    if new_outline.filled(found):
        lines.append(f'cavities=(Cavity("inclusion", {found["outline.surface"]!r}),),')
    if linear_cells(found):
        lines.append('dilatation="nodal_mean",')
    return {
        "imports": "\n".join(sorted(_imports(found))),
        "body": mesh or cylinder,
        "test": f"{test}, {'recorded' if stated_test(recording) else 'answered'}",
        "along": "-z" if test == "compression" else "+z",
        "rests": ", rests=True" if mesh or new_outline.whole(found) else "",
        "parts": "".join(f"        {line}\n" for line in lines),
        "fit_from": f"{_USUAL.fit_from / _USUAL.limit * limit:.3g}",
        "fit_to": f"{_USUAL.fit_to / _USUAL.limit * limit:.3g}",
        "limit": f"{limit:.3g}",
        "accept": f"{said:.3g}",
        "reason": repr(reason),
        "free": free,
        "fixed": fixed,
        "ends": ends,
        "E": new_outline.modulus(found),
        "law": "" if law == LINEAR else f', "{law}"{_coefficients(found)}',
        "title_of_law": law_kind(law).title,
        "solver": _solver(found),
        **new_outline.fields(found),
    }


def _solver(found: Answers) -> str:
    if found.get("law", LINEAR) != LINEAR:
        return 'Tabulated(StaticNewton("none"))'
    return "ExactPressure()" if new_outline.filled(found) else "NoFluid()"


def _imports(found: Answers) -> set[str]:
    """The lines that import what the file uses."""
    solver = {
        "T": {"static.newton import StaticNewton", "static.load_table import Tabulated"},
        "E": {"fluid.cavities import ExactPressure"},
        "N": {"fluid.cavities import NoFluid"},
    }[_solver(found)[0]]
    outline = ", PressedOutline" if new_outline.whole(found) else ""
    of = coefficients_of(found)
    laws = {f"from {of.__module__} import {of.__name__}"} if _coefficients(found) else set()
    cavity = "Cavity, " if new_outline.filled(found) else ""
    body = "MeshFile" if found.get("body.file") else "Cylinder"
    return laws | {f"from validate.solve.{line}" for line in solver} | {
        "from validate.compare.verdict import Accept",
        "from validate.pipeline.plates.scene import BONDED_PLATES, Compression, "
        f"CompressionRanges{outline}",
        "from validate.pipeline.experiment.experiment import Experiment",
        "from validate.pipeline.experiment.method import Method",
        f"from validate.scene.geometries.specification import {body}",
        "from validate.scene.material import Material",
        f"from validate.scene.scene import {cavity}Drive, Scene, Support",
    }  # fmt: skip


def _coefficients(found: Answers) -> str:
    """What the law has beyond modulus and Poisson ratio, as an argument; empty for none."""
    if found.get("law", LINEAR) == LINEAR:
        return ""
    law: Any = found.get("law", LINEAR)
    of_law = {"material": Material(None, None).of_law(law)}  # type: ignore[arg-type]
    given = with_values(of_law, coefficient_values(found))["material"].coefficients
    parts = ", ".join(
        f"{f.name}={value!r}"
        for f in fields(given) if (value := getattr(given, f.name)) != f.default
    )  # fmt: skip
    return f", coefficients={type(given).__name__}({parts})" if parts else ""


def _size(name: str, recording: Recording, found: Answers) -> str:
    """A value and its comment with its source; what nobody says is left open."""
    path = f"body.{name}"
    recorded, said = stated_sizes(recording), found.get(path, "")
    if path in recorded:
        by_area = name == "diameter" and "diameter_m" not in recording.metadata["specimen"]
        how = "of the header's cross-section" if by_area else "in the header"
        return f"{recorded[path]:.6g},  # m, recorded: {how}"
    if said:
        return f"{quantity_in('m')(said):.6g},  # m, answered"
    return "None,  # m, not in the recording: measure it and write it here"


def _assumed(recording: Recording, found: Answers) -> Sequence[str]:
    """Sizes of the header that the mesh does not have, and what is assumed of outlines."""
    recorded, of_mesh = stated_sizes(recording), mesh_sizes(found)
    odd = [
        f"{path}: {1e3 * recorded[path]:.4g} mm in the header, {1e3 * size:.4g} mm in "
        f"{found['body.file']}, which counts: check which of them is this specimen's"
        for path, size in of_mesh.items()
        if abs(recorded.get(path, size) / size - 1) > SAME
    ]
    return (*odd, *new_outline.assumed(recording, found))


def _used(recording: Recording, found: Answers) -> set[str]:
    return {"displacement", "force"} | new_outline.used(recording, found)


PLATES = NewKind(
    "plates",
    "a body between the plates or grips of a testing machine",
    "signals 'displacement' (m) and 'force' (N)",
    "FEM",
    "new_force.py.txt",
    _fits,
    _asks,
    _fields,
    _used,
    _assumed,
)
