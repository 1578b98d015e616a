"""Modules planted beside data: each leaves a trace where any process imports it."""

from pathlib import Path

import pytest

NAMES = (
    "json", "random", "numpy", "ezc3d", "validate", "scipy", "struct", "re", "pathlib", "tempfile",
    "zlib", "csv", "signal", "resource", "PIL", "h5py", "meshio", "sitecustomize", "runpy",
    "multiprocessing", "pyvista", "distributed",
)  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of canaries, which is the current one and on the user's PYTHONPATH."""
    place = tmp_path / "data"
    place.mkdir()
    plant(place)
    monkeypatch.chdir(place)
    monkeypatch.setenv("PYTHONPATH", str(place))
    return place


def plant(place: Path) -> None:
    """Half are modules, half packages; each leaves a file where it is run."""
    for i, name in enumerate(NAMES):
        code = f"open({str(place.parent / 'ran')!r}, 'a').write({name!r} + ' ')\n"
        file = place / (f"{name}.py" if i % 2 else f"{name}/__init__.py")
        file.parent.mkdir(exist_ok=True)
        file.write_text(code)


def ran(place: Path) -> str:
    file = place.parent / "ran"
    return file.read_text() if file.is_file() else ""
