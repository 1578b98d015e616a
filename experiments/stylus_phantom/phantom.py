"""The landmarks of a phantom digitised with a tracked stylus: parameters, recording, registration.

The stylus stands on each landmark while it is turned about it. Where the tip stands is found by
its dwells, which landmark that is by their distances.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from validate.arrays import Floats
from validate.datasets.home import data_path
from validate.errors import RecordingError
from validate.parameters import quantity
from validate.pipeline.experiment.tree import Tree
from validate.recording.formats.device_set import read_device_set
from validate.recording.readers import recognised
from validate.recording.types import Recording
from validate.register.registration import Registered
from validate.register.signals import SignalObservation
from validate.register.tools.landmarks import Digitised, Dwell
from validate.scene.meshless import RigidBody

from .touched_landmarks import TouchedLandmarks, tip_path

FOLDER = "markers/stylus"
SEQUENCE = "EightLandmarkPointsTrackedForPhantomRegistration.igs.mha"
DEVICES = "PlusDeviceSet_fCal_Sim_RecordPhantomLandmarks.xml"
RESULTS = "PhantomRegistration.results.xml"
LANDMARKS, TIP, PUBLISHED = "landmarks", "tip", "published"
_SHAFT = 0.1  # m: how far up the shaft, along the tip's own x axis, its turning is watched


@dataclass(frozen=True)
class Tools:
    """Names of frames, as the sequence and the device set have them."""

    stylus: str = quantity("Stylus", "1", "the tracked stylus")
    tip: str = quantity("StylusTip", "1", "its tip")
    reference: str = quantity(
        "Reference", "1", "the frame of what is found; tracked, or the files'"
    )
    tracker: str = quantity("Tracker", "1", "the frame of the tracker")
    body: str = quantity("Phantom", "1", "the body whose landmarks are touched")


@dataclass(frozen=True)
class TipOffset:
    """In the stylus' frame; none: the device set's."""

    x: float | None = quantity(None, "m", "along the shaft; none: the device set's")
    y: float | None = quantity(None, "m", "across; none: the device set's")
    z: float | None = quantity(None, "m", "across; none: the device set's")
    sd: float | None = quantity(None, "m", "uncertainty of each; none: the device set's Error / √3")

    off_x: float = quantity(0.0, "m", "how far off it may be, once its dwells are found")
    off_y: float = quantity(0.0, "m", "the same, along y")
    off_z: float = quantity(0.0, "m", "the same, along z")

    @property
    def at(self) -> Floats:
        return np.array([self.x or 0.0, self.y or 0.0, self.z or 0.0])

    @property
    def off(self) -> Floats:
        return np.array([self.off_x, self.off_y, self.off_z])


@dataclass(frozen=True)
class DwellRule:
    """When a tip stands, and what of that counts."""

    part: Literal["touch", "whole"] = quantity(
        "touch", "1", "the first touch, before the stylus is turned far, or the whole dwell"
    )
    radius: float = quantity(3e-3, "m", "radius within which a resting tip may move")
    least: float = quantity(1.0, "s", "shortest duration of a dwell")
    touch: float = quantity(0.5, "s", "of a dwell that is its first touch")
    holds: float = quantity(0.75e-3, "m", "within which the tip holds in it")
    match: float = quantity(5e-3, "m", "within which a place is a landmark's")


@dataclass(frozen=True)
class StylusPhantom:
    """The recording is a sequence that any reader takes, `landmarks` a device set of PLUS."""

    tools: Tools = Tools()
    tip: TipOffset = TipOffset()
    dwell: DwellRule = DwellRule()
    landmarks: str | None = quantity(None, "1", "the device set (XML); none: the data set's")
    published: str | None = quantity(None, "1", "results (XML) of PLUS; none: the data set's")


def load(tree: Tree, folder: Path) -> tuple[Recording, ...]:
    """The sequence, with the landmarks and the tip's offset of the device set as its records."""
    p: StylusPhantom = tree.settings
    path = data_path(FOLDER, SEQUENCE, folder, tree.recording or None)
    devices = read_device_set(data_path(FOLDER, DEVICES, folder, p.landmarks, "landmarks"))
    recording = recognised(path).read(path, _options(path))
    records = {**recording.metadata, LANDMARKS: _landmarks(devices.name, devices.landmarks)}
    declared = devices.transform(p.tools.tip, p.tools.stylus)
    records[TIP] = _tip(declared.matrix, declared.error or 0.0)
    if results := _results(tree, folder):
        records[PUBLISHED] = _published(results, p.tools)
    return (replace(recording, metadata=records),)


def _results(tree: Tree, folder: Path) -> Path | None:
    """Results of PLUS that the user names, else the data set's own where its sequence is judged and
    they are here: no command brings them."""
    own: StylusPhantom = tree.settings
    if own.published:
        return data_path(FOLDER, RESULTS, folder, own.published, "published")
    if tree.recording or own.landmarks:
        return None
    try:
        return data_path(FOLDER, RESULTS, folder)
    except RecordingError:
        return None


