"""The gallery has a card, a small thumbnail, a question and the README of every experiment."""

import re
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image
from script_modules import module_of

from validate.catalogue import experiment_files

ROOT = Path(__file__).resolve().parents[2]
NAMES = sorted(experiment_files(ROOT))
MOST = 40_000  # bytes of a thumbnail


@pytest.fixture(scope="module")
def gallery() -> ModuleType:
    return module_of(ROOT / "docs" / "gallery_page.py")


def test_every_experiment_has_its_card_and_section(gallery: ModuleType) -> None:
    text = gallery.page()
    assert re.findall(r"\{grid-item-card\} (\w+)", text) == NAMES
    assert re.findall(r"^## (\w+): ", text, re.MULTILINE) == NAMES
    assert text.count("**Question.** ") == len(NAMES)


def test_every_thumbnail_is_of_an_experiment_and_small(gallery: ModuleType) -> None:
    files = sorted(gallery.PICTURES.iterdir())
    assert [file.stem for file in files] == NAMES
    for file in files:
        assert file.stat().st_size <= MOST, file.name
        with Image.open(file) as picture:
            assert picture.size == gallery.SIZE


def test_a_figure_is_fitted_without_its_margins(gallery: ModuleType, tmp_path: Path) -> None:
    figure = Image.new("RGB", (400, 400), "white")
    figure.paste("black", (100, 100, 200, 150))
    figure.save(tmp_path / "figure.png")
    small = gallery.thumbnail(tmp_path / "figure.png")
    assert small.size == gallery.SIZE
    dark = sum(count for count, pixel in small.getcolors() if pixel == (0, 0, 0))
    assert dark == 100 * 50
