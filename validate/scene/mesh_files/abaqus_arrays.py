"""Arrays of an Abaqus .inp: the one part with solid elements, in its instance's position.

Node sets, surfaces (by element and face) and what Gmsh writes of faces become sets by name.
Materials, steps and loads are not taken, nor is what stands beside the solid: it is counted.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from validate.arrays import Floats, Ints
from validate.errors import SceneError
from validate.scene.mesh_files.abaqus_text import NOWHERE, Deck, Home, KeywordBlock, blocks_of

# --- Nodes of an Abaqus part: each number once, out of the `*System` in which they are written,
# and to where the part's instance stands.


def nodes_of(own: Sequence[KeywordBlock]) -> tuple[list[int], Floats]:
    """Numbers and places (n, 3) of all nodes; raises `SceneError` for one with two places."""
    at: dict[int, tuple[float, ...]] = {}
    for block in own:
        if block.keyword != "NODE" or not block.rows:
            continue
        numbers, places = _written(block)
        for number, place in zip(numbers, _from_system(places, block.system), strict=True):
            if at.setdefault(number, x := tuple(place.tolist())) != x:
                raise block.wrong(f"node {number} has two positions; export one part")
    if not at:
        raise SceneError("no nodes in the part that has solid elements")
    return list(at), np.array(list(at.values()), dtype=np.float64)


def _written(block: KeywordBlock) -> tuple[list[int], Floats]:
    numbers, places = [], []
    for row in block.rows:
        number, *x = block.floats(row)
        if not number.is_integer() or len(x) not in (2, 3):
            raise block.wrong(f"'{row[:40]}': expected a node number with x, y, z")
        numbers.append(int(number))
        places.append([*x, 0.0][:3])
    return numbers, np.array(places, dtype=np.float64)


def _from_system(x: Floats, system: KeywordBlock | None) -> Floats:
    """Places (n, 3) that are written in a local system, in the part's.

    Its rows: the origin and a point on the local x; then one in the local plane of x and y on the
    side of y. Without the second row z stays, and x is what the point shows across it.
    """
    if system is None:
        return x
    rows = [system.floats(row) for row in system.rows]
    if [len(row) for row in rows] not in ([3], [6], [6, 3]):
        raise system.wrong(
            "expected an origin, a point on the x axis, and in a second row a "
            "point away from that axis"
        )
    origin = np.array(rows[0][:3])
    if len(rows[0]) == 3:
        return np.asarray(x + origin)
    along = np.array(rows[0][3:]) - origin
    up = np.array([0.0, 0.0, 1.0])
    if len(rows) == 2:
        up = np.cross(along, np.array(rows[1]) - origin)
    else:
        along[2] = 0.0
    if not (np.linalg.norm(along) > 0 and np.linalg.norm(up) > 0):
        raise system.wrong("its points coincide or lie on a line")
    e_x, e_z = along / np.linalg.norm(along), up / np.linalg.norm(up)
    return np.asarray(origin + x @ np.array([e_x, np.cross(e_z, e_x), e_z]))


def placed(points: Floats, instance: KeywordBlock) -> Floats:
    """Points where the instance stands: shifted, then turned about an axis by degrees."""
    rows = [instance.floats(row) for row in instance.rows]
    if [len(row) for row in rows] not in ([], [3], [3, 7]):
        raise instance.wrong("expected a shift x, y, z, and a turn about two points by degrees")
    moved = points + np.array(rows[0]) if rows else points
    if len(rows) < 2:
        return moved
    a, b = np.array(rows[1][:3]), np.array(rows[1][3:6])
    if not np.linalg.norm(b - a) > 0:
        raise instance.wrong("the rotation axis has two equal points")
    axis = (b - a) / np.linalg.norm(b - a)
    turn = Rotation.from_rotvec(np.deg2rad(rows[1][6]) * axis)
    return np.asarray(turn.apply(moved - a) + a)


# -------------------------------------------------------------------------------------------------

_SOLID = re.compile(r"C3D(4|5|6|8|10|15|20)[A-Z]*$")
_SHAPES = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 15: "wedge15",
           20: "hexahedron20"}  # fmt: skip
# Of elements beside a solid: the corners of a face by type; none for what has no face.
_FACE = re.compile(r"(?:CPS|CPE|SFM3D|R3D)([3468])R?$")
_NO_FACE = re.compile(r"(?:T3D|T2D|MASS|ROTARYI|SPRING|DASHPOT|CONN|DCOUP)")
_CORNERS = {3: 3, 4: 4, 6: 3, 8: 4}
# Corners of the faces S1, S2, ... of the elements that surfaces name (Abaqus' own numbering).
_TET = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_HEX = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
_FACES = {4: _TET, 10: _TET, 8: _HEX, 20: _HEX}
_MOST = 10_000_000  # numbers of nodes and elements
Elements = dict[int, tuple[int, ...]]  # nodes by the element's number


def arrays(path: Path, part: str | None = None) -> dict[str, NDArray[Any]]:
    """Points (n, 3), solid cells by their shape, node sets, facets and sets of solids (the numbers
    of their cells) by name, what was left out; of several parts or instances the one named `part`.

    Raises `SceneError` for no part with solids, several of which none is named, a number that is
    none, a node or set that is not there.
    """
    deck = Deck(path)
    blocks = blocks_of(deck)
    (home, instance), beside = _body(blocks, part)
    own = [b for b in blocks if _belongs(b, home, instance)]
    numbers, points = nodes_of(own)
    solids: Elements = {}
    for block in filter(_is_solid, own):
        for number, nodes in _rows_of(block, _size(block)):
            if solids.setdefault(number, nodes) is not nodes:
                raise block.wrong(f"element {number} is defined twice; export one part")
    sets = _Sets(own, {n: i for i, n in enumerate(numbers)}, solids)
    found = {
        "points": points if instance is None else placed(points, instance),
        **_cells(own, sets.place),
        **{f"nset.{name}": at for name, at in sets.nodes().items()},
        **{f"facet.{name}": at for name, at in _facets(own, sets).items()},
        **{f"part.{name}": at for name, at in sets.solid_sets().items()},
    }
    whole = np.arange(len(solids))
    found |= {f"part.{name}": whole for name in _names((home, instance)) if name}
    beside += [f"{n} {kind}" for kind, n in _beside(own).items()]
    if beside:
        found["beside"] = np.array(", ".join(beside))
    if deck.included:
        found["included"] = np.array(", ".join(deck.included))
    if instance is not None and any(instance.rows):
        found["placed"] = np.array(instance.given.get("NAME", ""))
    return found


def _is_solid(block: KeywordBlock) -> bool:
    return block.keyword == "ELEMENT" and bool(_SOLID.match(_type(block)))


def _type(block: KeywordBlock) -> str:
    return block.given.get("TYPE", "").upper()


_Body = tuple[Home, KeywordBlock | None]  # and the instance by which it stands somewhere


def _body(blocks: Sequence[KeywordBlock], part: str | None) -> tuple[_Body, list[str]]:
    """The one body with solid elements, and what the others are."""
    homes = list(dict.fromkeys(b.home for b in blocks if b.keyword == "ELEMENT"))
    if not homes:
        raise SceneError("no elements: the file is not an Abaqus input file, or has no body")
    solid = [h for h in homes if any(_is_solid(b) for b in blocks if b.home == h)] or homes[:1]
    bodies = [(home, at) for home in solid for at in _instances(blocks, home)]
    found = _chosen(bodies, part)
    return found, [f"'{name}'" for kind, name in homes if (kind, name) != found[0] and name]


def _chosen(bodies: Sequence[_Body], part: str | None) -> _Body:
    """The only body, or the one of several of which the part or instance has that name."""
    named = [b for b in bodies if any(_same(part, name) for name in _names(b))]
    if len(bodies) == 1 or len(named) == 1:
        return (named or bodies)[0]
    listed = ", ".join(f"'{_names(b)[-1]}'" for b in (named or bodies)[:12])
    first = _names((named or bodies)[0])[-1]
    raise SceneError(
        f"{len(named or bodies)} bodies ({listed}): only one can be read; choose it: validate "
        f"body FILE --unit mm --part {first} -o body.npz"
    )


def _names(body: _Body) -> list[str]:
    """Of the part, and of the instance; what is told of a body is the last."""
    (_, name), instance = body
    return [name] if instance is None else [name, instance.given.get("NAME", "")]


def _instances(blocks: Sequence[KeywordBlock], home: Home) -> list[KeywordBlock | None]:
    """Where the body stands; none for a flat file and a part that stands nowhere."""
    kind, name = home
    key = {"PART": "PART", "INSTANCE": "NAME"}.get(kind)
    found = [b for b in blocks if b.keyword == "INSTANCE" and key and _same(b.given.get(key), name)]
    return [*found] or [None]


def _belongs(block: KeywordBlock, home: Home, instance: KeywordBlock | None) -> bool:
    """Whether a block is of the body, or of the assembly and about its instance."""
    if block.home == home:
        return True
    of_assembly = block.home == NOWHERE and block.keyword in ("NSET", "ELSET", "SURFACE")
    own = instance.given.get("NAME") if instance else None
    return of_assembly and ("INSTANCE" not in block.given or _same(block.given["INSTANCE"], own))


def _same(one: str | None, other: str | None) -> bool:
    """Whether two names are one: Abaqus takes capitals and small letters for the same."""
    return (one or "").upper() == (other or "").upper()


def _rows_of(block: KeywordBlock, size: int) -> Iterator[tuple[int, tuple[int, ...]]]:
    """Elements' numbers with their nodes; rows may go on in the next line."""
    numbers = block.wholes
    if len(numbers) % (size + 1):
        raise block.wrong(f"{len(numbers)} numbers, not {size + 1} for each {_type(block)}")
    for k in range(0, len(numbers), size + 1):
        yield numbers[k], tuple(numbers[k + 1 : k + 1 + size])


