"""The page: self-contained, sections present where they apply, verdict in words."""

import re
from dataclasses import replace
from functools import cache
from html import unescape
from html.parser import HTMLParser

import pytest
from report_samples import BLIND, CHECK, bare_result, sections_of, small_result

from validate.compare.effects import Change
from validate.compare.exhibit import Exhibit
from validate.compare.result import Result
from validate.compare.verdict import Acceptance, Validation
from validate.report.exhibits import DrawnExhibit, draw_all
from validate.report.export.tables import shown
from validate.report.page.html import page
from validate.report.sections.verdicts import band

CREATED = "2026-11-21T04:00:00Z"


@pytest.fixture(autouse=True)
def _no_gl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VALIDATE_NO_GL", "1")


def made(result: Result) -> tuple[dict[str, DrawnExhibit], str]:
    drawn = draw_all(result, sections_of(result))
    return {d.exhibit.anchor: d for d in drawn if d.shown}, page(
        result, drawn, CREATED, band(result)
    )


@cache
def small() -> tuple[dict[str, DrawnExhibit], str]:
    """The small result, drawn once: it is frozen."""
    return made(small_result())


def empty(result: Result) -> str:
    return page(result, (), CREATED, band(result))


class _Tags(HTMLParser):
    """Every attribute that a browser fetches, and the tags left open."""

    def __init__(self) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.fetched += [v or "" for k, v in attrs if k in ("src", "href", "srcset", "data")]
        if tag not in ("meta", "link", "img", "br", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_self_contained_and_well_formed() -> None:
    _, text = small()
    tags = _Tags()
    tags.feed(text)
    assert tags.open == []
    assert tags.fetched
    assert all(f.startswith(("data:", "#")) for f in tags.fetched)
    assert "@import" not in text
    assert not re.search(r"url\((?!#)", text)  # but a part of a drawing of its own
    assert len(text.encode()) < 3_000_000


def test_the_body_and_all_checks_stand_first_and_once() -> None:
    """Before the contents, whose sections link to them."""
    _, text = small()
    head = text[: text.index("<nav")]
    for name in ("body", "intervals_limits"):
        if f'id="figure-{name}"' in text:
            assert f'id="figure-{name}"' in head
            assert text.count(f'id="figure-{name}"') == 1
            assert text.count(f'href="#figure-{name}"') == 1
    assert 'id="figure-intervals_limits"' in head
    assert "Hz" in head[head.index('class="cost"') :]
    assert 'class="figures first"' not in empty(bare_result())


@pytest.mark.slow
def test_sections_of_a_recording_with_force_only() -> None:
    found, _ = small()
    assert set(found) == {
        "checks", "curves", "discrimination", "body", "methods", "published", "identified",
        "scores", "recording", "parameters",
    }  # fmt: skip


def test_sections_when_nothing_finished() -> None:
    found, text = made(bare_result())
    assert set(found) == {"methods", "parameters"}
    assert "not_converged at step 3: 1 update allowed" in unescape(text)


@pytest.mark.slow
def test_all_recordings_are_drawn() -> None:
    found, _ = small()
    level, off = found["curves"].exhibit.charts
    labels = [s.name for s in level.series if s.style == "points"]
    assert labels == ["measured, cube_a", "measured, cube_b"]
    assert (level.x, level.y) == ("stage / mm", "force.plate / N")
    assert off.linear == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("validation", "acceptance", "word", "colour"),
    [("differs", "good enough", "Good enough", "good"),
     ("differs", "not good enough", "Not good enough", "bad"),
     ("not distinguishable", "undecided", "Undecided", "open"),
     ("not distinguishable", "no requirement", "Not distinguishable", "good"),
     ("differs", "no requirement", "Differs", "bad"),
     ("fitted", "fitted", "No evidence", "open"),
     ("same model", "same model", "No evidence", "open")],
)  # fmt: skip
def test_band_says_the_verdict_in_words_and_colour(
    validation: Validation, acceptance: Acceptance, word: str, colour: str
) -> None:
    result = small_result()
    one = replace(CHECK, validation=validation, acceptance=acceptance, ratio=2.0)
    method = replace(result.methods[0], checks=(one,))
    text = empty(replace(result, methods=(method,)))
    assert f'class="band {colour}" id="verdict"><b>{word}:' in text
    assert unescape(text).count(result.sentence) == 1


