"""Configurations of the PLUS toolkit (XML): declared transforms, and landmarks of a body."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from validate.arrays import Floats, checked
from validate.errors import RecordingError
from validate.recording.reader import head

_MM = 1e-3  # m: PLUS writes millimetres
_BYTES = 4 * 2**20
_KNOWN = 20  # names in a message


@dataclass(frozen=True)
class DeclaredTransform:
    """T_target_from_source (4, 4), translation in m, and the error m that stands beside it."""

    matrix: Floats
    error: float | None


@dataclass(frozen=True)
class DeviceSet:
    """Transforms by (from, to), and landmarks (3,) m by name in their body's frame."""

    name: str
    transforms: Mapping[tuple[str, str], DeclaredTransform]
    landmarks: Mapping[str, Floats]

    def transform(self, source: str, target: str) -> DeclaredTransform:
        """Raise `RecordingError` naming what is there instead."""
        if (source, target) not in self.transforms:
            there = ", ".join(f"{a} to {b}" for a, b in list(self.transforms)[:_KNOWN])
            raise RecordingError(
                f"{self.name}: no transform from {source} to {target}; it has {there or 'none'}"
            )
        return self.transforms[source, target]


def read_device_set(path: Path) -> DeviceSet:
    """Raise `RecordingError` for a file that is missing, damaged, too large or not XML, and for a
    matrix or position that is none."""
    text = head(path, _BYTES + 1)
    if not text or len(text) > _BYTES or b"<!" in text.replace(b"<!--", b""):
        raise RecordingError(
            f"{path}: {len(text)} bytes; expected a PLUS configuration: XML of 1 to {_BYTES} "
            f"bytes without DTD declarations"
        )
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise RecordingError(f"{path.name}: not XML, or damaged ({error})") from None
    transforms = {
        (node.get("From", ""), node.get("To", "")): _declared(path, node)
        for node in root.iter("Transform")
        if node.get("Matrix")
    }
    landmarks = {
        node.get("Name", ""): _MM * _numbers(path, node.get("Position", ""), 3)
        for node in root.iterfind(".//Landmarks/Landmark")
    }
    return DeviceSet(path.name, transforms, landmarks)


def _declared(path: Path, node: ElementTree.Element) -> DeclaredTransform:
    matrix = _numbers(path, node.get("Matrix", ""), 16).reshape(4, 4)
    matrix[:3, 3] *= _MM
    error = node.get("Error")
    return DeclaredTransform(
        checked(matrix, "matrix", (4, 4), error=RecordingError),
        None if error is None else _MM * float(_numbers(path, error, 1)[0]),
    )


def _numbers(path: Path, text: str, count: int) -> Floats:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise RecordingError(f"{path.name}: '{text[:60]}' is not {count} finite numbers")
    return values
