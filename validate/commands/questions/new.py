"""`validate new`: write an experiment file from a recording and answers.

Texts of the recording are data: they enter the file as Python literals or in comments without line
ends, never as code.
"""

import re
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from string import Template

import click

from validate.commands.arguments import complain, require_new
from validate.commands.display import say
from validate.commands.questions.answers import (
    Answers,
    Question,
    answered,
    listed,
    on_a_terminal,
    read_answers,
)
from validate.commands.questions.body import BODY
from validate.commands.questions.inclusion import INCLUSION
from validate.commands.questions.kinds import NewKind
from validate.commands.questions.plates import PLATES
from validate.commands.recordings import ask_back, beside, channels, plain, topics
from validate.errors import SceneError, UsageError
from validate.pipeline.run.estimate import RunEstimate, estimated
from validate.pipeline.run.twin_record import kind_of_recordings
from validate.places import try_folder, write_whole
from validate.recording.readers import read_recording
from validate.recording.types import Recording

KINDS = (PLATES, INCLUSION, BODY)
_LARGEST = 20_000  # bytes of such a file
_FIRST = 60.0  # s, estimated: a first answer that would take longer is given on a coarser mesh
_HALVINGS, _COARSER = "body.halvings", ("-1", "-2")


def new(
    name: str,
    source: Path,
    out: Path | None,
    answers: Path | None,
    *,
    questions: bool = False,
    force: bool = False,
) -> None:
    """Write `out` (default experiments/NAME.py); refuses names that no module may have.

    What the recording does not tell is taken from the file `answers`, asked on a terminal, or left
    open; `questions` only lists it.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or name in {*sys.stdlib_module_names, "validate"}:
        raise UsageError(
            f"experiment '{name}': expected a name of a-z, 0-9 and _ that no Python module has"
        )
    path = out or Path("experiments") / f"{name}.py"
    if path.name != f"{name}.py":
        raise UsageError(f"-o {path}: the file must have the experiment's name, {name}.py")
    if not questions:
        require_new((path,), (source, *((answers,) if answers else ())), force=force)
        try_folder(path, _LARGEST)
    recording = read_recording(source)
    ask_back(recording)
    kinds = fitting(recording)
    given = _without_settled(kinds, read_answers(answers) if answers else {})
    asks = partial(_asked, kinds, recording, path.parent)
    if questions:
        click.echo(listed(asks, given))
        return
    terminal, folder = answers is None and on_a_terminal(), answers and answers.parent
    found = answered(asks, given, terminal=terminal, folder=folder)
    kind = _chosen(kinds, found)
    path.parent.mkdir(parents=True, exist_ok=True)

    def written_with(answers: Answers) -> RunEstimate | None:
        text = written(name, recording, beside(source, path), path.parent, kind, answers)
        write_whole(path, text)
        return estimated(path)

    expected = written_with(found)
    for halvings in _COARSER if found.get("body.file") else ():
        if expected is None or expected.seconds <= _FIRST:
            break
        coarser = {**found, _HALVINGS: halvings}
        try:
            expected = written_with(coarser)
        except SceneError:  # too few nodes, or no closed surface: many steps are what takes long
            expected = written_with(found)
            break
        found = coarser
    for line in kind.assumed(recording, found):
        complain(line)
    # The topics that the experiment leaves out; logs of repeats are in their mean and scatter
    used = kind.used(recording, found)
    mean = used if "repeats" in recording.metadata else ()
    for topic in [t for t in topics(recording) if t not in used and t.split("/")[0] not in mean]:
        complain(f"'{topic}' is not used by this experiment")
    say(f"{path}: edit it, then `validate run {_called(name, path)}`", indent="  ")
    if expected:
        say(
            f"first answer: up to {float(f'{expected.seconds:.1g}'):.0f} s (often far less: `run` "
            f"shows what is left), about {expected.memory / 1e9:.1f} GB, {expected.unknowns:.0f} "
            "unknowns at most",
            indent="  ",
        )
    if found.get(_HALVINGS):
        say(
            f"its mesh is coarser: {found['body.file']} filled anew with larger cells; "
            f"validate run {_called(name, path)} --refine takes the file's own",
            indent="  ",
        )


def fitting(recording: Recording) -> tuple[NewKind, ...]:
    """Return the kinds of experiment that the recording can be; raises `UsageError` where it is
    none."""
    found = tuple(kind for kind in KINDS if kind.fits(recording))
    if found:
        return found
    held = f"{recording.name} holds {topics(recording)} and records {sorted(recording.metadata)}"
    if recording.frames:
        raise UsageError(
            f"{held}: images alone do not define a body; find their outlines first: "
            f"validate outline {Path(recording.source.path).name} -o outlined.mcap"
        )
    raise UsageError(f"{held}; an experiment needs {', or '.join(k.needs for k in KINDS)}")


def _asked(
    kinds: Sequence[NewKind], recording: Recording, folder: Path, found: Answers
) -> Sequence[Question]:
    names = tuple(kind.name for kind in kinds)
    if len(kinds) > 1:
        doc = "; ".join(f"{kind.name}: {kind.doc}" for kind in kinds)
        which = Question(
            "experiment",
            f"kind of test ({doc})",
            names[0],
            "the first kind that fits the recording",
            choices=names,
        )
        if which.key not in found:
            return (which,)
    return _chosen(kinds, found).asks(recording, folder, found)


def _without_settled(kinds: Sequence[NewKind], given: Answers) -> Answers:
    """Return the answers without that to a question that the recording answers alone.

    Raises `UsageError` where it answers otherwise."""
    if len(kinds) > 1 or "experiment" not in given:
        return given
    if given["experiment"] != kinds[0].name:
        raise UsageError(
            f'experiment = "{given["experiment"]}": this recording fits {kinds[0].name} only'
        )
    return {key: answer for key, answer in given.items() if key != "experiment"}


def _chosen(kinds: Sequence[NewKind], found: Answers) -> NewKind:
    return next((k for k in kinds if k.name == found.get("experiment")), kinds[0])


def written(
    name: str,
    recording: Recording,
    source: str,
    folder: Path,
    kind: NewKind,
    found: Mapping[str, str],
) -> str:
    """Return the experiment file's text; `source` is the recording's path from the file's
    `folder`."""
    template = Template((Path(__file__).parent / kind.template).read_text("utf-8"))
    title = f"{plain(recording.name)}: measured against {kind.against}"
    declared = kind_of_recordings((recording,))
    return template.substitute(
        kind.fields(recording, source, folder, found),
        name=repr(name),
        title=title.replace("\\", "/").replace('"', "'"),
        title_text=repr(title),
        source=plain(Path(source).name).replace("\\", "/").replace('"', "'"),
        source_text=repr(plain(Path(source).name)),
        kind="" if declared == "measured" else f" kind={declared!r},",
        recording=repr(source),
        channels="\n".join(f"#   {line}".rstrip() for line in channels(recording)),
    )


def _called(name: str, path: Path) -> str:
    return name if path.resolve().parent == Path("experiments").resolve() else str(path)
