"""Questions about the constitutive law of a material and its coefficients."""

from collections.abc import Mapping
from dataclasses import fields

from validate.commands.questions.answers import Answers, Question
from validate.parameters import with_values
from validate.scene.laws import LAWS, Coefficients, law_kind

LINEAR = "linear"


def law_names() -> tuple[str, ...]:
    """Return the names of all laws, those of plug-ins among them, the linear one last."""
    return (*(kind.name for kind in LAWS), LINEAR)


def law_questions(found: Answers, default: str, why: str) -> list[Question]:
    """Return the question about the law, and those about the coefficients that it has beyond the
    modulus and Poisson ratio."""
    known = ", ".join(f"{kind.name} ({kind.title})" for kind in LAWS)
    law = Question("law", f"law of the material: {LINEAR}, or at large strain {known}", default,
                   why, choices=law_names())  # fmt: skip
    names = law_kind(found.get("law", LINEAR)).coefficients
    return [law, *(_of_coefficient(found, name, last=name == names[-1]) for name in names)]


def coefficient_values(found: Answers) -> dict[str, str]:
    """Return the answered coefficients of the law by path."""
    names = law_kind(found.get("law", LINEAR)).coefficients
    paths = [f"material.{name}" for name in names]
    return {path: found[path] for path in paths if found.get(path)}


def coefficients_of(found: Answers) -> type[Coefficients]:
    """Return the class of the coefficients of the answered law."""
    return law_kind(found.get("law", LINEAR)).holds or Coefficients


def left_open(found: Answers) -> set[str]:
    """Return the paths of the law's coefficients while one of them is not answered yet: they have
    to agree."""
    names = law_kind(found.get("law", LINEAR)).coefficients
    paths = {f"material.{name}" for name in names}
    return set() if paths <= found.keys() else paths


def _of_coefficient(found: Answers, name: str, *, last: bool) -> Question:
    (f,) = (f for f in fields(coefficients_of(found)) if f.name == name)

    def check(text: str) -> None:
        values: Mapping[str, str] = {name: text}
        if last:  # lists have to agree, and are checked with the last one
            own = coefficient_values(found)
            values = {**{k.removeprefix("material."): v for k, v in own.items()}, **values}
        if last or isinstance(f.default, float):
            with_values(coefficients_of(found)(), values)

    unit = f.metadata["unit"]
    text = f"{f.metadata['doc']}{'' if unit == '1' else f'; {unit}'}"
    may_be_empty = f.default == ()
    return Question(
        f"material.{name}", text + ("; empty: none" if may_be_empty else ""),
        open=not may_be_empty, check=check,
    )  # fmt: skip
