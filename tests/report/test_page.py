"""The page: self-contained, sections present where they apply, verdict in words."""

import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser

import pytest
from report_samples import BLIND, CHECK, bare_result, small_result

from validate.compare.effects import Change
from validate.compare.result import Result
from validate.report.html import SECTIONS, page
from validate.report.page import Section

CREATED = "2026-11-21T04:00:00Z"


@pytest.fixture(autouse=True)
def _no_gl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")


def made(result: Result) -> tuple[dict[str, Section], str]:
    found = {name: s for name, make in SECTIONS if (s := make(result)) is not None}
    return found, page(result, tuple(found.values()), CREATED)


class _Tags(HTMLParser):
    """Every attribute that a browser fetches, and the tags left open."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.open: list[str] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.fetched += [v or "" for k, v in attrs if k in ("src", "href", "srcset", "data")]
        if tag not in ("meta", "link", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_self_contained_and_well_formed() -> None:
    _, text = made(small_result())
    tags = _Tags()
    tags.feed(text)
    assert tags.open == []
    assert tags.fetched
    assert all(f.startswith(("data:", "#")) for f in tags.fetched)
    assert "script" not in tags.tags
    assert "@import" not in text
    assert "url(" not in text
    assert len(text.encode()) < 2_000_000


def test_sections_of_a_recording_with_force_only() -> None:
    found, _ = made(small_result())
    assert set(found) == {
        "checks", "curves", "discrimination", "body", "methods", "published", "identified",
        "scores", "recording", "parameters",
    }  # fmt: skip


def test_sections_when_nothing_finished() -> None:
    found, text = made(bare_result())
    assert set(found) == {"methods", "parameters"}
    assert "not_converged at step 3: 1 update allowed" in unescape(text)


def test_all_recordings_are_drawn() -> None:
    found, _ = made(small_result())
    (picture,) = found["curves"].pictures
    assert "2 recordings" in picture.caption


@pytest.mark.parametrize(
    ("verdict", "word", "colour"),
    [("agrees", "Agrees", "good"), ("differs", "Differs", "bad"),
     ("cannot decide", "Undecided", "open")],
)  # fmt: skip
def test_band_says_the_verdict_in_words_and_colour(verdict: str, word: str, colour: str) -> None:
    result = small_result()
    method = replace(result.methods[0], checks=(replace(CHECK, verdict=verdict),))
    text = page(replace(result, methods=(method,)), (), CREATED)
    assert f'class="band {colour}" id="verdict"><b>{word}:' in text
    assert unescape(text).count(result.sentence) == 1


def test_nothing_checked_is_undecided() -> None:
    assert "<b>Undecided:" in page(bare_result(), (), CREATED)


@pytest.mark.parametrize("anchor", ["quick", "twin", "same-model"])
def test_notices_only_where_they_apply(anchor: str) -> None:
    plain = small_result()
    told = replace(plain, quick=True, twin_notice="It is a twin.", same_model=True)
    assert f'id="{anchor}"' not in page(plain, (), CREATED)
    assert f'id="{anchor}"' in page(told, (), CREATED)


def test_names_are_escaped() -> None:
    _, text = made(small_result())
    assert "soft <cube>" not in text
    assert "A cube &lt;between&gt; plates" in text


def test_every_picture_has_words_and_units() -> None:
    found, text = made(small_result())
    pictures = [p for s in found.values() for p in s.pictures]
    assert pictures
    assert len(re.findall(r"<img [^>]*alt=\"[^\"]+\"", text)) == len(pictures)
    assert all(re.search(r"\b(mm|N|kPa|no unit)\b", p.caption) for p in pictures)


def test_check_row_shows_two_u_val_and_its_parts() -> None:
    found, _ = made(small_result())
    table = next(p for p in found["checks"].parts if p.kind == "table")
    assert [c.text for c in table.rows[0]] == [
        "soft", "force.plate@2mm", "N",
        "0.0100", "0.0400", "0.0150", "0.0100", "0.00500", "0.500", "1",
        "✓ agrees", "|E| is 0.5 u_val",
    ]  # fmt: skip


def test_sentences_say_what_can_and_cannot_be_told_apart() -> None:
    found, _ = made(small_result())
    (items,) = (p for p in found["discrimination"].parts if p.kind == "items")
    assert "can tell it apart, by force.plate" in items.texts[0]
    assert "cannot be told apart" in items.texts[1]
    assert "would decide: a better cell" in items.texts[1]


def test_references_without_noise_are_no_sensors() -> None:
    result = small_result()
    exact = Change("volume.relative_error@2mm", 0.08, 0.08, "1", 3e13)
    effect = replace(result.effects[0], changes=(*result.effects[0].changes, exact))
    soft = result.methods[0]
    noiseless = replace(
        next(iter(soft.residuals.values())), quantity="volume.relative_error", sd=0.0, unit="1"
    )
    soft = replace(soft, residuals={**soft.residuals, noiseless.name: noiseless})
    found, _ = made(replace(result, effects=(effect, BLIND), methods=(soft,)))
    tables = [p for p in found["discrimination"].parts if p.kind == "table"]
    assert tables[0].headings == ("effect", "force.plate")
    assert [c.text for c in tables[0].rows[0]] == ["modulus: E 10 % higher", "✓ 7.0"]
    assert [c.text for c in tables[0].rows[1]] == ["nu: nu 0.45", "0.1"]
    assert [row[1].mark for row in tables[0].rows] == ["good", ""]


def test_a_line_on_another_is_named() -> None:
    result = small_result()
    twin = replace(result.methods[0], name="twin", label="the same again", accepted=False)
    found, _ = made(replace(result, methods=(*result.methods, twin)))
    (picture,) = found["curves"].pictures
    assert "lying on another line: the same again (on soft <cube>)" in picture.caption
