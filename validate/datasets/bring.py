"""Download of a data set into the cache, complete and with checked hashes."""

import re
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pooch
import requests

from validate.datasets.home import DataFile, DataSet, cache_folder, whole
from validate.errors import RecordingError

# --- Rows of numbers that others keep inside a program, written as the CSV file that is
# registered.
#
# Numbers are rounded to nine significant digits and not changed. Nothing of the text is run.

_NUMBER = r"-?\d+(?:\.\d+)?"
_PAIR = re.compile(rf"^\s*({_NUMBER})\s+({_NUMBER})\s*$", re.MULTILINE)
_SERIES = re.compile(
    rf"λ₁ == ({_NUMBER})\s+λ₂ = \[(.*?)\].*?s₁ = \[(.*?)\]\s+s₂ = \[(.*?)\]", re.DOTALL
)


def csv_of(text: str, function: str, header: str) -> str:
    """The rows that a function of a Julia file holds, below `header`; the header alone for none.

    A matrix of two columns, or Kawabata's series: one stretch 1, then lists of stretch 2 and of
    both stresses.
    """
    begin = text.find(f"function {function}(")
    end = text.find("\nend", begin)
    body = text[begin:end] if 0 <= begin < end else ""
    rows: list[tuple[float, ...]] = []
    for first, *lists in _SERIES.findall(body):
        columns = [[float(number) for number in re.findall(_NUMBER, text)] for text in lists]
        rows += [(float(first), *row) for row in zip(*columns, strict=False)]
    rows = rows or [tuple(map(float, pair)) for pair in _PAIR.findall(body)]
    lines = [header, *(",".join(f"{value:.9g}" for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


# -------------------------------------------------------------------------------------------------

#: Called with bytes done, bytes in all, and the file that comes.
ReportAdditions = Callable[[int, int, str], None]
_CHUNK = 65_536  # bytes between two looks at the progress
_PATIENCE = 30.0  # s without an answer
_LEFT_OVER = 86_400.0  # s: a transfer as old as that is of a process that was killed


def bring(data_set: DataSet, told: ReportAdditions) -> tuple[DataFile, ...]:
    """Brings what is not whole in the cache; returns the files that came.

    A file takes its place once its hash is the registered one: a transfer that is cut or changed
    leaves what was there before. Where one is not what is registered, the others come all the same.
    Raises `RecordingError` in one line for what did not come.
    """
    folder = cache_folder() / data_set.folder
    missing = tuple(f for f in data_set.brought if not whole(folder / f.name, f))
    done, total, wrong = 0, sum(f.size for f in missing), list[str]()
    pooch.get_logger().setLevel("WARNING")
    for file in missing:
        try:
            bar = _Bar(told, done, file, total)
            _one(data_set.address(file), file, folder / file.name, bar)
        except _OtherFileError as error:
            wrong.append(str(error))
        done += file.size
    if wrong:
        raise RecordingError(
            f"{len(wrong)} of {len(missing)} files could not be downloaded: {wrong[0]}"
        )
    return missing


class _OtherFileError(RecordingError):
    """The server answers, but not with the file; of another file it may."""


def _one(address: str, file: DataFile, place: Path, bar: "_Bar") -> None:
    loader = pooch.HTTPDownloader(progressbar=bar, chunk_size=_CHUNK, timeout=_PATIENCE)
    with _in_a_line(address, file), _aside() as aside:
        registered = None if file.rows else f"sha256:{file.sha256}"
        came = Path(pooch.retrieve(address, registered, "file", aside, downloader=loader))
        if file.rows:
            # The registered file in the place of its source; `ValueError` where it is another one
            text = csv_of(came.read_text("utf-8"), file.rows, file.header)
            came.write_bytes(text.encode())
            if not whole(came, file):
                raise ValueError(f"the rows of {file.rows} are not the registered ones")
        place.parent.mkdir(parents=True, exist_ok=True)
        came.replace(place)


@contextmanager
def _aside() -> Iterator[Path]:
    """A folder of a transfer, away from the data sets, gone at its end however it ends."""
    transfers = cache_folder().parent / "transfers"
    transfers.mkdir(parents=True, exist_ok=True)
    for left in transfers.iterdir():
        if time.time() - left.stat().st_mtime > _LEFT_OVER:
            shutil.rmtree(left, ignore_errors=True)
    with tempfile.TemporaryDirectory(dir=transfers) as folder:
        yield Path(folder)


@contextmanager
def _in_a_line(address: str, file: DataFile) -> Iterator[None]:
    host = urlsplit(address).netloc
    try:
        yield
    except requests.HTTPError as error:
        raise _OtherFileError(
            f"{file.name}: {error}; the download is discarded. Try again later or download it "
            f"manually"
        ) from error
    except requests.exceptions.ChunkedEncodingError as error:
        raise RecordingError(
            f"{file.name}: the transfer from {host} ended before its {file.size} bytes were "
            f"complete; the download is discarded, run the command again"
        ) from error
    except requests.RequestException as error:
        raise RecordingError(
            f"{file.name}: {host} cannot be reached; check the network and run the command again, "
            f"or copy the file from {address} into a folder that VALIDATE_SHARED_DATA names"
        ) from error
    except ValueError as error:
        raise _OtherFileError(
            f"{file.name}: the file at {address} is not the registered one (sha256 "
            f"{file.sha256[:12]}..., {file.size} bytes); the download is discarded"
        ) from error


class _Bar:
    """The progress of one file among all, as pooch asks for one.

    pooch counts chunks, not bytes, and a transfer may be compressed: never more than the file.
    """

    def __init__(self, told: ReportAdditions, before: int, file: DataFile, among: int) -> None:
        self.total = 0  # pooch sets it
        self._told, self._before, self._file, self._among = told, before, file, among
        self._here = 0
        self.update(0)

    def update(self, count: int) -> None:
        self._here = min(self._here + count, self._file.size)
        self._told(self._before + self._here, self._among, self._file.name)

    def reset(self) -> None:
        self._here = 0

    def close(self) -> None:
        """Nothing is held."""
