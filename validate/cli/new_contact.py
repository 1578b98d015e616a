"""Questions about a rigid indenter on a measured body, and about the machine that moves it."""

from collections.abc import Mapping

import numpy as np

from validate.arrays import Floats
from validate.cli.asking import Answers, Question
from validate.cli.new_body_questions import UNKNOWN, by_path, parsed
from validate.errors import UsageError
from validate.recording.types import Recording
from validate.replay.contact_cards import ROUND
from validate.replay.measured_drive import NOTED
from validate.scene.named_place import axis_of
from validate.units import in_si, split

FRICTIONLESS, BONDED = "frictionless", "bonded"
CONTACT_WORDS = {FRICTIONLESS: ("friction", "0"), BONDED: ("bonded", "true")}
_SHAPES = ("none", "plate", *ROUND)
_CELLS, _FINER, _STATES = "14", "1.25", "12"  # contact is solved some ten times a state
_POWER = {"sphere": 1.5, "cylinder": 1.0, "plate": 1.0, "punch": 1.0}  # of force over depth
_RANGES = ((0.02, 0.3), (0.01, 0.1))  # shares of the largest force that find the first touch
_FEWEST = 8  # samples there
_ENDS = 3.0  # a parabola is as much less certain at its end than in the mean


def of_the_indenter(recording: Recording, found: Answers) -> list[Question]:
    """Return the questions about what presses on the place that a displacement moves."""
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
                 "friction coefficient", open=True, check=_friction,
                 words=(FRICTIONLESS, BONDED)),
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
                      "it", check=parsed("machine.compliance", UNKNOWN),
                      words=(UNKNOWN,))]  # fmt: skip
    if found.get("machine.compliance", UNKNOWN) == UNKNOWN:
        return asked
    return [*asked, by_path("machine.sd", "standard uncertainty of the compliance, m/N, as 1e-7")]


def contact_values(recording: Recording, found: Answers) -> Mapping[str, str]:
    """Return the parameters that follow from the answers; none without an indenter."""
    shape = found.get("indenter.shape", "none")
    if shape == "none":
        return {}
    answer = found["indenter.friction"]
    key, value = CONTACT_WORDS.get(answer, ("friction", answer))
    values = {
        "indenter.friction": "0",
        f"indenter.{key}": value,
        "body.cells": _CELLS,
        "body.finer": _FINER,
        "seen.states": _STATES,
    }
    reach = _reach(recording, found)
    return values | ({"indenter.reach": f"{reach:.3g}"} if reach > 0 else {})


def _reach(recording: Recording, found: Answers) -> float:
    """Hertz's radius of contact sqrt(R d) at the largest depth, m; that of a punch; 0 for a
    plate."""
    if found.get("indenter.shape") not in ROUND:
        return 0.0
    way = recording.signal(found["moved.by"], "m").y[:, 0]
    depth = float(np.abs(way - way[0]).max()) - _metres(found["indenter.gap"])
    radius = _metres(found["indenter.radius"])
    if found["indenter.shape"] == "punch":
        return radius
    return float(np.sqrt(radius * min(max(depth, 0.0), radius)))


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
