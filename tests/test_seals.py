"""A stored document that was edited, is damaged or nests without end is not believed."""

import json
from pathlib import Path

import pytest

from validate.checksums import SEAL, read_sealed, sealed, unsealed
from validate.errors import RecordingError

CONTENT = {"b": [1, 2.5, None], "a": {"text": "ä", "big": 2**70}}


def test_a_sealed_document_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "r.json"
    file.write_text(json.dumps(sealed(CONTENT)), "utf-8")
    assert read_sealed(file) == {"b": [1, 2.5, None], "a": {"text": "ä", "big": float(2**70)}}
    again = sealed(json.loads(file.read_text("utf-8")))
    assert again[SEAL] == sealed(CONTENT)[SEAL]  # its old seal is no part of it
    turned = dict(reversed(sealed(CONTENT).items()))
    assert unsealed(turned) == read_sealed(file)  # nor is the order of keys


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (json.dumps(sealed(CONTENT)).replace("2.5", "2.6"), "does not match its checksum"),
        (json.dumps(CONTENT), "no checksum"),
        ("[1]", "list, expected an object"),
        ("{", "Expecting property name"),
        ('{"sha256": "0", "a": ' + "[" * 100_000 + "]" * 100_000 + "}", "nested too deeply"),
        ('{"sha256": "0", "a": ' + "[" * 900 + "]" * 900 + "}", "nested too deeply|checksum"),
    ],
    ids=["edited", "unsealed", "list", "cut", "deep", "less deep"],
)
def test_any_other_is_one_line(text: str, why: str, tmp_path: Path) -> None:
    (tmp_path / "cube").mkdir()
    file = tmp_path / "cube" / "results.json"
    file.write_text(text, "utf-8")
    with pytest.raises(RecordingError, match=rf"^cube/results\.json: ignored \(.*({why})"):
        read_sealed(file)
