"""`validate body`: import a third-party mesh, check it and store it as npz."""

from dataclasses import replace
from pathlib import Path

from validate.commands.arguments import complain, pairs
from validate.commands.display import say, table
from validate.errors import SceneError, UsageError
from validate.places import try_file
from validate.scene.body_facts import POOR, SAME, facts, largest_side, odd_size, quality
from validate.scene.mesh_files.mesh_file import SUFFIXES as SURFACES
from validate.scene.mesh_files.mesh_file import filled, read_mesh, write_mesh
from validate.scene.mesh_files.meshio_arrays import SURFACE
from validate.scene.mesh_files.third_party_meshes import SUFFIXES as FOREIGN
from validate.scene.mesh_files.third_party_meshes import (
    ForeignBody,
    cells_of,
    only,
    pieces,
    read_foreign,
)
from validate.scene.places import facets_of, place_of
from validate.units import in_si, split


def body(
    file: Path,
    unit: str | None,
    edge: str | None,
    part: str | None,
    faces: tuple[str, ...],
    size: str | None,
    out: Path | None,
    *,
    curved: bool,
) -> None:
    """Reads the body in `file`, names its `faces`, says what it is like, writes it to `out`."""
    if out is not None:
        try_file(out)
    found = _read(file, unit, edge, part)
    # Refuse a body of another size than given, and one of an unusual size that is not confirmed
    side = largest_side(found.mesh)
    if size is not None:
        if abs(_metres("size", size) / side - 1) > SAME:
            raise UsageError(
                f"{file.name}: --size {size}: the largest side is {1e3 * side:.4g} mm in "
                f"{unit or 'm'}; check --unit and --size"
            )
    elif odd := odd_size(found.mesh, unit or "m"):
        other = "another --unit" if unit else "nodes in m"
        raise UsageError(
            f"{file.name}: the body is {odd}: give {other}, or confirm its largest side: "
            f"--size {1e3 * side:.4g}mm"
        )
    # Facet sets by name, each where its words say
    places = pairs(faces, "--face")
    chosen = {
        name: facets_of(found.mesh, place_of(words, found.mesh)) for name, words in places.items()
    }
    mesh = replace(found.mesh, facets={**found.mesh.facets, **chosen})
    mesh = mesh.quadratic() if curved else mesh
    say(str(file), "bold")
    table("", ["of the body", "what"], [[k, v] for k, v in {**facts(mesh), **found.told}.items()])
    worst = quality(mesh)
    if worst.min() < POOR:
        complain(
            f"{file.name}: {int((worst < POOR).sum())} elements have a quality below {POOR:g}, "
            f"down "
            f"to {worst.min():.2g}: they shorten explicit steps; improve the mesh"
        )
    if (separate := pieces(mesh).max()) > 1:
        complain(
            f"{file.name}: {separate} bodies share no node, so a support of one does not "
            "hold the others: choose one, as --part 1 (the largest), or join them in your mesher"
        )
    if out is not None:
        told = "; ".join(f"{k} {v}" for k, v in found.told.items())
        write_mesh(mesh, out, f"{file.name}; {told}")
        say(f"{out}: {out.stat().st_size / 1e3:.0f} kB", indent="  ")


def _read(file: Path, unit: str | None, edge: str | None, part: str | None) -> ForeignBody:
    suffix = file.suffix.lower()
    if suffix == ".vtp":
        raise UsageError(f"{file.name}: {SURFACE}")
    if suffix not in (*FOREIGN, *SURFACES, ".npz"):
        raise UsageError(
            f"{file.name}: this format is not read; expected npz, "
            f"{', '.join((*FOREIGN, *SURFACES))}: "
            "convert the file, for example with Gmsh or meshio"
        )
    if edge is not None and suffix not in SURFACES:
        raise UsageError(
            f"{file.name}: --edge {edge}: only a surface ({', '.join(SURFACES)}) is filled with "
            "elements; leave --edge out"
        )
    if suffix == ".npz":
        return _part(file, ForeignBody(read_mesh(file, unit), {}), part)
    if unit is None:
        raise UsageError(f"{file.name}: this format has no unit; give it, as --unit mm")
    if suffix in FOREIGN:
        return read_foreign(file, unit, part)
    return _part(file, filled(file, unit, _metres("edge", edge) if edge else 0.0), part)


def _part(file: Path, found: ForeignBody, part: str | None) -> ForeignBody:
    """The part of a file that has no names for its parts."""
    if part is None:
        return found
    try:
        chosen = cells_of(found.mesh, part, {})
    except SceneError as error:
        raise SceneError(f"{file.name}: {error}") from None
    told = {"part": f"{part}: {chosen.sum()} of {len(chosen)} elements"}
    return ForeignBody(only(found.mesh, chosen), {**found.told, **told})


def _metres(option: str, text: str) -> float:
    number, unit = split(text) or (0.0, "")
    value = in_si(number, unit, "m") if unit else None
    if value is None or value <= 0:
        raise UsageError(f"--{option} {text}: expected a length with its unit, as 2mm")
    return value
