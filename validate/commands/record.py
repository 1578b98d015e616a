"""`validate record`: synthetic recording of an experiment."""

from pathlib import Path

from validate.commands.arguments import pairs
from validate.commands.progress import progress
from validate.commands.recordings import written as say
from validate.commands.run import ask_about
from validate.errors import UsageError
from validate.parameters import with_values
from validate.pipeline.experiment.find import find
from validate.pipeline.run.twin_record import stamped
from validate.places import try_file, write_whole
from validate.recording.mcap.write import write_recording
from validate.recording.reader import digest, to_text
from validate.recording.readers import read_recording


def record(name: str, out: Path, values: tuple[str, ...], named: tuple[Path, ...] = ()) -> None:
    """Make an experiment's twin recording, with a JSON beside it of what must be read."""
    experiment = find(name, Path.cwd(), named)
    twin = experiment.twin
    if twin is None:
        raise UsageError(
            f"experiment '{name}' has no synthetic recording, as its data are measured; name a twin"
        )
    given = pairs(values, "--set")
    parameters = with_values(experiment.parameters, given)
    ask_about(experiment, given)
    try_file(out)
    with progress(f"record {name}") as bar:
        done = iter(range(10))
        made = twin.record(parameters, lambda text: bar(next(done), 3, text))
    write_recording(stamped(made, parameters), out)
    written = read_recording(out)
    write_whole(out.with_suffix(".json"), to_text(digest(written)))
    say(written, out)
