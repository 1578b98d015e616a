"""Text encoding of a file, chosen by evidence that the recording lists.

UTF-8 and UTF-16 prove themselves. Older encodings do not: nearly every byte is a letter in each of
them. So each candidate is decoded, and the one in which the words of testing machines appear wins
(`vocabulary.evidence`), then the one whose letters stand where letters stand.
"""

import codecs
import re
from dataclasses import dataclass
from pathlib import Path

from validate.errors import RecordingError, UsageError
from validate.files import read_bytes
from validate.recording.tables.vocabulary import evidence, is_ideographic, plain

MAX_BYTES = 256 * 1024 * 1024
# In order of preference where nothing decides.
CANDIDATES = ("cp1252", "cp1250", "gb18030", "cp1251", "cp932", "big5", "cp850", "cp852")
_BY_WORDS = CANDIDATES[2:]  # nearly any bytes are text in these: known words must speak for them
_HIGH = re.compile(rb"[\x80-\xff]+")
_GB_COMMON = re.compile(rb"(?:[\xb0-\xd7][\xa1-\xfe])+")  # the frequent characters of GB 2312
_ODD_SIGN = re.compile(r"(?<=[^\W\d_])[^\w\s!-~](?=[^\W\d_])|(?<=[^\W\d_])[¹²³¼½¾](?=[^\W\d_])")


@dataclass(frozen=True)
class Text:
    """The text, its encoding, and what decided for it."""

    text: str
    encoding: str
    why: str


@dataclass(frozen=True)
class _Reading:
    """One candidate's text, the known words in it, and its signs that stand where none should."""

    encoding: str
    text: str
    words: tuple[str, ...]
    hits: int
    odd: int


def decode(data: bytes, said: str | None = None) -> Text:
    """Return the text of a file; `said` is an encoding the user gives, which is then believed.

    Raises `RecordingError` for empty, oversized and binary files, and for bytes that no encoding
    known here can hold; `UsageError` for an unknown `said`.
    """
    if len(data) > MAX_BYTES:
        raise RecordingError(f"{len(data)} bytes, the limit for text tables is {MAX_BYTES}")
    encoding, why = (_named(said), "given by --map") if said else _chosen(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        raise RecordingError(
            f"not a text file: byte {error.start} of {len(data)} is not {encoding}; "
            "export the test as CSV text, or name its encoding with --map encoding=cp1250"
        ) from error
    odd = re.search(r"[\x00-\x08\x0e-\x19\x1b-\x1f\x7f\ufffe\uffff]", text)
    if odd:
        raise RecordingError(
            f"a binary file: character {ord(odd[0])} at {odd.start()}; export the test as CSV text"
        )
    if not text.strip():
        raise RecordingError(f"an empty file ({len(data)} bytes)")
    return Text(text.strip("\x1a").removeprefix("\ufeff"), encoding, why)


def whole_file(path: Path) -> bytes:
    """Return the bytes of a text of bounded size; raises `RecordingError` where it cannot be
    read."""
    return read_bytes(path, MAX_BYTES)


def _named(said: str) -> str:
    try:
        return codecs.lookup(said).name
    except LookupError:
        raise UsageError(
            f"--map encoding={said}: unknown encoding; expected utf-8, utf-16, "
            f"{', '.join(CANDIDATES)}"
        ) from None


def _chosen(data: bytes) -> tuple[str, str]:
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16", "byte order mark"
    head = data[:4096]
    if len(head) >= 4 and 0.3 * len(head) < head.count(0) <= 0.5 * len(head):
        little = head[1::2].count(0) > head[::2].count(0)
        return ("utf-16-le" if little else "utf-16-be"), "nearly every second byte is 0"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        # The best of the older encodings; a file without any evidence is read as the first one.
        # Only lines with letters beyond ASCII tell something.
        lines = b"\n".join(line for line in re.split(rb"[\r\n]+", data) if not line.isascii())
        found = [r for r in (_reading(lines, name) for name in CANDIDATES) if r is not None]
        if not found:
            return CANDIDATES[0], "no known encoding fits"
        best = max(found, key=lambda r: (r.hits, -r.odd))  # the first of equals
        if best.words:
            return best.encoding, f"by its words {', '.join(best.words[:4])}"
        tied = [
            r for r in found if (r.hits, r.odd) == (best.hits, best.odd) and r.text != best.text
        ]
        doubt = f"; {' and '.join(r.encoding for r in tied)} would fit as well" if tied else ""
        return best.encoding, f"by the kind of its letters{doubt}"
    if data.startswith(codecs.BOM_UTF8):
        return "utf-8-sig", "byte order mark"
    return "utf-8-sig", "ASCII only" if data.isascii() else "valid UTF-8"


def _reading(lines: bytes, encoding: str) -> _Reading | None:
    """What the lines are in an encoding; None where they are no text in it, or no word says so."""
    try:
        text = lines.decode(encoding)
    except UnicodeDecodeError:
        return None
    # Known words with letters beyond ASCII, as written.
    found = {
        w for w in re.findall(r"[^\W\d_]+", text) if not w.isascii() and plain(w) in evidence()
    }
    whole = plain(text)
    found |= {w for w in evidence() if is_ideographic(w) and w in whole}
    words = sorted(found)
    # 1 when every run of high bytes is made of frequent Chinese characters.
    runs = _HIGH.findall(lines)
    hits = len(words) + int(
        encoding == "gb18030" and bool(runs) and all(map(_GB_COMMON.fullmatch, runs))
    )
    if encoding in _BY_WORDS and not hits:
        return None
    # Signs between letters, and letters of scripts that no word vouches for.
    strange = sum(ord(c) >= 0x400 or 0x2500 <= ord(c) < 0x2600 for c in text)
    spacing = sum(c in "˛˘˙˝ˇ¨¸¯" for c in text)
    return _Reading(
        encoding, text, tuple(words), hits, (len(_ODD_SIGN.findall(text)) + strange + spacing)
    )
