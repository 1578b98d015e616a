"""Any text becomes the name of a file, and different texts different ones."""

import re

from hypothesis import given
from hypothesis import strategies as st

from validate.files import safe_name


def test_plain_names_stay_and_others_differ() -> None:
    for text in ("node_A", "force.rms@9mm".replace("@", " "), "study-tradeoff+quick", "a b"):
        assert safe_name(text) == text
    assert re.fullmatch(r"a_b-[0-9a-f]{6}", safe_name("a/b"))
    odd = ("a/b", "a\\b", "a:b", "..", ".", "", " ", "a\0b", "x" * 400, "x" * 401, "ä", "\ud800")
    names = [safe_name(text) for text in odd]
    assert len(set(names)) == len(odd)


@given(st.text())
def test_no_text_leaves_its_folder(text: str) -> None:
    name = safe_name(text)
    assert re.fullmatch(r"[A-Za-z0-9._+ -]{1,107}", name)
    assert name.strip(" .") == name
