"""Output into a pipe whose reader ends early, as `| head` does."""

import io
from typing import TextIO


class _Pipe(io.RawIOBase):
    """A raw stream that drops what is written once nobody reads it any more."""

    def __init__(self, raw: io.RawIOBase) -> None:
        self._raw, self._read = raw, True

    def writable(self) -> bool:
        return True

    def write(self, data: object) -> int:
        size = memoryview(data).nbytes  # type: ignore[arg-type]
        if not self._read:
            return size
        try:
            return self._raw.write(data) or 0  # type: ignore[arg-type]
        except BrokenPipeError:
            self._read = False
            return size

    def fileno(self) -> int:
        return self._raw.fileno()

    def isatty(self) -> bool:
        return self._raw.isatty()


def outlives_reader(stream: TextIO) -> TextIO:
    """The stream, with a reader that may end early: the command goes on, its exit code stays."""
    buffer = getattr(stream, "buffer", None)
    raw = getattr(buffer, "raw", buffer)  # an unbuffered stream has its raw one there
    if not isinstance(raw, io.RawIOBase):
        return stream
    stream.flush()
    return io.TextIOWrapper(
        io.BufferedWriter(_Pipe(raw)), encoding=stream.encoding, errors=stream.errors,
        line_buffering=True,
    )  # fmt: skip
