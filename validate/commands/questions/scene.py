"""Declaration of a measured body's scene and observations from the answers."""

from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from validate.commands.questions.answers import Answers
from validate.commands.questions.contact import CONTACT_WORDS, contact_settings, indented, reach_of
from validate.commands.questions.kinds import NONE, NOTED, UNKNOWN, sides, unit_of
from validate.commands.questions.law import coefficient_values, left_open
from validate.errors import SceneError, UsageError
from validate.parameters import describe, with_values
from validate.pipeline.bodies.choices import MeasuredBody
from validate.pipeline.bodies.first_modes import WATER
from validate.pipeline.bodies.mesh import grid_unknowns
from validate.pipeline.experiment.tree import Tree
from validate.recording.types import Recording
from validate.scene.contact import Indenter, RigidContact
from validate.scene.geometries.box import divided
from validate.scene.geometries.specification import Box, Cylinder, Geometry, MeshFile
from validate.scene.material import Material
from validate.scene.mesh import Mesh
from validate.scene.mesh_files.third_party_meshes import SUFFIXES as FOREIGN
from validate.scene.places import axis_of, nodes_of, place_of
from validate.scene.scene import Drive, Load, Prescribed, Pressure, Scene, Support, Weight
from validate.units import in_si, split

# --- Parts of a declaration as the lines of an experiment's file: what differs from the
# defaults, with units in comments. Values are Python literals: nothing of a recording becomes
# code.

_WIDTH = 100
_INDENT = "    "
_AXES = "xyz"
_OPEN = ", identified"  # what stands open


def rendered(part: Any, depth: int = 1) -> str:
    """Return the part's constructor over several lines, indented `depth` levels; what is inside it
    stands on one line each where that fits."""
    inner = _INDENT * depth
    body = "\n".join(f"{inner}{line}" for f in _told(part) for line in _lines(part, f, depth))
    return f"{type(part).__name__}(\n{body}\n{_INDENT * (depth - 1)})"


def imports(parts: Iterable[Any], more: Mapping[str, tuple[str, ...]]) -> str:
    """Return the import lines of the parts' classes, and of `more` names by module."""
    found = {module: set(names) for module, names in more.items()}
    for kind in {kind for part in parts for kind in _classes(part)}:
        found.setdefault(kind.__module__, set()).add(kind.__name__)
    return "\n".join(
        f"from {module} import {', '.join(sorted(names))}"
        for module, names in sorted(found.items())
    )


def _classes(value: Any) -> set[type]:
    """Of what is written out."""
    if isinstance(value, tuple):
        return {kind for v in value for kind in _classes(v)}
    if not is_dataclass(value):
        return set()
    return {type(value)}.union(*(_classes(getattr(value, f.name)) for f in _told(value)))


def _told(part: Any) -> list[Any]:
    return [f for f in fields(part) if f.init and getattr(part, f.name) != f.default]


def _lines(part: Any, f: Any, depth: int) -> list[str]:
    value = getattr(part, f.name)
    said = f"{f.name}={_field(f, value)},"
    units = _units(value) if _of_parts(value) else _unit(f)
    line = said + (f"  # {units}" if units else "")
    if len(_INDENT * depth + line) <= _WIDTH:
        return [line]
    if units and len(_INDENT * depth + said) <= _WIDTH:
        return [f"# {units}", said]
    if is_dataclass(value):
        return [f"{f.name}={rendered(value, depth + 1)},"]
    if _of_parts(value):
        each = [f"{_INDENT}{_literal(v)}," + (f"  # {u}" if (u := _units(v)) else "")
                for v in value]  # fmt: skip
        inner = "".join(f"{_INDENT * depth}{line}\n" for line in each)
        return [f"{f.name}=(\n{inner}{_INDENT * depth}),"]
    return [*([f"# {units}"] if units else []), said]


def _of_parts(value: Any) -> bool:
    return is_dataclass(value) or (isinstance(value, tuple) and any(map(is_dataclass, value)))


