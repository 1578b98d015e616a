"""Answers of `validate new`, from a terminal or TOML; list of open questions.

A question is asked where the recording does not tell. One whose default stands is answered by it
where nobody is there; without a default it is open, and all open ones are named at once.
"""

import os
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from validate.commands.display import say
from validate.errors import RecordingError, UsageError, ValidateError
from validate.files import inside, read_text
from validate.parameters import nearest_names

Answers = Mapping[str, str]
_MOST = 200  # questions one after another: more would be a circle
_LARGEST = 100_000  # bytes of a file of answers


def _anything(text: str) -> None:
    return None


@dataclass(frozen=True)
class Question:
    """`key` is how a file of answers spells it; `check` raises `ValidateError` for a wrong answer.

    `default` answers it where nobody does, `why` says what the default rests on; `open` ones need
    an answer of the user. The answer to one with `words` is the name of a file, or one of them.
    """

    key: str
    text: str
    default: str = ""
    why: str = ""
    open: bool = False
    choices: tuple[str, ...] = ()
    check: Callable[[str], Any] = _anything
    words: tuple[str, ...] | None = None

    def checked(self, answer: str) -> str:
        """Return the answer, stripped; raises `UsageError` that names the question for a wrong
        one."""
        answer = answer.strip()
        if self.open and not answer:
            raise UsageError(f"{self.key}: the answer is missing; {self.text}")
        if self.choices and answer not in self.choices:
            raise UsageError(f"{self.key} = {answer}: expected one of {', '.join(self.choices)}")
        if answer and answer != self.default:
            try:
                self.check(answer)
            except ValidateError as error:
                raise UsageError(f"{self.key} = {answer}: {error}") from None
        return answer


Asks = Callable[[Answers], Sequence[Question]]  # the questions that follow from the answers so far


def read_answers(path: Path) -> dict[str, str]:
    """Answers by key of a TOML file; tables and dotted keys are one, lists are joined by commas.

    Raises `UsageError` for a file that is missing, too large or no TOML.
    """
    try:
        return _flat(tomllib.loads(read_text(path, _LARGEST, errors="strict")))
    except RecordingError as error:
        raise UsageError(str(error)) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        why = " ".join(str(error).split())[:100]
        raise UsageError(f'{path}: not TOML ({why}); write each line as key = "answer"') from None


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    found: dict[str, str] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = _text(value)
    return found


def _text(value: Any) -> str:
    if isinstance(value, list):
        return ",".join(_text(v) for v in value)
    return str(value).lower() if isinstance(value, bool) else str(value)


def answered(
    asks: Asks, given: Answers, *, terminal: bool, folder: Path | None = None
) -> dict[str, str]:
    """Every question answered: by what is given, on the terminal, or by its default.

    Files that are named in a file of answers lie in its `folder` or below. Raises `UsageError` for
    a wrong answer, for one to no question, and, naming all, where open questions are left.
    """
    found: dict[str, str] = {}
    left: dict[str, Question] = {}
    for _ in range(_MOST):
        pending = [q for q in asks(found) if q.key not in found and q.key not in left]
        if not pending:
            break
        question = pending[0]
        if question.key in given:
            answer = given[question.key]
            names_file = question.words is not None and answer and answer not in question.words
            if folder is not None and names_file:  # as it is from here
                try:
                    answer = os.path.relpath(inside(folder, answer))
                except RecordingError as error:
                    raise UsageError(f"{question.key}: {error}") from None
            found[question.key] = question.checked(answer)
        elif terminal:
            for line in _explained(question):
                say(line, indent="  ")
            while question.key not in found:
                prompted = click.prompt(
                    question.key, default=question.default, show_default=bool(question.default)
                )
                try:
                    found[question.key] = question.checked(str(prompted))
                except UsageError as error:
                    say(str(error), "yellow", "  ")
        elif question.open:
            left[question.key] = question
        else:
            found[question.key] = question.default
    if left:
        named = "; ".join(f"{q.key} ({q.text})" for q in left.values())
        raise UsageError(
            f"{len(left)} question{'s are' if len(left) > 1 else ' is'} open: {named}. Answer "
            "in a terminal, or with --answers FILE; --questions prints such a file"
        )
    unknown = [key for key in given if key not in found]
    if unknown:
        raise UsageError(
            f"no question has the key {', '.join(unknown)}; {nearest_names(unknown[0], set(found))}"
        )
    return found


def on_a_terminal() -> bool:
    """Return whether standard input is a terminal."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def listed(asks: Asks, given: Answers) -> str:
    """Return the questions as a file of answers: those known so far, the given ones answered, and
    which were answers to none. Raises `UsageError` for a wrong answer; an open one may be empty
    here."""
    found: dict[str, str] = {}
    lines = []
    for _ in range(_MOST):
        pending = [q for q in asks(found) if q.key not in found]
        if not pending:
            break
        question = pending[0]
        answer = given.get(question.key, question.default)
        found[question.key] = question.checked(answer) if answer.strip() else answer
        lines += [f"# {line}" for line in _explained(question)]
        lines.append(f'{question.key} = "{answer}"')
    if odd := [key for key in given if key not in found]:
        lines.append(f"# left out, as no question has this key: {', '.join(odd)}")
    lines.append("# these answers may lead to further questions: list them with --answers")
    return "\n".join(lines)


def _explained(question: Question) -> list[str]:
    lines = [question.text]
    if question.choices:
        lines.append("one of: " + ", ".join(question.choices))
    if question.open:
        lines.append("open: the recording does not answer it")
    elif question.why:
        lines.append(f"'{question.default}': {question.why}")
    return lines