def _size(block: KeywordBlock) -> int:
    """Nodes of a solid element or a face; 0 for others."""
    found = _SOLID.match(_type(block)) or _FACE.match(_type(block))
    return int(found[1]) if found else 0


def _cells(own: Sequence[KeywordBlock], place: Mapping[int, int]) -> dict[str, NDArray[Any]]:
    """Solid cells by shape, and what is neither solid nor beside one, by its type."""
    found: dict[str, list[list[int]]] = {}
    for block in own:
        kind = _type(block)
        if block.keyword != "ELEMENT" or _FACE.match(kind) or _NO_FACE.match(kind):
            continue
        if not _is_solid(block):
            found.setdefault(kind or "untyped", []).extend([[0]] * len(block.rows))
            continue
        try:
            cells = [[place[n] for n in nodes] for _, nodes in _rows_of(block, _size(block))]
        except KeyError as missing:
            raise block.wrong(f"there is no node {missing}") from None
        found.setdefault(_SHAPES[_size(block)], []).extend(cells)
    return {f"cells.{kind}": np.array(cells, dtype=np.int64) for kind, cells in found.items()}


def _beside(own: Sequence[KeywordBlock]) -> Counter[str]:
    counted: Counter[str] = Counter()
    for block in own:
        kind = _type(block)
        if block.keyword == "ELEMENT" and _FACE.match(kind):
            counted[kind] += sum(1 for _ in _rows_of(block, _size(block)))
        elif block.keyword == "ELEMENT" and _NO_FACE.match(kind):
            counted[kind] += len(block.rows)
    return counted


