"""File of the long table beside results.json: Parquet, or compressed CSV without pyarrow.

Both begin with a head (texts of the run) that holds a checksum of the whole file. A CSV file has
the head in its first line: `pandas.read_csv("results.csv.gz", skiprows=1)`.
"""

import csv
import gzip
import hashlib
import json
import zlib
from collections.abc import Iterator, Mapping
from io import BytesIO, StringIO
from itertools import takewhile
from pathlib import Path
from typing import Any

from validate.checksums import SEAL, read_sealed
from validate.compare.row import (
    CHART,
    POINT,
    SAMPLE,
    TABLE,
    TRACE,
    LongRow,
    Wanted,
    require_columns,
    selects,
)
from validate.errors import RecordingError
from validate.files import LARGEST, json_value, read_bytes
from validate.report.export import parquet
from validate.report.long_table import LongTable, long_table, traces_of
from validate.report.stored.exhibit_rows import exhibit_rows
from validate.report.stored.folder import MARK
from validate.report.stored.json_values import Json

PARQUET, CSV = "results.parquet", "results.csv.gz"
_LAST = (POINT, SAMPLE)  # parts that are read only where they are asked for
_MADE = {(TRACE,): traces_of, (TABLE, CHART): exhibit_rows}
_BLANK = "0" * 64  # in the place of the checksum while it is computed


def write_long_table(table: LongTable, folder: Path) -> Path:
    """Write the table into `folder`, but for traces, which results.json has; return its path."""
    text = json.dumps({SEAL: _BLANK, **table.head}, ensure_ascii=False, allow_nan=False)
    kept = [r for r in table.rows if r.part != TRACE]
    groups = [
        [r for r in kept if (_LAST.index(r.part) + 1 if r.part in _LAST else 0) == i]
        for i in range(len(_LAST) + 1)
    ]
    if parquet.available():
        path, data = folder / PARQUET, _sealed(parquet.parquet_bytes(text, groups))
    else:
        # The head, the columns' names, then a line a row; numbers in full precision
        rows = [r for rows in groups for r in rows]
        out = StringIO()
        out.write(f"{text}\n")
        writer = csv.writer(out)  # lines end in \r\n, as RFC 4180 says: only so is \r quoted
        writer.writerow(LongRow._fields)
        writer.writerows([repr(v) if isinstance(v, float) else v for v in row] for row in rows)
        plain = _sealed(out.getvalue().encode())
        path, data = folder / CSV, gzip.compress(plain, 6, mtime=0)
    path.write_bytes(data)
    return path


def stored_table(folder: Path, **labels: Wanted) -> LongTable:
    """Return the table of a stored run with the rows that fit `labels` (as `LongTable.where`).

    The column `run` is the name of the folder. Traces, and numbers of tables and charts, are there
    where `part` asks for them. A run without a file of the table has the rows that its results.json
    gives, a folder of something else has none. Raises `RecordingError` for a damaged or edited
    file, `KeyError` or `TypeError` for a results.json that `validate` did not write, `UsageError`
    for an unknown column and for Parquet without pyarrow.
    """
    require_columns(labels, LongRow._fields)
    run = folder.resolve().name
    inside = {name: wanted for name, wanted in labels.items() if name != "run"}
    if not selects(labels.get("run", "*"))(run):
        inside["part"] = ()
    for name, read in ((PARQUET, _from_parquet), (CSV, _from_csv)):
        if (folder / name).is_file():
            try:
                table = read(read_bytes(folder / name, LARGEST), inside)
            except (ValueError, csv.Error, zlib.error, EOFError, gzip.BadGzipFile) as error:
                why = " ".join(str(error).split())[:120]
                raise RecordingError(f"{run}/{name}: ignored ({why})") from None
            rows = (*(r._replace(run=run) for r in table.rows), *_asked_for(folder, run, inside))
            return LongTable(table.head, rows)
    content = read_sealed(folder / MARK)
    if not {"kind", "experiment"} & content.keys():  # a comparison, a summary
        return LongTable({}, ())
    table = long_table(content, run).where(**inside)
    return LongTable(table.head, (*table.rows, *_asked_for(folder, run, inside)))


def _asked_for(folder: Path, run: str, labels: Mapping[str, Wanted]) -> tuple[LongRow, ...]:
    """Rows that are made of results.json where `part` asks for them."""
    fits = selects(labels.get("part", ()))
    makers = [make for parts, make in _MADE.items() if any(map(fits, parts))]
    content = read_sealed(folder / MARK) if makers else {}
    rows = tuple(row for make in makers for row in make(content, run))
    return LongTable({}, rows).where(**labels).rows


def _sealed(data: bytes) -> bytes:
    """The file with its checksum in the place of the zeros."""
    mark = f'"{SEAL}": "'.encode()
    return data.replace(mark + _BLANK.encode(), mark + _digest(data), 1)


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).hexdigest().encode()


def _unsealed(head: str, data: bytes) -> Json:
    """The head without its checksum; raises `ValueError` where the file does not fit it."""
    found: Json = json_value(head)
    seal = str(found.pop(SEAL, "")).encode()
    if not seal or _digest(data.replace(seal, _BLANK.encode(), 1)) != seal:
        raise ValueError("its content does not match its checksum: edited or damaged")
    return found


def _from_parquet(data: bytes, labels: Mapping[str, Wanted]) -> LongTable:
    head = _unsealed(parquet.parquet_head(data), data)
    return LongTable(head, tuple(parquet.parquet_rows(data, labels)))


# --- CSV ------------------------------------------------------------------------------------------


def _from_csv(data: bytes, labels: Mapping[str, Wanted]) -> LongTable:
    with gzip.GzipFile(fileobj=BytesIO(data)) as file:
        text = file.read(LARGEST + 1)
    if len(text) > LARGEST:
        raise ValueError(f"more than {LARGEST} bytes unpacked")
    head, _, body = text.partition(b"\n")
    found = _unsealed(head.decode(), text)
    lines = csv.reader(StringIO(body.decode(), newline=""))
    if tuple(next(lines, ())) != LongRow._fields:
        raise ValueError("its columns are not those of this version")
    rows: Iterator[LongRow] = map(_row, lines)
    fits = selects(labels.get("part", "*"))
    if not any(map(fits, _LAST)):
        rows = takewhile(lambda row: row.part not in _LAST, rows)
    return LongTable(found, tuple(rows)).where(**labels)


def _row(texts: list[str]) -> LongRow:
    return LongRow._make(_value(t, kind) for t, kind in zip(texts, _TYPES, strict=True))


def _value(text: str, kind: type) -> Any:
    if kind is str:
        return text
    return kind(text) if text else None


_TYPES = tuple(parquet.column_types().values())
