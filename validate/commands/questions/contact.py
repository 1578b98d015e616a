"""Questions about a rigid indenter and its testing machine."""

from typing import Any

import numpy as np

from validate.arrays import Floats
from validate.commands.questions.answers import Answers, Question
from validate.commands.questions.kinds import NONE, NOTED, UNKNOWN, by_path, parsed
from validate.errors import UsageError
from validate.parameters import with_values
from validate.recording.types import Recording
from validate.scene.contact import ROUND, Indenter
from validate.scene.geometries.box import divided
from validate.scene.geometries.indented_bodies import IndentedBlock, IndentedCylinder
from validate.scene.geometries.specification import Geometry
from validate.scene.places import axis_of
from validate.units import in_si, split

FRICTIONLESS, BONDED = "frictionless", "bonded"
CONTACT_WORDS = {FRICTIONLESS: ("friction", "0"), BONDED: ("bonded", "true")}
_SHAPES = ("none", "plate", *ROUND)
_CELLS, _FINER, _STATES = 14, "1.25", "12"  # contact is solved some ten times a state
_PER_REACH = 4.0  # cells along the radius of contact on the nominal mesh
_LEAST = 0.02  # cells are not clustered further
_WAYS = {"zmax": "-z", "zmin": "+z"}  # places that a quarter keeps, and the way towards them
_MIDDLE = 1e-6  # of the body's size: so far a tip lies from the axis of symmetry
_POWER = {"sphere": 1.5, "cylinder": 1.0, "plate": 1.0, "punch": 1.0}  # of force over depth
_RANGES = ((0.02, 0.3), (0.01, 0.1))  # shares of the largest force that find the first touch
_FEWEST = 8  # samples there
_ENDS = 3.0  # a parabola is as much less certain at its end than in the mean


def of_the_indenter(recording: Recording, found: Answers) -> list[Question]:
    """Return the questions about the indenter at the place that a displacement moves."""
    asked = [Question("indenter.shape", "rigid body that presses on the place; none: the place is "
                      "glued or gripped", "none", "the place itself is moved",
                      choices=_SHAPES)]  # fmt: skip
    shape = found.get("indenter.shape", "none")
    if shape == "none":
        return asked
    if shape in ROUND:
        asked.append(by_path("indenter.radius", f"radius of the {shape}, as 5mm"))
    if shape == "cylinder":
        asked.append(Question("indenter.axis", "direction of the cylinder's axis, as +y", open=True,
                              check=axis_of))  # fmt: skip
    touch = _first_touch(recording, found, shape)
    gap, sd = touch or (0.0, 0.0)
    why = (
        "the displacement at which the force leaves zero"
        if touch
        else "the indenter touches at the first sample"
    )
    return [
        *asked,
        Question("indenter.friction", f"contact: {FRICTIONLESS}, {BONDED} while it presses, or "
                                      f"Coulomb's "
                 "friction coefficient", open=True, check=_friction),
        Question("indenter.tip", "point below the indenter's middle, as 20mm,20mm,12mm; empty: "
                 "the middle of the place", check=parsed("indenter.tip")),
        by_path("indenter.gap", "displacement from the first sample to first contact, as 0.3mm",
                f"{1e3 * gap:.4g}mm", why),
        by_path("ranges.contact", "standard uncertainty of that displacement, as 0.01mm",
                f"{1e3 * sd:.1g}mm", "from the fit of the first contact" if touch else "not known"),
        *of_the_machine(found),
    ]  # fmt: skip


def of_the_machine(found: Answers) -> list[Question]:
    """Return the questions about the compliance of the testing machine."""
    asked = [Question("machine.compliance", "compliance of frame, load cell and grips, m/N, as "
                      f"2e-6; {UNKNOWN}: the report estimates its effect", UNKNOWN,
                      "the recording does not contain "
                      "it", check=parsed("machine.compliance", UNKNOWN))]  # fmt: skip
    if found.get("machine.compliance", UNKNOWN) == UNKNOWN:
        return asked
    return [*asked, by_path("machine.sd", "standard uncertainty of the compliance, m/N, as 1e-7")]


def contact_settings(found: Answers) -> dict[str, str]:
    """Settings by path of a body that an indenter presses; none without one: contact is solved some
    ten times a state."""
    if found.get("indenter.shape", "none") == "none":
        return {}
    return {"mesh.finer": _FINER, "seen.states": _STATES}


def reach_of(recording: Recording, found: Answers) -> float:
    """Hertz's radius of contact sqrt(R d) at the largest depth, m; that of a punch; 0 for a
    plate; -1 without an indenter."""
    if found.get("indenter.shape", "none") == "none":
        return -1.0
    if found["indenter.shape"] not in ROUND or not found.get("indenter.radius"):
        return 0.0
    radius = _metres(found["indenter.radius"])
    if found["indenter.shape"] == "punch":
        return radius
    way = recording.signal(found["moved.by"], "m").y[:, 0]
    depth = float(np.abs(way - way[0]).max()) - _metres(found.get("indenter.gap") or "0")
    return float(f"{np.sqrt(radius * min(max(depth, 0.0), radius)):.3g}")


