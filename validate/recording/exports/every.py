"""All specimens of one export of a testing machine, each as a recording of its own."""

from dataclasses import replace
from pathlib import Path

from validate.errors import UsageError
from validate.recording.exports.blocks import parse_tables
from validate.recording.exports.encoding import whole_file
from validate.recording.exports.instron import INSTRON
from validate.recording.exports.specimens import specimen_tables
from validate.recording.exports.xlsx import SHEETS, XLSX, specimens_in_sheet
from validate.recording.reader import Options, Reader
from validate.recording.types import Recording

ALL = "all"  # --map specimen=all


def every_specimen(reader: Reader, path: Path, options: Options) -> list[Recording]:
    """A recording of each specimen, named by its label; raises as the reader, and `UsageError` for
    one of another format."""
    if reader in (XLSX, SHEETS):
        labels = specimens_in_sheet(path, options)
    elif reader is INSTRON:
        said = (options.get("encoding"), options.get("decimal"))
        labels = tuple(specimen_tables(parse_tables(whole_file(path), *said)))
    else:
        raise UsageError(
            f"--map specimen={ALL}: {path.name} is {reader.doc}, which has no specimens"
        )
    logs = [reader.read(path, {**options, "specimen": label}) for label in labels]
    return [replace(log, name=f"{log.name}-{i}") for log, i in zip(logs, labels, strict=True)]
