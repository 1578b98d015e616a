"""`validate body`: a body of another program, checked, filled and kept as npz."""

from pathlib import Path

from validate.cli.arguments import complain
from validate.cli.display import say, table
from validate.errors import UsageError
from validate.places import try_file
from validate.scene.body_facts import POOR, facts, quality
from validate.scene.filled import SUFFIXES as SURFACES
from validate.scene.filled import filled
from validate.scene.foreign_mesh import SUFFIXES as FOREIGN
from validate.scene.foreign_mesh import ForeignBody, read_foreign
from validate.scene.mesh import quadratic
from validate.scene.mesh_file import read_mesh, write_mesh
from validate.units import in_si, split


def body(file: Path, unit: str | None, edge: str | None, out: Path | None, *, curved: bool) -> None:
    """Reads the body in `file`, says what it is like, and writes it to `out`."""
    if out is not None:
        try_file(out)
    found = _read(file, unit, edge)
    mesh = quadratic(found.mesh) if curved else found.mesh
    say(str(file), "bold")
    table("", ["of the body", "what"], [[k, v] for k, v in {**facts(mesh), **found.told}.items()])
    worst = quality(mesh)
    if worst.min() < POOR:
        complain(
            f"{file.name}: {int((worst < POOR).sum())} elements of a quality below {POOR:g}, down "
            f"to {worst.min():.2g}: they shorten explicit steps; mesh it again"
        )
    if out is not None:
        told = "; ".join(f"{k} {v}" for k, v in found.told.items())
        write_mesh(mesh, out, f"{file.name}; {told}")
        say(f"{out}: {out.stat().st_size / 1e3:.0f} kB", indent="  ")


def _read(file: Path, unit: str | None, edge: str | None) -> ForeignBody:
    suffix = file.suffix.lower()
    if suffix not in (*FOREIGN, *SURFACES):
        return ForeignBody(read_mesh(file), {})
    if unit is None:
        raise UsageError(f"{file.name}: a file of this kind states no unit; say it: --unit mm")
    if suffix in FOREIGN:
        return read_foreign(file, unit)
    return filled(file, unit, _metres(edge) if edge else 0.0)


def _metres(text: str) -> float:
    number, unit = split(text) or (0.0, "")
    value = in_si(number, unit, "m") if unit else None
    if value is None or value <= 0:
        raise UsageError(f"--edge {text}: expected a length with its unit, as 2mm")
    return value
