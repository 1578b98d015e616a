"""Parquet files of the long table. The only file that imports pyarrow."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from types import NoneType
from typing import Any, get_args, get_type_hints

import numpy as np

from validate.compare.row import LongRow, Wanted, selects
from validate.errors import UsageError
from validate.installation import install_command

HEAD = b"validate"  # key of the head in the file's metadata


def available() -> bool:
    """Return whether pyarrow is installed (the extra `tables`)."""
    return find_spec("pyarrow") is not None


def parquet_bytes(head: str, groups: Sequence[Sequence[LongRow]]) -> bytes:
    """Return a Parquet file of the rows, one row group for each sequence that has rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    out = pa.BufferOutputStream()
    types = {str: pa.string(), float: pa.float64(), int: pa.int64()}
    schema = pa.schema([(name, types[kind]) for name, kind in column_types().items()])
    # The schema's copy in Arrow's own form is of no use to other readers.
    with pq.ParquetWriter(out, schema, compression="zstd", store_schema=False) as writer:
        writer.add_key_value_metadata({HEAD: head.encode()})
        for rows in groups:
            if rows:
                columns = zip(*rows, strict=True)
                arrays = [pa.array(c, f.type) for c, f in zip(columns, schema, strict=True)]
                writer.write_table(pa.table(arrays, schema=schema))
    return bytes(out.getvalue())


def parquet_head(data: bytes) -> str:
    """Return the head of a Parquet file; raises `ValueError` for a file without one."""
    metadata = _opened(data).metadata.metadata or {}
    if HEAD not in metadata:
        raise ValueError("a Parquet file without a head of validate")
    return bytes(metadata[HEAD]).decode()


def parquet_rows(data: bytes, labels: Mapping[str, Wanted]) -> list[LongRow]:
    """Return the rows whose columns fit; row groups without any are not decoded as a whole."""
    file, rows = _opened(data), []
    import pyarrow as pa

    for i in range(file.num_row_groups):
        kept = np.ones(file.metadata.row_group(i).num_rows, dtype=bool)
        for name, wanted in labels.items():
            if kept.any():
                column = file.read_row_group(i, columns=[name], use_threads=False).column(0)
                values = column.to_pylist()
                fits = selects(wanted)
                known = {value: fits(value) for value in set(values)}
                kept &= np.array([known[value] for value in values], dtype=bool)
        if kept.any():
            found = file.read_row_group(i, columns=list(LongRow._fields), use_threads=False)
            # The mask as pyarrow has it, by its bits: `pyarrow.array` would import pandas (42 MB)
            bits = pa.py_buffer(np.packbits(kept, bitorder="little"))
            found = found.filter(pa.Array.from_buffers(pa.bool_(), len(kept), [None, bits]))
            columns = [found.column(name).to_pylist() for name in LongRow._fields]
            rows += [LongRow(*row) for row in zip(*columns, strict=True)]
    return rows


def _opened(data: bytes) -> Any:
    """Raises `UsageError` without pyarrow, `ValueError` for what is no Parquet file."""
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise UsageError(
            f"results.parquet needs pyarrow, which is not installed: {install_command('tables')}"
        ) from None
    try:
        return pq.ParquetFile(pa.BufferReader(data))
    except (pa.ArrowException, OSError) as error:
        raise ValueError(f"no Parquet file: {error!s:.80}") from None


def column_types() -> dict[str, type]:
    """Return the type of every column; all but texts may be None."""
    hints = get_type_hints(LongRow)
    return {n: next((t for t in get_args(h) if t is not NoneType), h) for n, h in hints.items()}
