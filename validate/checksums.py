"""Checksums of stored JSON documents; an edited number is refused.

A seal is the SHA-256 of the document's canonical text (keys sorted, no blanks) without the seal.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from validate.errors import RecordingError
from validate.files import json_value, read_bytes

SEAL = "sha256"
LARGEST = 500_000_000  # bytes of a document: more is none of ours


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the document with its seal (another that it had is left out), as it is read again."""
    plain: dict[str, Any] = json_value(json.dumps(content, allow_nan=False))
    plain.pop(SEAL, None)
    return {**plain, SEAL: seal_of(plain)}


def unsealed(content: Any) -> dict[str, Any]:
    """Return the document without its seal; raises `ValueError` where it does not fit."""
    if not isinstance(content, dict):
        raise ValueError(f"{type(content).__name__}, expected an object")
    plain = {key: value for key, value in content.items() if key != SEAL}
    if SEAL not in content:
        raise ValueError("no checksum")
    if content[SEAL] != seal_of(plain):
        raise ValueError("its content does not match its checksum: edited or damaged")
    return plain


def seal_of(plain: Mapping[str, Any]) -> str:
    """Return the seal of a document that has none."""
    try:
        text = json.dumps(plain, sort_keys=True, separators=(",", ":"))
    except RecursionError:
        raise ValueError("nested too deeply") from None
    return hashlib.sha256(text.encode()).hexdigest()


def read_sealed(path: Path) -> dict[str, Any]:
    """Return the document in a file without its seal.

    Raises `RecordingError`, one line with the file's name, for what cannot be read, is no JSON
    object, nests too deeply, or does not fit its seal.
    """
    try:
        return unsealed(json_value(read_bytes(path, LARGEST)))
    except ValueError as error:
        why = " ".join(str(error).split())[:120]
        name = f"{path.parent.name}/{path.name}"
        raise RecordingError(f"{name}: ignored ({why})") from None
