"""Export of a testing machine with several specimens: one recording for each."""

from dataclasses import replace
from pathlib import Path

from validate.errors import UsageError
from validate.recording.reader import Options, Reader
from validate.recording.tables.blocks import parse_tables
from validate.recording.tables.encoding import whole_file
from validate.recording.tables.specimens import specimen_tables
from validate.recording.tables.testing_machine import INSTRON
from validate.recording.tables.workbook import ALL, SHEETS, XLSX, specimens_in_book
from validate.recording.types import Recording

__all__ = ["ALL", "every_specimen"]


def every_specimen(reader: Reader, path: Path, options: Options) -> list[Recording]:
    """Return a recording of each specimen, named by its label; raises as the reader, and
    `UsageError` for one of another format."""
    if reader in (XLSX, SHEETS):
        chosen = specimens_in_book(path, options)
    elif reader is INSTRON:
        said = (options.get("encoding"), options.get("decimal"))
        tables = specimen_tables(parse_tables(whole_file(path), *said))
        chosen = {label: {"specimen": label} for label in tables}
    else:
        raise UsageError(
            f"--map specimen={ALL}: {path.name} is {reader.doc}, which has no specimens"
        )
    logs = {label: reader.read(path, {**options, **one}) for label, one in chosen.items()}
    return [replace(log, name=f"{log.name}-{label}") for label, log in logs.items()]