def indented(found: Answers, sides: tuple[float, ...], reach: float) -> Geometry:
    """Return the block or cylinder with cells that are small below the indenter: of a quarter,
    where that is enough. Raises `UsageError` for a cylinder that is not pressed so."""
    quarter, round_ = _is_quarter(found, sides), len(sides) == 2
    if round_ and not quarter:
        raise UsageError(
            "an indenter on a cylinder must press along -z on zmax (or +z on zmin) in its middle, "
            "with the body held at zmin and zmax only and only its force compared; otherwise give "
            "the body as a mesh file"
        )
    by = 2 if quarter else 1
    spans = (sides[0] / 2, sides[1]) if round_ else (sides[0] / by, sides[1] / by, sides[2])
    nominal = tuple(_CELLS * s / max(spans) for s in spans)
    shares = tuple(1.0 for _ in spans)
    if reach > 0:
        shares = tuple(round(max(_LEAST, min(1.0, reach / _PER_REACH / (s / n))), 4)
                       for s, n in zip(spans, nominal, strict=True))  # fmt: skip
    cells = divided(nominal)
    if round_:
        end: Any = found["moved.place"]
        return IndentedCylinder(sides[0], sides[1], cells, shares, end)
    if found["indenter.shape"] == "cylinder":  # along its axis nothing is concentrated
        along = axis_of(found["indenter.axis"])
        shares = tuple(1.0 if a else s for a, s in zip(along, shares, strict=True))
    tip = _point(found["indenter.tip"]) if found.get("indenter.tip") else ()
    middle = np.array(sides) / 2 * (1 - np.array(axis_of(found["moved.along"])))
    at = tip or tuple(middle.tolist())
    return IndentedBlock(sides, cells, at, shares, "quarter" if quarter else "whole")


def _is_quarter(found: Answers, sides: tuple[float, ...]) -> bool:
    """Whether two planes of symmetry leave a quarter: a block or cylinder that is pressed in its
    middle along z, held at its ends alone, of which nothing but the force is judged."""
    if any(found.get(key, NONE) != NONE for key in ("seen.markers", "seen.outline")):
        return False
    place = found.get("moved.place", "")
    if place not in _WAYS or axis_of(found["moved.along"]) != axis_of(_WAYS[place]):
        return False
    if not {found.get("held.all", ""), found.get("held.z", "")} <= {"", *_WAYS}:
        return False
    if any(found.get(f"held.{c}") for c in ("x", "y", "slides")):
        return False
    axis = found.get("indenter.axis", "+y").lstrip("+-")
    if found["indenter.shape"] == "cylinder" and axis not in ("x", "y"):
        return False
    tip = _point(found["indenter.tip"]) if found.get("indenter.tip") else ()
    middle = np.array(sides[:2]) / 2 if len(sides) == 3 else np.zeros(2)
    off = np.abs(np.array(tip[:2]) - middle) if tip else np.zeros(2)
    return bool((off <= _MIDDLE * max(sides)).all())


def _point(text: str) -> tuple[float, ...]:
    found: tuple[float, ...] = with_values(Indenter("plate"), {"tip": text}).tip
    return found


def _first_touch(recording: Recording, found: Answers, shape: str) -> tuple[float, float] | None:
    """Way m to the first touch and its standard uncertainty; None where it cannot be found.

    For F = k (u - u_0)^m, m = 3/2 of a sphere (Hertz), F^(1/m) is straight in u. It bends with the
    specimen's thickness, so that a parabola is fitted, once to all of `_RANGES[0]` and once to its
    beginning: they differ by what the form of the curve leaves unknown.
    """
    by, force = found.get("moved.by", ""), found.get("seen.force", "")
    signals = recording.signals
    felt = [t for t, s in signals.items() if s.unit == "N"]
    force = force if force in signals else (felt[0] if felt else "")
    if by == NOTED or by not in signals or not force:
        return None
    u, F = signals[by], signals[force]
    way = np.abs(u.y[:, 0] - u.y[0, 0])
    load = np.interp(u.t, F.t, F.y[:, 0])
    size = np.abs(load - load[: max(1, len(load) // 50)].mean())
    rising = slice(0, int(size.argmax()) + 1)
    zeros = [_zero_of(way[rising], size[rising], _POWER[shape], *part) for part in _RANGES]
    if zeros[0] is None:
        return None
    zero, sd = zeros[0]
    other = zeros[1][0] if zeros[1] else 0.0
    return zero, float(np.hypot(sd, other - zero))


def _zero_of(
    x: Floats, force: Floats, power: float, low: float, high: float
) -> tuple[float, float] | None:
    """Where a parabola through force^(1/power) between two shares of the largest is zero, and what
    the scatter about it leaves unknown there."""
    used = (force >= low * force.max()) & (force <= high * force.max())
    if used.sum() < _FEWEST:
        return None
    x, y = x[used], force[used] ** (1 / power)
    bent = np.polynomial.Polynomial.fit(x, y, 2)
    slope = float(np.polyfit(x, y, 1)[0])
    roots = np.array([r.real for r in bent.roots() if abs(r.imag) < 1e-9 and r.real < x.max()])
    if slope <= 0 or not len(roots):
        return None
    zero = max(0.0, float(roots.max()))
    scatter = float(np.std(y - bent(x), ddof=3)) / slope
    return zero, _ENDS * scatter / float(np.sqrt(len(x)))


def _friction(text: str) -> None:
    if text not in CONTACT_WORDS:
        parsed("indenter.friction")(text)


def _metres(text: str) -> float:
    found = split(text)
    value = in_si(found[0], found[1] or "m", "m") if found else None
    if value is None:
        raise UsageError(f"'{text[:40]}': expected a length, as 5mm")
    return value