class _Sets:
    """Node and element sets of a part by name, in whatever case, as first written; a name may stand
    in several blocks."""

    def __init__(
        self, own: Sequence[KeywordBlock], place: Mapping[int, int], solids: Elements
    ) -> None:
        self.place, self.solids = place, solids
        self._written: dict[str, str] = {}
        self._nodes: dict[str, list[int]] = {}
        self._elements: dict[str, list[int]] = {}
        for block in own:
            key = block.keyword if block.keyword in ("NSET", "ELSET") else ""
            name = self.written(block.given.get(key, ""))
            if block.keyword == "ELEMENT" and "ELSET" in block.given and _size(block):
                numbers = [n for n, _ in _rows_of(block, _size(block))]
                self._elements.setdefault(self.written(block.given["ELSET"]), []).extend(numbers)
            elif block.keyword == "NODE" and "NSET" in block.given:
                numbers = [int(block.floats(row)[0]) for row in block.rows]
                self._nodes.setdefault(self.written(block.given["NSET"]), []).extend(numbers)
            elif block.keyword == "ELSET" and name:
                self._elements.setdefault(name, []).extend(self._listed(block, self._elements))
            elif block.keyword == "NSET" and name:
                self._nodes.setdefault(name, []).extend(self._nodes_of(block))

    def _nodes_of(self, block: KeywordBlock) -> list[int]:
        of = block.given.get("ELSET")
        if of is None:
            return self._listed(block, self._nodes)
        elements = self.elements(of, block)
        return [n for e in elements for n in self.solids.get(e, ())]

    def written(self, name: str) -> str:
        """The name as it was written first."""
        return self._written.setdefault(name.upper(), name)

    def _listed(self, block: KeywordBlock, known: Mapping[str, Sequence[int]]) -> list[int]:
        return _listed(block, lambda name: known.get(self.written(name)))

    def elements(self, name: str, block: KeywordBlock) -> list[int]:
        name = self.written(name)
        if name not in self._elements:
            raise block.wrong(f"there is no element set '{name}'")
        return self._elements[name]

    def solid_sets(self) -> dict[str, Ints]:
        """Of every set of solids their numbers, counted as they are read."""
        at = {element: i for i, element in enumerate(self.solids)}
        found = {k: [at[e] for e in v if e in at] for k, v in self._elements.items()}
        return {name: np.array(rows, dtype=np.int64) for name, rows in found.items() if rows}

    def nodes(self) -> dict[str, Ints]:
        """Indices of the nodes of every set that has any here."""
        found = {k: sorted({self.place[n] for n in v if n in self.place})
                 for k, v in self._nodes.items()}  # fmt: skip
        return {name: np.array(at, dtype=np.int64) for name, at in found.items() if at}


