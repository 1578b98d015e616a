"""Each shipped experiment has a README of half a page with its command."""

import re
from pathlib import Path

import pytest

from validate.catalogue import experiment_files

PARTS = ("Recording", "Body", "Methods", "Checks", "Known limits")
MOST_WORDS = 260
NAMES = sorted(experiment_files(Path(__file__).parents[2]))


@pytest.mark.parametrize("name", NAMES)
def test_a_readme_says_what_is_compared_and_how(name: str, project_root: Path) -> None:
    text = (project_root / "experiments" / name / "README.md").read_text("utf-8")
    assert text.startswith(f"# {name}: ")
    assert tuple(re.findall(r"^\*\*([\w ]+)\.\*\*", text, re.MULTILINE)) == PARTS
    assert f"\nvalidate run {name}\n" in text
    assert len(text.split()) <= MOST_WORDS
    for other in re.findall(r"`([a-z]+_[a-z_]+)`", text):
        assert other in NAMES, other