def _unit(f: Any) -> str:
    unit: str = f.metadata.get("unit", "1")
    return "" if unit == "1" else unit


def _units(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(dict.fromkeys(unit for v in value if (unit := _units(v))))
    told = _told(value)
    own = [f"{f.name}: {_unit(f)}{_OPEN if getattr(value, f.name) is None else ''}"
           for f in told if _unit(f)]  # fmt: skip
    inner = [_units(v) for f in told if _of_parts(v := getattr(value, f.name))]
    return ", ".join(text for text in (*own, *inner) if text)


def _field(f: Any, value: Any) -> str:
    """A direction along an axis is a word."""
    if f.name == "direction" and sorted(map(abs, value or ())) == [0.0, 0.0, 1.0]:
        axis = next(i for i, c in enumerate(value) if c)
        return repr(f"{'+' if value[axis] > 0 else '-'}{_AXES[axis]}")
    return _literal(value)


def _literal(value: Any) -> str:
    if is_dataclass(value):
        inside = ", ".join(f"{f.name}={_field(f, getattr(value, f.name))}" for f in _told(value))
        return f"{type(value).__name__}({inside})"
    if isinstance(value, float):
        return f"{value:.6g}" if float(f"{value:.6g}") == value else repr(value)
    if isinstance(value, tuple):
        inside = ", ".join(_literal(v) for v in value)
        return f"({inside},)" if len(value) == 1 else f"({inside})"
    return repr(value)


# -------------------------------------------------------------------------------------------------

IDENTIFIED = "identified"
CELLS = 6  # along the longest edge of a block or cylinder
_ACROSS = 2  # cells across a slender body
_ASPECT = 2.0  # length of its cells over their thickness
_UNKNOWNS = 10_000  # of a nominal mesh that has more cells than `CELLS` says
_FLAT = 5e-3  # of a sliding place's width
_HELD = {"all": (0, 1, 2), "x": (0,), "y": (1,), "z": (2,)}
_NU, _GRAVITY = 0.45, 9.80665
_SETTINGS = {p.path for p in describe(MeasuredBody())}
_TOPICS = ("seen.markers", "seen.force", "seen.outline")


def tree_of(
    recording: Recording, found: Answers, cells: int = CELLS, order: int = 2
) -> Tree:  # fmt: skip
    """Return the parameters that the answers so far make, in cells of that `order`; mesh files are
    found from the current folder. Raises what the parts of the scene do."""
    body = geometry_of(found, cells, order, reach_of(recording, found))
    supports = [Support(found[f"held.{c}"], axes) for c, axes in _HELD.items()
                if found.get(f"held.{c}")]  # fmt: skip
    if rest := found.get("held.slides"):
        mesh = answered_mesh(found)
        assert mesh is not None
        supports.append(Support(rest, (_across(rest, mesh),), rests=True))
    parts = _mover(recording, found)
    if "drives" in parts and found.get("moved.sideways", "true") == "true":
        across = tuple(c for c in range(3) if not parts["drives"][0].direction[c])
        supports.append(Support(found["moved.place"], across))
    scene = Scene(
        body, material_of(found), tuple(supports), dilatation="by_element", **parts
    )  # fmt: skip
    values = {k: v for k, v in found.items() if k in _SETTINGS and v not in ("", UNKNOWN)}
    values = {k: v for k, v in values.items() if k not in _TOPICS or v != NONE}
    values |= {"noted": found["moved.noted"]} if found.get("moved.noted") else {}
    for path, text in (damping_of(found), held_of(found)):
        values |= {path: text} if path.startswith("motion.") else {}
    settings: MeasuredBody = with_values(MeasuredBody(), {**contact_settings(found), **values})
    return Tree("", scene, settings)


# --- the body -------------------------------------------------------------------------------------


def geometry_of(found: Answers, cells: int, order: int, reach: float = -1.0) -> Geometry:
    """Return the body that is answered; below an indenter of that `reach` m (0: a flat one) with
    cells that are small there."""
    if found.get("body.shape") == "file":
        element: Any = "quadratic" if order == 2 else "linear"
        halvings = int(found.get("body.halvings", "0"))
        return MeshFile(found["body.file"], found.get("body.unit"), halvings, element)
    sizes = sides_of(found)
    if reach >= 0:
        return indented(found, sizes, reach)
    bricks = found.get("seen.outline", NONE) == NONE
    kind: Any = ("hex" if bricks else "tet") + str({(1, 1): 8, (1, 2): 27, (0, 1): 4, (0, 2): 10}[
        (int(bricks), order)])  # fmt: skip
    even: tuple[bool, ...] = ()
    if found.get("held.slides") and len(sizes) == 3:
        # Every grid has a middle in the plane of the place that it rests on: that middle stays
        across = _across(found["held.slides"], Box(sizes, (1, 1, 1), "hex8").resolved(Path()))
        even = tuple(c != across for c in range(3))
    # Cells per axis (of a cylinder along radius and height): cubes where the body is compact. A
    # slender or thin body has `_ACROSS` cells across it, at most `_ASPECT` times as long as they
    # are thick, as far as `_UNKNOWNS` allow
    round_ = len(sizes) == 2
    spans = (sizes[0] / 2, sizes[1]) if round_ else sizes

    def of_edge(edge: float) -> tuple[float, ...]:
        return tuple(max(span / edge, _ACROSS) for span in spans)

    cubes = max(sizes) / cells
    edge = min(cubes, _ASPECT * (min(spans) / _ACROSS))
    while edge < cubes and grid_unknowns(of_edge(edge), round_=round_) > _UNKNOWNS:
        edge = min(1.1 * edge, cubes)
    n = divided(of_edge(edge), even)
    if len(sizes) == 3:
        return Box(sizes, n, kind)
    return Cylinder(sizes[0], sizes[1], (n[0], n[1]), kind)


def sides_of(found: Answers) -> tuple[float, ...]:
    """Lengths m of a block along x, y, z; diameter and height of a cylinder."""
    if found.get("body.block"):
        return sides(found["body.block"], 3)
    return sides(found["body.cylinder"], 2)


def _across(place: str, mesh: Mesh) -> int:
    """The axis that a flat place lies across; raises `SceneError` for one that is not flat."""
    spread = np.ptp(mesh.nodes[nodes_of(mesh, place_of(place, mesh))], axis=0)
    if spread.min() > _FLAT * spread.max():
        raise SceneError(
            f"held.slides = {place}: {1e3 * spread.min():.3g} mm out of flat; a sliding place must "
            "be a plane normal to x, y or z"
        )
    return int(spread.argmin())


def answered_mesh(found: Answers) -> Mesh | None:
    """Return the body without its indenter, once it is known; raises what reading it does."""
    shape, file = found.get("body.shape", ""), found.get("body.file", "")
    needed = f"body.{shape}" if shape != "file" else "body.unit"
    if shape == "file" and (not file or Path(file).suffix.lower() not in FOREIGN):
        needed = "body.file"
    if not found.get(needed):
        return None
    changed = Path(file).resolve() if file else Path(), Path(file).stat().st_mtime_ns if file else 0
    keys = ("seen.outline",) if shape != "file" else ()
    said = {k: v for k, v in found.items() if k.startswith("body.") or k in keys}
    return _read(tuple(sorted(said.items())), changed)


@lru_cache(maxsize=4)
def _read(said: tuple[tuple[str, str], ...], changed: tuple[Path, int]) -> Mesh:
    """The body that is answered; its file is read again where it has `changed`."""
    mesh = geometry_of(dict(said), CELLS, 1).resolved(Path())
    return replace(mesh, facets={**mesh.facets, "surface": mesh.surface})


# --- the scene ------------------------------------------------------------------------------------


def material_of(found: Answers) -> Material:
    """Raise `UsageError` and `SceneError` as its values do."""
    law: Any = found.get("law", "linear")
    usual = Material(None, _NU, rho=WATER).of_law(law)  # type: ignore[arg-type]
    skipped = left_open(found)
    given = {k: v for k, v in coefficient_values(found).items() if k not in skipped}
    given |= {k: found[k] for k in ("material.E", "material.nu", "material.rho") if found.get(k)}
    values = {k.removeprefix("material."): v for k, v in given.items() if v != UNKNOWN}
    path, beta = damping_of(found)
    values |= {"stiffness_damping": beta} if path == "material.stiffness_damping" else {}
    material: Material = with_values(usual, values)
    return material


def _mover(recording: Recording, found: Answers) -> dict[str, Any]:
    """What moves or loads the body, and weight beside it, as fields of the scene; {} until the
    answers say it."""
    by, place, along = (found.get(f"moved.{k}", "") for k in ("by", "place", "along"))
    if by == "gravity":
        return {"loads": (Weight("gravity", axis_of(along), _GRAVITY),)} if along else {}
    unit = unit_of(recording, by)
    if not place or not (along or by == "markers" or unit == "Pa"):
        return {}
    part: dict[str, Any]
    if by == "markers":
        labels = tuple(n.strip() for n in found.get("moved.markers", "").split(","))
        return {"tracked": (Prescribed("moved", place, labels=labels),)} | _weight(found)
    if unit == "m":
        name = "moved" if by == NOTED else by
        if found.get("indenter.shape", "none") != "none":
            # The indenter's contact
            given = {k: v for k, v in found.items() if k.startswith("indenter.")}
            shape = {k.removeprefix("indenter."): v for k, v in given.items()}
            answer = shape.pop("friction", "0")
            key, value = CONTACT_WORDS.get(answer, ("friction", answer))
            bonded = {"bonded": value} if key == "bonded" else {}
            values = {k: v for k, v in {**shape, **bonded}.items() if v}
            declared: Any = with_values(Indenter("plate"), values)
            way = axis_of(found["moved.along"])
            contact = RigidContact(name, found["moved.place"], declared, way)
            rubs = {"friction": value} if key == "friction" else {}
            part = {"contacts": (with_values(contact, rubs),)}
        else:
            part = {"drives": (Drive(name, place, axis_of(along)),)}
        return part | _weight(found)
    load: Any = Pressure(by, place) if unit == "Pa" else Load(by, place, axis_of(along))
    return {"loads": (load, *_weight(found).get("loads", ()))}


def _weight(found: Answers) -> dict[str, Any]:
    """Gravity beside what moves the body."""
    along = found.get("motion.gravity")
    return {"loads": (Weight("gravity", axis_of(along), _GRAVITY),)} if along else {}


# --- what is measured -----------------------------------------------------------------------------


def held_of(found: Answers) -> tuple[str, str]:
    """Return the parameter that the answer on what was released is of, and its value."""
    text = found.get("moved.held", "")
    return held(text) if text else ("", "")


def held(text: str) -> tuple[str, str]:
    parts = split(text)
    for unit, name in (("N", "motion.held_force"), ("m", "motion.held_displacement")):
        if parts and parts[1] and in_si(parts[0], parts[1], unit) is not None:
            return name, text
    raise UsageError("expected a force, as 0.2N, or a displacement, as 5mm, with its unit")


def damping_of(found: Answers) -> tuple[str, str]:
    """Return the parameter that the answer on damping is of, and its value."""
    text = found.get("motion.damping", "")
    return damping(text) if text else ("", "")


def damping(text: str) -> tuple[str, str]:
    if text == IDENTIFIED:
        return "", text
    parts = split(text)
    if parts and parts[1]:
        with_values(Material(1.0, _NU), {"stiffness_damping": text})
        return "material.stiffness_damping", text
    with_values(MeasuredBody(), {"motion.damping_ratio": text})
    return "motion.damping_ratio", text
