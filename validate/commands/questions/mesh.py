"""Questions about the mesh file of a specimen between plates."""

from functools import lru_cache
from pathlib import Path

from validate.commands.questions.answers import Answers, Question
from validate.commands.questions.kind import quadratic_fits
from validate.commands.questions.kinds import known_size, there
from validate.commands.recording_summary import beside
from validate.pipeline.bodies.mesh import PLATES, sizes_of_mesh
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.mesh_file import read_mesh
from validate.scene.mesh_files.third_party_meshes import SUFFIXES as FOREIGN


def mesh_questions(found: Answers, *, needed: bool) -> list[Question]:
    """Return the questions about the mesh file, its unit and its unusual size."""
    plates = " and ".join(f'"{plate}"' for plate in PLATES)
    asked = [
        Question(
            "body.file",
            f"mesh file of the specimen, axis z, with the facet sets {plates}"
            + ("; it needs the wall of the inclusion, too" if needed else "; empty: a cylinder"),
            open=needed, check=_readable, words=(),
        )
    ]  # fmt: skip
    file = found.get("body.file", "")
    if not _foreign(file):
        return asked
    asked.append(
        Question("body.unit", "unit of the file's lengths, as mm", open=True,
                 check=lambda unit: sizes_of_mesh(read_mesh(Path(file), unit), Path(file).name))
    )  # fmt: skip
    if unit := found.get("body.unit"):
        asked += known_size("body.size", specimen_mesh(found), unit)
    return asked


def specimen_mesh(found: Answers) -> Mesh | None:
    """Return the mesh that the answers name; None without one, or before its unit is known."""
    file, unit = found.get("body.file", ""), found.get("body.unit")
    if not file or (_foreign(file) and not unit):
        return None
    return _read(file, unit, Path(file).stat().st_mtime_ns)


def mesh_sizes(found: Answers) -> dict[str, float]:
    """Return height and diameter of equal area m of the mesh, by parameter; none without one."""
    mesh = specimen_mesh(found)
    return {} if mesh is None else sizes_of_mesh(mesh, Path(found["body.file"]).name)


def declared_mesh(found: Answers, folder: Path) -> str:
    """Return the mesh file as an experiment file in `folder` declares it; empty without one."""
    if not found.get("body.file"):
        return ""
    file = beside(Path(found["body.file"]), folder / "x.py")
    unit = f", unit={found['body.unit']!r}" if found.get("body.unit") else ""
    halvings = f", halvings={found['body.halvings']}" if found.get("body.halvings") else ""
    element = "linear" if linear_cells(found) else "quadratic"
    return f'MeshFile({file!r}{unit}{halvings}, element="{element}"),'


def linear_cells(found: Answers) -> str:
    """Return why linear cells are proposed; empty where quadratic ones fit, or without a mesh."""
    mesh = specimen_mesh(found)
    if mesh is None or quadratic_fits(mesh):
        return ""
    return (
        f"{found['body.file']} has {len(mesh.cells)} cells: linear ones are proposed "
        "(element=linear), as quadratic ones do not fit into a first answer of 30 s"
    )


def _foreign(file: str) -> bool:
    return Path(file).suffix.lower() in FOREIGN


def _readable(file: str) -> None:
    there(file)
    if not _foreign(file):
        sizes_of_mesh(read_mesh(Path(file)), Path(file).name)


@lru_cache(maxsize=4)
def _read(file: str, unit: str | None, changed: int) -> Mesh:
    return read_mesh(Path(file), unit)