def _listed(block: KeywordBlock, known: Callable[[str], Sequence[int] | None]) -> list[int]:
    """Numbers, ranges, and names of sets before it; an instance's name before a number is cut."""
    if "GENERATE" in block.given:
        found = list[int]()
        for row in block.rows:
            found.extend(_range(block, row))
        return found
    found = []
    for word in block.words():
        number = word.rpartition(".")[2]
        if number.isascii() and number.isdigit():
            found.append(int(number))
        elif (members := known(word)) is not None:
            found.extend(members)
        else:
            raise block.wrong(f"there is no set '{word[:40]}' before it")
    return found


def _range(block: KeywordBlock, row: str) -> range:
    """The numbers from the first to the last by a step, as a row states them."""
    said = block.floats(row)
    if len(said) not in (2, 3) or not all(x.is_integer() and 0 < x < _MOST for x in said):
        raise block.wrong(f"'{row[:40]}': expected first, last and step")
    first, last, *step = (int(x) for x in said)
    return range(first, last + 1, *step)


def _facets(own: Sequence[KeywordBlock], sets: _Sets) -> dict[str, Ints]:
    """Corners (f, m) of the faces of every surface by element, and of faces beside the solid."""
    found: dict[str, list[tuple[int, ...]]] = {}
    for block in own:
        name = block.given.get("NAME", "")
        if block.keyword == "SURFACE" and block.given.get("TYPE", "ELEMENT").upper() == "ELEMENT":
            found.setdefault(name, []).extend(_surface(block, sets))
        elif block.keyword == "ELEMENT" and _FACE.match(_type(block)) and "ELSET" in block.given:
            corners = _CORNERS[_size(block)]
            rows = [nodes[:corners] for _, nodes in _rows_of(block, _size(block))]
            found.setdefault(sets.written(block.given["ELSET"]), []).extend(rows)
    return {
        name: np.array([[sets.place[n] for n in row] for row in rows], dtype=np.int64)
        for name, rows in found.items()
        if name and rows and len({len(row) for row in rows}) == 1
        and all(n in sets.place for row in rows for n in row)
    }  # fmt: skip


def _surface(block: KeywordBlock, sets: _Sets) -> Iterator[tuple[int, ...]]:
    """Corners, in nodes' numbers, of the faces that the rows name; whole sets have none."""
    for row in block.rows:
        of, _, face = (part.strip() for part in row.partition(","))
        if not re.fullmatch(r"[Ss][1-6]", face):
            continue
        own = of.rpartition(".")[2]
        elements = [int(own)] if own.isascii() and own.isdigit() else sets.elements(of, block)
        for element in elements:
            nodes = sets.solids.get(element, ())
            faces = _FACES.get(len(nodes), ())
            if int(face[1]) > len(faces):
                raise block.wrong(f"element {element} has no face {face}")
            yield tuple(nodes[k] for k in faces[int(face[1]) - 1])
