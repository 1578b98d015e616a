"""`validate data`: list and download third-party data sets."""

import json
from pathlib import Path
from typing import Any

from validate.commands.display import relative, say, table
from validate.commands.progress import progress
from validate.datasets.home import DataSet, cache_folder, data_set_of, data_sets, searched, whole
from validate.errors import RecordingError


def show(as_json: bool) -> None:
    """Print every data set, and where it is here."""
    if as_json:
        documents: list[dict[str, Any]] = []
        for s in data_sets():
            place = _where(s)
            files = [
                {"name": f.name, "address": s.address(f) if f.source else None,
                 "sha256": f.sha256, "bytes": f.size}
                for f in s.files
            ]  # fmt: skip
            documents.append({
                "name": s.name, "folder": s.folder, "title": s.title,
                "repository": s.repository, "commit": s.commit, "licence": s.licence,
                "citation": s.citation, "made": s.made or None,
                "here": str(place) if place else None, "files": files,
            })  # fmt: skip
        print(json.dumps(documents, ensure_ascii=False, indent=2))
        return
    rows = []
    for s in data_sets():
        size = f"{len(s.files)}, {sum(f.size for f in s.files) / 1e6:.2g} MB"
        place, count = max(_counts(s).items(), key=lambda found: found[1])
        if not count:
            here = "no" if s.brought else "no; not downloadable"
        else:
            here = relative(place) if count == len(s.files) else f"{count} in {relative(place)}"
        rows.append([s.name, s.title, s.licence, size, here])
    table("", ["name", "what", "licence", "files", "here"], rows)
    say("\n`validate data get NAME` downloads one; the licence of each applies.")


def get(name: str) -> None:
    """Brings a data set into the cache, unless it is here already; says what to cite."""
    data_set = data_set_of(name)
    if here := _where(data_set):
        say(f"{data_set.name} is already here: {relative(here / data_set.folder)}", indent="  ")
    elif data_set.brought:
        from validate.datasets.bring import bring

        with progress(data_set.name) as told:
            came = bring(data_set, told)
        place = relative(cache_folder() / data_set.folder)
        kept = len(data_set.brought) - len(came)
        say(
            f"{place}: {len(came)} files downloaded, {kept} already present; every hash is correct",
            indent="  ",
        )
        if data_set.made:
            say(f"{len(data_set.files) - len(data_set.brought)} files are not downloadable: "
                f"{_made(data_set)}",
                indent="  ")  # fmt: skip
    else:
        raise RecordingError(f"{data_set.name} cannot be downloaded: {_made(data_set)}")
    say(f"licence {data_set.licence}; cite: {data_set.citation} {data_set.page}", indent="  ")


def _made(data_set: DataSet) -> str:
    return (
        f"{data_set.made} ({data_set.page}); put such files into {data_set.folder}/ in the "
        "folder that VALIDATE_SHARED_DATA names"
    )


def _counts(data_set: DataSet) -> dict[Path, int]:
    """How many of its files are whole, by the folders that are looked through."""
    beside = Path.cwd() / "experiments"
    return {
        place: sum(whole(place / data_set.folder / f.name, f) for f in data_set.files)
        for place in searched(beside)
    }


def _where(data_set: DataSet) -> Path | None:
    whole_in = (p for p, n in _counts(data_set).items() if n == len(data_set.files))
    return next(whole_in, None)