def _options(path: Path) -> Mapping[str, str]:
    """Of a tracked sequence the transforms alone."""
    return {"images": "no"} if recognised(path).name in ("metaimage", "nrrd") else {}


def _landmarks(file: str, landmarks: Mapping[str, Floats]) -> Mapping[str, str]:
    if not landmarks:
        raise RecordingError(f"{file}: no landmarks in its PhantomDefinition")
    return {name: " ".join(map(repr, x.tolist())) for name, x in landmarks.items()}


def _tip(matrix: Floats, error: float) -> Mapping[str, str]:
    """Of the tip's pose (4, 4) in the stylus' frame and its error m."""
    x, y, z = matrix[:3, 3].tolist()
    sd = error / np.sqrt(3)
    shaft = " ".join(map(repr, (_SHAFT * matrix[:3, 0]).tolist()))
    return {"x": repr(x), "y": repr(y), "z": repr(z), "sd": repr(float(sd)), "shaft": shaft}


def _published(path: Path, tools: Tools) -> Mapping[str, str]:
    results = read_device_set(path)
    declared = results.transform(tools.body, tools.reference)
    matrix = " ".join(map(repr, declared.matrix.ravel().tolist()))
    return {"file": results.name, "matrix": matrix, "error": repr(declared.error or 0.0)}


def stated(recording: Recording) -> Mapping[str, float]:
    """The tip's offset, and its standard uncertainty per axis: the declared error over root 3."""
    record = recording.metadata.get(TIP, {})
    paths = {"tip.x": "x", "tip.y": "y", "tip.z": "z", "tip.sd": "sd"}
    return {path: float(record[key]) for path, key in paths.items() if key in record}


def known(recording: Recording) -> tuple[tuple[str, ...], Floats]:
    """Names (k,) and places (k, 3) m of the landmarks in the body's frame."""
    record = recording.record(LANDMARKS)
    places = [[float(word) for word in text.split()] for text in record.values()]
    return tuple(record), np.array(places)


def build(recording: Recording, tree: Tree, model: None) -> RigidBody:
    return RigidBody(*known(recording))


def place(recording: Recording, tree: Tree, scene: RigidBody) -> Registered:
    """Each landmark that was touched, at its own instant, with the pose of all the others."""
    p: StylusPhantom = tree.settings
    seen = digitised(recording, p)
    order = np.argsort([seen.parts[i].t.mean() for i in seen.match.seen])
    match = replace(seen.match, known=seen.match.known[order], seen=seen.match.seen[order])
    seen = replace(seen, match=match)
    t = np.array([seen.parts[i].t.mean() for i in match.seen])
    poses = seen.poses
    drives = (
        SignalObservation("rotation", "drives", t, poses[:, :3], "rad", 0.0),
        SignalObservation("translation", "drives", t, poses[:, 3:], "m", 0.0),
    )
    return Registered((*drives, TouchedLandmarks(seen, t)))


def digitised(
    recording: Recording, p: StylusPhantom, part: Literal["", "touch", "whole"] = ""
) -> Digitised:
    """The touched landmarks; `part` of a dwell in place of the parameters' own."""
    t, x = path_of(recording, p, np.zeros(3))
    rule = p.dwell
    standing = Dwell.of_path(t, x, rule.radius, rule.least)
    if not standing:
        raise RecordingError(
            f"{recording.name}: the tip never rests within {1e3 * rule.radius:g} mm for "
            f"{rule.least:g} s; set dwell.radius and dwell.least"
        )
    whole = (part or rule.part) == "whole"
    parts = standing if whole else tuple(d.touch(rule.touch, rule.holds) for d in standing)
    names, places = known(recording)
    found = Digitised.of(t, x, standing, parts, names, places, rule.match)
    return found.along(path_of(recording, p, p.tip.off)[1]) if p.tip.off.any() else found


def path_of(recording: Recording, p: StylusPhantom, beyond: Floats) -> tuple[Floats, Floats]:
    """Times (n,) s and places (n, 3) m of the tip, or of a point `beyond` (3,) m it, in the
    reference's frame."""
    tools = p.tools
    direct = f"{tools.stylus}To{tools.reference}"
    if f"{direct}/rotation" in recording.signals:
        return tip_path((direct, ""), _poses(recording, direct), None, p.tip.at + beyond)
    names = (f"{tools.stylus}To{tools.tracker}", f"{tools.reference}To{tools.tracker}")
    stylus, reference = (_poses(recording, name) for name in names)
    return tip_path(names, stylus, reference, p.tip.at + beyond)


def shaft_of(recording: Recording, p: StylusPhantom) -> Floats:
    """The path (n, 3) m of a point 100 mm up the shaft."""
    beyond = np.array([float(word) for word in recording.record(TIP)["shaft"].split()])
    return path_of(recording, p, beyond)[1]


def _poses(recording: Recording, name: str) -> tuple[Floats, Floats]:
    R = recording.signal(f"{name}/rotation", "1")
    x = recording.signal(f"{name}/translation", "m")
    return R.t, np.concatenate([R.y.reshape(-1, 3, 3), x.y[:, :, None]], axis=2)