def test_nothing_checked_says_so() -> None:
    assert "<b>Nothing compared:" in empty(bare_result())


@pytest.mark.parametrize("anchor", ["quick", "twin", "same-model"])
def test_notices_only_where_they_apply(anchor: str) -> None:
    plain = small_result()
    told = replace(plain, quick=True, twin_notice="It is a twin.", kind="same model")
    assert f'id="{anchor}"' not in empty(plain)
    assert f'id="{anchor}"' in empty(told)


def test_first_sections_of_an_experiment_are_open_and_all_of_a_study() -> None:
    own = tuple(Exhibit(f"own{i}", f"Own {i}", ("Some words.",)) for i in range(5))
    result = replace(small_result(), exhibits=own)
    whole = page(result, draw_all(result, own), CREATED, band(result))
    study = replace(result, methods=())
    loose = page(study, draw_all(study, own), CREATED, ("plain", "Study"))
    opened = [re.findall(r'<details open>\s*<summary><h2 id="(\w+)"', t) for t in (whole, loose)]
    assert opened == [["own0", "own1", "own2"], [e.anchor for e in own]]


def test_names_are_escaped() -> None:
    _, text = small()
    assert "soft <cube>" not in text
    assert "A cube &lt;between&gt; plates" in text


def test_every_picture_has_words_and_units() -> None:
    found, text = small()
    pictures = [p for s in found.values() for p in s.pictures if p.name != "intervals_limits"]
    assert pictures  # the checks are lines of text
    assert len(re.findall(r"<img [^>]*alt=\"[^\"]+\"", text)) == len(pictures)
    assert all(re.search(r"\b(mm|N|kPa|no unit)\b", p.caption) for p in pictures)


def test_check_row_shows_two_u_val_and_its_parts() -> None:
    found, _ = small()
    table, declared, sampled = found["checks"].exhibit.tables
    assert declared.rows == (("modulus", "within 5 %", "assumed"),)
    assert [shown(entry) for entry in sampled.rows[0]] == [
        "force@3mm", "N", "0.0200", "0.0300", "? 50.0", "12",
    ]  # fmt: skip
    assert [shown(c) for c in table.rows[0]] == [
        "soft <cube>", "force.plate@2mm", "✓ good enough", "not distinguishable", "0.010",
        "0.040", "0.500", "0.450", "0.012", "0.008", "0.0150", "0.0100", "0.0050", "1",
        "ours: a half", "|E| is 0.5 u_val",
    ]  # fmt: skip


def test_sentences_say_what_can_and_cannot_be_told_apart() -> None:
    found, _ = small()
    first, second = found["discrimination"].exhibit.words
    assert "can distinguish it, by force.plate" in first
    assert "cannot be distinguished" in second
    assert "try sensors: a better cell" in second


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
    tables = found["discrimination"].exhibit.tables
    assert tables[0].headings == ("variation", "note", "force.plate")
    assert [shown(c) for c in tables[0].rows[0]] == ["modulus", "E 10 % higher", "7.00"]
    assert [shown(c) for c in tables[0].rows[1]] == ["nu", "nu 0.45", "0.100"]
    assert tables[1].headings[2:] == ("force.plate / N", "volume.relative_error")


def test_a_line_on_another_is_named() -> None:
    result = small_result()
    twin = replace(result.methods[0], name="twin", label="the same again", accepted=False)
    found, _ = made(replace(result, methods=(*result.methods, twin)))
    picture, _ = found["curves"].pictures
    assert "as they coincide with another line: the same again (on soft <cube>)" in picture.caption
